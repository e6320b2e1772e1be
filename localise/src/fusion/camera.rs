//! Order and liveness of one camera's frames.

use serde::{Deserialize, Serialize};

use super::{Admission, FusionSettings};
use crate::localiser::Observation;

/// A smaller sequence this long after the last picture is a new start, not an old picture.
const RESTART_US: i64 = 500_000;

/// What is remembered of a camera.
#[derive(Debug, Clone, Default)]
pub struct CameraState {
    last: Option<Last>,
    frozen: bool,
}

#[derive(Debug, Clone)]
struct Last {
    sequence: u64,
    exposure_us: i64,
    arrival_us: i64,
    digest: u64,
    /// Exposure of the last picture that was new.
    changed_us: i64,
}

/// Whether a camera can be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum CameraHealth {
    /// No frame yet.
    Silent,
    Live,
    /// No frame for too long.
    Stalled {
        since_us: i64,
    },
    /// Frames arrive, and show the same picture again and again.
    Frozen {
        since_us: i64,
    },
}

impl CameraState {
    /// First in, first out by sequence; also whether the picture is a new one.
    ///
    /// - Returns what becomes of the frame, and how many sequence numbers were skipped.
    pub(super) fn admit(
        &mut self,
        observation: &Observation,
        now_us: i64,
        moving: bool,
        settings: &FusionSettings,
    ) -> (Admission, u64) {
        let Observation {
            sequence,
            exposure_us,
            digest,
            ..
        } = *observation;
        let age_us = now_us.saturating_sub(exposure_us);
        if age_us < 0 || age_us > settings.measurement_age_max_us {
            return (Admission::TooOld, 0);
        }
        let Some(last) = &mut self.last else {
            self.last = Some(Last {
                sequence,
                exposure_us,
                arrival_us: now_us,
                digest,
                changed_us: exposure_us,
            });
            return (Admission::Used, 0);
        };
        // A camera that was switched off and on counts from 0 again, long after its last picture.
        let restarted = sequence <= last.sequence && exposure_us - last.exposure_us > RESTART_US;
        if (sequence <= last.sequence && !restarted) || exposure_us <= last.exposure_us {
            return (Admission::OutOfOrder, 0);
        }
        let missed = if restarted { 0 } else { sequence - last.sequence - 1 };
        (last.sequence, last.exposure_us, last.arrival_us) = (sequence, exposure_us, now_us);
        if digest != last.digest {
            (last.digest, last.changed_us) = (digest, exposure_us);
            self.frozen = false;
        } else if settings.frames_have_noise || moving {
            self.frozen = true;
        }
        let admission = if self.frozen {
            Admission::Frozen
        } else {
            Admission::Used
        };
        (admission, missed)
    }

    pub(super) fn health(&self, now_us: i64, settings: &FusionSettings) -> CameraHealth {
        match &self.last {
            None => CameraHealth::Silent,
            Some(last) if now_us - last.arrival_us > settings.stalled_after_us => CameraHealth::Stalled {
                since_us: last.arrival_us,
            },
            Some(last) if self.frozen => CameraHealth::Frozen {
                since_us: last.changed_us,
            },
            Some(_) => CameraHealth::Live,
        }
    }
}
