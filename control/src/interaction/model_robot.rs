//! The robot's model beside the robot: driven by the commands on their way, laid onto what was measured.
//!
//! ```text
//! dead  = answer as measured - answer of the model                     what is on its way and no property of the robot
//! P_k   = P_(k-1) m_k exp(b T)                                         m_k: motion of the model in tick k
//! fresh = measured P(now - age - dead)^-1 P(now)
//! x    <- x m_k exp(b T);   x <- x (2 w T nu),  b <- b + w_b^2 T nu,     nu = x^-1 fresh
//! ```
//! `x` is where the robot will be seen when the command of now takes effect; `b` is what the model does not say of its velocity.

use twin::SUBSTEPS;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use super::virtual_robot::motion;
use crate::TICK_S;
use crate::answer::Answer;
use crate::law::RobotObservation;
use crate::prediction::{Motion, after, between, moved};
use crate::safety::SafeCommand;
use crate::vector::{clip, length, wrap};

/// Ticks that are remembered: 0.53 s.
const DEPTH: usize = 64;
/// `w`: how fast what was measured is followed, 1/s.
const FOLLOWING_PER_S: f64 = 6.0;
/// `w_b`: how fast the bias is learnt, 1/s.
const LEARNING_PER_S: f64 = 3.0;
/// An older pose is not believed.
const OLDEST_S: f64 = 0.15;
/// Longest dead time.
const LONGEST_DEAD_S: f64 = 0.2;
/// A model that is further off than this is not believed.
const FARTHEST_M: f64 = 0.06;
const FARTHEST_RAD: f64 = 0.3;
const BIAS_M_PER_S: f64 = 0.25;
const BIAS_RAD_PER_S: f64 = 0.8;
/// No robot and no model moves as far in a tick.
const LONGEST_TICK_M: f64 = 0.1;
const LONGEST_TICK_RAD: f64 = 0.5;

#[derive(Debug)]
pub(super) struct ModelRobot {
    /// Its poses are those that a tracker sees of it: marker and cameras are part of the model.
    model: Robot,
    free: FreeRobot,
    at_rest: FreeRobot,
    /// Of the model itself.
    answer: Answer,
    dead_s: f64,
    products: [Motion; DEPTH],
    newest: usize,
    told: BodyTwist,
    steering_rad: f64,
    bias: BodyTwist,
    learns_bias: bool,
    placed: bool,
}

impl ModelRobot {
    pub(super) fn new(model: &Robot, learns_bias: bool) -> ModelRobot {
        let at_rest = FreeRobot::at_rest(model, Pose::default());
        ModelRobot {
            model: model.clone(),
            free: at_rest.clone(),
            at_rest,
            answer: Answer::of(model),
            dead_s: 0.0,
            products: [Motion::default(); DEPTH],
            newest: 0,
            told: BodyTwist::default(),
            steering_rad: 0.0,
            bias: BodyTwist::default(),
            learns_bias,
            placed: false,
        }
    }

    /// Takes what was measured; false when model, pose or delay cannot be believed.
    pub(super) fn see(&mut self, seen: &RobotObservation, answer: &Answer) -> bool {
        let known = seen.pose.is_finite() && (0.0..=OLDEST_S).contains(&seen.pose_age_s);
        let dead_s = answer.driving_s - self.answer.driving_s;
        if !known || !dead_s.is_finite() || !self.free.is_finite() {
            self.placed = false;
            return false;
        }
        self.dead_s = dead_s.clamp(0.0, LONGEST_DEAD_S);
        let then = self.product((seen.pose_age_s + self.dead_s) / TICK_S);
        let fresh = moved(&seen.pose, &between(&then, &self.products[self.newest]));
        if !fresh.is_finite() {
            self.placed = false;
            return false;
        }
        let here = self.pose();
        let off = between(&motion(&here), &motion(&fresh));
        let off = Motion {
            yaw_rad: wrap(off.yaw_rad),
            ..off
        };
        let near = length(off.at) <= FARTHEST_M && off.yaw_rad.abs() <= FARTHEST_RAD;
        let was_placed = self.placed;
        self.placed = true;
        if !(was_placed && near) {
            self.lay(fresh);
            self.bias = BodyTwist::default();
            return !was_placed;
        }
        let share = (2.0 * FOLLOWING_PER_S * TICK_S).min(1.0);
        let part = Motion {
            at: [share * off.at[0], share * off.at[1]],
            yaw_rad: share * off.yaw_rad,
        };
        self.lay(moved(&here, &part));
        if self.learns_bias {
            self.learn(&off);
        }
        true
    }

