//! The virtual side of a run: the twin beside the robots and at their pace.
//!
//! Records of the run in, poses of the virtual robots out; no clock and no socket. In the mode `physical` the twin has a control
//! of its own and sees of the physical side only where the robots stood when motion began and how many ticks have passed. In the
//! mode `interactive` it gets the commands that were sent and the poses that were believed, and tells where the robots are now.

use crate::carry_out::scenario;
use crate::follower::Follower;
use crate::record::{Record, Shadow, ShadowPose, Start};
use api::experiment::Mode;
use api::lab::Assignment;
use control::rehearsal::Rehearsal;
use control::scenario::{FieldProblem, Scenario};
use std::collections::BTreeMap;
use twin::pose::Pose;

/// One picture for this many ticks: 20 Hz.
const TICKS_PER_PICTURE: i64 = 6;

/// See the module.
#[derive(Debug, Default)]
pub struct ShadowRun {
    assignment: Option<Assignment>,
    /// Newest believed pose of each robot before the motion.
    seen: BTreeMap<u8, [f64; 3]>,
    side: Option<VirtualSide>,
    next_picture: i64,
    /// Of all robots in all pictures that tell one.
    gaps_m: Vec<f64>,
}

/// How far followed robots were from where the twin expected them 0.5 s before, over a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GapFigures {
    pub median_m: f64,
    pub largest_m: f64,
    pub samples: usize,
}

#[derive(Debug)]
enum VirtualSide {
    /// A run of its own.
    Beside(Box<Rehearsal>),
    /// By robot number.
    Following(BTreeMap<u8, Follower>),
}

impl ShadowRun {
    /// Figures of the run so far; none when nobody was followed for half a second.
    pub fn gaps(&self) -> Option<GapFigures> {
        let mut gaps_m = self.gaps_m.clone();
        gaps_m.sort_unstable_by(f64::total_cmp);
        Some(GapFigures {
            median_m: *gaps_m.get(gaps_m.len() / 2)?,
            largest_m: *gaps_m.last()?,
            samples: gaps_m.len(),
        })
    }

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
            Record::Pose(pose) if pose.accepted => match &mut self.side {
                None => {
                    self.seen.insert(pose.robot, [pose.x_m, pose.y_m, pose.yaw_rad]);
                }
                Some(VirtualSide::Following(robots)) => {
                    if let Some(robot) = robots.get_mut(&pose.robot) {
                        robot.see(pose);
                    }
                }
                Some(VirtualSide::Beside(_)) => {}
            },
            Record::Command(command) => {
                if let Some(VirtualSide::Following(robots)) = &mut self.side
                    && let Some(robot) = robots.get_mut(&command.robot)
                {
                    robot.command(command);
                }
            }
            Record::Motion(motion) => self.side = self.begin(motion.start_us)?,
            Record::Tick(tick) if tick.tick >= 0 => return Ok(self.follow(tick.tick, tick.due_us)),
            Record::End(_) => *self = Self::default(),
            _ => {}
        }
        Ok(None)
    }

    fn begin(&self, start_us: i64) -> Result<Option<VirtualSide>, String> {
        let Some(assignment) = &self.assignment else {
            return Ok(None);
        };
        match assignment.experiment.mode {
            // A virtual run has no physical side to stand beside.
            Mode::Virtual => Ok(None),
            Mode::Physical => self.beside(assignment).map(Some),
            Mode::Interactive => Self::following(assignment, start_us).map(Some),
        }
    }

    /// The twin where the robots stand; at the experiment's starts where those do not pass its rules.
    fn beside(&self, assignment: &Assignment) -> Result<VirtualSide, String> {
        let made = [true, false].map(|measured| self.scenario(assignment, measured));
        let mut problem = String::new();
        for scenario in made {
            match scenario.and_then(|scenario| sandbox::start::rehearsal(&scenario)) {
                Ok(twin) => return Ok(VirtualSide::Beside(Box::new(twin))),
                Err(problems) => problem = first(&problems),
            }
        }
        Err(problem)
    }

    fn following(assignment: &Assignment, start_us: i64) -> Result<VirtualSide, String> {
        let scenario = scenario(assignment);
        let robots = scenario.and_then(|scenario| control::rehearsal::modelled(&scenario));
        let robots = robots.map_err(|problems| first(&problems))?;
        let numbers = assignment.robots.iter().map(|robot| robot.number);
        let follower = |(number, robot)| (number, Follower::new(robot, start_us));
        Ok(VirtualSide::Following(numbers.zip(&robots).map(follower).collect()))
    }

    fn scenario(&self, assignment: &Assignment, measured: bool) -> Result<Scenario, Vec<FieldProblem>> {
        let mut assignment = assignment.clone();
        for (wanted, robot) in assignment.experiment.robots.iter_mut().zip(&assignment.robots) {
            if let Some([x_m, y_m, yaw_rad]) = self.seen.get(&robot.number).filter(|_| measured) {
                (wanted.start.x_m, wanted.start.y_m, wanted.start.yaw_rad) = (*x_m, *y_m, *yaw_rad);
            }
        }
        scenario(&assignment)
    }

    /// Where the virtual robots are at a tick. A twin that began late catches up: it is far faster than the robots.
    fn follow(&mut self, tick: i64, at_us: i64) -> Option<Shadow> {
        let side = self.side.as_mut()?;
        if let VirtualSide::Beside(twin) = side {
            while (twin.progress().0 as i64) <= tick && twin.step() {}
        }
        if tick < self.next_picture {
            return None;
        }
        self.next_picture = tick + TICKS_PER_PICTURE;
        let numbers = self.assignment.as_ref()?.robots.iter().map(|robot| robot.number);
        let robots: Vec<ShadowPose> = match side {
            VirtualSide::Beside(twin) => {
                let poses = (0..numbers.len()).map(|place| twin.state(place).pose);
                numbers
                    .zip(poses)
                    .map(|(robot, pose)| shadow_pose(robot, pose, None))
                    .collect()
            }
            VirtualSide::Following(robots) => {
                let seen = robots.iter_mut().filter_map(|(number, robot)| {
                    let pose = robot.pose_at(at_us)?;
                    Some(shadow_pose(*number, pose, robot.gap_m()))
                });
                seen.collect()
            }
        };
        self.gaps_m.extend(robots.iter().filter_map(|robot| robot.gap_m));
        Some(Shadow { tick, at_us, robots })
    }
}

const fn shadow_pose(robot: u8, pose: Pose, gap_m: Option<f64>) -> ShadowPose {
    ShadowPose {
        robot,
        x_m: pose.x_m,
        y_m: pose.y_m,
        yaw_rad: pose.yaw_rad,
        gap_m,
    }
}

fn first(problems: &[FieldProblem]) -> String {
    let first = problems.first();
    first.map_or_else(String::new, |first| format!("{}: {}", first.field, first.message))
}
