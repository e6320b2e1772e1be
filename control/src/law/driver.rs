//! Brings a robot of any chassis along a wanted velocity: what the laws for teams have in common.
//!
//! A robot that turns in place points first and drives then. A car-like robot follows the arc through the point it is on
//! the way to [Coulter 1992, pure pursuit]; a point inside its turning circle is approached by backing off first, and a
//! place to stop at by a Reeds-Shepp path at the end.

use twin::twist::BodyTwist;

use super::manoeuvre::{Car, Manoeuvre};
use super::motion::{Wish, YAW_RATE_LIMIT_RAD_PER_S, twist_for};
use super::piece::Place;
use super::{Drive, RobotObservation};
use crate::vector::{Vector, add, dot, heading, length, sub, wrap};

/// A slower wish is a wish to stand.
const REST_M_PER_S: f64 = 0.006;
/// So close a robot that turns in place would rather drive back than turn round.
const BACK_M: f64 = 0.15;
/// A robot that turns in place drives at full speed up to this angle, and not at all beyond the other.
const FULL_SPEED_RAD: f64 = 0.35;
const NO_SPEED_RAD: f64 = 1.0;
/// A car-like robot changes from forwards to backwards, or back, beyond this angle.
const GEAR_LIMIT_RAD: f64 = 1.95;
/// Backing off ends when the robot points this well.
const ALIGNED_RAD: f64 = 0.3;
/// Nearest point that a car-like robot pursues.
const SHORTEST_PURSUIT_M: f64 = 0.12;
/// Slowest speed when backing off.
const BACKING_M_PER_S: f64 = 0.12;
/// After so long at a standstill the other direction is tried.
const STUCK_TICKS: u32 = 90;
const STUCK_M_PER_S: f64 = 0.012;
/// A car-like robot parks from this close, and gives it up from further away.
const PARKING_M: f64 = 0.35;
const FAR_M: f64 = 0.7;
const PARKING_M_PER_S: f64 = 0.2;
/// It plans anew when the place has moved this far.
const MOVED_M: f64 = 0.04;

/// What a law wants of one robot in this tick.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// Velocity of the body origin in the world frame, m/s.
    pub velocity: Vector,
    /// From the robot to the place it is on the way to, world frame, m.
    pub way: Vector,
    /// Yaw to have at rest; robots that move sideways have it all the time. Free when `None`.
    pub yaw_rad: Option<f64>,
    /// The robot is to stop at the end of `way`.
    pub stops: bool,
}

/// State of the way of one robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Driver {
    first_yaw_rad: Option<f64>,
    backwards: bool,
    chosen: bool,
    backing_off: bool,
    stuck_ticks: u32,
    /// Where it parks.
    parking: Option<Place>,
    manoeuvre: Manoeuvre,
}

impl Driver {
    /// Body twist for a request.
    ///
    /// - `yaw_gain_per_s`: yaw rate for each radian of heading error.
    /// - Returns zero for a robot without a finite pose.
    pub fn twist(
        &mut self,
        drive: Drive,
        robot: &RobotObservation,
        request: &Request,
        yaw_gain_per_s: f64,
    ) -> BodyTwist {
        let pose = &robot.pose;
        if !pose.is_finite() {
            return BodyTwist::default();
        }
        let first_yaw_rad = *self.first_yaw_rad.get_or_insert(pose.yaw_rad);
        match drive {
            Drive::Holonomic => {
                let wish = Wish {
                    velocity: request.velocity,
                    aim: request.velocity,
                    yaw_rad: request.yaw_rad.or(Some(first_yaw_rad)),
                };
                twist_for(drive, pose, &wish, yaw_gain_per_s)
            }
            Drive::TurnInPlace { .. } => turning(robot, request, yaw_gain_per_s),
            Drive::Steered {
                turning_radius_m,
                axle_x_m,
            } => {
                let car = Car {
                    turning_radius_m,
                    axle_x_m,
                    speed_m_per_s: PARKING_M_PER_S,
                };
                self.steered(robot, request, &car)
            }
        }
    }

