//! The learning side of a run: every robot's model learned from what the hub tells, at the run's pace.
//!
//! Records of the run in; figures of the predictions and, at the end, versions out. No clock and no socket. A robot begins at the
//! version that its run was rehearsed with, or at its description.

use crate::carry_out::scenario;
use crate::record::{Command, LINK_WHEELS, Learning, LearningGap, Pose as SeenPose, Record};
use api::experiment::Mode;
use api::lab::{Assignment, LearnedModel};
use learn::online::{Closing, OnlineLearner, Prediction};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, VecDeque};
use twin::PHYSICS_RATE_HZ;
use twin::command::WheelCommand;
use twin::model_document::ModelDocument;
use twin::pose::Pose;
use twin::robot::Robot;
use uuid::Uuid;

/// One word for this many ticks: 5 Hz.
const TICKS_PER_WORD: i64 = 24;
/// Predictions that the figures are of: two seconds of motion.
const PREDICTIONS_SHOWN: usize = 20;
/// Most robots of one run that are learned: 0.1 s of processor time per second, with room.
const ROBOTS_MOST: usize = 24;

/// See the module.
#[derive(Debug, Default)]
pub struct LearningRun {
    assignment: Option<Box<Assignment>>,
    start_us: i64,
    pupils: BTreeMap<u8, Pupil>,
    next_word: i64,
    /// Records of this run were lost: what was learned from the rest is shown and not kept.
    is_lossy: bool,
}

/// What a run taught about one robot.
#[derive(Debug, Clone)]
pub struct Lesson {
    pub run_id: Uuid,
    pub robot: String,
    pub closing: Closing,
    pub discarded: u32,
    /// Where the learnt one was better at the end and nothing was lost.
    pub version: Option<LearnedModel>,
}

#[derive(Debug)]
struct Pupil {
    learner: OnlineLearner,
    /// Positions in `wheels` of the driven wheels: the order of the records.
    driven: Vec<usize>,
    newest: VecDeque<Prediction>,
    /// Of everything that it learned from.
    data: Sha256,
}

/// What comes out of a record.
#[derive(Debug, Default)]
pub struct Heard {
    pub word: Option<Learning>,
    /// At the end of a run.
    pub lessons: Vec<Lesson>,
    /// Robots that cannot be learned, and why.
    pub problems: Vec<String>,
}

impl LearningRun {
    /// Takes a record of the run.
    pub fn take(&mut self, record: &Record) -> Heard {
        let mut heard = Heard::default();
        match record {
            Record::Start(start) => {
                *self = Self {
                    assignment: Some(Box::new(start.assignment.clone())),
                    ..Self::default()
                };
            }
            Record::Motion(motion) => {
                self.start_us = motion.start_us;
                heard.problems = self.begin();
            }
            Record::Command(command) => {
                let step = self.step_at(command.sent_us);
                if let Some(pupil) = self.pupils.get_mut(&command.robot) {
                    pupil.command(step, command);
                }
            }
            Record::Pose(pose) if pose.accepted => {
                let step = self.step_at(pose.exposure_us);
                if let Some(pupil) = self.pupils.get_mut(&pose.robot) {
                    pupil.see(step, pose);
                }
            }
            Record::Tick(tick) if tick.tick >= self.next_word => {
                self.next_word = tick.tick + TICKS_PER_WORD;
                heard.word = self.word(tick.tick, tick.due_us);
            }
            Record::End(_) => heard.lessons = std::mem::take(self).finish(),
            _ => {}
        }
        heard
    }

    /// Records were lost on their way.
    pub fn lost(&mut self) {
        self.is_lossy = true;
    }

    fn step_at(&self, at_us: i64) -> i64 {
        ((at_us - self.start_us) * i64::from(PHYSICS_RATE_HZ) + 500_000).div_euclid(1_000_000)
    }

    fn begin(&mut self) -> Vec<String> {
        let Some(assignment) = &self.assignment else {
            return Vec::new();
        };
        if assignment.experiment.mode == Mode::Virtual {
            return Vec::new();
        }
        let robots = scenario(assignment).and_then(|scenario| control::rehearsal::modelled(&scenario));
        let robots = match robots {
            Ok(robots) => robots,
            Err(problems) => return problems.into_iter().take(1).map(|problem| problem.message).collect(),
        };
        let mut problems = Vec::new();
        for (robot, lab) in robots.iter().zip(&assignment.robots).take(ROBOTS_MOST) {
            match Pupil::new(assignment, robot) {
                Ok(pupil) => {
                    self.pupils.insert(lab.number, pupil);
                }
                Err(problem) => problems.push(format!("{}: {problem}", robot.name())),
            }
        }
        if robots.len() > ROBOTS_MOST {
            problems.push(format!("only {ROBOTS_MOST} of {} robots are learned", robots.len()));
        }
        problems
    }

