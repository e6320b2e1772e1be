//! Where a robot will be when the command of this tick takes effect: what laws see in place of a pose of the past.
//!
//! A pose of age `a` was measured at `t = now - a`; what is sent at `s` is done at `s + d`, turning at `s + d_turning`.
//! So what the robot does from `t` to `now + d` was sent from `now - a - d` to now:
//!
//! ```text
//! pose(now + d)  = pose(t) exp(x_i f) exp(x_(i+1) T) ... exp(x_k T)       SE(2), f the rest of the oldest command
//! x_j            = (u_j, v_j, r_j of d_turning - d earlier) + gap_j
//! gap'           = (measured - told d before - gap) / 0.6 s       what the robot does differently: slip, slopes
//! twist(now + d) = told_k + gap
//! ```
//! The product of the commands so far, `P_j = P_(j-1) exp(x_j T)`, is kept, so that a prediction is one quotient.
//! For a robot that lags rather than waits, `d` is the mean delay of its answer: over a start or a stop the gap is zero in
//! the mean, which is why it is followed slowly and why the measured twist itself is not carried forward. The safety
//! filter does not use this: it goes on with the measured pose, its age and margins.

use twin::pose::Pose;
use twin::twist::BodyTwist;

use crate::TICK_S;
use crate::answer::{Answer, LONGEST_ANSWER_S};
use crate::effectiveness::Effectiveness;
use crate::law::RobotObservation;
use crate::vector::{Vector, clip, heading};

/// Commands that are remembered: 0.53 s.
const DEPTH: usize = 64;
/// Nothing is predicted further from its measurement than this.
pub const LONGEST_PREDICTION_S: f64 = 0.35;
/// The gap is followed up this fast, and is at most so much.
const GAP_S: f64 = 0.6;
pub const GAP_M_PER_S: f64 = 0.5;
pub const GAP_RAD_PER_S: f64 = 1.0;
/// Poses further away are no places of a robot, and nothing here moves or turns faster: such twists count as unknown.
const FARTHEST_M: f64 = 1e6;
const FASTEST: f64 = 100.0;

/// A place and a heading, or a motion from one to another.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Motion {
    pub(crate) at: Vector,
    pub(crate) yaw_rad: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Told {
    twist: BodyTwist,
    /// What is integrated: with the gap and the later turn.
    done: BodyTwist,
    /// Product of all commands up to the end of this one.
    product: Motion,
}

/// Prediction for one robot. No allocation, no clock; see the module.
#[derive(Debug, Clone)]
pub struct Predictor {
    answer: Option<Answer>,
    /// Where the fixed axle is: a steered body slides sideways ahead of it.
    axle_x_m: f64,
    told: [Told; DEPTH],
    newest: usize,
    gap: BodyTwist,
    /// `None`: the robot is taken to do what it is told.
    learnt: Option<Effectiveness>,
}

impl Predictor {
    /// A predictor that is off: laws see what was measured.
    ///
    /// - `axle_x_m`: of the axle that cannot slide, ahead of the body origin; 0 for robots that turn in place.
    pub fn new(axle_x_m: f64) -> Predictor {
        Predictor {
            answer: None,
            axle_x_m,
            told: [Told::default(); DEPTH],
            newest: 0,
            gap: BodyTwist::default(),
            learnt: None,
        }
    }

    /// The same, and it learns how much of the yaw rate that it is told the robot turns.
    #[must_use]
    pub fn learning(mut self) -> Predictor {
        self.learnt = Some(Effectiveness::default());
        self
    }

    /// What to tell the robot for a twist that the law wants: the twist itself, bit for bit, where nothing is learnt or the
    /// predictor is off.
    pub fn command(&self, wanted: &BodyTwist) -> BodyTwist {
        match (&self.answer, &self.learnt) {
            (Some(_), Some(learnt)) => learnt.command(wanted),
            _ => *wanted,
        }
    }

    /// Delay of link and robot from now on, s; off with `None` or what is not finite. At most [`LONGEST_ANSWER_S`] counts.
    pub fn set_answer(&mut self, answer: Option<Answer>) {
        let known = |answer: &Answer| answer.driving_s.is_finite() && answer.turning_s.is_finite();
        self.answer = answer.filter(known).map(|answer| {
            let driving_s = answer.driving_s.clamp(0.0, LONGEST_ANSWER_S);
            Answer {
                driving_s,
                turning_s: answer.turning_s.clamp(driving_s, LONGEST_ANSWER_S),
            }
        });
    }

