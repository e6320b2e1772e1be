//! Finds the robots in one camera's pictures: around predicted places, and everywhere ten times a second.

use super::frame_stream::FrameHeader;
use localise::{
    Camera, CameraLocaliser, DetectorSettings, Expected, FloorSettings, Frame, Fusion, FusionSettings, Observation,
    Problem, TagOutcome,
};

/// Time between two searches of the whole picture.
const FULL_SEARCH_US: i64 = 100_000;
/// A robot that was not seen for this long is only looked for everywhere.
const FORGET_US: i64 = 300_000;
/// What a predicted place may be wrong by besides three standard deviations.
const REACH_M: f64 = 0.03;
/// Largest acceleration that the prediction does not know.
const ACCELERATION_M_PER_S2: f64 = 4.0;
/// No place is looked for further away than this from its prediction.
const REACH_MAX_M: f64 = 0.3;

/// See the module.
#[derive(Debug)]
pub struct Eye {
    localiser: CameraLocaliser,
    /// Of this camera alone: predicts where to look.
    tracks: Fusion,
    outcomes: Vec<TagOutcome>,
    expected: Vec<Expected>,
    next_full_us: i64,
}

impl Eye {
    /// - `tag_height_m`: of all tags above the floor.
    /// - `robots`: tags from this number on are foreign.
    pub fn new(camera: Camera, tag_height_m: f64, robots: u16) -> Result<Self, Problem> {
        let detector = DetectorSettings {
            identities: robots,
            ..DetectorSettings::default()
        };
        let floor = FloorSettings {
            tag_height_m,
            ..FloorSettings::default()
        };
        let tracks = FusionSettings {
            cameras: 1,
            robots,
            ..FusionSettings::default()
        };
        Ok(Self {
            localiser: CameraLocaliser::new(camera, detector, floor),
            tracks: Fusion::new(tracks)?,
            outcomes: Vec::new(),
            expected: Vec::new(),
            next_full_us: i64::MIN,
        })
    }

    /// Name of the camera.
    pub fn name(&self) -> &str {
        self.localiser.camera().name()
    }

    /// What a picture shows.
    ///
    /// - Errors: a picture of another size than the calibration's.
    pub fn look(&mut self, header: &FrameHeader, pixels: &[u8]) -> Result<Observation, Problem> {
        let frame = Frame::new(usize::from(header.width_px), usize::from(header.height_px), pixels)?;
        let now_us = header.mid_exposure_us;
        let everywhere = now_us >= self.next_full_us || now_us < self.next_full_us - 2 * FULL_SEARCH_US;
        if everywhere {
            self.next_full_us = now_us + FULL_SEARCH_US;
        }
        self.predict(now_us);
        let expected = (!everywhere).then_some(self.expected.as_slice());
        let observation = self.localiser.locate(&frame, header.sequence, now_us, expected)?;
        self.tracks.observe(0, &observation, now_us, &mut self.outcomes);
        // A robot that has just come in is not predicted yet: look everywhere until it is.
        if self.outcomes.contains(&TagOutcome::Candidate) {
            self.next_full_us = now_us;
        }
        Ok(observation)
    }

    fn predict(&mut self, now_us: i64) {
        self.expected.clear();
        for pose in self.tracks.poses(now_us) {
            if pose.age_us > FORGET_US {
                continue;
            }
            let [[xx, ..], [_, yy, _], _] = pose.covariance;
            let age_s = pose.age_us as f64 * 1e-6;
            let reach_m = REACH_M + 3.0 * xx.max(yy).sqrt() + 0.5 * ACCELERATION_M_PER_S2 * age_s * age_s;
            self.expected.push(Expected {
                x_m: pose.x_m,
                y_m: pose.y_m,
                reach_m: reach_m.min(REACH_MAX_M),
            });
        }
    }
}
