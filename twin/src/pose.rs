//! Position and heading in the world.

use serde::{Deserialize, Serialize};

/// Pose of the body origin in the world frame (x right, y up on the page; yaw counter-clockwise positive).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

impl Pose {
    /// True when all three numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.yaw_rad.is_finite()
    }

    /// Distance between two origins, m.
    pub fn distance_m(&self, other: &Pose) -> f64 {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        (dx * dx + dy * dy).sqrt()
    }
}

/// An angle wrapped to [-pi, pi], rad.
pub fn wrapped_rad(angle_rad: f64) -> f64 {
    if angle_rad.abs() <= core::f64::consts::PI {
        return angle_rad;
    }
    let turns = (angle_rad / core::f64::consts::TAU + 0.5).floor();
    angle_rad - turns * core::f64::consts::TAU
}
