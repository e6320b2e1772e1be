//! Range sensors on a ring around the robot.

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use super::surroundings::{Ray, Surroundings};
use crate::SUBSTEPS;
use crate::state::RobotState;

/// Range sensors on one robot.
pub const RANGE_SENSORS: usize = 7;

/// Seven range sensors; each opening cone is taken as its middle ray.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    pub mounts: [RangeMount; RANGE_SENSORS],
    /// Nearer things read this.
    pub min_m: f64,
    /// Farther things are not seen.
    pub max_m: f64,
    /// Part of the standard deviation that does not depend on distance.
    pub noise_m: f64,
    /// Part of the standard deviation per distance, m/m.
    pub noise_share: f64,
}

/// Where a range sensor sits in the body frame and where it looks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeMount {
    pub x_m: f64,
    pub y_m: f64,
    /// From body x, counter-clockwise positive.
    pub angle_rad: f64,
}

impl RangeMount {
    /// Seven mounts at this distance from the body origin looking outward, every 30 degrees from right (-90) to left (+90).
    pub fn ring(radius_m: f64) -> [RangeMount; RANGE_SENSORS] {
        core::array::from_fn(|index| {
            let angle_rad = (index as f64 - 3.0) * (PI / 6.0);
            let (sin, cos) = libm::sincos(angle_rad);
            RangeMount {
                x_m: radius_m * cos,
                y_m: radius_m * sin,
                angle_rad,
            }
        })
    }
}

impl RangeSettings {
    pub(super) fn ideal(ring_radius_m: f64) -> RangeSettings {
        RangeSettings {
            every_steps: 6 * SUBSTEPS,
            mounts: RangeMount::ring(ring_radius_m),
            min_m: 0.02,
            max_m: 4.0,
            noise_m: 0.0,
            noise_share: 0.0,
        }
    }

    /// Distance from each sensor to the first thing on its ray, m; `None` when that is farther than `max_m`.
    ///
    /// - Noise: standard deviation `noise_m + noise_share d`; the result is kept within `min_m..=max_m`.
    pub(super) fn sample(
        &self,
        state: &RobotState,
        surroundings: &Surroundings<'_>,
        noise: &mut NoiseStream,
    ) -> [Option<f64>; RANGE_SENSORS] {
        let distances_m = surroundings.distances_m(&self.rays(state));
        let is_noisy = self.noise_m > 0.0 || self.noise_share > 0.0;
        distances_m.map(|distance_m| {
            // Drawn for every sensor, so that what one sees does not change the noise of the others.
            let unit = if is_noisy { noise.normal() } else { 0.0 };
            (distance_m <= self.max_m).then(|| {
                let deviation_m = self.noise_m + self.noise_share * distance_m;
                (distance_m + deviation_m * unit).max(self.min_m).min(self.max_m)
            })
        })
    }

    fn rays(&self, state: &RobotState) -> [Ray; RANGE_SENSORS] {
        let (sin, cos) = libm::sincos(state.pose.yaw_rad);
        self.mounts.map(|mount| {
            let (direction_y, direction_x) = libm::sincos(state.pose.yaw_rad + mount.angle_rad);
            Ray {
                x_m: state.pose.x_m + mount.x_m * cos - mount.y_m * sin,
                y_m: state.pose.y_m + mount.x_m * sin + mount.y_m * cos,
                direction_x,
                direction_y,
            }
        })
    }
}
