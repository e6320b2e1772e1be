//! Angle sensor of the steering gear.

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::SUBSTEPS;
use crate::state::RobotState;

/// Angle sensor of the steering gear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SteeringSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// One standard deviation.
    pub noise_rad: f64,
}

impl SteeringSettings {
    pub(super) fn ideal() -> SteeringSettings {
        SteeringSettings {
            every_steps: SUBSTEPS,
            noise_rad: 0.0,
        }
    }

    /// Bicycle angle, rad, positive turns left.
    pub(super) fn sample(&self, state: &RobotState, noise: &mut NoiseStream) -> f64 {
        state.steering_rad + noise.error(self.noise_rad)
    }
}
