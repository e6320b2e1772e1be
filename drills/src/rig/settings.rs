//! What a closed loop is driven under.

use crate::{AirSettings, LightSettings};
use emulator::hidden::Hidden;

/// When the virtual world begins.
const BEGIN_US: i64 = 50_000_000;

/// Everything outside the laboratory's own code.
#[derive(Debug, Clone)]
pub struct RigSettings {
    pub seed: u64,
    pub hidden: Hidden,
    pub light: LightSettings,
    /// Laboratory to robots, and back.
    pub up: AirSettings,
    pub down: AirSettings,
    /// Quarter of the control period by which the loop's ticks are shifted against the plant's pictures, 0 to 3.
    pub phase: i64,
    /// When the virtual world begins, on the laboratory's clock.
    pub begin_us: i64,
    /// The law sees where robots will be; see [`lab::pilot::Pilot::looking_ahead`].
    pub looks_ahead: bool,
    /// The laboratory learns what share of its yaw rate a robot turns; see [`lab::pilot::Pilot::without_learning`].
    pub learns: bool,
    /// Orders and frames are noted from the first one on; see [`crate::Rig::said`].
    pub audited: bool,
    /// Robots tell their health; see [`crate::Rig::ward`].
    pub health: bool,
}

impl Default for RigSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            hidden: Hidden::neutral(),
            light: LightSettings::default(),
            up: AirSettings::default(),
            down: AirSettings::default(),
            phase: 0,
            begin_us: BEGIN_US,
            looks_ahead: true,
            learns: true,
            audited: false,
            health: false,
        }
    }
}
