//! Runs along the path of the run that is shown.

use super::Recording;
use crate::tracking::Tracking;
use std::collections::BTreeMap;
use uuid::Uuid;

/// Runs that stand beside each other at most.
pub const TRACKS_MAX: usize = 12;

/// What the Run page shows of a run along a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RunSide {
    /// The floor, and errors over time.
    #[default]
    Motion,
    /// Beside earlier runs along the same path.
    Comparison,
}

/// Measured tracks of runs, and what follows from them.
#[derive(Debug, Clone, Default)]
pub struct Comparison {
    pub side: RunSide,
    /// As they came from the server; the newest [`TRACKS_MAX`] of the path that is shown.
    pub tracks: BTreeMap<Uuid, Recording>,
    /// Computed from them; none where nothing can be: an unknown robot, an empty track.
    pub found: BTreeMap<Uuid, Option<Tracking>>,
}
