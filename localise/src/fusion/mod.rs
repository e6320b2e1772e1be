//! Observations of all cameras to one world pose per robot.
//!
//! Identity: within a frame a robot seen twice counts as a duplicate, and only a place that agrees with the robot's
//! track is used. Between frames a place that does not agree with the track feeds a candidate, which replaces the track
//! only after the track has been without measurements for [`FusionSettings::lost_after_us`].
//! Between cameras the same rule decides: who disagrees with the track is not used.

mod camera;
mod settings;
mod track;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::floor::FloorPose;
use crate::localiser::Observation;

pub use camera::{CameraHealth, CameraState};
pub use settings::FusionSettings;
use track::{Agreement, Track};

/// Angle in (-pi, pi].
pub fn wrap_rad(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle_rad.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// A robot on the floor as all cameras together see it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorldPose {
    pub robot: u16,
    /// Time this pose is for: the one that was asked for.
    pub time_us: i64,
    /// Time since the middle of the exposure of the last measurement in it.
    pub age_us: i64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub vx_m_per_s: f64,
    pub vy_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
    /// Of x, y, yaw at `time_us`: m^2, m rad, rad^2; yaw is filtered apart, so its cross terms are zero.
    pub covariance: [[f64; 3]; 3],
    /// Of vx, vy, yaw rate: m^2/s^2, rad^2/s^2.
    pub velocity_variance: [f64; 3],
    /// Camera of the last measurement.
    pub camera: u16,
}

impl WorldPose {
    /// Standard deviations: of the place along its most uncertain direction, m, and of the yaw, rad.
    pub fn spread(&self) -> [f64; 2] {
        let [[xx, xy, _], [_, yy, _], [.., yaw]] = self.covariance;
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let largest = mean + half.hypot(xy);
        [largest.max(0.0).sqrt(), yaw.max(0.0).sqrt()]
    }
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Admission {
    Used,
    /// A camera number beyond the number of cameras.
    UnknownCamera,
    /// Sequence not above the last one, or exposure not after the last one of this camera.
    OutOfOrder,
    /// The exposure lies in the future or further back than measurements are used.
    TooOld,
    /// The very same picture or measurements again while the camera has noise or robots move.
    Frozen,
}

/// What became of one tag in a frame that was used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TagOutcome {
    /// Went into the robot's pose.
    Used,
    /// First sightings, before a pose is told to anybody.
    Candidate,
    /// Does not agree with the track: too far, too fast, or another identity.
    Jump,
    /// Seen at several places at once and not the one that agrees with the track.
    Duplicate,
    /// Numbers no camera can send: not finite, or no covariance.
    Invalid,
}

/// Counters since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FusionCounts {
    pub used: u64,
    pub jumps: u64,
    /// Frames in which a robot was seen at more than one place.
    pub duplicates: u64,
    pub invalid: u64,
    /// Robots whose track was given up for another place.
    pub relocations: u64,
    pub out_of_order_frames: u64,
    pub too_old_frames: u64,
    pub frozen_frames: u64,
    /// Frames missing between the sequences that arrived.
    pub missed_frames: u64,
    pub unknown_camera_frames: u64,
}

#[derive(Debug, Clone, Default)]
struct Robot {
    track: Option<Track>,
    candidate: Option<Track>,
    /// Speed the robot was told to drive, and until when that is known.
    commanded: Option<(f64, i64)>,
}

/// Fuses frames in the order in which they arrive; the same calls give the same poses.
#[derive(Debug, Clone)]
pub struct Fusion {
    settings: FusionSettings,
    cameras: Vec<CameraState>,
    robots: BTreeMap<u16, Robot>,
    counts: FusionCounts,
}

impl Fusion {
    /// - Errors: settings outside their limits, by field.
    pub fn new(settings: FusionSettings) -> Result<Fusion, crate::Problem> {
        settings.check()?;
        let cameras = (0..settings.cameras).map(|_| CameraState::default()).collect();
        Ok(Fusion {
            settings,
            cameras,
            robots: BTreeMap::new(),
            counts: FusionCounts::default(),
        })
    }

    pub fn counts(&self) -> FusionCounts {
        self.counts
    }

    /// Tells that a robot has been commanded to move until `until_us`; a camera that shows it at rest for long is frozen.
    pub fn expect_motion(&mut self, robot: u16, speed_m_per_s: f64, until_us: i64) {
        if usize::from(robot) < usize::from(self.settings.robots) {
            self.robots.entry(robot).or_default().commanded = Some((speed_m_per_s.abs(), until_us));
        }
    }

