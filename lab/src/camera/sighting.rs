//! What a camera's process tells the laboratory of one picture.

use localise::Observation;
use serde::{Deserialize, Serialize};

/// One line of a camera's socket; times are `CLOCK_MONOTONIC` microseconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sighting {
    /// Name of the camera in its calibration file.
    pub camera: String,
    /// The whole picture had arrived.
    pub received_us: i64,
    /// The tags were found.
    pub located_us: i64,
    pub observation: Observation,
}
