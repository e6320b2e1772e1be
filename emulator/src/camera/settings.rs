//! What a camera, its lens and the hall around it are like, apart from the calibration.

use super::floor::FloorTexture;
use super::misalignment::Misalignment;
use super::problem::{CameraProblem, within};
use serde::{Deserialize, Serialize};

/// Everything about a camera that no calibration file tells.
///
/// Signal in digital numbers (DN): `black_dn + gain * white_dn_per_ms * exposure * light * reflectance`, blurred, plus noise of
/// variance `gain^2 read_noise_dn^2 + gain * shot_variance_dn * (signal - black_dn)`, rounded, from 0 to 255.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSettings {
    /// Seed of the noise and of the hidden error of calibration.
    pub seed: u64,
    /// Length of an exposure.
    pub exposure_us: u32,
    /// Analogue gain; amplifies noise too.
    pub gain: f64,
    /// Signal of reflectance 1 in full light per millisecond of exposure at gain 1, DN/ms.
    pub white_dn_per_ms: f64,
    /// Signal without light, DN.
    pub black_dn: f64,
    /// Standard deviation of the read noise at gain 1, DN.
    pub read_noise_dn: f64,
    /// Variance of the shot noise per DN of signal at gain 1, DN; 1 / (electrons per DN).
    pub shot_variance_dn: f64,
    /// Standard deviation of the blur of an imperfect focus, px; at most 1.2.
    pub defocus_px: f64,
    /// Share of light that the lens loses in the farthest corner.
    pub vignetting: f64,
    /// Relative change of the light over the floor along world x and y, 1/m.
    pub light_gradient_per_m: [f64; 2],
    pub floor: FloorTexture,
    /// How far the camera really is from its calibration file.
    pub misalignment: Misalignment,
}

impl Default for CameraSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            exposure_us: 3000,
            gain: 1.0,
            white_dn_per_ms: 75.0,
            black_dn: 6.0,
            read_noise_dn: 1.0,
            shot_variance_dn: 0.025,
            defocus_px: 0.5,
            vignetting: 0.25,
            light_gradient_per_m: [0.04, -0.03],
            floor: FloorTexture::default(),
            misalignment: Misalignment::default(),
        }
    }
}

impl CameraSettings {
    /// Every rule on its own.
    pub fn check(&self) -> Result<(), CameraProblem> {
        let sane = "give a value a real camera has";
        within("exposure_us", f64::from(self.exposure_us), 1.0, 100_000.0, sane)?;
        within("gain", self.gain, 0.01, 100.0, sane)?;
        within("white_dn_per_ms", self.white_dn_per_ms, 0.0, 1e5, sane)?;
        within("black_dn", self.black_dn, 0.0, 255.0, sane)?;
        within("read_noise_dn", self.read_noise_dn, 0.0, 50.0, sane)?;
        within("shot_variance_dn", self.shot_variance_dn, 0.0, 10.0, sane)?;
        within("defocus_px", self.defocus_px, 0.0, 1.2, "focus the lens")?;
        within("vignetting", self.vignetting, 0.0, 1.0, sane)?;
        within("light_gradient_per_m[0]", self.light_gradient_per_m[0], -1.0, 1.0, sane)?;
        within("light_gradient_per_m[1]", self.light_gradient_per_m[1], -1.0, 1.0, sane)?;
        within("floor.reflectance", self.floor.reflectance, 0.0, 1.0, sane)?;
        within("floor.contrast", self.floor.contrast, 0.0, 1.0, sane)?;
        within("floor.grain_m", self.floor.grain_m, 1e-3, 10.0, sane)?;
        self.misalignment.check()
    }

    /// Signal of reflectance 1 in full light above black, DN.
    pub fn white_dn(&self) -> f64 {
        self.gain * self.white_dn_per_ms * f64::from(self.exposure_us) / 1000.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_their_limits_are_refused_by_name() {
        let refused = |change: fn(&mut CameraSettings)| {
            let mut settings = CameraSettings::default();
            change(&mut settings);
            settings.check().expect_err("refused").field
        };
        assert!(CameraSettings::default().check().is_ok());
        assert_eq!(refused(|s| s.exposure_us = 0), "exposure_us");
        assert_eq!(refused(|s| s.gain = f64::NAN), "gain");
        assert_eq!(refused(|s| s.defocus_px = 2.0), "defocus_px");
        assert_eq!(refused(|s| s.floor.grain_m = 0.0), "floor.grain_m");
        assert_eq!(refused(|s| s.misalignment.focal_px = -1.0), "misalignment.focal_px");
    }

    #[test]
    fn reflectance_1_gives_the_configured_signal() {
        let settings = CameraSettings {
            gain: 2.0,
            exposure_us: 1500,
            ..CameraSettings::default()
        };
        assert!((settings.white_dn() - 225.0).abs() < 1e-12);
    }
}
