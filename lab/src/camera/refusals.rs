//! Pictures that a camera's process could not use, counted for the laboratory.

use serde::{Deserialize, Serialize};

/// Since the start of the camera's process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct PictureRefusals {
    /// Of another size than the calibration's.
    pub size: u64,
    /// Damaged on the way.
    pub pixels: u64,
}

/// A line of a camera's socket beside its sightings: at the first refusal of each kind, and then at most one a second while there
/// are more.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefusalLine {
    /// Name of the camera in its calibration file.
    pub camera: String,
    pub refused: PictureRefusals,
}

impl PictureRefusals {
    /// What was added since; a process that was started anew counts from 0.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        let since = |now: u64, before: u64| now.checked_sub(before).unwrap_or(now);
        Self {
            size: since(self.size, before.size),
            pixels: since(self.pixels, before.pixels),
        }
    }
}
