//! Where robots of a laboratory live: the file `robopheus.docks/1` beside the laboratory's own.

use crate::experiment::Pose;
use serde::{Deserialize, Serialize};

/// Value of `format`.
pub const DOCKS_FORMAT: &str = "robopheus.docks/1";

/// The file. A robot without a dock stays where it stopped, or is carried.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Docks {
    /// Always `robopheus.docks/1`.
    pub format: String,
    pub docks: Vec<Dock>,
}

/// A place on the floor with a charger, for one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dock {
    /// Name of the robot.
    pub robot: String,
    /// Where the robot's body origin stands while it charges, world frame.
    pub pose: Pose,
}
