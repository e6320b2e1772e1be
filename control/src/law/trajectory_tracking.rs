//! `trajectory_tracking`: every robot is at each of its targets at the time of that target.
//!
//! - Holonomic: v = v_r + k (x_r - x).
//! - Others, with the errors in the robot's frame: u = u_r cos e_t + k e_x,  r = r_r + u_r (k_y e_y + 2 sqrt(k_y) sin e_t)
//!   [Kanayama et al. 1990; critically damped]. A car-like robot bends no more than its steering allows.

use twin::twist::BodyTwist;

use super::corner::start_problem;
use super::motion::YAW_RATE_LIMIT_RAD_PER_S;
use super::parameters::YAW_GAIN;
use super::targets::{Owner, TargetRule, YawUse};
use super::trajectory::{Reference, Trajectory};
use super::{
    Demand, Drive, Law, LawSpec, Observation, ParameterSpec, Parameters, RobotObservation, TRAJECTORY_TRACKING,
};
use crate::TICK_S;
use crate::prediction::LONGEST_PREDICTION_S;
use crate::scenario::{FieldProblem, Scenario};
use crate::vector::{Vector, add, body_from_world, length, scale, sub, world_from_body, wrap};

pub(super) const SPEC: LawSpec = LawSpec {
    name: TRAJECTORY_TRACKING,
    title: "Trajectory tracking: a smooth trajectory passes the targets at equal times, the robot follows it by feed-forward and feedback",
    source: "Kanayama et al. 1990, tracking control rule for vehicles; natural cubic spline, de Boor 1978",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 1,
        most_each: 200,
        yaw: YawUse::Unused,
        apart: false,
        meaning: "Target k of a robot (from 1) is passed at start_delay_s + k interval_s, without stopping; a robot without any stands still.",
    },
    parameters: &[
        ParameterSpec::quantity("interval_s", "s", [0.5, 4.0, 60.0], "Time from one target to the next."),
        ParameterSpec::quantity(
            "start_delay_s",
            "s",
            [0.0, 2.0, 30.0],
            "Time before the trajectory begins, in which robots that turn in place turn to its direction.",
        ),
        ParameterSpec::quantity(
            "speed_m_per_s",
            "m/s",
            [0.05, 0.5, 0.7],
            "Fastest trajectory that is accepted.",
        ),
        ParameterSpec::quantity(
            "tracking_gain_per_s",
            "1/s",
            [0.2, 3.0, 8.0],
            "Speed for each metre between robot and trajectory, along it (any direction for robots that move sideways).",
        ),
        ParameterSpec::quantity(
            "lateral_gain_per_m2",
            "1/m2",
            [1.0, 25.0, 200.0],
            "k_y: curvature for each metre beside the trajectory, for robots that cannot move sideways.",
        ),
        YAW_GAIN,
        ParameterSpec::quantity(
            "reach_radius_m",
            "m",
            [0.005, 0.05, 0.5],
            "At the end the robot must be this close to its last target.",
        ),
    ],
};

/// Feedback adds at most this share of the largest speed.
const FEEDBACK_SHARE: f64 = 0.5;
/// Below this speed a reference has no direction of its own.
const STILL_M_PER_S: f64 = 1e-3;
/// Points of a trajectory that are compared with the limits, for each interval.
const SAMPLES: usize = 40;

#[derive(Debug)]
pub struct TrajectoryTracking {
    trajectories: Vec<Trajectory>,
    first_yaw_rad: Vec<Option<f64>>,
}

impl TrajectoryTracking {
    pub fn new(scenario: &Scenario) -> TrajectoryTracking {
        let robots = scenario.experiment.robots.len();
        TrajectoryTracking {
            trajectories: (0..robots).map(|i| trajectory(scenario, i)).collect(),
            first_yaw_rad: vec![None; robots],
        }
    }
}

