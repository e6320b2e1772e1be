//! Why nothing can be learned.

use identify::workers::Cancelled;

/// Refused input, by name.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    #[error("{path}: {message}")]
    Unreadable { path: String, message: String },
    #[error(
        "{found} runs; at least {least} are needed: one to train, one to validate, one that stays locked; give more --runs"
    )]
    TooFewRuns { found: usize, least: usize },
    #[error("{path} has {found} wheels, {other} has {expected}: all runs must be of one robot")]
    OtherRobot {
        path: String,
        other: String,
        found: usize,
        expected: usize,
    },
    #[error("{path} is of chassis {found}, {other} of {expected}: all runs must be of one robot")]
    OtherChassis {
        path: String,
        other: String,
        found: String,
        expected: String,
    },
    #[error("{path}: {missing}: nothing says where the robot went; learning needs measured poses and set-points")]
    Channels { path: String, missing: &'static str },
    #[error(
        "the {role} runs give {found} windows of {horizon_s} s; at least {least} are needed: give longer runs, or runs without pauses"
    )]
    TooShort {
        role: &'static str,
        found: usize,
        least: usize,
        horizon_s: f64,
    },
    #[error(
        "{path}: {quantity} of {value} at {time_s:.3} s is beyond +-{limit}: no robot of a laboratory does that; check the units"
    )]
    Absurd {
        path: String,
        quantity: &'static str,
        value: f64,
        time_s: f64,
        limit: f64,
    },
    #[error("the training runs stand still or hold one motion: no input varies; drive with changing speed and turning")]
    Constant,
    #[error("model: {0}")]
    Model(String),
    #[error("the model already carries a learned residual; learn on its parent, or on the version without it")]
    HasResidual,
    #[error("the physical model cannot be driven through the runs: {0}")]
    Simulation(String),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
