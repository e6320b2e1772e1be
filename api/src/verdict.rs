//! What the twin says about an experiment before it is queued.

use crate::note::TickNotes;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Verdict {
    /// Always `robopheus.verdict/1`.
    pub format: String,
    pub accepted: bool,
    /// One sentence for a person.
    pub sentence: String,
    pub findings: Vec<Finding>,
    /// Trace digest, lower-case hexadecimal.
    pub digest: String,
    pub twin_version: String,
    /// Control ticks simulated.
    pub ticks: u64,
    /// Smallest distance between two robots' bounding circles; `None` with one robot.
    pub smallest_separation_m: Option<f64>,
    /// Smallest distance between a robot's bounding circle and a wall.
    pub smallest_wall_distance_m: f64,
    /// Largest distance from the active path segment, for laws that follow a path.
    pub largest_path_error_m: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Finding {
    /// `error` rejects the experiment, `warning` does not.
    pub severity: String,
    /// Stable code: `robots_collide`, `robot_hits_wall`, `target_not_reached`, `left_finite_numbers`, ...
    pub code: String,
    /// Moment in the replay.
    pub at_s: f64,
    pub robots: Vec<String>,
    /// How close, how far: the figure behind the finding.
    pub value: Option<f64>,
    pub limit: Option<f64>,
    pub unit: Option<String>,
    pub message: String,
}

/// What the twin did, for playback: file `replay.json` of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    /// Always `robopheus.replay/1`.
    pub format: String,
    /// Time between two frames.
    pub period_s: f64,
    pub robots: Vec<ReplayRobot>,
    /// What the user's own controller said and drew; drawings about thirty times a second.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<TickNotes>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReplayRobot {
    pub name: String,
    /// `[x_m, y_m, yaw_rad]` per frame.
    pub poses: Vec<[f64; 3]>,
    /// `[x_m, y_m]` of the moving target per frame.
    pub targets: Vec<[f64; 2]>,
}