    /// Delay of link and robot; `None` when the predictor is off.
    pub(crate) fn answer(&self) -> Option<Answer> {
        self.answer
    }

    /// A command has gone out; it holds until the next one, a tick later. What no robot can do counts as rest.
    pub fn sent(&mut self, command: &BodyTwist) {
        let r = command.yaw_rate_rad_per_s;
        let twist = BodyTwist {
            left_m_per_s: command.left_m_per_s - self.axle_x_m * r,
            ..*command
        };
        let twist = if is_possible(&twist) {
            twist
        } else {
            BodyTwist::default()
        };
        let before = self.told[self.newest].product;
        self.newest = (self.newest + 1) % DEPTH;
        self.told[self.newest].twist = twist;
        let turns_later_s = self.answer.map_or(0.0, |answer| answer.turning_s - answer.driving_s);
        let later = self.back(turns_later_s / TICK_S).yaw_rate_rad_per_s;
        let done = BodyTwist {
            forward_m_per_s: twist.forward_m_per_s,
            left_m_per_s: twist.left_m_per_s + self.axle_x_m * (twist.yaw_rate_rad_per_s - later),
            yaw_rate_rad_per_s: later,
        };
        let done = sum(&self.followed(&done), &self.gap);
        let told = &mut self.told[self.newest];
        told.done = done;
        told.product = after(&before, &done, TICK_S);
    }

    /// What the law sees of a robot: the pose at the moment at which a command of now takes effect, its age negative by the
    /// time that is left until then.
    ///
    /// - Without delay, with the predictor off, or where there is no pose: the observation itself, bit for bit.
    /// - At most [`LONGEST_PREDICTION_S`] from the measurement.
    pub fn predict(&mut self, seen: &RobotObservation) -> RobotObservation {
        let Some(answer) = self.answer else { return *seen };
        let known = seen.pose.is_finite() && seen.pose.x_m.abs().max(seen.pose.y_m.abs()) < FARTHEST_M;
        if !known || !(0.0..=f64::MAX).contains(&seen.pose_age_s) {
            return *seen;
        }
        let far_s = seen.pose_age_s + answer.driving_s;
        if far_s == 0.0 {
            return *seen;
        }
        let ticks = far_s / TICK_S;
        let seconds = far_s.min(LONGEST_PREDICTION_S);
        let told_then = self.doing(ticks);
        let told_last = self.doing(ticks - seconds / TICK_S);
        if is_possible(&seen.twist) {
            if let Some(learnt) = &mut self.learnt {
                learnt.learn(told_then.yaw_rate_rad_per_s, seen.twist.yaw_rate_rad_per_s);
            }
            self.follow(&self.followed(&told_then), &seen.twist);
        }
        let from = self.product(ticks);
        let to = self.product(ticks - seconds / TICK_S);
        let way = between(&from, &to);
        RobotObservation {
            pose: moved(&seen.pose, &way),
            pose_age_s: seen.pose_age_s - seconds,
            twist: sum(&self.followed(&told_last), &self.gap),
            online: seen.online,
        }
    }

    /// What the robot does of a command, as far as it was learnt.
    fn followed(&self, told: &BodyTwist) -> BodyTwist {
        self.learnt.map_or(*told, |learnt| learnt.done(told))
    }

