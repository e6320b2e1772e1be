//! `go_to_pose`: every robot drives to its own place and stops there with the yaw that is asked for.
//!
//! - Holonomic: v = min(k e, speed), r = k_y (yaw error).
//! - Turning in place, with e the distance, a the angle to the goal and t the angle of the line to the goal against the
//!   goal's yaw: u = g e cos a,  r = k a + g (cos a sin a / a)(a + h t)    [Aicardi et al. 1995]; backwards
//!   when the goal lies behind, and on the spot at the end.
//! - Car-like: the Reeds-Shepp path that stays in the arena, see `reeds_shepp.rs` and `manoeuvre.rs`.

use twin::twist::BodyTwist;

use super::driver::{Driver, Request};
use super::manoeuvre::{Car, Manoeuvre, distance};
use super::motion::YAW_RATE_LIMIT_RAD_PER_S;
use super::parameters::{SPEED, YAW_GAIN};
use super::piece::Place;
use super::targets::{Owner, TargetRule, YawUse};
use super::{Demand, Drive, GO_TO_POSE, Law, LawSpec, Observation, ParameterSpec, Parameters, RobotObservation};
use crate::scenario::Scenario;
use crate::vector::{Vector, clip, length, scale, sub, wrap};

pub(super) const SPEC: LawSpec = LawSpec {
    name: GO_TO_POSE,
    title: "Go to pose: every robot stops at its own place with its own yaw, car-like ones by reversing where needed",
    source: "Aicardi et al. 1995 for robots that turn in place; Reeds and Shepp 1990 (eqs. 8.1 to 8.11) and Samson 1992 for car-like ones",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 1,
        most_each: 1,
        yaw: YawUse::Needed,
        apart: true,
        meaning: "The pose of each robot at the end, with its yaw; a robot without one stands still.",
    },
    parameters: &[
        SPEED,
        ParameterSpec::quantity(
            "goal_gain_per_s",
            "1/s",
            [0.1, 1.5, 5.0],
            "Speed for each metre between robot and goal.",
        ),
        YAW_GAIN,
        ParameterSpec::quantity(
            "reach_radius_m",
            "m",
            [0.002, 0.008, 0.1],
            "The place counts as reached when the robot is this close.",
        ),
        ParameterSpec::quantity(
            "yaw_tolerance_rad",
            "rad",
            [0.005, 0.025, 0.5],
            "The yaw counts as reached when it is this close.",
        ),
    ],
};

/// `h`: how much the yaw at the goal bends the way there.
const YAW_BEND: f64 = 1.0;
/// Room left between the walls and the bounding circle of a planned path.
const ROOM_M: f64 = 0.06;

#[derive(Debug)]
pub struct GoToPose {
    half_arena_m: Vector,
    robots: Vec<Progress>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    driver: Driver,
    manoeuvre: Manoeuvre,
    /// Backwards all the way; chosen at the first tick.
    backwards: Option<bool>,
    on_the_spot: bool,
    arrived: bool,
}

impl GoToPose {
    pub fn new(scenario: &Scenario) -> GoToPose {
        GoToPose {
            half_arena_m: [0.5 * scenario.arena.width_m, 0.5 * scenario.arena.height_m],
            robots: vec![Progress::default(); scenario.experiment.robots.len()],
        }
    }
}

impl Law for GoToPose {
    fn name(&self) -> &'static str {
        GO_TO_POSE
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let half_arena_m = self.half_arena_m;
        for (i, (progress, demand)) in self.robots.iter_mut().zip(demands).enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            if !robot.pose.is_finite() {
                continue;
            }
            let here = Place {
                place_m: [robot.pose.x_m, robot.pose.y_m],
                yaw_rad: robot.pose.yaw_rad,
            };
            let Some(target) = observation.targets.get(i).and_then(|goals| goals.first()) else {
                demand.target = here.place_m;
                demand.finished = true;
                continue;
            };
            let goal = Place {
                place_m: target.place_m,
                yaw_rad: target.yaw_rad.unwrap_or(here.yaw_rad),
            };
            demand.target = goal.place_m;
            demand.finished = progress.arrives(&here, &goal, observation.parameters);
            let room_m = body.bounding_radius_m + ROOM_M;
            let half_room_m = [half_arena_m[0] - room_m, half_arena_m[1] - room_m];
            demand.twist = match body.drive {
                Drive::Holonomic => progress.straight(robot, &here, &goal, observation.parameters),
                Drive::TurnInPlace => progress.bent(&here, &goal, observation.parameters),
                Drive::Steered {
                    turning_radius_m,
                    axle_x_m,
                } => {
                    let car = Car {
                        turning_radius_m,
                        axle_x_m,
                        half_room_m,
                        speed_m_per_s: observation.parameters.get("speed_m_per_s"),
                    };
                    let (twist, ahead) = progress.manoeuvre(&car, &here, &goal);
                    demand.target = ahead;
                    twist
                }
            };
        }
    }
}

