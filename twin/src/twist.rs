//! Velocity of the body.

use serde::{Deserialize, Serialize};

/// Body twist `(u, v, r)` at the body origin, in the body frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyTwist {
    /// `u`, positive forward.
    pub forward_m_per_s: f64,
    /// `v`, positive to the left.
    pub left_m_per_s: f64,
    /// `r`, positive counter-clockwise.
    pub yaw_rate_rad_per_s: f64,
}

impl BodyTwist {
    /// Speed of the body origin, m/s.
    pub fn speed_m_per_s(&self) -> f64 {
        (self.forward_m_per_s * self.forward_m_per_s + self.left_m_per_s * self.left_m_per_s).sqrt()
    }
}
