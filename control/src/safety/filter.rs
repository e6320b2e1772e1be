//! The filter itself: observations and desired twists in, safe commands out.

use twin::command::WheelCommand;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use super::constraints::{self, Against, Constraint, Place};
use super::intervention::{Cause, Intervention};
use super::solver::{self, Groups};
use super::{Filtered, Limits, SafeCommand};
use crate::law::{Drive, RobotObservation};
use crate::vector::{Vector, body_from_world, clip, dot, heading, length, right_of, scale, sub, world_from_body};

/// A change below this is not recorded.
const RECORDED_M_PER_S: f64 = 2e-3;
const RECORDED_RAD_PER_S: f64 = 1e-3;

/// A robot as the filter needs it.
#[derive(Debug, Clone)]
pub struct FilterBody {
    pub robot: Robot,
    pub bounding_radius_m: f64,
}

/// Turns desired twists into safe commands; see the module. Allocates only in `new`.
#[derive(Debug, Clone)]
pub struct SafetyFilter {
    limits: Limits,
    half_arena: Vector,
    bodies: Vec<FilterBody>,
    drives: Vec<Drive>,
    places: Vec<Place>,
    velocities: Vec<Vector>,
    yaw_rad: Vec<f64>,
    yaw_rates: Vec<f64>,
    constraints: Vec<Constraint>,
    groups: Groups,
    factors: Vec<f64>,
    stops: Vec<Option<Cause>>,
    steering_rad: Vec<f64>,
    filtered: Vec<Filtered>,
}

const STOP: SafeCommand = SafeCommand {
    twist: BodyTwist {
        forward_m_per_s: 0.0,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.0,
    },
    wheels: WheelCommand {
        wheel_rad_per_s: [0.0; twin::MAX_WHEELS],
        steering_rad: 0.0,
    },
};

impl SafetyFilter {
    /// A filter for robots in a rectangular arena centred at the origin, `arena_m = [width, height]`.
    pub fn new(limits: Limits, arena_m: [f64; 2], bodies: Vec<FilterBody>) -> SafetyFilter {
        let n = bodies.len();
        let drives = bodies.iter().map(|body| Drive::of(&body.robot)).collect();
        let place = |body: &FilterBody| Place {
            position: None,
            radius_m: body.bounding_radius_m,
            movable: false,
            velocity: [0.0, 0.0],
            commanded: [0.0, 0.0],
            pose_age_s: 0.0,
            axis: None,
        };
        SafetyFilter {
            limits,
            half_arena: scale(arena_m, 0.5),
            drives,
            places: bodies.iter().map(place).collect(),
            velocities: vec![[0.0, 0.0]; n],
            yaw_rad: vec![0.0; n],
            yaw_rates: vec![0.0; n],
            constraints: Vec::with_capacity(n * n.saturating_sub(1) / 2 + 4 * n),
            groups: Groups::new(n),
            factors: vec![1.0; n],
            stops: vec![None; n],
            steering_rad: vec![0.0; n],
            filtered: vec![
                Filtered {
                    command: STOP,
                    intervention: None
                };
                n
            ],
            bodies,
        }
    }

    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Safe commands for this tick, one per robot, in order. Missing observations count as offline, missing twists as zero.
    pub fn apply(&mut self, observations: &[RobotObservation], desired: &[BodyTwist]) -> &[Filtered] {
        for i in 0..self.bodies.len() {
            let wanted = desired.get(i).copied().unwrap_or_default();
            self.admit(i, observations.get(i), wanted);
        }
        // A robot that was never seen could be anywhere.
        if self.places.iter().any(|place| place.position.is_none()) {
            for (place, stop) in self.places.iter_mut().zip(&mut self.stops) {
                place.movable = false;
                stop.get_or_insert(Cause::PoseAge);
            }
        }
        constraints::collect(&mut self.places, self.half_arena, &self.limits, &mut self.constraints);
        for (velocity, place) in self.velocities.iter_mut().zip(&self.places) {
            if !place.movable {
                *velocity = [0.0, 0.0];
            }
        }
        solver::project(&mut self.constraints, &mut self.velocities);
        self.shorten();
        self.steady_turns();
        for i in 0..self.bodies.len() {
            let wanted = desired.get(i).copied().unwrap_or_default();
            self.filtered[i] = self.finish(i, observations.get(i), wanted);
        }
        &self.filtered
    }