impl Progress {
    /// Within the tolerances; having arrived, within twice these.
    fn arrives(&mut self, here: &Place, goal: &Place, parameters: &Parameters) -> bool {
        let [way_m, turn_rad] = distance(here, goal);
        let slack = if self.arrived { 2.0 } else { 1.0 };
        self.arrived = way_m <= slack * parameters.get("reach_radius_m")
            && turn_rad <= slack * parameters.get("yaw_tolerance_rad");
        self.arrived
    }

    fn straight(&mut self, robot: &RobotObservation, here: &Place, goal: &Place, parameters: &Parameters) -> BodyTwist {
        let way = sub(goal.place_m, here.place_m);
        let request = Request {
            velocity: clip(
                scale(way, parameters.get("goal_gain_per_s")),
                parameters.get("speed_m_per_s"),
            ),
            way,
            yaw_rad: Some(goal.yaw_rad),
            stops: true,
        };
        let gain_per_s = parameters.get("yaw_gain_per_s");
        self.driver.twist(Drive::Holonomic, robot, &request, gain_per_s)
    }

    /// Aicardi's law in the direction of driving, then a turn on the spot.
    fn bent(&mut self, here: &Place, goal: &Place, parameters: &Parameters) -> BodyTwist {
        let way = sub(goal.place_m, here.place_m);
        let way_m = length(way);
        let reach_m = parameters.get("reach_radius_m");
        let gain_per_s = parameters.get("yaw_gain_per_s");
        let bound = |rate: f64| rate.clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S);
        self.on_the_spot = way_m <= if self.on_the_spot { reach_m } else { 0.4 * reach_m };
        if self.on_the_spot {
            return BodyTwist {
                yaw_rate_rad_per_s: bound(gain_per_s * wrap(goal.yaw_rad - here.yaw_rad)),
                ..BodyTwist::default()
            };
        }
        let line_rad = libm::atan2(way[1], way[0]);
        let bearing_rad = wrap(line_rad - here.yaw_rad);
        let backwards = *self
            .backwards
            .get_or_insert(bearing_rad.abs() > core::f64::consts::FRAC_PI_2);
        let (sign, turn_rad) = if backwards {
            (-1.0, core::f64::consts::PI)
        } else {
            (1.0, 0.0)
        };
        let a_rad = wrap(bearing_rad - turn_rad);
        let t_rad = wrap(line_rad - goal.yaw_rad - turn_rad);
        let speed = parameters.get("speed_m_per_s");
        let wanted = parameters.get("goal_gain_per_s") * way_m;
        let g_per_s = if wanted > speed {
            speed / way_m
        } else {
            parameters.get("goal_gain_per_s")
        };
        let sinc = if a_rad.abs() < 1e-6 {
            1.0
        } else {
            libm::sin(a_rad) / a_rad
        };
        let rate = gain_per_s * a_rad + g_per_s * libm::cos(a_rad) * sinc * (a_rad + YAW_BEND * t_rad);
        let share = (bound(rate) / rate).abs();
        BodyTwist {
            forward_m_per_s: sign * g_per_s * way_m * libm::cos(a_rad) * if share.is_finite() { share } else { 1.0 },
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: bound(rate),
        }
    }

    fn manoeuvre(&mut self, car: &Car, here: &Place, goal: &Place) -> (BodyTwist, Vector) {
        // The last millimetres are driven as well: at the edge of the tolerance nothing is left for errors.
        if self.arrived && !self.manoeuvre.is_ending() {
            self.manoeuvre.forget();
            return (BodyTwist::default(), goal.place_m);
        }
        self.manoeuvre.step(car, here, goal)
    }
}
