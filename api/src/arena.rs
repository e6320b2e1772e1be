//! The place where robots drive.

use crate::experiment::Pose;
use serde::{Deserialize, Serialize};

/// Rectangular arena, world origin at its centre, x right and y up as seen from above.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Arena {
    /// Name used in experiments, for example `reference`.
    pub name: String,
    /// Extent along x in metres.
    pub width_m: f64,
    /// Extent along y in metres.
    pub height_m: f64,
    /// Floor covering, for example `lab-floor`; models belong to a robot and a floor.
    pub floor: String,
    /// Obstacles, floor regions and tilt; absent: an empty room with a level floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contents: Option<Contents>,
}

/// What stands in an arena and what its floor is like. Poses are in the world frame; ranges in `docs/world.md`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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

/// Outline seen from above, centred at its pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Shape {
    Circle {
        radius_m: f64,
    },
    Rectangle {
        /// Whole side along its x.
        length_m: f64,
        /// Whole side along its y.
        width_m: f64,
    },
}

/// Something that does not move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FixedObstacle {
    pub name: String,
    pub shape: Shape,
    pub pose: Pose,
}

/// Something that robots push over the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FloorRegion {
    pub shape: Shape,
    pub pose: Pose,
    /// Times the floor friction of every wheel whose contact point is inside.
    pub friction_scale: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// An arena and what it is doing now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ArenaView {
    #[serde(flatten)]
    pub arena: Arena,
    /// `free`, `leased`, `held` (waiting for a self-check or an operator) or `offline` (no laboratory connected).
    pub state: String,
    /// Why, in words, when it is not free.
    pub message: Option<String>,
    /// The protective stop is pressed and not cleared.
    #[serde(default)]
    pub stopped: bool,
    /// Page of its protective stop; `POST` to `stop` below it stops the robots, also without this service.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_url: Option<String>,
}