    /// Stop commands for all robots.
    pub fn stop(&mut self) -> &[Filtered] {
        for (i, filtered) in self.filtered.iter_mut().enumerate() {
            *filtered = Filtered {
                command: stop_holding(self.steering_rad[i]),
                intervention: None,
            };
            self.places[i].commanded = [0.0, 0.0];
        }
        &self.filtered
    }

    /// Takes in one robot: where it is, whether it may move, and its desired velocity within the speed limits.
    fn admit(&mut self, i: usize, observation: Option<&RobotObservation>, wanted: BodyTwist) {
        let limits = self.limits;
        let place = &mut self.places[i];
        place.radius_m = self.bodies[i].bounding_radius_m;
        self.velocities[i] = [0.0, 0.0];
        self.yaw_rates[i] = 0.0;
        let stop = stop_cause(observation, &wanted, &limits);
        self.stops[i] = stop;
        place.movable = stop.is_none();
        let Some(seen) = observation.filter(|seen| seen.pose.is_finite()) else {
            place.velocity = [0.0, 0.0];
            place.pose_age_s = limits.oldest_pose_s;
            place.radius_m += limits.stale_growth_m;
            return;
        };
        place.position = Some([seen.pose.x_m, seen.pose.y_m]);
        let age_s = if seen.pose_age_s.is_finite() {
            seen.pose_age_s.max(0.0)
        } else {
            f64::MAX
        };
        place.pose_age_s = age_s.min(limits.oldest_pose_s);
        if age_s > limits.oldest_pose_s {
            place.radius_m += (limits.stale_growth_m_per_s * age_s).min(limits.stale_growth_m);
        }
        let body_velocity = [seen.twist.forward_m_per_s, seen.twist.left_m_per_s];
        let known = body_velocity[0].is_finite() && body_velocity[1].is_finite();
        let yaw_rad = seen.pose.yaw_rad;
        self.yaw_rad[i] = yaw_rad;
        place.velocity = if known {
            clip(world_from_body(body_velocity, yaw_rad), 2.0 * limits.speed_m_per_s)
        } else {
            [0.0, 0.0]
        };
        let holonomic = self.drives[i] == Drive::Holonomic;
        place.axis = (!holonomic).then(|| heading(yaw_rad));
        if place.movable {
            let sideways = if holonomic { wanted.left_m_per_s } else { 0.0 };
            let velocity = clip([wanted.forward_m_per_s, sideways], limits.speed_m_per_s);
            self.velocities[i] = world_from_body(velocity, yaw_rad);
            self.yaw_rates[i] = wanted
                .yaw_rate_rad_per_s
                .clamp(-limits.yaw_rate_rad_per_s, limits.yaw_rate_rad_per_s);
        }
    }

    /// Shortens all velocities of a group by one factor, so that limits and constraints hold together.
    fn shorten(&mut self) {
        self.groups.reset();
        for constraint in &self.constraints {
            if let Against::Robot(other) = constraint.against {
                let (a, b) = (constraint.robot as usize, other as usize);
                if self.places[a].movable && self.places[b].movable {
                    self.groups.join(a, b);
                }
            }
        }
        self.factors.fill(1.0);
        for i in 0..self.bodies.len() {
            let factor = self.limit_factor(i);
            let group = self.groups.of(i);
            self.factors[group] = self.factors[group].min(factor);
        }
        for constraint in &self.constraints {
            let factor = solver::shortening(constraint, &self.velocities);
            let robots = [
                Some(constraint.robot),
                if let Against::Robot(other) = constraint.against {
                    Some(other)
                } else {
                    None
                },
            ];
            for robot in robots.into_iter().flatten() {
                let group = self.groups.of(robot as usize);
                self.factors[group] = self.factors[group].min(factor);
            }
        }
        for i in 0..self.bodies.len() {
            self.velocities[i] = scale(self.velocities[i], self.factors[self.groups.of(i)]);
        }
    }

