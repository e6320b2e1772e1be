//! How long a robot takes from a set-point to the motion that it asks for.

use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::{PHYSICS_PERIOD_S, SUBSTEPS};

use crate::TICK_RATE_HZ;
use crate::law::Drive;
use crate::safety::Limits;

/// Longest answer that is believed.
pub const LONGEST_ANSWER_S: f64 = 0.40;
/// Small steps: nothing slips and no current limit is reached.
const DRIVING_M_PER_S: f64 = 0.1;
const TURNING_RAD_PER_S: f64 = 0.4;
/// Speed at which a steered robot is asked to bend, and how: with this share of its steering.
const BENDING_M_PER_S: f64 = 0.3;
const BENDING_SHARE: f64 = 0.3;
/// A turn on the spot at a corner, over the small one: 1.6 rad/s.
const SPIN_TIMES: f64 = 4.0;
/// How long the answer to a step is watched.
const WATCHED_STEPS: u32 = 3 * SUBSTEPS * TICK_RATE_HZ;
/// A robot that does less than this share of what it is told does not answer.
const LEAST_SHARE: f64 = 0.1;

/// Mean delay of the answer to a small step, s: a robot that lags by a first-order lag of T and a dead time D has T + D.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Answer {
    pub driving_s: f64,
    pub turning_s: f64,
}

impl Answer {
    /// Of the robot as it is described, on the nominal floor of the twin.
    ///
    /// `T = sum (1 - y / y_end) dt`, y the answer to a step at 0.
    pub fn of(robot: &Robot) -> Answer {
        let (c, s) = robot.drive_axis_rad().map_or((1.0, 0.0), |axis_rad| {
            let [c, s] = crate::vector::heading(axis_rad);
            (c, s)
        });
        let driving = BodyTwist {
            forward_m_per_s: c * DRIVING_M_PER_S,
            left_m_per_s: s * DRIVING_M_PER_S,
            yaw_rate_rad_per_s: 0.0,
        };
        let (before, turning) = turn(robot);
        let along = |twist: &BodyTwist| (c * twist.forward_m_per_s + s * twist.left_m_per_s) / DRIVING_M_PER_S;
        let round = |twist: &BodyTwist| twist.yaw_rate_rad_per_s / turning.yaw_rate_rad_per_s;
        Answer {
            driving_s: delay_s(robot, BodyTwist::default(), driving, along),
            turning_s: delay_s(robot, before, turning, round),
        }
    }

    /// The slower of the two.
    pub fn slowest_s(&self) -> f64 {
        self.driving_s.max(self.turning_s)
    }
}

/// What the safety filter of a robot allows for before anything is measured: [`Limits::latency_s`], the chassis' answer or
/// the robot's own.
///
/// - `answer`: the robot's own in the nominal twin, [`Answer::of`].
/// - Returns the largest of the three, the chassis' and the robot's answers counting up to [`LONGEST_ANSWER_S`].
pub fn assumed_latency_s(robot: &Robot, answer: &Answer, limits: &Limits) -> f64 {
    let answer_s = chassis_answer_s(robot).max(answer.slowest_s());
    limits.latency_s.max(answer_s.min(LONGEST_ANSWER_S))
}

/// From set-points to motion, assumed: robots whose wheels roll, and robots that drag their wheels over the floor to turn.
pub const ROLLING_ANSWER_S: f64 = 0.10;
pub const SKIDDING_ANSWER_S: f64 = 0.23;
/// Axles closer than this are one.
const AXLE_SPREAD_M: f64 = 0.02;

/// What a chassis is assumed to take from set-points to motion, s.
pub fn chassis_answer_s(robot: &Robot) -> f64 {
    let wheels = &robot.description().wheels;
    // Wheels that cannot slip sideways, on more than one axle and none of them steered, are dragged over the floor in a turn.
    let axles = || {
        wheels
            .iter()
            .filter(|wheel| wheel.kind == "standard")
            .map(|wheel| wheel.x_m)
    };
    let spread_m = axles().fold(f64::NEG_INFINITY, f64::max) - axles().fold(f64::INFINITY, f64::min);
    if spread_m > AXLE_SPREAD_M && !wheels.iter().any(|wheel| wheel.steered) {
        SKIDDING_ANSWER_S
    } else {
        ROLLING_ANSWER_S
    }
}

