//! Motor current and bus voltage.

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::state::RobotState;
use crate::{MAX_WHEELS, SUBSTEPS};

/// Current sensors of the motors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// One standard deviation.
    pub noise_a: f64,
}

/// Voltage sensor of the battery.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusVoltageSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// One standard deviation.
    pub noise_v: f64,
}

impl CurrentSettings {
    pub(super) fn ideal() -> CurrentSettings {
        CurrentSettings {
            every_steps: SUBSTEPS,
            noise_a: 0.0,
        }
    }

    /// Motor currents, A, by position in `wheels`; 0 where no motor drives the wheel. Positive drives along the rolling direction.
    pub(super) fn sample(
        &self,
        driven: &[bool; MAX_WHEELS],
        state: &RobotState,
        noise: &mut NoiseStream,
    ) -> [f64; MAX_WHEELS] {
        let mut current_a = [0.0; MAX_WHEELS];
        for wheel in (0..MAX_WHEELS).filter(|wheel| driven[*wheel]) {
            current_a[wheel] = state.current_a[wheel] + noise.error(self.noise_a);
        }
        current_a
    }
}

impl BusVoltageSettings {
    pub(super) fn ideal() -> BusVoltageSettings {
        BusVoltageSettings {
            every_steps: SUBSTEPS,
            noise_v: 0.0,
        }
    }

    /// Battery voltage, V.
    pub(super) fn sample(&self, state: &RobotState, noise: &mut NoiseStream) -> f64 {
        state.bus_v + noise.error(self.noise_v)
    }
}