    fn word(&self, tick: i64, at_us: i64) -> Option<Learning> {
        let gaps = self.pupils.iter().filter_map(|(robot, pupil)| pupil.gap(*robot));
        let robots: Vec<LearningGap> = gaps.collect();
        (!robots.is_empty()).then_some(Learning { tick, at_us, robots })
    }

    fn finish(self) -> Vec<Lesson> {
        let Some(assignment) = self.assignment else {
            return Vec::new();
        };
        let lesson = |pupil: Pupil| pupil.finish(assignment.run_id, self.is_lossy);
        self.pupils.into_values().map(lesson).collect()
    }
}

impl Pupil {
    fn new(assignment: &Assignment, robot: &Robot) -> Result<Self, String> {
        let parent = match assignment.models.get(robot.name()) {
            Some(document) => serde_json::from_value(document.clone()).map_err(|error| error.to_string())?,
            None => nominal(robot, &assignment.experiment.floor),
        };
        let wheels = robot.description().wheels.iter().enumerate();
        Ok(Self {
            learner: OnlineLearner::new(parent).map_err(|error| error.to_string())?,
            driven: wheels
                .filter(|(_, wheel)| wheel.driven)
                .map(|(place, _)| place)
                .collect(),
            newest: VecDeque::new(),
            data: Sha256::new(),
        })
    }

    fn command(&mut self, step: i64, sent: &Command) {
        let mut command = WheelCommand {
            steering_rad: sent.steering_rad,
            ..WheelCommand::default()
        };
        let speeds: [f64; LINK_WHEELS] = sent.wheel_rad_per_s;
        for (wheel, speed) in self.driven.iter().zip(speeds) {
            if let Some(place) = command.wheel_rad_per_s.get_mut(*wheel) {
                *place = speed;
            }
        }
        self.digest(b'c', step, &[&speeds[..], &[sent.steering_rad]].concat());
        self.learner.command(step, command);
    }

    fn see(&mut self, step: i64, seen: &SeenPose) {
        let pose = Pose {
            x_m: seen.x_m,
            y_m: seen.y_m,
            yaw_rad: seen.yaw_rad,
        };
        self.digest(b'p', step, &[pose.x_m, pose.y_m, pose.yaw_rad]);
        if let Some(prediction) = self.learner.pose(step, pose) {
            self.newest.push_back(prediction);
            if self.newest.len() > PREDICTIONS_SHOWN {
                self.newest.pop_front();
            }
        }
    }

    fn digest(&mut self, kind: u8, step: i64, numbers: &[f64]) {
        self.data.update([kind]);
        self.data.update(step.to_le_bytes());
        for number in numbers {
            self.data.update(number.to_le_bytes());
        }
    }

    fn gap(&self, robot: u8) -> Option<LearningGap> {
        let count = self.newest.len();
        if count == 0 {
            return None;
        }
        let rms = |error: fn(&Prediction) -> f64| {
            let squares: f64 = self.newest.iter().map(|prediction| error(prediction).powi(2)).sum();
            (squares / count as f64).sqrt()
        };
        let counts = self.learner.counts();
        Some(LearningGap {
            robot,
            parent_m: rms(|prediction| prediction.parent_m),
            learnt_m: rms(|prediction| prediction.learnt_m),
            predictions: counts.predictions,
            discarded: counts.discarded,
        })
    }

    fn finish(self, run_id: Uuid, is_lossy: bool) -> Lesson {
        let closing = self.learner.close();
        let robot = self.learner.parent().robot.name.clone();
        let sha256: String = self.data.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let provenance = json!({
            "data": [{"path": format!("run {run_id}"), "sha256": sha256, "role": "train"}],
            "split": {"deciding": "last third of the run, predicted before it was seen"},
            "learned_online": {"run": run_id, "closing": closing},
            "library_version": twin::VERSION,
        });
        let version = (closing.is_better && !is_lossy)
            .then(|| self.learner.version(provenance))
            .flatten();
        let version = version.and_then(|document| {
            Some(LearnedModel {
                robot: robot.clone(),
                document: serde_json::to_value(document).ok()?,
            })
        });
        Lesson {
            run_id,
            robot,
            closing,
            discarded: self.learner.counts().discarded,
            version,
        }
    }
}

/// A robot without a version as a document; it has no identifier, because nobody could find it.
fn nominal(robot: &Robot, floor: &str) -> ModelDocument {
    let mut document = ModelDocument::new(None, robot.description().clone(), floor, Vec::new(), Value::Null);
    document.id.clear();
    document
}
