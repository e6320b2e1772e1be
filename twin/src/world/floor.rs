//! What the floor does to the robots on it.

use std::sync::Arc;

use super::contents::Contents;
use super::shape::Placed;
use crate::GRAVITY_M_PER_S2;

/// Regions and tilt, as every robot's step sees them.
#[derive(Debug, Clone)]
pub(crate) struct Floor {
    regions: Arc<[(Placed, f64)]>,
    pub(crate) tilt_x_rad: f64,
    pub(crate) tilt_y_rad: f64,
}

impl Floor {
    pub(crate) fn new(contents: &Contents) -> Floor {
        let regions = contents.regions.iter();
        Floor {
            regions: regions
                .map(|region| (Placed::new(region.shape, region.pose), region.friction_scale))
                .collect(),
            tilt_x_rad: contents.tilt_x_rad,
            tilt_y_rad: contents.tilt_y_rad,
        }
    }

    pub(crate) fn is_tilted(&self) -> bool {
        self.tilt_x_rad != 0.0 || self.tilt_y_rad != 0.0
    }

    /// True when no region differs from the floor around it.
    pub(crate) fn is_even(&self) -> bool {
        self.regions.iter().all(|(_, scale)| *scale == 1.0)
    }

    /// Friction over that of the bare floor at a point; the last region that holds the point decides.
    pub(crate) fn friction_scale(&self, x_m: f64, y_m: f64) -> f64 {
        let holds = |(placed, _): &&(Placed, f64)| placed.holds(x_m, y_m);
        self.regions.iter().rev().find(holds).map_or(1.0, |(_, scale)| *scale)
    }

    /// Largest friction anywhere over that of the bare floor.
    pub(crate) fn largest_scale(&self) -> f64 {
        self.regions.iter().fold(1.0, |largest, (_, scale)| scale.max(largest))
    }

    /// Acceleration that the tilt gives a body, m/s^2.
    pub(crate) fn pull_m_per_s2(&self) -> f64 {
        GRAVITY_M_PER_S2 * (self.tilt_x_rad * self.tilt_x_rad + self.tilt_y_rad * self.tilt_y_rad).sqrt()
    }
}
