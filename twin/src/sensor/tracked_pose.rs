//! Pose of the robot as a camera tracker sees it: exposed, late, sometimes missing.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::pose::{Pose, wrapped_rad};
use crate::{PHYSICS_PERIOD_S, SUBSTEPS};

/// Most frames between exposure and arrival; a full queue loses the newest frame.
pub const MAX_FRAMES_IN_FLIGHT: usize = 1024;

/// Camera tracker of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackedPoseSettings {
    /// Physics steps from the start of one exposure to the start of the next.
    pub every_steps: u32,
    /// Physics steps that the shutter is open; 0 = an instant. At most `every_steps`.
    pub exposure_steps: u32,
    /// Shortest time from mid-exposure to arrival; at least half the exposure.
    pub latency_s: f64,
    /// A uniform share of this is added to the latency of each frame.
    pub latency_jitter_s: f64,
    /// One standard deviation of x and of y.
    pub noise_xy_m: f64,
    /// One standard deviation.
    pub noise_yaw_rad: f64,
    /// Share of the frames in which the robot is not found.
    pub drop_probability: f64,
}

/// One frame's result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackedPose {
    /// Mean over the exposure; yaw wrapped to [-pi, pi].
    pub pose: Pose,
    /// Middle of the exposure; 0 at physics step 0.
    pub exposure_s: f64,
    /// When the frame's result reaches the laboratory; never before that of an earlier frame.
    pub arrival_s: f64,
}

impl TrackedPoseSettings {
    pub(super) fn ideal() -> TrackedPoseSettings {
        TrackedPoseSettings {
            every_steps: SUBSTEPS,
            exposure_steps: 0,
            latency_s: 0.0,
            latency_jitter_s: 0.0,
            noise_xy_m: 0.0,
            noise_yaw_rad: 0.0,
            drop_probability: 0.0,
        }
    }
}

/// Frames being exposed and frames on their way, oldest first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tracker {
    exposure: Option<Exposure>,
    in_flight: VecDeque<TrackedPose>,
    last_arrival_s: f64,
}

/// An open shutter: the integral of the displacement `(x, y, yaw)` since the first pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Exposure {
    start_step: u64,
    first: Pose,
    last_step: u64,
    last_displacement: [f64; 3],
    integral: [f64; 3],
}

impl Exposure {
    fn new(start_step: u64, first: Pose) -> Exposure {
        Exposure {
            start_step,
            first,
            last_step: start_step,
            last_displacement: [0.0; 3],
            integral: [0.0; 3],
        }
    }

    /// Integrates a straight line from the last pose to this one, up to `end_step`.
    fn extend(&mut self, pose: &Pose, step: u64, end_step: u64) {
        let steps = step.saturating_sub(self.last_step) as f64;
        let open_steps = step.min(end_step).saturating_sub(self.last_step) as f64;
        if steps == 0.0 {
            return;
        }
        let last_yaw_rad = self.first.yaw_rad + self.last_displacement[2];
        let displacement = [
            pose.x_m - self.first.x_m,
            pose.y_m - self.first.y_m,
            self.last_displacement[2] + wrapped_rad(pose.yaw_rad - last_yaw_rad),
        ];
        for ((integral, last), now) in self.integral.iter_mut().zip(self.last_displacement).zip(displacement) {
            let at_end = last + (now - last) * (open_steps / steps);
            *integral += 0.5 * open_steps * (last + at_end);
        }
        self.last_step = step;
        self.last_displacement = displacement;
    }

    /// Mean pose over the exposure; the first pose when it lasted no time.
    fn mean(&self, exposure_steps: u32) -> Pose {
        let steps = f64::from(exposure_steps.max(1));
        Pose {
            x_m: self.first.x_m + self.integral[0] / steps,
            y_m: self.first.y_m + self.integral[1] / steps,
            yaw_rad: self.first.yaw_rad + self.integral[2] / steps,
        }
    }
}

