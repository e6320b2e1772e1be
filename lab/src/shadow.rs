//! The virtual side of a run: the twin with a control of its own, beside the robots and at their pace.
//!
//! Records of the run in, poses of the virtual robots out; no clock and no socket. It sees of the physical side only where
//! the robots stood when motion began and how many ticks have passed.

use crate::record::{Record, Shadow, ShadowPose, Start};
use api::lab::Assignment;
use control::rehearsal::Rehearsal;
use control::scenario::Scenario;
use serde_json::json;
use std::collections::BTreeMap;

/// One picture for this many ticks: 20 Hz.
const TICKS_PER_PICTURE: i64 = 6;

/// See the module.
#[derive(Debug, Default)]
pub struct ShadowRun {
    assignment: Option<Assignment>,
    /// Newest believed pose of each robot before the motion.
    seen: BTreeMap<u8, [f64; 3]>,
    twin: Option<Rehearsal>,
    next_picture: i64,
}

impl ShadowRun {
    /// Takes a record of the run; a picture comes out when one is due.
    ///
    /// - Errors: an experiment that the twin cannot run.
    pub fn take(&mut self, record: &Record) -> Result<Option<Shadow>, String> {
        match record {
            Record::Start(start) => {
                let Start { assignment, .. } = &**start;
                *self = Self {
                    assignment: Some(assignment.clone()),
                    ..Self::default()
                };
            }
            Record::Pose(pose) if pose.accepted && self.twin.is_none() => {
                self.seen.insert(pose.robot, [pose.x_m, pose.y_m, pose.yaw_rad]);
            }
            Record::Motion(_) => self.twin = self.begin()?,
            Record::Tick(tick) if tick.tick >= 0 => return Ok(self.follow(tick.tick, tick.due_us)),
            Record::End(_) => *self = Self::default(),
            _ => {}
        }
        Ok(None)
    }

    /// The twin where the robots stand; at the experiment's starts where those do not pass its rules.
    fn begin(&self) -> Result<Option<Rehearsal>, String> {
        let Some(assignment) = &self.assignment else {
            return Ok(None);
        };
        let made = [true, false].map(|measured| self.scenario(assignment, measured));
        let mut problem = String::new();
        for scenario in made {
            match scenario.and_then(|scenario| Rehearsal::new(&scenario)) {
                Ok(twin) => return Ok(Some(twin)),
                Err(problems) => {
                    let first = problems.first();
                    problem = first.map_or_else(String::new, |first| format!("{}: {}", first.field, first.message));
                }
            }
        }
        Err(problem)
    }

    fn scenario(
        &self,
        assignment: &Assignment,
        measured: bool,
    ) -> Result<Scenario, Vec<control::scenario::FieldProblem>> {
        let mut experiment = assignment.experiment.clone();
        for (wanted, robot) in experiment.robots.iter_mut().zip(&assignment.robots) {
            if let Some([x_m, y_m, yaw_rad]) = self.seen.get(&robot.number).filter(|_| measured) {
                (wanted.start.x_m, wanted.start.y_m, wanted.start.yaw_rad) = (*x_m, *y_m, *yaw_rad);
            }
        }
        let document = json!({
            "experiment": experiment,
            "robots": assignment.robots,
            "arena": assignment.arena,
        });
        Scenario::from_json(&document.to_string())
    }

    /// Steps the twin up to a tick. One that began late catches up: the twin is far faster than the robots.
    fn follow(&mut self, tick: i64, at_us: i64) -> Option<Shadow> {
        let twin = self.twin.as_mut()?;
        while (twin.progress().0 as i64) <= tick && twin.step() {}
        if tick < self.next_picture {
            return None;
        }
        self.next_picture = tick + TICKS_PER_PICTURE;
        let frame = twin.frame();
        let robots = self.assignment.as_ref()?.robots.iter().zip(&frame.robots);
        Some(Shadow {
            tick,
            at_us,
            robots: robots
                .map(|(robot, seen)| {
                    let [x_m, y_m, yaw_rad] = seen.pose;
                    ShadowPose {
                        robot: robot.number,
                        x_m,
                        y_m,
                        yaw_rad,
                    }
                })
                .collect(),
        })
    }
}
