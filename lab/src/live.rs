//! The live picture: folds records into a frame for watchers about twenty times a second.

use crate::live_stages::StageMeans;
use crate::notes::LiveNotes;
use crate::record::{LearningGap, Record, SafetyKind, ShadowPose};
use api::CONTROL_HZ;
use api::live::{LiveFrame, LiveLearning, LiveRobot, LiveShadow};
use std::collections::BTreeMap;
use uuid::Uuid;

/// One frame for this many ticks: 20 Hz.
pub(crate) const TICKS_PER_FRAME: i64 = 6;

/// Virtual poses older than this are not shown.
const SHADOW_OLD_TICKS: i64 = 30;
/// Nor are figures of predictions.
const LEARNING_OLD_TICKS: i64 = 120;

/// What watchers of one run see.
#[derive(Debug, Clone)]
pub struct LivePicture {
    run_id: Uuid,
    epoch: i64,
    robots: Vec<LiveRobot>,
    places: BTreeMap<u8, usize>,
    /// Interventions since the last frame.
    safety: BTreeMap<u8, SafetyKind>,
    next_frame_tick: i64,
    stages: StageMeans,
    /// Newest virtual poses and their tick.
    shadow: (i64, Vec<LiveShadow>),
    /// Newest figures of the predictions and their tick.
    learning: (i64, Vec<LiveLearning>),
    notes: LiveNotes,
}

impl LivePicture {
    /// `robots`: link number and name, in the order of the experiment.
    pub fn new(run_id: Uuid, epoch: i64, robots: &[(u8, String)]) -> Self {
        let unseen = |name: &String| LiveRobot {
            name: name.clone(),
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
            target_x_m: 0.0,
            target_y_m: 0.0,
            pose_age_ms: 0.0,
            link_age_ms: 0.0,
            bus_v: 0.0,
            safety: None,
        };
        Self {
            run_id,
            epoch,
            robots: robots.iter().map(|(_, name)| unseen(name)).collect(),
            places: robots
                .iter()
                .enumerate()
                .map(|(place, (number, _))| (*number, place))
                .collect(),
            safety: BTreeMap::new(),
            next_frame_tick: i64::MIN,
            stages: StageMeans::default(),
            shadow: (i64::MIN, Vec::new()),
            learning: (i64::MIN, Vec::new()),
            notes: LiveNotes::default(),
        }
    }

    fn robot(&mut self, number: u8) -> Option<&mut LiveRobot> {
        self.robots.get_mut(*self.places.get(&number)?)
    }

    /// Takes a record; a frame comes out when one is due.
    pub fn take(&mut self, record: &Record) -> Option<LiveFrame> {
        self.stages.take(record);
        match record {
            Record::Pose(pose) if pose.accepted => {
                if let Some(robot) = self.robot(pose.robot) {
                    (robot.x_m, robot.y_m, robot.yaw_rad) = (pose.x_m, pose.y_m, pose.yaw_rad);
                }
            }
            Record::Command(command) => {
                if let Some(robot) = self.robot(command.robot) {
                    if let Some(target_m) = command.target_m {
                        [robot.target_x_m, robot.target_y_m] = target_m;
                    }
                    robot.pose_age_ms = command.pose_age_us as f64 * 1e-3;
                    robot.link_age_ms = command.link_age_us as f64 * 1e-3;
                }
            }
            Record::Telemetry(telemetry) => {
                if let Some(robot) = self.robot(telemetry.robot) {
                    robot.bus_v = telemetry.bus_v;
                }
            }
            Record::Intervention(intervention) => {
                self.safety.insert(intervention.robot, intervention.kind);
            }
            Record::Shadow(shadow) => {
                let virtual_robot = |pose: &ShadowPose| {
                    Some(LiveShadow {
                        name: self.robots.get(*self.places.get(&pose.robot)?)?.name.clone(),
                        x_m: pose.x_m,
                        y_m: pose.y_m,
                        yaw_rad: pose.yaw_rad,
                    })
                };
                self.shadow = (shadow.tick, shadow.robots.iter().filter_map(virtual_robot).collect());
            }
            Record::Learning(learning) => {
                let figures = |gap: &LearningGap| {
                    Some(LiveLearning {
                        name: self.robots.get(*self.places.get(&gap.robot)?)?.name.clone(),
                        parent_m: gap.parent_m,
                        learnt_m: gap.learnt_m,
                    })
                };
                self.learning = (learning.tick, learning.robots.iter().filter_map(figures).collect());
            }
            Record::Notes(notes) => self.notes.take(notes),
            Record::Tick(tick) if tick.tick >= self.next_frame_tick => {
                self.next_frame_tick = tick.tick + TICKS_PER_FRAME;
                return Some(self.frame(tick.tick, tick.missed));
            }
            _ => {}
        }
        None
    }

    fn frame(&mut self, tick: i64, ticks_missed: i64) -> LiveFrame {
        for robot in &mut self.robots {
            robot.safety = None;
        }
        for (number, kind) in std::mem::take(&mut self.safety) {
            if let Some(robot) = self.robot(number) {
                robot.safety = Some(kind.as_str().to_owned());
            }
        }
        LiveFrame {
            run_id: self.run_id,
            epoch: self.epoch,
            tick,
            time_s: tick as f64 / f64::from(CONTROL_HZ),
            robots: self.robots.clone(),
            ticks_missed,
            shadow: if tick.saturating_sub(self.shadow.0) <= SHADOW_OLD_TICKS {
                self.shadow.1.clone()
            } else {
                Vec::new()
            },
            learning: if tick.saturating_sub(self.learning.0) <= LEARNING_OLD_TICKS {
                self.learning.1.clone()
            } else {
                Vec::new()
            },
            notes: self.notes.frame(tick),
            stages: self.stages.finish(),
        }
    }
}
