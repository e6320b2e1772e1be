//! Gyro and accelerometer at the body origin.

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::state::RobotState;
use crate::{GRAVITY_M_PER_S2, SUBSTEPS};

/// Gyro about the vertical axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// One standard deviation.
    pub noise_rad_per_s: f64,
}

/// Accelerometer along the three body axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelerometerSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// One standard deviation of each axis.
    pub noise_m_per_s2: f64,
}

/// Force per mass on the body origin without gravity, in the body frame.
///
/// f = (du/dt - r v, dv/dt + r u, g): (0, 0, 9.81) at rest on a level floor; `left` is positive in a left-hand bend.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecificForce {
    pub forward_m_per_s2: f64,
    pub left_m_per_s2: f64,
    pub up_m_per_s2: f64,
}

impl GyroSettings {
    pub(super) fn ideal() -> GyroSettings {
        GyroSettings {
            every_steps: SUBSTEPS,
            noise_rad_per_s: 0.0,
        }
    }

    /// Yaw rate, rad/s, counter-clockwise positive.
    pub(super) fn sample(&self, state: &RobotState, noise: &mut NoiseStream) -> f64 {
        state.twist.yaw_rate_rad_per_s + noise.error(self.noise_rad_per_s)
    }
}

impl AccelerometerSettings {
    pub(super) fn ideal() -> AccelerometerSettings {
        AccelerometerSettings {
            every_steps: SUBSTEPS,
            noise_m_per_s2: 0.0,
        }
    }

    /// The contact forces of the last physics step over the mass, and the floor's reaction to the weight.
    ///
    /// - The push of a collision is not part of [`RobotState`]'s acceleration, so it does not show here either.
    pub(super) fn sample(&self, state: &RobotState, noise: &mut NoiseStream) -> SpecificForce {
        SpecificForce {
            forward_m_per_s2: state.accel_x_m_per_s2 + noise.error(self.noise_m_per_s2),
            left_m_per_s2: state.accel_y_m_per_s2 + noise.error(self.noise_m_per_s2),
            up_m_per_s2: GRAVITY_M_PER_S2 + noise.error(self.noise_m_per_s2),
        }
    }
}
