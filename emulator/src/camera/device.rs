//! One camera: pictures on demand, with its faults.

use super::calibration::Calibration;
use super::canvas::Canvas;
use super::faults::{CameraFault, CameraFaults, Damage};
use super::frame::FrameHeader;
use super::optics::Optics;
use super::problem::CameraProblem;
use super::robot_view::RobotInView;
use super::sensor::Sensor;
use super::settings::CameraSettings;
use crate::noise::Noise;

/// A picture that leaves the camera.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    pub header: FrameHeader,
    /// Row by row from the top, 8 bits grey.
    pub pixels: &'a [u8],
    /// What happens to it on the way.
    pub damage: Option<Damage>,
}

/// An emulated camera.
///
/// Deterministic: calibration, index, settings, faults and what was in view decide every pixel; noise depends on seed, index
/// and sequence, not on the frames before.
#[derive(Debug, Clone)]
pub struct Camera {
    index: u16,
    seed: u64,
    settings: CameraSettings,
    canvas: Canvas,
    sensor: Sensor,
    faults: CameraFaults,
    sequence: u64,
    pixels: Vec<u8>,
    has_picture: bool,
}

impl Camera {
    /// A camera that is as its calibration says but for the hidden error in the settings.
    ///
    /// - `index`: tells the cameras of a laboratory apart; also in every frame.
    /// - Errors: the first field of calibration or settings that does not fit.
    pub fn new(calibration: &Calibration, index: u16, settings: CameraSettings) -> Result<Self, CameraProblem> {
        calibration.check()?;
        settings.check()?;
        let seed = settings.seed ^ (u64::from(index) + 1).wrapping_mul(0xD1B5_4A32_D192_ED03);
        let optics = settings.misalignment.apply(calibration, seed);
        let canvas = Canvas::new(optics, &settings)?;
        Ok(Self {
            sensor: Sensor::new(calibration.width_px, &settings, seed),
            pixels: vec![0; usize::from(calibration.width_px) * usize::from(calibration.height_px)],
            faults: CameraFaults::default(),
            sequence: 0,
            has_picture: false,
            index,
            seed,
            settings,
            canvas,
        })
    }

    /// The true camera, which no calibration file tells; for tests and for judging a localiser.
    pub fn true_optics(&self) -> &Optics {
        self.canvas.optics()
    }

    pub fn settings(&self) -> &CameraSettings {
        &self.settings
    }

    pub fn faults(&self) -> &CameraFaults {
        &self.faults
    }

    /// Puts a fault on, or ends all.
    pub fn set_fault(&mut self, fault: CameraFault) -> Result<(), CameraProblem> {
        let (dirt, light_off) = (self.faults.dirt.len(), self.faults.light_off);
        self.faults.apply(fault)?;
        if dirt != self.faults.dirt.len() || light_off != self.faults.light_off {
            self.canvas.relight(&self.faults);
        }
        Ok(())
    }

    /// Takes one picture.
    ///
    /// - `mid_exposure_us`: middle of the exposure on the caller's clock; goes into the header.
    /// - `robots`: with their poses during the exposure.
    /// - `None`: the frame was dropped by a fault; its sequence number is missing from the stream.
    pub fn expose(&mut self, mid_exposure_us: i64, robots: &[RobotInView<'_>]) -> Option<Picture<'_>> {
        let sequence = self.sequence;
        self.sequence += 1;
        if self.faults.dropped_fraction > 0.0
            && Noise::new(self.seed ^ 0xD0_0B, sequence).uniform() < self.faults.dropped_fraction
        {
            return None;
        }
        if !(self.faults.frozen && self.has_picture) {
            self.canvas.draw(robots, &self.faults);
            self.sensor.read_out(
                self.canvas.signal_dn(),
                sequence,
                &self.faults.dead_pixels,
                &mut self.pixels,
            );
            self.has_picture = true;
        }
        let spoilt = Noise::new(self.seed ^ 0xDA_3A, sequence).uniform() < self.faults.damaged_fraction;
        let optics = self.canvas.optics();
        let (width_px, full_px) = (optics.width_px, optics.height_px);
        let height_px = if self.faults.wrong_size {
            (full_px / 2).max(1)
        } else {
            full_px
        };
        let length = usize::from(width_px) * usize::from(height_px);
        Some(Picture {
            header: FrameHeader {
                camera: self.index,
                sequence,
                mid_exposure_us,
                exposure_us: self.settings.exposure_us,
                width_px,
                height_px,
            },
            pixels: self.pixels.get(..length).unwrap_or_default(),
            damage: self.faults.damage.filter(|_| spoilt),
        })
    }
}
