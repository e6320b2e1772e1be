//! What a robot's sensors say about its state.
//!
//! A reading is a function of state, surroundings, settings and the noise streams passed in; without noise it is the
//! truth, bit for bit. Bias, scale errors and delay of the robot's clock are effects of a model, not noise.

pub mod electrical;
pub mod encoder;
pub mod golden;
pub mod inertial;
mod limits;
pub mod magnetometer;
pub mod noise;
pub mod range;
mod readings;
mod settings;
pub mod steering;
pub mod surroundings;
pub mod tracked_pose;

use serde::{Deserialize, Serialize};

pub use noise::{NoiseStream, NoiseStreams};
pub use readings::Readings;
pub use settings::SensorSettings;
pub use surroundings::Surroundings;

use crate::MAX_WHEELS;
use crate::parameter::ParameterError;
use crate::robot::Robot;
use crate::state::RobotState;
use encoder::EncoderWindow;
use tracked_pose::Tracker;

/// All sensors of one robot.
#[derive(Debug, Clone)]
pub struct SensorSuite {
    settings: SensorSettings,
    driven: [bool; MAX_WHEELS],
    memory: SensorMemory,
}

/// What the sensors remember: counted ticks, the open exposure, frames on their way. With the [`NoiseStreams`] it is all
/// that the next readings depend on besides the robot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorMemory {
    encoder: EncoderWindow,
    tracker: Tracker,
}

impl SensorSuite {
    /// Sensors that have not sampled yet.
    ///
    /// - Errors: the first problem of [`SensorSettings::check`].
    pub fn new(robot: &Robot, settings: SensorSettings) -> Result<SensorSuite, ParameterError> {
        if let Some(problem) = settings.check(robot).into_iter().next() {
            return Err(problem);
        }
        let mut driven = [false; MAX_WHEELS];
        for (driven, wheel) in driven.iter_mut().zip(&robot.description().wheels) {
            *driven = wheel.driven;
        }
        Ok(SensorSuite {
            settings,
            driven,
            memory: SensorMemory::default(),
        })
    }

    /// The settings these sensors were made from.
    pub fn settings(&self) -> &SensorSettings {
        &self.settings
    }

    /// Samples every sensor whose `every_steps` divides `step`, and gives the tracked poses that have arrived.
    ///
    /// - `step`: 480 Hz physics steps since the start; rises from call to call. A [`crate::world::World`] shows its
    ///   robots after every fourth step: sensors then sample where a multiple of 4 is a multiple of `every_steps`.
    /// - Two calls with equal state, step, memory and streams give the same bits.
    pub fn sample(
        &mut self,
        state: &RobotState,
        surroundings: &Surroundings<'_>,
        step: u64,
        noise: &mut NoiseStreams,
    ) -> Readings {
        let is_due = |every_steps: u32| step.is_multiple_of(u64::from(every_steps));
        let (settings, driven, memory) = (&self.settings, &self.driven, &mut self.memory);
        let mut readings = Readings::default();
        if let Some(encoder) = settings.encoder.as_ref().filter(|s| is_due(s.every_steps)) {
            let window = &mut memory.encoder;
            readings.encoder = Some(window.sample(encoder, driven, state, step, &mut noise.encoder));
        }
        if let Some(current) = settings.current.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.current_a = Some(current.sample(driven, state, &mut noise.current));
        }
        if let Some(bus) = settings.bus_voltage.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.bus_v = Some(bus.sample(state, &mut noise.bus_voltage));
        }
        if let Some(steering) = settings.steering.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.steering_rad = Some(steering.sample(state, &mut noise.steering));
        }
        if let Some(gyro) = settings.gyro.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.gyro_z_rad_per_s = Some(gyro.sample(state, &mut noise.gyro));
        }
        if let Some(accelerometer) = settings.accelerometer.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.specific_force = Some(accelerometer.sample(state, &mut noise.accelerometer));
        }
        if let Some(magnetometer) = settings.magnetometer.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.magnetic_field = Some(magnetometer.sample(state, &mut noise.magnetometer));
        }
        if let Some(range) = settings.range.as_ref().filter(|s| is_due(s.every_steps)) {
            readings.range_m = Some(range.sample(state, surroundings, &mut noise.range));
        }
        if let Some(tracker) = &settings.tracked_pose {
            let arrived = memory
                .tracker
                .sample(tracker, &state.pose, step, &mut noise.tracked_pose);
            readings.tracked_poses = arrived;
        }
        readings
    }

    /// What the sensors remember after the last sample.
    pub fn memory(&self) -> &SensorMemory {
        &self.memory
    }

    /// Continues from a memory of this suite or of one with the same settings.
    pub fn restore(&mut self, memory: SensorMemory) {
        self.memory = memory;
    }
}
