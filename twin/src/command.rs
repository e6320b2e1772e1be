//! Set-points that a robot receives.

use serde::{Deserialize, Serialize};

use crate::MAX_WHEELS;

/// Wheel speed set-points and the bicycle steering angle. Holds until the next one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelCommand {
    /// Index = position in the robot's `wheels`; undriven wheels are ignored. Positive rolls along the rolling direction.
    pub wheel_rad_per_s: [f64; MAX_WHEELS],
    /// Bicycle angle, positive turns left; ignored without steering.
    pub steering_rad: f64,
}

impl WheelCommand {
    /// Name of the first number that is not finite.
    pub fn non_finite_field(&self) -> Option<String> {
        if !self.steering_rad.is_finite() {
            return Some("steering_rad".to_owned());
        }
        let wheel = self.wheel_rad_per_s.iter().position(|w| !w.is_finite())?;
        Some(format!("wheel_rad_per_s[{wheel}]"))
    }
}