fn trajectory(scenario: &Scenario, i: usize) -> Trajectory {
    let start = scenario.experiment.robots[i].start;
    let mut places_m = vec![[start.x_m, start.y_m]];
    places_m.extend(scenario.targets_of(i).map(|target| [target.x_m, target.y_m]));
    Trajectory::new(places_m, Parameters::of(&scenario.experiment.control).get("interval_s"))
}

/// Speed and curvature that a trajectory needs must be what the robot has.
pub(super) fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let mut problems = Vec::new();
    let parameters = Parameters::of(&scenario.experiment.control);
    let limit = parameters.get("speed_m_per_s");
    let interval_s = parameters.get("interval_s");
    for (i, drive) in super::drives(scenario).into_iter().enumerate() {
        let name = &scenario.experiment.robots[i].name;
        let trajectory = trajectory(scenario, i);
        let samples = SAMPLES * (scenario.targets_of(i).count());
        let at = |k: usize| trajectory.at(trajectory.duration_s() * k as f64 / samples.max(1) as f64);
        let fastest = (0..samples).map(|k| length(at(k).velocity_m_per_s)).fold(0.0, f64::max);
        if fastest > limit {
            let enough_s = interval_s * fastest / limit;
            problems.push(FieldProblem {
                field: "control.parameters.interval_s".into(),
                message: format!("the trajectory of {name} needs {fastest:.2} m/s"),
                limit: format!("{limit} m/s (speed_m_per_s)"),
                remedy: format!("choose interval_s of at least {enough_s:.1} s, or move the targets together"),
            });
        }
        let Drive::Steered {
            turning_radius_m,
            axle_x_m,
        } = drive
        else {
            continue;
        };
        let allowed_per_m = 1.0 / length([turning_radius_m, axle_x_m]);
        let sharpest = (1..samples).map(|k| curvature_per_m(&at(k)).abs()).fold(0.0, f64::max);
        if sharpest > allowed_per_m {
            problems.push(FieldProblem {
                field: "targets".into(),
                message: format!(
                    "the trajectory of {name} bends with a radius of {:.2} m",
                    1.0 / sharpest
                ),
                limit: format!("a radius of at least {:.2} m", 1.0 / allowed_per_m),
                remedy: "move the targets apart or into a wider arc, or use a robot that turns in place".into(),
            });
        }
        problems.extend(start_problem(scenario, i, Some(trajectory.at(0.0).tangent)));
    }
    problems
}

fn cross(a: Vector, b: Vector) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn curvature_per_m(reference: &Reference) -> f64 {
    let speed = length(reference.velocity_m_per_s);
    if speed < STILL_M_PER_S {
        return 0.0;
    }
    cross(reference.velocity_m_per_s, reference.acceleration_m_per_s2) / (speed * speed * speed)
}

impl Law for TrajectoryTracking {
    fn name(&self) -> &'static str {
        TRAJECTORY_TRACKING
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let parameters = observation.parameters;
        let now_s = observation.tick as f64 * TICK_S - parameters.get("start_delay_s");
        let all = self.trajectories.iter().zip(&mut self.first_yaw_rad).zip(demands);
        for (i, ((trajectory, first_yaw_rad), demand)) in all.enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            demand.target = trajectory.at(now_s).place_m;
            if !robot.pose.is_finite() {
                continue;
            }
            // A pose that is predicted is compared with the trajectory at its time.
            let time_s = now_s + ahead_s(robot);
            let reference = trajectory.at(time_s);
            let ended = now_s >= trajectory.duration_s();
            let away = sub(reference.place_m, seen_now(robot));
            demand.finished = ended && length(away) <= parameters.get("reach_radius_m");
            let yaw_rad = *first_yaw_rad.get_or_insert(robot.pose.yaw_rad);
            demand.twist = match body.drive {
                Drive::Holonomic => sideways(robot, &reference, away, yaw_rad, parameters),
                Drive::TurnInPlace { .. } if time_s < 0.0 => turning(robot, &reference, parameters),
                drive => bent(drive, robot, &reference, away, parameters),
            };
        }
    }
}