impl Tracker {
    /// Takes in the pose at this step and gives the frames that have arrived by now, oldest first.
    ///
    /// - To be called at every step whose poses an exposure shall see; between calls the pose moves in a straight line.
    pub(super) fn sample(
        &mut self,
        settings: &TrackedPoseSettings,
        pose: &Pose,
        step: u64,
        noise: &mut NoiseStream,
    ) -> Vec<TrackedPose> {
        self.expose(settings, pose, step, noise);
        if self.exposure.is_none() && step.is_multiple_of(u64::from(settings.every_steps)) {
            self.exposure = Some(Exposure::new(step, *pose));
            if settings.exposure_steps == 0 {
                self.expose(settings, pose, step, noise);
            }
        }
        let now_s = step as f64 * PHYSICS_PERIOD_S;
        let arrived = self.in_flight.iter().take_while(|frame| frame.arrival_s <= now_s);
        let count = arrived.count();
        self.in_flight.drain(..count).collect()
    }

    /// Goes on with an open exposure and closes it when its time is over.
    fn expose(&mut self, settings: &TrackedPoseSettings, pose: &Pose, step: u64, noise: &mut NoiseStream) {
        let Some(exposure) = &mut self.exposure else { return };
        let end_step = exposure.start_step.saturating_add(u64::from(settings.exposure_steps));
        exposure.extend(pose, step, end_step);
        if step >= end_step {
            let (start_step, mean) = (exposure.start_step, exposure.mean(settings.exposure_steps));
            self.exposure = None;
            self.send(settings, start_step, mean, noise);
        }
    }

    /// Adds noise and sends the frame on its way. Draws as many numbers for a lost frame as for any other.
    fn send(&mut self, settings: &TrackedPoseSettings, start_step: u64, mean: Pose, noise: &mut NoiseStream) {
        let mid_step = start_step as f64 + 0.5 * f64::from(settings.exposure_steps);
        let exposure_s = mid_step * PHYSICS_PERIOD_S;
        let is_lost = settings.drop_probability > 0.0 && noise.uniform() < settings.drop_probability;
        let pose = Pose {
            x_m: mean.x_m + noise.error(settings.noise_xy_m),
            y_m: mean.y_m + noise.error(settings.noise_xy_m),
            yaw_rad: wrapped_rad(mean.yaw_rad + noise.error(settings.noise_yaw_rad)),
        };
        let mut latency_s = settings.latency_s;
        if settings.latency_jitter_s > 0.0 {
            latency_s += settings.latency_jitter_s * noise.uniform();
        }
        if is_lost || self.in_flight.len() >= MAX_FRAMES_IN_FLIGHT {
            return;
        }
        // First in, first out: a frame waits for the ones before it.
        self.last_arrival_s = self.last_arrival_s.max(exposure_s + latency_s);
        self.in_flight.push_back(TrackedPose {
            pose,
            exposure_s,
            arrival_s: self.last_arrival_s,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::Sensor;
    use super::*;

    #[test]
    fn a_full_queue_loses_the_newest_frame() {
        let settings = TrackedPoseSettings {
            every_steps: 1,
            latency_s: 1e3,
            ..TrackedPoseSettings::ideal()
        };
        let mut tracker = Tracker::default();
        let mut noise = NoiseStream::new(1, 0, Sensor::TrackedPose);
        for step in 0..2 * MAX_FRAMES_IN_FLIGHT as u64 {
            let pose = Pose {
                x_m: step as f64,
                ..Pose::default()
            };
            assert!(tracker.sample(&settings, &pose, step, &mut noise).is_empty());
        }
        let late = tracker.sample(&settings, &Pose::default(), 10_000_000, &mut noise);
        assert_eq!(late.len(), MAX_FRAMES_IN_FLIGHT);
        assert_eq!(late.last().map(|frame| frame.pose.x_m), Some(1023.0));
    }
}
