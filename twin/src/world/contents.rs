//! What stands in an arena and what its floor is like: the description.

use serde::{Deserialize, Serialize};

use super::Arena;
use super::shape::Shape;
use crate::parameter::ParameterError;
use crate::pose::Pose;

/// Most fixed obstacles in one world.
pub const MAX_FIXED: usize = 1000;
/// Most pushable obstacles in one world.
pub const MAX_PUSHABLE: usize = 1000;
/// Most floor regions in one world.
pub const MAX_REGIONS: usize = 64;

/// Obstacles, floor regions and tilt. Poses are in the world frame; see `docs/world.md`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contents {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<FixedObstacle>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pushable: Vec<PushableObstacle>,
    /// Where regions overlap, the last of them in this list holds.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<FloorRegion>,
    /// Slope of the whole floor: positive pulls towards positive x and y.
    #[serde(skip_serializing_if = "is_zero")]
    pub tilt_x_rad: f64,
    #[serde(skip_serializing_if = "is_zero")]
    pub tilt_y_rad: f64,
    /// Corners of a region that the safety filter keeps robots in, as a simple polygon; empty: the walls alone. No part of the physics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub geofence: Vec<[f64; 2]>,
}

/// Something that does not move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedObstacle {
    pub name: String,
    pub shape: Shape,
    pub pose: Pose,
}

/// Something that robots push over the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushableObstacle {
    pub name: String,
    pub shape: Shape,
    /// At the start, at rest.
    pub pose: Pose,
    /// Spread evenly over the shape.
    pub mass_kg: f64,
    /// Coefficient of dry friction on the floor.
    pub floor_friction: f64,
}

/// A part of the floor with a grip of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorRegion {
    pub shape: Shape,
    pub pose: Pose,
    /// Times the floor friction of every wheel whose contact point is inside.
    pub friction_scale: f64,
}

impl Contents {
    /// True for an empty room with a level floor and no geofence.
    pub fn is_empty(&self) -> bool {
        self.fixed.is_empty()
            && self.pushable.is_empty()
            && self.regions.is_empty()
            && self.tilt_x_rad == 0.0
            && self.tilt_y_rad == 0.0
            && self.geofence.is_empty()
    }

    /// Everything that is wrong with it, by its path, for example `pushable[2].mass_kg`; empty when it fits the arena.
    pub fn check(&self, arena: &Arena) -> Vec<ParameterError> {
        super::check::check(self, arena)
    }

    /// The first fixed obstacle that a circle overlaps by more than 1 mm: `(position in fixed, overlap)`.
    pub fn fixed_overlap_m(&self, x_m: f64, y_m: f64, radius_m: f64) -> Option<(usize, f64)> {
        overlap_m(self.fixed.iter().map(|one| (one.shape, one.pose)), [x_m, y_m], radius_m)
    }

    /// The first pushable obstacle, at its start, that a circle overlaps by more than 1 mm: `(position in pushable, overlap)`.
    pub fn pushable_overlap_m(&self, x_m: f64, y_m: f64, radius_m: f64) -> Option<(usize, f64)> {
        overlap_m(
            self.pushable.iter().map(|one| (one.shape, one.pose)),
            [x_m, y_m],
            radius_m,
        )
    }
}

fn overlap_m(shapes: impl Iterator<Item = (Shape, Pose)>, at_m: [f64; 2], radius_m: f64) -> Option<(usize, f64)> {
    shapes.enumerate().find_map(|(index, (shape, pose))| {
        // Cheap look first: the heading is needed only close by.
        let (dx, dy) = (at_m[0] - pose.x_m, at_m[1] - pose.y_m);
        let reach_m = shape.bounding_radius_m() + radius_m;
        if dx * dx + dy * dy >= reach_m * reach_m {
            return None;
        }
        let overlap_m = radius_m - super::shape::Placed::new(shape, pose).distance_m(at_m[0], at_m[1]);
        (overlap_m > super::START_OVERLAP_M).then_some((index, overlap_m))
    })
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
