//! From a wish in the world (which way, how fast, where to point) to a body twist that a chassis can drive.

use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use crate::vector::{Vector, body_from_world, dot, heading, length, wrap};

/// Largest yaw rate that the laws ask for.
pub const YAW_RATE_LIMIT_RAD_PER_S: f64 = 1.8;
/// A robot that turns on the spot drives only when it points this well.
const POINTING_LIMIT_RAD: f64 = 0.5;
/// An aim closer than this gives no direction.
const SHORTEST_AIM_M: f64 = 0.004;

/// What a chassis can do, as far as control laws and safety filter care.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// Any direction at once.
    Holonomic,
    /// Forward and back, turns on the spot.
    TurnInPlace {
        /// How far ahead of the body origin the point may lie about which it turns: at the foremost wheel that does not roll
        /// sideways. Which wheels slide in a turn depends on loads and motors.
        swing_m: f64,
    },
    /// Forward and back on arcs not tighter than the radius.
    Steered {
        turning_radius_m: f64,
        /// Middle of the axle that is not steered, ahead of the body origin; it moves like a unicycle.
        axle_x_m: f64,
    },
}

impl Drive {
    /// Drive of a robot, from its wheels.
    pub fn of(robot: &Robot) -> Drive {
        let wheels = &robot.description().wheels;
        let mean_x_m = |steered: bool| {
            let chosen = wheels.iter().filter(|w| w.steered == steered && w.kind != "caster");
            let (sum, count) = chosen.fold((0.0, 0.0_f64), |(sum, count), w| (sum + w.x_m, count + 1.0));
            sum / count.max(1.0)
        };
        if wheels.iter().any(|w| w.steered) {
            let base_m = (mean_x_m(true) - mean_x_m(false)).abs();
            let tangent = libm::tan(robot.max_steering_rad().clamp(0.05, 1.5));
            return Drive::Steered {
                turning_radius_m: base_m / tangent,
                axle_x_m: mean_x_m(false),
            };
        }
        let omni = wheels.iter().filter(|w| w.driven && w.kind == "omni").count();
        if omni >= 3 {
            Drive::Holonomic
        } else {
            let fixed = wheels.iter().filter(|w| w.kind == "standard");
            Drive::TurnInPlace {
                swing_m: fixed.map(|w| w.x_m).fold(0.0, f64::max),
            }
        }
    }
}

/// What a law wants of a robot, before its chassis is considered.
#[derive(Debug, Clone, Copy)]
pub struct Wish {
    /// Velocity of the body origin in the world frame, m/s.
    pub velocity: Vector,
    /// From the robot to the point that a robot which cannot move sideways should point at, world frame, m.
    pub aim: Vector,
    /// Yaw that a robot which can move sideways should have.
    pub yaw_rad: Option<f64>,
}

/// Body twist for a wish.
pub fn twist_for(drive: Drive, pose: &Pose, wish: &Wish, yaw_gain_per_s: f64) -> BodyTwist {
    let turn = |error_rad: f64| (yaw_gain_per_s * error_rad).clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S);
    match drive {
        Drive::Holonomic => {
            let [forward_m_per_s, left_m_per_s] = body_from_world(wish.velocity, pose.yaw_rad);
            let yaw_rate_rad_per_s = wish.yaw_rad.map_or(0.0, |yaw_rad| turn(wrap(yaw_rad - pose.yaw_rad)));
            BodyTwist {
                forward_m_per_s,
                left_m_per_s,
                yaw_rate_rad_per_s,
            }
        }
        Drive::TurnInPlace { .. } => {
            let Some(error_rad) = pointing_error_rad(pose, wish.aim) else {
                let yaw_rate_rad_per_s = wish.yaw_rad.map_or(0.0, |yaw_rad| turn(wrap(yaw_rad - pose.yaw_rad)));
                return BodyTwist {
                    yaw_rate_rad_per_s,
                    ..BodyTwist::default()
                };
            };
            let forward_m_per_s = dot(wish.velocity, heading(pose.yaw_rad)) * pointing_share(error_rad);
            BodyTwist {
                forward_m_per_s,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: turn(error_rad),
            }
        }
        Drive::Steered { turning_radius_m, .. } => steered_twist(pose, wish, turning_radius_m),
    }
}

/// Pure pursuit of the aim, backwards when it lies behind.
fn steered_twist(pose: &Pose, wish: &Wish, turning_radius_m: f64) -> BodyTwist {
    let Some(error_rad) = pointing_error_rad(pose, wish.aim) else {
        return BodyTwist::default();
    };
    let sign = if error_rad.abs() > core::f64::consts::FRAC_PI_2 {
        -1.0
    } else {
        1.0
    };
    let forward_m_per_s = sign * length(wish.velocity);
    let curvature = 2.0 * libm::sin(error_rad) / length(wish.aim);
    let limit = 1.0 / turning_radius_m.max(1e-3);
    let yaw_rate_rad_per_s = forward_m_per_s * curvature.clamp(-limit, limit);
    BodyTwist {
        forward_m_per_s,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s,
    }
}

/// Angle from the robot's forward axis to the aim; `None` when it stands on it.
pub fn pointing_error_rad(pose: &Pose, aim: Vector) -> Option<f64> {
    (length(aim) > SHORTEST_AIM_M).then(|| wrap(libm::atan2(aim[1], aim[0]) - pose.yaw_rad))
}

/// 1 when pointing at the aim, 0 from `POINTING_LIMIT_RAD` on.
pub fn pointing_share(error_rad: f64) -> f64 {
    (1.0 - error_rad.abs() / POINTING_LIMIT_RAD).max(0.0)
}
