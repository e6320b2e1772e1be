//! From light to command: how long each stage takes, from the records.

use crate::record::Record;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Pictures that wait for the tick that uses them.
const PICTURES: usize = 64;

/// Quantiles of one stage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    pub p50_ms: f64,
    pub p95_ms: f64,
    pub p99_ms: f64,
    pub samples: u64,
}

/// Stages of the loop in the order in which a picture passes them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stages {
    /// `cameras`, `tracker`, or `twin` for a virtual run, whose other stages mean nothing.
    pub localisation: String,
    /// Mid-exposure to the whole picture at the localiser: half the exposure, reading out, transport.
    pub camera: Stage,
    /// Finding the tags.
    pub locate: Stage,
    /// To the laboratory's process, and fusion.
    pub fuse: Stage,
    /// Waiting for the next tick of the 120 Hz loop.
    pub wait: Stage,
    /// Law, safety filter, frames to all robots.
    pub control: Stage,
    /// All of the above: mid-exposure to the last frame sent, by the first tick that knew the picture.
    pub exposure_to_sent: Stage,
    /// One way on the robot link, robot to laboratory, by the estimated clock offset.
    pub link: Stage,
    /// Age of a robot's pose when its command was computed, over all commands.
    pub pose_age: Stage,
}

/// Collects while a journal is read.
#[derive(Debug, Default)]
pub struct StageTimes {
    from_tracker: bool,
    from_twin: bool,
    /// Exposure and arrival of the newest pictures.
    pictures: VecDeque<(i64, i64)>,
    used_exposure_us: i64,
    camera_us: Vec<i64>,
    locate_us: Vec<i64>,
    fuse_us: Vec<i64>,
    wait_us: Vec<i64>,
    control_us: Vec<i64>,
    total_us: Vec<i64>,
    link_us: Vec<i64>,
    age_us: Vec<i64>,
}

impl StageTimes {
    /// Looks at a record.
    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Picture(picture) => {
                self.from_tracker |= picture.received_us == picture.exposure_us;
                self.camera_us.push(picture.received_us - picture.exposure_us);
                self.locate_us.push(picture.located_us - picture.received_us);
                self.fuse_us.push(picture.arrival_us - picture.located_us);
                self.pictures.push_back((picture.exposure_us, picture.arrival_us));
                if self.pictures.len() > PICTURES {
                    self.pictures.pop_front();
                }
            }
            Record::Tick(tick) => {
                self.control_us.push(tick.done_us - tick.woke_us);
                if tick.exposure_us > self.used_exposure_us {
                    self.used_exposure_us = tick.exposure_us;
                    let newest = self
                        .pictures
                        .iter()
                        .rev()
                        .find(|(exposure_us, _)| *exposure_us == tick.exposure_us);
                    if let Some((exposure_us, arrival_us)) = newest {
                        self.wait_us.push((tick.woke_us - arrival_us).max(0));
                        self.total_us.push(tick.done_us - exposure_us);
                    }
                }
            }
            Record::Telemetry(telemetry) if telemetry.sample_bound_us < i64::MAX => {
                self.link_us.push(telemetry.arrival_us - telemetry.sample_us);
            }
            Record::Pose(pose) => self.from_twin |= &*pose.camera == crate::virtual_run::CAMERA,
            Record::Command(command) if command.enable => self.age_us.push(command.pose_age_us),
            _ => {}
        }
    }

    /// The figures of the manifest.
    pub fn finish(self) -> Stages {
        Stages {
            localisation: match (self.from_twin, self.from_tracker) {
                (true, _) => crate::virtual_run::CAMERA,
                (false, true) => "tracker",
                (false, false) => "cameras",
            }
            .to_owned(),
            camera: stage(self.camera_us),
            locate: stage(self.locate_us),
            fuse: stage(self.fuse_us),
            wait: stage(self.wait_us),
            control: stage(self.control_us),
            exposure_to_sent: stage(self.total_us),
            link: stage(self.link_us),
            pose_age: stage(self.age_us),
        }
    }
}

fn stage(mut samples_us: Vec<i64>) -> Stage {
    samples_us.sort_unstable();
    let quantile_ms = |share: f64| {
        let rank = (share * samples_us.len() as f64).ceil() as usize;
        samples_us
            .get(rank.saturating_sub(1))
            .map_or(0.0, |us| *us as f64 * 1e-3)
    };
    Stage {
        p50_ms: quantile_ms(0.5),
        p95_ms: quantile_ms(0.95),
        p99_ms: quantile_ms(0.99),
        samples: samples_us.len() as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Picture, Tick};

    #[test]
    fn each_stage_counts_its_own_part_and_a_picture_counts_once() {
        let mut times = StageTimes::default();
        for k in 1..=100_i64 {
            let exposure_us = 16_667 * k;
            times.take(&Record::Picture(Picture {
                camera: "cam-0".into(),
                frame: k as u64,
                exposure_us,
                received_us: exposure_us + 4000,
                located_us: exposure_us + 5000,
                arrival_us: exposure_us + 5300,
                robots: 3,
            }));
            for tick in 0..2 {
                let woke_us = exposure_us + 7300 + 8333 * tick;
                times.take(&Record::Tick(Tick {
                    tick: 2 * k + tick,
                    due_us: woke_us,
                    woke_us,
                    done_us: woke_us + 200,
                    missed: 0,
                    exposure_us,
                }));
            }
        }
        let stages = times.finish();
        let parts = [stages.camera, stages.locate, stages.fuse, stages.wait, stages.control];
        assert_eq!(parts.map(|stage| stage.p95_ms), [4.0, 1.0, 0.3, 2.0, 0.2]);
        assert_eq!(
            (stages.exposure_to_sent.p50_ms, stages.exposure_to_sent.samples),
            (7.5, 100)
        );
        assert_eq!((stages.localisation.as_str(), stages.control.samples), ("cameras", 200));
    }
}