    /// A command has gone out; it holds for a tick.
    pub(super) fn follow(&mut self, command: &SafeCommand) {
        self.told = command.twist();
        let before = motion(&self.pose());
        let wheels = command.wheel_command();
        self.steering_rad = wheels.steering_rad;
        (0..SUBSTEPS).for_each(|_| self.free.step(&wheels));
        let mut way = between(&before, &motion(&self.pose()));
        way.yaw_rad = wrap(way.yaw_rad);
        let possible =
            self.free.is_finite() && length(way.at) <= LONGEST_TICK_M && way.yaw_rad.abs() <= LONGEST_TICK_RAD;
        if !possible {
            // What it had come to says nothing: it begins anew, and the pose has to be taken again.
            let Self { free, at_rest, .. } = self;
            free.copy_from(at_rest);
            self.placed = false;
            way = Motion::default();
        }
        let way = after(&way, &self.bias, TICK_S);
        let product = combined(&self.products[self.newest], &way);
        self.newest = (self.newest + 1) % DEPTH;
        self.products[self.newest] = product;
        if self.placed {
            let from = Pose {
                x_m: before.at[0],
                y_m: before.at[1],
                yaw_rad: before.yaw_rad,
            };
            self.lay(moved(&from, &way));
        }
    }

    /// Where the robot will be seen when the command of now takes effect.
    pub(super) fn pose(&self) -> Pose {
        self.model.seen_pose(self.free.pose())
    }

    fn lay(&mut self, seen: Pose) {
        self.free.lay(self.model.pose_seen_at(seen));
    }

    pub(super) fn free(&self) -> &FreeRobot {
        &self.free
    }

    /// Steering of the command in force.
    pub(super) fn steering_rad(&self) -> f64 {
        self.steering_rad
    }

    /// The last command, as it would move an ideal robot.
    pub(super) fn told(&self) -> BodyTwist {
        self.told
    }

    #[cfg(test)]
    pub(super) fn spoil(&mut self, value: f64) {
        self.lay(Pose {
            x_m: value,
            y_m: value,
            yaw_rad: 0.0,
        });
    }

    pub(super) fn bias(&self) -> &BodyTwist {
        &self.bias
    }

    fn learn(&mut self, off: &Motion) {
        let gain = LEARNING_PER_S * LEARNING_PER_S * TICK_S;
        let [forward_m_per_s, left_m_per_s] = clip(
            [
                self.bias.forward_m_per_s + gain * off.at[0],
                self.bias.left_m_per_s + gain * off.at[1],
            ],
            BIAS_M_PER_S,
        );
        let yaw_rate_rad_per_s = self.bias.yaw_rate_rad_per_s + gain * off.yaw_rad;
        self.bias = BodyTwist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s: yaw_rate_rad_per_s.clamp(-BIAS_RAD_PER_S, BIAS_RAD_PER_S),
        };
    }

    /// Product of the motions up to so many ticks ago, within a tick along a straight line.
    fn product(&self, ticks: f64) -> Motion {
        let ticks = ticks.clamp(0.0, (DEPTH - 2) as f64);
        let whole = ticks as usize;
        let slot = |back: usize| &self.products[(self.newest + DEPTH - back) % DEPTH];
        let (late, early) = (slot(whole), slot(whole + 1));
        let way = between(early, late);
        let share = 1.0 - (ticks - whole as f64);
        let part = Motion {
            at: [share * way.at[0], share * way.at[1]],
            yaw_rad: share * way.yaw_rad,
        };
        combined(early, &part)
    }
}

/// `a b`.
fn combined(a: &Motion, b: &Motion) -> Motion {
    let pose = moved(
        &Pose {
            x_m: a.at[0],
            y_m: a.at[1],
            yaw_rad: a.yaw_rad,
        },
        b,
    );
    motion(&pose)
}
