//! A virtual robot that follows its physical one: driven by the wheel speeds that were really sent, put where the localisation
//! saw the robot, and ahead of it by what the picture is old.
//!
//! The twin integrates in a frame of its own. Each believed pose at its exposure fixes where that frame lies in the arena; the
//! pose now is the twin's motion since then, laid there. Nothing but the frame is corrected: wheel speeds and velocities are the
//! twin's own.

use crate::record::{Command, LINK_WHEELS, Pose as SeenPose};
use std::collections::VecDeque;
use twin::PHYSICS_RATE_HZ;
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::{Pose, wrapped_rad};
use twin::robot::Robot;

/// Own poses that are kept, one a step of 1/480 s: 1 s.
const KEPT_STEPS: usize = PHYSICS_RATE_HZ as usize;
/// How far ahead the gap looks.
pub const GAP_HORIZON_US: i64 = 500_000;
/// Frames that are kept for the gap: those of the horizon at 120 pictures a second, and some.
const KEPT_FRAMES: usize = 96;
/// A step further behind than this is not made up for: a laboratory that was held up.
const BEHIND_US: i64 = 1_000_000;

/// See the module.
#[derive(Debug)]
pub struct Follower {
    twin: FreeRobot,
    /// Positions in `wheels` of the driven wheels: the order of the records.
    driven: Vec<usize>,
    command: WheelCommand,
    /// When step 0 was.
    start_us: i64,
    /// The twin's own poses, newest last, the newest after `twin.steps()` steps.
    own: VecDeque<Pose>,
    /// Exposure, and the frame found then; newest last.
    frames: VecDeque<(i64, Pose)>,
    gap_m: Option<f64>,
}

impl Follower {
    /// A robot at rest at `start_us`; it is nowhere until it is seen.
    pub fn new(robot: &Robot, start_us: i64) -> Self {
        Self {
            twin: FreeRobot::at_rest(robot, Pose::default()),
            driven: robot
                .description()
                .wheels
                .iter()
                .enumerate()
                .filter(|(_, wheel)| wheel.driven)
                .map(|(position, _)| position)
                .collect(),
            command: WheelCommand::default(),
            start_us,
            own: VecDeque::from([Pose::default()]),
            frames: VecDeque::new(),
            gap_m: None,
        }
    }

    /// Takes over what was sent, from the moment it was.
    pub fn command(&mut self, command: &Command) {
        self.advance(command.sent_us);
        let speeds: [f64; LINK_WHEELS] = command.wheel_rad_per_s;
        for (wheel, speed) in self.driven.iter().zip(speeds) {
            if let Some(place) = self.command.wheel_rad_per_s.get_mut(*wheel) {
                *place = speed;
            }
        }
        self.command.steering_rad = command.steering_rad;
    }

    /// Takes a believed pose.
    pub fn see(&mut self, seen: &SeenPose) {
        let seen_at = Pose {
            x_m: seen.x_m,
            y_m: seen.y_m,
            yaw_rad: seen.yaw_rad,
        };
        let Some(own) = self.own_at(seen.exposure_us) else {
            return;
        };
        let old = self
            .frames
            .iter()
            .rev()
            .find(|(at_us, _)| seen.exposure_us - at_us >= GAP_HORIZON_US);
        self.gap_m = old.map(|(_, frame)| laid(frame, &own).distance_m(&seen_at));
        self.frames.push_back((seen.exposure_us, frame_of(&own, &seen_at)));
        if self.frames.len() > KEPT_FRAMES {
            self.frames.pop_front();
        }
    }

    /// Where the robot is at a moment; none before it was seen.
    pub fn pose_at(&mut self, at_us: i64) -> Option<Pose> {
        self.advance(at_us);
        let (_, frame) = self.frames.back()?;
        Some(laid(frame, self.own.back()?))
    }

    /// Distance between the last believed pose and what the twin expected there 0.5 s before, m.
    pub fn gap_m(&self) -> Option<f64> {
        self.gap_m
    }

    /// The step nearest to a moment: ticks are whole steps, but not whole microseconds.
    fn steps_at(&self, at_us: i64) -> i64 {
        ((at_us - self.start_us) * i64::from(PHYSICS_RATE_HZ) + 500_000).div_euclid(1_000_000)
    }

    fn advance(&mut self, to_us: i64) {
        let wanted = self.steps_at(to_us);
        let behind = wanted - self.twin.steps() as i64;
        if behind > BEHIND_US * i64::from(PHYSICS_RATE_HZ) / 1_000_000 {
            // What happened meanwhile is unknown; the frames before it say nothing any more.
            self.start_us = to_us - (self.twin.steps() as i64 * 1_000_000) / i64::from(PHYSICS_RATE_HZ);
            self.own.clear();
            self.frames.clear();
            return;
        }
        for _ in 0..behind.max(0) {
            self.twin.step(&self.command);
            self.own.push_back(self.twin.state().pose);
            if self.own.len() > KEPT_STEPS {
                self.own.pop_front();
            }
        }
    }

    /// The twin's own pose at a moment that is not too long ago.
    fn own_at(&mut self, at_us: i64) -> Option<Pose> {
        self.advance(at_us);
        let back = usize::try_from(self.twin.steps() as i64 - self.steps_at(at_us)).ok()?;
        let place = self.own.len().checked_sub(1 + back)?;
        self.own.get(place).copied()
    }
}

/// The frame in which the twin's own pose is the seen one.
fn frame_of(own: &Pose, seen: &Pose) -> Pose {
    let yaw_rad = wrapped_rad(seen.yaw_rad - own.yaw_rad);
    let (sin, cos) = yaw_rad.sin_cos();
    Pose {
        x_m: seen.x_m - (cos * own.x_m - sin * own.y_m),
        y_m: seen.y_m - (sin * own.x_m + cos * own.y_m),
        yaw_rad,
    }
}

/// The twin's own pose in the arena.
fn laid(frame: &Pose, own: &Pose) -> Pose {
    let (sin, cos) = frame.yaw_rad.sin_cos();
    Pose {
        x_m: frame.x_m + cos * own.x_m - sin * own.y_m,
        y_m: frame.y_m + sin * own.x_m + cos * own.y_m,
        yaw_rad: wrapped_rad(frame.yaw_rad + own.yaw_rad),
    }
}
