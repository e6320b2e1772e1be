//! From light to numbers: noise, rounding, saturation, dead pixels.

use super::faults::DeadPixel;
use super::settings::CameraSettings;
use crate::noise::Noise;

/// Normal numbers drawn once; every row of every frame starts at another place of this table.
const TABLE: usize = 1 << 17;

/// The chip of one camera.
#[derive(Debug, Clone)]
pub struct Sensor {
    width: usize,
    black_dn: f32,
    read_variance_dn2: f32,
    shot_variance_dn: f32,
    seed: u64,
    /// Mean 0, variance 1; `TABLE` numbers and the first row's worth again.
    normal: Vec<f32>,
}

impl Sensor {
    pub fn new(width_px: u16, settings: &CameraSettings, seed: u64) -> Self {
        let mut random = Noise::new(seed, u64::MAX - 8);
        let mut normal: Vec<f64> = (0..TABLE).map(|_| random.normal()).collect();
        let mean = normal.iter().sum::<f64>() / TABLE as f64;
        let variance = normal.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / TABLE as f64;
        normal.extend_from_within(..usize::from(width_px));
        Self {
            width: usize::from(width_px),
            black_dn: settings.black_dn as f32,
            read_variance_dn2: (settings.gain * settings.read_noise_dn).powi(2) as f32,
            shot_variance_dn: (settings.gain * settings.shot_variance_dn) as f32,
            seed,
            normal: normal
                .into_iter()
                .map(|value| ((value - mean) / variance.sqrt()) as f32)
                .collect(),
        }
    }

    /// Reads a frame out.
    ///
    /// - `signal_dn`: DN above black of every pixel; `sequence`: the noise of a frame depends on it and the seed only.
    pub fn read_out(&self, signal_dn: &[f32], sequence: u64, dead: &[DeadPixel], pixels: &mut [u8]) {
        let mut random = Noise::new(self.seed ^ 0x5EED_0F0A_F4A3_E000, sequence);
        for (signal, out) in signal_dn
            .chunks_exact(self.width)
            .zip(pixels.chunks_exact_mut(self.width))
        {
            let start = (random.uniform() * TABLE as f64) as usize;
            self.read_row(signal, &self.normal[start..start + self.width], out);
        }
        for pixel in dead {
            if let Some(value) = pixels.get_mut(usize::from(pixel.v_px) * self.width + usize::from(pixel.u_px)) {
                *value = pixel.value;
            }
        }
    }

    fn read_row(&self, signal_dn: &[f32], normal: &[f32], out: &mut [u8]) {
        for ((pixel, signal), normal) in out.iter_mut().zip(signal_dn).zip(normal) {
            let deviation_dn = (self.read_variance_dn2 + self.shot_variance_dn * signal).sqrt();
            let value = self.black_dn + signal + deviation_dn * normal;
            *pixel = (value + 0.5).clamp(0.0, 255.0) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u16 = 640;
    const PIXELS: usize = 640 * 480;

    fn frame(settings: &CameraSettings, signal_dn: f32, sequence: u64) -> Vec<u8> {
        let mut pixels = vec![0; PIXELS];
        Sensor::new(WIDTH, settings, 3).read_out(&vec![signal_dn; PIXELS], sequence, &[], &mut pixels);
        pixels
    }

    fn mean_and_variance(pixels: &[u8]) -> (f64, f64) {
        let mean = pixels.iter().map(|value| f64::from(*value)).sum::<f64>() / pixels.len() as f64;
        let variance = pixels
            .iter()
            .map(|value| (f64::from(*value) - mean).powi(2))
            .sum::<f64>();
        (mean, variance / pixels.len() as f64)
    }

    /// Read noise, shot noise, and 1/12 for the rounding; 307 200 samples of variance V have a deviation of 0.26 % of V.
    #[test]
    fn noise_has_the_configured_variance() {
        for (gain, signal_dn) in [(1.0, 20.0f32), (1.0, 100.0), (1.0, 180.0), (3.0, 100.0)] {
            let settings = CameraSettings {
                gain,
                read_noise_dn: 1.2,
                shot_variance_dn: 0.03,
                ..CameraSettings::default()
            };
            let (mean, variance) = mean_and_variance(&frame(&settings, signal_dn, 9));
            let expected = (gain * 1.2f64).powi(2) + gain * 0.03 * f64::from(signal_dn) + 1.0 / 12.0;
            assert!((mean - f64::from(signal_dn) - settings.black_dn).abs() < 0.03, "{mean}");
            assert!(
                (variance / expected - 1.0).abs() < 0.02,
                "{gain} {signal_dn}: {variance} {expected}"
            );
        }
    }

    #[test]
    fn frames_differ_and_repeat_with_seed_and_sequence() {
        let settings = CameraSettings::default();
        let (first, second) = (frame(&settings, 90.0, 1), frame(&settings, 90.0, 2));
        assert_eq!(first, frame(&settings, 90.0, 1));
        let product: f64 = first
            .iter()
            .zip(&second)
            .map(|(a, b)| (f64::from(*a) - 96.0) * (f64::from(*b) - 96.0))
            .sum();
        let (_, variance) = mean_and_variance(&first);
        let correlation = product / PIXELS as f64 / variance;
        assert!(correlation.abs() < 0.02, "{correlation}");
        let rows: Vec<f64> = (1..480)
            .map(|row| {
                let (one, other) = (&first[..640], &first[row * 640..(row + 1) * 640]);
                let sum: f64 = one
                    .iter()
                    .zip(other)
                    .map(|(a, b)| (f64::from(*a) - 96.0) * (f64::from(*b) - 96.0))
                    .sum();
                sum / 640.0 / variance
            })
            .collect();
        assert!(
            rows.iter().filter(|value| value.abs() > 0.25).count() <= 1,
            "rows repeat each other"
        );
    }

    #[test]
    fn bright_light_saturates_and_darkness_stays_at_black() {
        assert!(
            frame(&CameraSettings::default(), 900.0, 0)
                .iter()
                .all(|value| *value == 255)
        );
        let (mean, _) = mean_and_variance(&frame(&CameraSettings::default(), 0.0, 0));
        assert!((mean - 6.0).abs() < 0.02);
    }
}