    /// Limits yaw rates where turning would bend a velocity into a constraint before the command takes effect.
    ///
    /// A command is a twist in the body frame; after the latency t it points r t further round. What this adds to the
    /// approach may not exceed what the gap allows, so it vanishes with the gap. Turning away is never limited.
    fn steady_turns(&mut self) {
        for constraint in &self.constraints {
            let (other, allowed) = match constraint.against {
                Against::Robot(other) => (Some(other as usize), -constraint.bound / 2.0),
                Against::Wall(_) => (None, -constraint.bound),
            };
            let own = (constraint.robot as usize, constraint.normal);
            let other = other.map(|other| (other, scale(constraint.normal, -1.0)));
            for (i, normal) in [Some(own), other].into_iter().flatten() {
                let latency_s = self.limits.latency_s + self.places[i].pose_age_s;
                let left = scale(right_of(self.velocities[i]), -1.0);
                let bend = dot(normal, left) * self.yaw_rates[i] * latency_s;
                if bend < -allowed {
                    self.yaw_rates[i] *= allowed / -bend;
                }
            }
        }
    }

    /// Factor that brings a robot's speed and its wheels (translation only) within their limits.
    fn limit_factor(&self, i: usize) -> f64 {
        let speed = length(self.velocities[i]);
        let body = if speed > self.limits.speed_m_per_s {
            self.limits.speed_m_per_s / speed
        } else {
            1.0
        };
        let [forward_m_per_s, left_m_per_s] = body_from_world(self.velocities[i], self.yaw_rad[i]);
        let left_m_per_s = if self.drives[i] == Drive::Holonomic {
            left_m_per_s
        } else {
            0.0
        };
        let straight = BodyTwist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s: 0.0,
        };
        let wheels = largest_wheel(&self.bodies[i].robot, &straight);
        let limit = self.wheel_limit(i);
        if wheels > limit { body.min(limit / wheels) } else { body }
    }

    fn wheel_limit(&self, i: usize) -> f64 {
        self.bodies[i].robot.max_wheel_speed_rad_per_s() * self.limits.wheel_share
    }

    /// Body twist, wheel set-points and the record of one robot.
    fn finish(&mut self, i: usize, observation: Option<&RobotObservation>, requested: BodyTwist) -> Filtered {
        let movable = self.places[i].movable;
        let Some(seen) = observation.filter(|_| movable) else {
            self.places[i].commanded = [0.0, 0.0];
            let cause = self.stops[i].unwrap_or(Cause::Infeasible);
            let intervention = Some(record(cause, requested, BodyTwist::default()));
            return Filtered {
                command: stop_holding(self.steering_rad[i]),
                intervention,
            };
        };
        let twist = self.twist(i, seen, requested);
        let robot = &self.bodies[i].robot;
        let mut wheels = robot.wheel_speeds_holding(twist, self.steering_rad[i]);
        let limit = self.wheel_limit(i);
        for speed in &mut wheels.wheel_rad_per_s {
            *speed = speed.clamp(-limit, limit);
        }
        wheels.steering_rad = wheels
            .steering_rad
            .clamp(-robot.max_steering_rad(), robot.max_steering_rad());
        if wheels.non_finite_field().is_some() {
            self.places[i].commanded = [0.0, 0.0];
            let intervention = Some(record(Cause::NotFinite, requested, BodyTwist::default()));
            return Filtered {
                command: stop_holding(0.0),
                intervention,
            };
        }
        self.steering_rad[i] = wheels.steering_rad;
        self.places[i].commanded = self.velocities[i];
        Filtered {
            command: SafeCommand { twist, wheels },
            intervention: self.judge(i, requested, twist),
        }
    }

    /// The filtered velocity as a body twist, the yaw rate reduced to what the wheels leave for it.
    fn twist(&self, i: usize, seen: &RobotObservation, requested: BodyTwist) -> BodyTwist {
        let [forward_m_per_s, left_m_per_s] = body_from_world(self.velocities[i], seen.pose.yaw_rad);
        if let Drive::Steered { .. } = self.drives[i] {
            // A steered robot keeps its arc: the yaw rate follows the speed.
            let arc = if requested.forward_m_per_s.abs() > 1e-6 {
                forward_m_per_s / requested.forward_m_per_s
            } else {
                0.0
            };
            let yaw_rate_rad_per_s = self.yaw_rates[i] * arc.clamp(-1.0, 1.0);
            let twist = BodyTwist {
                forward_m_per_s,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s,
            };
            let (limit, needed) = (self.wheel_limit(i), largest_wheel(&self.bodies[i].robot, &twist));
            let factor = if needed > limit { limit / needed } else { 1.0 };
            return BodyTwist {
                forward_m_per_s: forward_m_per_s * factor,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: yaw_rate_rad_per_s * factor,
            };
        }
        let left_m_per_s = if self.drives[i] == Drive::Holonomic {
            left_m_per_s
        } else {
            0.0
        };
        let robot = &self.bodies[i].robot;
        let straight = BodyTwist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s: 0.0,
        };
        let turning = BodyTwist {
            yaw_rate_rad_per_s: self.yaw_rates[i],
            ..BodyTwist::default()
        };
        let left_over = (self.wheel_limit(i) - largest_wheel(robot, &straight)).max(0.0);
        let needed = largest_wheel(robot, &turning);
        let share = if needed > left_over { left_over / needed } else { 1.0 };
        BodyTwist {
            yaw_rate_rad_per_s: self.yaw_rates[i] * share,
            ..straight
        }
    }

    /// What changed the command most; `None` when nothing did.
    fn judge(&self, i: usize, requested: BodyTwist, applied: BodyTwist) -> Option<Intervention> {
        let intervention = record(Cause::Speed, requested, applied);
        if intervention.change_m_per_s < RECORDED_M_PER_S && intervention.change_rad_per_s < RECORDED_RAD_PER_S {
            return None;
        }
        let mut cause = if self.factors[self.groups.of(i)] == 0.0 {
            Cause::Infeasible
        } else {
            self.limit_cause(requested)
        };
        let mut largest = RECORDED_M_PER_S / 2.0;
        for constraint in self.constraints.iter().filter(|c| c.multiplier > 0.0) {
            let (gradient, found) = match constraint.against {
                Against::Wall(side) if constraint.robot as usize == i => (constraint.gradient, Cause::Wall { side }),
                Against::Robot(other) if constraint.robot as usize == i => {
                    (constraint.gradient, Cause::Robot { other })
                }
                Against::Robot(other) if other as usize == i => (
                    constraint.gradient_other,
                    Cause::Robot {
                        other: constraint.robot,
                    },
                ),
                _ => continue,
            };
            let push = constraint.multiplier * length(gradient);
            if push > largest && cause != Cause::Infeasible {
                largest = push;
                cause = found;
            }
        }
        Some(Intervention { cause, ..intervention })
    }

    fn limit_cause(&self, requested: BodyTwist) -> Cause {
        let fast = requested.speed_m_per_s() > self.limits.speed_m_per_s;
        let turns = requested.yaw_rate_rad_per_s.abs() > self.limits.yaw_rate_rad_per_s;
        if fast || turns { Cause::Speed } else { Cause::WheelSpeed }
    }
}