/// What a robot does before it is told to turn, and then.
fn turn(robot: &Robot) -> (BodyTwist, BodyTwist) {
    let turning = |forward_m_per_s: f64, yaw_rate_rad_per_s: f64| BodyTwist {
        forward_m_per_s,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s,
    };
    match Drive::of(robot) {
        Drive::Steered { turning_radius_m, .. } => {
            let rate = BENDING_SHARE * BENDING_M_PER_S / turning_radius_m.max(1e-3);
            (turning(BENDING_M_PER_S, 0.0), turning(BENDING_M_PER_S, rate))
        }
        _ => (BodyTwist::default(), turning(0.0, TURNING_RAD_PER_S)),
    }
}

/// Share of the yaw rate that a robot is told which it turns at last, in a small turn, the mean of left and right; 0 for one
/// that does not turn.
pub(crate) fn turn_share(robot: &Robot) -> f64 {
    let ([left, right], told_rad_per_s) = turned(robot, 1.0);
    let share = 0.5 * (left.yaw_rate_rad_per_s - right.yaw_rate_rad_per_s) / told_rad_per_s;
    if share.is_finite() { share } else { 0.0 }
}

/// Point of the body that does not slide sideways in a turn on the spot as laws ask for, ahead of the body origin, m: where the fixed
/// axle is, or, of a robot that drags its wheels over the floor, where loads and motors let it turn. 0 for one that does not turn.
pub(crate) fn turn_point_x_m(robot: &Robot) -> f64 {
    let ([left, right], told_rad_per_s) = turned(robot, SPIN_TIMES);
    let rate = left.yaw_rate_rad_per_s - right.yaw_rate_rad_per_s;
    let point_m = -(left.left_m_per_s - right.left_m_per_s) / rate;
    if rate > LEAST_SHARE * told_rad_per_s && point_m.is_finite() {
        point_m
    } else {
        0.0
    }
}

/// Twists at the end of a turn to the left and one to the right, and the yaw rate that was told.
///
/// - `times`: as fast as a small turn.
fn turned(robot: &Robot, times: f64) -> ([BodyTwist; 2], f64) {
    let (before, small) = turn(robot);
    let left = BodyTwist {
        yaw_rate_rad_per_s: times * small.yaw_rate_rad_per_s,
        ..small
    };
    let right = BodyTwist {
        yaw_rate_rad_per_s: -left.yaw_rate_rad_per_s,
        ..left
    };
    let turned = |turning: BodyTwist| {
        let mut free = FreeRobot::at_rest(robot, Pose::default());
        for twist in [before, turning] {
            let command = robot.wheel_speeds(twist);
            (0..WATCHED_STEPS).for_each(|_| free.step(&command));
        }
        free.state().twist
    };
    ([turned(left), turned(right)], left.yaw_rate_rad_per_s)
}

/// - `share`: of what is asked, from the twist.
fn delay_s(robot: &Robot, before: BodyTwist, after: BodyTwist, share: impl Fn(&BodyTwist) -> f64) -> f64 {
    let mut free = FreeRobot::at_rest(robot, Pose::default());
    if before != BodyTwist::default() {
        let command = robot.wheel_speeds(before);
        (0..WATCHED_STEPS).for_each(|_| free.step(&command));
    }
    let command = robot.wheel_speeds(after);
    // A robot that is steered wrong turns before it is told to.
    let first = share(&free.state().twist);
    let (mut sum, mut last) = (0.0, 0.0);
    for _ in 0..WATCHED_STEPS {
        free.step(&command);
        last = share(&free.state().twist) - first;
        sum += last;
    }
    if !free.is_finite() || last < LEAST_SHARE {
        return 0.0;
    }
    ((f64::from(WATCHED_STEPS) - sum / last) * PHYSICS_PERIOD_S).clamp(0.0, LONGEST_ANSWER_S)
}
