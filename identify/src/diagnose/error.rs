//! Why a diagnosis fails.

use crate::workers::Cancelled;

/// Why there is no diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DiagnoseError {
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    #[error("no runs to diagnose; name at least one")]
    NoRuns,
    #[error("{path}: the robot has {found} wheels, that of {other} has {expected}: these are runs of different robots")]
    OtherRobot {
        path: String,
        other: String,
        found: usize,
        expected: usize,
    },
    #[error("{path}: chassis {found:?}, that of {other} is {expected:?}: these are runs of different robots")]
    OtherChassis {
        path: String,
        other: String,
        found: String,
        expected: String,
    },
    #[error(
        "{path} and {other} are the same recording: one that is learned from cannot check what was learned; give every run once, as a reference, as a run or as a locked one"
    )]
    Twice { path: String, other: String },
    #[error(
        "{path}: no window of 1.3 s with commands and enough measurements; channels needed: commands, and poses or wheel speeds"
    )]
    Unusable { path: String },
    #[error("the given model cannot be simulated: {0}")]
    Model(String),
}
