//! What a rehearsal says about an experiment; the same JSON as the service's wire types.

use crate::notebook::TickNotes;
use serde::{Deserialize, Serialize};

/// Format string of a verdict.
pub const VERDICT_FORMAT: &str = "robopheus.verdict/1";
/// Format string of a replay.
pub const REPLAY_FORMAT: &str = "robopheus.replay/1";

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    pub format: String,
    pub accepted: bool,
    /// One sentence for a person.
    pub sentence: String,
    /// In the order of their time.
    pub findings: Vec<Finding>,
    /// Trace digest, lower-case hexadecimal.
    pub digest: String,
    pub twin_version: String,
    /// Control ticks simulated.
    pub ticks: u64,
    /// Smallest distance between two bounding circles; `None` with one robot.
    pub smallest_separation_m: Option<f64>,
    pub smallest_wall_distance_m: f64,
    /// Largest distance from the active path segment, for laws that follow a path.
    pub largest_path_error_m: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Rejects the experiment.
    Error,
    Warning,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub severity: Severity,
    /// `robots_collide`, `robot_hits_wall`, `left_finite_numbers`, `target_not_reached`, `deadlock`, `controller_fault` or
    /// `path_error_large`.
    pub code: String,
    /// Moment in the replay.
    pub at_s: f64,
    pub robots: Vec<String>,
    /// The figure behind the finding.
    pub value: Option<f64>,
    pub limit: Option<f64>,
    pub unit: Option<String>,
    pub message: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    pub format: String,
    /// Time between two frames.
    pub period_s: f64,
    pub robots: Vec<ReplayRobot>,
    /// What the user's own controller said and drew.
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

/// The sentence of a verdict.
pub fn sentence(findings: &[Finding], robots: usize, simulated_s: f64, separation_m: Option<f64>) -> String {
    let errors = findings.iter().filter(|f| f.severity == Severity::Error).count();
    if let Some(first) = findings.iter().find(|f| f.severity == Severity::Error) {
        let more = if errors > 1 {
            format!(" ({} more)", errors - 1)
        } else {
            String::new()
        };
        return format!("Rejected: {}{more}.", first.message);
    }
    let who = if robots == 1 {
        "1 robot".to_owned()
    } else {
        format!("{robots} robots")
    };
    let apart = separation_m.map_or(String::new(), |m| format!(", never closer than {m:.2} m to each other"));
    match findings {
        [] => format!("Accepted: {who} finished in {simulated_s:.1} s{apart}."),
        [only] => format!("Accepted with a warning: {}.", only.message),
        [first, rest @ ..] => format!("Accepted with {} warnings: {}.", rest.len() + 1, first.message),
    }
}