    /// Takes one frame of one camera.
    ///
    /// - `now_us`: when it arrived, on the clock of the exposures.
    /// - `outcomes`: cleared, then one per pose of the observation, in its order; empty if the frame was not used.
    pub fn observe(
        &mut self,
        camera: u16,
        observation: &Observation,
        now_us: i64,
        outcomes: &mut Vec<TagOutcome>,
    ) -> Admission {
        outcomes.clear();
        let moving = self.sees_motion(camera, observation, now_us);
        let Some(state) = self.cameras.get_mut(usize::from(camera)) else {
            self.counts.unknown_camera_frames += 1;
            return Admission::UnknownCamera;
        };
        let (admission, missed) = state.admit(observation, now_us, moving, &self.settings);
        self.counts.missed_frames += missed;
        match admission {
            Admission::Used => {}
            Admission::OutOfOrder => self.counts.out_of_order_frames += 1,
            Admission::TooOld => self.counts.too_old_frames += 1,
            Admission::Frozen => self.counts.frozen_frames += 1,
            Admission::UnknownCamera => self.counts.unknown_camera_frames += 1,
        }
        if admission != Admission::Used {
            return admission;
        }
        outcomes.resize(observation.poses.len(), TagOutcome::Invalid);
        let limit = self.settings.robots;
        let mut by_robot: BTreeMap<u16, Vec<usize>> = BTreeMap::new();
        for (index, pose) in observation.poses.iter().enumerate() {
            if pose.robot < limit && is_possible(pose) {
                by_robot.entry(pose.robot).or_default().push(index);
            } else {
                self.counts.invalid += 1;
            }
        }
        for (robot, places) in by_robot {
            self.take(camera, observation, robot, &places, outcomes);
        }
        admission
    }

    /// One robot's places in one frame.
    fn take(
        &mut self,
        camera: u16,
        observation: &Observation,
        robot: u16,
        places: &[usize],
        outcomes: &mut [TagOutcome],
    ) {
        let settings = &self.settings;
        let entry = self.robots.entry(robot).or_default();
        let time_us = observation.exposure_us;
        let agrees = |track: &Option<Track>, index: usize| {
            track
                .as_ref()
                .is_some_and(|track| track.agreement(&observation.poses[index], time_us, settings) == Agreement::Agrees)
        };
        let mut chosen = places[0];
        if places.len() > 1 {
            self.counts.duplicates += 1;
            places.iter().for_each(|&index| outcomes[index] = TagOutcome::Duplicate);
            let mut agreeing = places.iter().copied().filter(|&index| agrees(&entry.track, index));
            // Neither place is used unless exactly one agrees with a track.
            match (agreeing.next(), agreeing.next()) {
                (Some(only), None) => chosen = only,
                _ => return,
            }
        }
        let pose = &observation.poses[chosen];
        if agrees(&entry.track, chosen) {
            if let Some(track) = &mut entry.track {
                track.update(pose, camera, time_us, settings);
            }
            outcomes[chosen] = TagOutcome::Used;
            self.counts.used += 1;
            return;
        }
        outcomes[chosen] = if entry.track.is_some() {
            TagOutcome::Jump
        } else {
            TagOutcome::Candidate
        };
        self.counts.jumps += u64::from(entry.track.is_some());
        if agrees(&entry.candidate, chosen) {
            if let Some(candidate) = &mut entry.candidate {
                candidate.update(pose, camera, time_us, settings);
            }
        } else {
            entry.candidate = Some(Track::new(pose, camera, time_us, settings));
        }
        let lost = entry
            .track
            .as_ref()
            .is_none_or(|track| time_us - track.time_us() > settings.lost_after_us);
        let proven = entry
            .candidate
            .as_ref()
            .is_some_and(|candidate| candidate.hits() >= settings.hits_to_start);
        if lost && proven {
            self.counts.relocations += u64::from(entry.track.is_some());
            entry.track = entry.candidate.take();
            outcomes[chosen] = TagOutcome::Used;
            self.counts.used += 1;
        }
    }

    /// Whether a robot in this frame is known to move: told so, or seen moving by another camera.
    fn sees_motion(&self, camera: u16, observation: &Observation, now_us: i64) -> bool {
        observation.poses.iter().any(|pose| {
            let Some(robot) = self.robots.get(&pose.robot) else {
                return false;
            };
            let told = robot
                .commanded
                .is_some_and(|(speed, until)| now_us <= until && speed > self.settings.rest_m_per_s);
            let seen = robot
                .track
                .as_ref()
                .is_some_and(|track| track.camera() != camera && track.speed_m_per_s() > self.settings.rest_m_per_s);
            told || seen
        })
    }

    /// Pose of a robot carried forward to `now_us`; `None` before it is known and once its track is lost.
    pub fn pose(&self, robot: u16, now_us: i64) -> Option<WorldPose> {
        let track = self.robots.get(&robot)?.track.as_ref()?;
        (now_us - track.time_us() <= self.settings.lost_after_us).then(|| track.pose(robot, now_us, &self.settings))
    }

    /// All robots that are known at `now_us`, by number.
    pub fn poses(&self, now_us: i64) -> Vec<WorldPose> {
        self.robots
            .keys()
            .filter_map(|&robot| self.pose(robot, now_us))
            .collect()
    }

    /// State of a camera at `now_us`; `None` for a number beyond the number of cameras.
    pub fn camera(&self, camera: u16, now_us: i64) -> Option<CameraHealth> {
        Some(self.cameras.get(usize::from(camera))?.health(now_us, &self.settings))
    }
}

/// Finite, within a kilometre, and variances that are positive.
fn is_possible(pose: &FloorPose) -> bool {
    let numbers = [pose.x_m, pose.y_m, pose.yaw_rad];
    let c = &pose.covariance;
    numbers.iter().all(|number| number.abs() < 1000.0)
        && c.as_flattened().iter().all(|number| number.is_finite())
        && (0..3).all(|axis| c[axis][axis] > 0.0)
        && c[0][0] * c[1][1] - c[0][1] * c[1][0] > 0.0
}