/// How far ahead of now a pose is predicted.
fn ahead_s(robot: &RobotObservation) -> f64 {
    (-robot.pose_age_s).clamp(0.0, LONGEST_PREDICTION_S)
}

/// The place of the robot by now: the pose is as old as it says.
fn seen_now(robot: &RobotObservation) -> Vector {
    let here = [robot.pose.x_m, robot.pose.y_m];
    let twist = [robot.twist.forward_m_per_s, robot.twist.left_m_per_s];
    if !twist[0].is_finite() || !twist[1].is_finite() || !(0.0..0.2).contains(&robot.pose_age_s) {
        return here;
    }
    add(
        here,
        scale(world_from_body(twist, robot.pose.yaw_rad), robot.pose_age_s),
    )
}

fn bound(rate: f64) -> f64 {
    rate.clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S)
}

fn sideways(
    robot: &RobotObservation,
    reference: &Reference,
    away: Vector,
    yaw_rad: f64,
    parameters: &Parameters,
) -> BodyTwist {
    let back = crate::vector::clip(
        scale(away, parameters.get("tracking_gain_per_s")),
        FEEDBACK_SHARE * parameters.get("speed_m_per_s"),
    );
    let velocity = add(reference.velocity_m_per_s, back);
    let [forward_m_per_s, left_m_per_s] = body_from_world(velocity, robot.pose.yaw_rad);
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s: bound(parameters.get("yaw_gain_per_s") * wrap(yaw_rad - robot.pose.yaw_rad)),
    }
}

/// Before the start: to the direction in which the trajectory begins.
fn turning(robot: &RobotObservation, reference: &Reference, parameters: &Parameters) -> BodyTwist {
    if length(reference.tangent) < STILL_M_PER_S {
        return BodyTwist::default();
    }
    let wanted_rad = libm::atan2(reference.tangent[1], reference.tangent[0]);
    BodyTwist {
        yaw_rate_rad_per_s: bound(parameters.get("yaw_gain_per_s") * wrap(wanted_rad - robot.pose.yaw_rad)),
        ..BodyTwist::default()
    }
}

fn bent(
    drive: Drive,
    robot: &RobotObservation,
    reference: &Reference,
    away: Vector,
    parameters: &Parameters,
) -> BodyTwist {
    let speed = length(reference.velocity_m_per_s);
    let curvature = curvature_per_m(reference);
    // The fixed axle lies behind the body origin, so on an arc a car-like body points outside of it.
    let inward_rad = match drive {
        Drive::Steered { axle_x_m, .. } => libm::asin((-axle_x_m * curvature).clamp(-0.9, 0.9)),
        _ => 0.0,
    };
    let [ahead_m, left_m] = body_from_world(away, robot.pose.yaw_rad);
    let limit = FEEDBACK_SHARE * parameters.get("speed_m_per_s");
    let back = (parameters.get("tracking_gain_per_s") * ahead_m).clamp(-limit, limit);
    if speed < STILL_M_PER_S {
        let rests = matches!(drive, Drive::Steered { .. });
        return BodyTwist {
            forward_m_per_s: if rests && ahead_m.abs() < 0.01 { 0.0 } else { back },
            ..BodyTwist::default()
        };
    }
    let way_rad = libm::atan2(reference.velocity_m_per_s[1], reference.velocity_m_per_s[0]) - inward_rad;
    let error_rad = wrap(way_rad - robot.pose.yaw_rad);
    let k_y = parameters.get("lateral_gain_per_m2");
    let forward_m_per_s = speed * libm::cos(inward_rad) * libm::cos(error_rad) + back;
    let rate = speed * (curvature + k_y * left_m + 2.0 * k_y.sqrt() * libm::sin(error_rad));
    let rate = match drive {
        Drive::Steered { turning_radius_m, .. } => {
            let most = forward_m_per_s.abs() / turning_radius_m.max(1e-3);
            rate.clamp(-most, most)
        }
        _ => bound(rate),
    };
    BodyTwist {
        forward_m_per_s,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: rate,
    }
}