    /// Follows up what the robot does differently from what it was told.
    fn follow(&mut self, told: &BodyTwist, measured: &BodyTwist) {
        let share = TICK_S / GAP_S;
        let off = difference(&difference(measured, told), &self.gap);
        let [forward_m_per_s, left_m_per_s] = clip(
            [
                self.gap.forward_m_per_s + share * off.forward_m_per_s,
                self.gap.left_m_per_s + share * off.left_m_per_s,
            ],
            GAP_M_PER_S,
        );
        let yaw_rate_rad_per_s = self.gap.yaw_rate_rad_per_s + share * off.yaw_rate_rad_per_s;
        self.gap = BodyTwist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s: yaw_rate_rad_per_s.clamp(-GAP_RAD_PER_S, GAP_RAD_PER_S),
        };
    }

    /// The command that was in force so many ticks ago: 0 to 1 is the newest.
    fn slot(&self, ticks: f64) -> usize {
        let back = (ticks.max(0.0).ceil() as usize).clamp(1, DEPTH) - 1;
        (self.newest + DEPTH - back) % DEPTH
    }

    fn back(&self, ticks: f64) -> BodyTwist {
        self.told[self.slot(ticks + 1.0)].twist
    }

    /// What was asked for at a moment, with the later turn and without the gap: driving and turning together.
    fn doing(&self, ticks: f64) -> BodyTwist {
        let turns_later_s = self.answer.map_or(0.0, |answer| answer.turning_s - answer.driving_s);
        let told = self.told[self.slot(ticks)].twist;
        let later = self.told[self.slot(ticks + turns_later_s / TICK_S)]
            .twist
            .yaw_rate_rad_per_s;
        BodyTwist {
            forward_m_per_s: told.forward_m_per_s,
            left_m_per_s: told.left_m_per_s + self.axle_x_m * (told.yaw_rate_rad_per_s - later),
            yaw_rate_rad_per_s: later,
        }
    }

    /// Product of the commands up to so many ticks ago; older than remembered: up to the oldest.
    fn product(&self, ticks: f64) -> Motion {
        let told = &self.told[self.slot(ticks)];
        let left = ticks.clamp(0.0, DEPTH as f64) - (ticks.max(0.0).ceil().clamp(1.0, DEPTH as f64) - 1.0);
        after(&told.product, &told.done, -left * TICK_S)
    }
}

/// False also of what is not a number.
pub(crate) fn is_possible(twist: &BodyTwist) -> bool {
    [twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s]
        .into_iter()
        .all(|part| part.abs() < FASTEST)
}

fn sum(a: &BodyTwist, b: &BodyTwist) -> BodyTwist {
    BodyTwist {
        forward_m_per_s: a.forward_m_per_s + b.forward_m_per_s,
        left_m_per_s: a.left_m_per_s + b.left_m_per_s,
        yaw_rate_rad_per_s: a.yaw_rate_rad_per_s + b.yaw_rate_rad_per_s,
    }
}

fn difference(a: &BodyTwist, b: &BodyTwist) -> BodyTwist {
    BodyTwist {
        forward_m_per_s: a.forward_m_per_s - b.forward_m_per_s,
        left_m_per_s: a.left_m_per_s - b.left_m_per_s,
        yaw_rate_rad_per_s: a.yaw_rate_rad_per_s - b.yaw_rate_rad_per_s,
    }
}

/// `from exp(twist time)`: the chord of the arc, half of its angle ahead.
pub(crate) fn after(from: &Motion, twist: &BodyTwist, time_s: f64) -> Motion {
    let angle_rad = twist.yaw_rate_rad_per_s * time_s;
    let half_rad = 0.5 * angle_rad;
    // sin(h) / h = 1 - h^2 / 6: below 1e-8 the difference is lost in rounding.
    let chord_s = if half_rad.abs() < 1e-8 {
        time_s
    } else {
        time_s * libm::sin(half_rad) / half_rad
    };
    let [c, s] = heading(from.yaw_rad + half_rad);
    let (x, y) = (twist.forward_m_per_s * chord_s, twist.left_m_per_s * chord_s);
    Motion {
        at: [from.at[0] + c * x - s * y, from.at[1] + s * x + c * y],
        yaw_rad: from.yaw_rad + angle_rad,
    }
}

/// `from^-1 to`.
pub(crate) fn between(from: &Motion, to: &Motion) -> Motion {
    let [c, s] = heading(from.yaw_rad);
    let (dx, dy) = (to.at[0] - from.at[0], to.at[1] - from.at[1]);
    Motion {
        at: [c * dx + s * dy, c * dy - s * dx],
        yaw_rad: to.yaw_rad - from.yaw_rad,
    }
}

/// `pose way`.
pub(crate) fn moved(pose: &Pose, way: &Motion) -> Pose {
    let [c, s] = heading(pose.yaw_rad);
    Pose {
        x_m: pose.x_m + c * way.at[0] - s * way.at[1],
        y_m: pose.y_m + s * way.at[0] + c * way.at[1],
        yaw_rad: pose.yaw_rad + way.yaw_rad,
    }
}