fn stop_holding(steering_rad: f64) -> SafeCommand {
    SafeCommand {
        wheels: WheelCommand {
            steering_rad,
            ..STOP.wheels
        },
        ..STOP
    }
}

/// Why a robot may not move at all.
fn stop_cause(observation: Option<&RobotObservation>, wanted: &BodyTwist, limits: &Limits) -> Option<Cause> {
    let Some(seen) = observation else {
        return Some(Cause::Offline);
    };
    let finite =
        wanted.forward_m_per_s.is_finite() && wanted.left_m_per_s.is_finite() && wanted.yaw_rate_rad_per_s.is_finite();
    if !seen.online {
        Some(Cause::Offline)
    } else if !seen.pose.is_finite() || !finite {
        Some(Cause::NotFinite)
    } else if !(0.0..=limits.oldest_pose_s).contains(&seen.pose_age_s) {
        Some(Cause::PoseAge)
    } else {
        None
    }
}

fn largest_wheel(robot: &Robot, twist: &BodyTwist) -> f64 {
    robot
        .wheel_speeds(*twist)
        .wheel_rad_per_s
        .iter()
        .fold(0.0, |largest: f64, speed| largest.max(speed.abs()))
}

fn record(cause: Cause, requested: BodyTwist, applied: BodyTwist) -> Intervention {
    let change = sub(
        [requested.forward_m_per_s, requested.left_m_per_s],
        [applied.forward_m_per_s, applied.left_m_per_s],
    );
    let turn = requested.yaw_rate_rad_per_s - applied.yaw_rate_rad_per_s;
    let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
    let requested = BodyTwist {
        forward_m_per_s: finite(requested.forward_m_per_s),
        left_m_per_s: finite(requested.left_m_per_s),
        yaw_rate_rad_per_s: finite(requested.yaw_rate_rad_per_s),
    };
    Intervention {
        cause,
        change_m_per_s: finite(length(change)),
        change_rad_per_s: finite(turn.abs()),
        requested,
    }
}