    fn steered(&mut self, robot: &RobotObservation, request: &Request, car: &Car) -> BodyTwist {
        let speed = length(request.velocity);
        if speed < REST_M_PER_S {
            *self = Driver {
                first_yaw_rad: self.first_yaw_rad,
                ..Driver::default()
            };
            return BodyTwist::default();
        }
        self.unlock(robot);
        if let Some(twist) = self.park(robot, request, car) {
            return twist;
        }
        let bearing_rad = wrap(libm::atan2(request.velocity[1], request.velocity[0]) - robot.pose.yaw_rad);
        let error_rad = self.gear(bearing_rad);
        let limit_per_m = 1.0 / car.turning_radius_m.max(1e-3);
        let needed_per_m = 2.0 * libm::sin(error_rad) / length(request.way).max(SHORTEST_PURSUIT_M);
        let outside = error_rad.abs() < core::f64::consts::FRAC_PI_2 && needed_per_m.abs() <= 1.3 * limit_per_m;
        self.backing_off = if self.backing_off {
            !(error_rad.abs() < ALIGNED_RAD && needed_per_m.abs() < limit_per_m)
        } else {
            !outside
        };
        let sign = if self.backwards == self.backing_off { 1.0 } else { -1.0 };
        let (speed, curvature_per_m) = if self.backing_off {
            (speed.max(BACKING_M_PER_S), limit_per_m.copysign(error_rad))
        } else {
            (speed, needed_per_m.clamp(-limit_per_m, limit_per_m))
        };
        BodyTwist {
            forward_m_per_s: sign * speed,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: speed * curvature_per_m,
        }
    }

    /// Chooses forwards or backwards and returns the angle from that direction to the wish.
    fn gear(&mut self, bearing_rad: f64) -> f64 {
        let of = |backwards: bool| {
            if backwards {
                wrap(bearing_rad - core::f64::consts::PI)
            } else {
                bearing_rad
            }
        };
        if !self.chosen || (!self.backing_off && of(self.backwards).abs() > GEAR_LIMIT_RAD) {
            self.chosen = true;
            self.backwards = bearing_rad.abs() > core::f64::consts::FRAC_PI_2;
            self.backing_off = false;
        }
        of(self.backwards)
    }

    /// Something keeps the robot from moving: try the other direction.
    fn unlock(&mut self, robot: &RobotObservation) {
        let moves = robot.twist.forward_m_per_s.abs() > STUCK_M_PER_S;
        self.stuck_ticks = if moves { 0 } else { self.stuck_ticks + 1 };
        if self.stuck_ticks > STUCK_TICKS {
            self.stuck_ticks = 0;
            self.backwards = !self.backwards;
            self.backing_off = !self.backing_off;
            self.parking = None;
        }
    }

    /// The way to a place to stop at, when it is near.
    fn park(&mut self, robot: &RobotObservation, request: &Request, car: &Car) -> Option<BodyTwist> {
        let here = Place {
            place_m: [robot.pose.x_m, robot.pose.y_m],
            yaw_rad: robot.pose.yaw_rad,
        };
        let goal_m = add(here.place_m, request.way);
        let far_m = length(request.way);
        let near_m = if self.parking.is_some() { FAR_M } else { PARKING_M };
        if !request.stops || far_m > near_m {
            self.parking = None;
            return None;
        }
        let goal = match self.parking {
            Some(goal) if length(sub(goal.place_m, goal_m)) <= MOVED_M => goal,
            _ => {
                self.manoeuvre.forget();
                Place {
                    place_m: goal_m,
                    yaw_rad: Manoeuvre::best_yaw_rad(car, &here, goal_m),
                }
            }
        };
        self.parking = Some(goal);
        Some(self.manoeuvre.step(car, &here, &goal, &|_| true).0)
    }
}

fn turning(robot: &RobotObservation, request: &Request, yaw_gain_per_s: f64) -> BodyTwist {
    let turn = |error_rad: f64| (yaw_gain_per_s * error_rad).clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S);
    let yaw_rad = robot.pose.yaw_rad;
    if length(request.velocity) < REST_M_PER_S {
        return BodyTwist {
            yaw_rate_rad_per_s: request.yaw_rad.map_or(0.0, |wanted| turn(wrap(wanted - yaw_rad))),
            ..BodyTwist::default()
        };
    }
    let mut error_rad = wrap(libm::atan2(request.velocity[1], request.velocity[0]) - yaw_rad);
    if error_rad.abs() > core::f64::consts::FRAC_PI_2 && length(request.way) < BACK_M {
        error_rad = wrap(error_rad - core::f64::consts::PI);
    }
    BodyTwist {
        forward_m_per_s: dot(request.velocity, heading(yaw_rad)) * share(error_rad),
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: turn(error_rad),
    }
}

/// Share of the speed while a robot that turns in place still points elsewhere.
fn share(error_rad: f64) -> f64 {
    ((NO_SPEED_RAD - error_rad.abs()) / (NO_SPEED_RAD - FULL_SPEED_RAD)).clamp(0.0, 1.0)
}

/// Whether a robot is at its place: it must come closer than the radius, and has left when it is twice as far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Arrival {
    arrived: bool,
}

impl Arrival {
    pub fn update(&mut self, distance_m: f64, radius_m: f64) -> bool {
        self.arrived = distance_m <= if self.arrived { 2.0 * radius_m } else { radius_m };
        self.arrived
    }
}
