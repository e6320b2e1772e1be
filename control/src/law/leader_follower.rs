//! `leader_follower`: the first robot drives along its targets, each other robot follows the one before it.
//!
//! Robot i + 1 keeps its place at a distance l and a bearing b behind robot i:
//!
//! p = x_i - l [cos(c + b), sin(c + b)],  v = dp/dt + k (p - x)      [Das et al. 2002, separation-bearing control]
//!
//! The direction c of "behind" is that of a hitched trailer of length l, dc/dt = |v_i| sin(arg v_i - c) / l: it is the
//! same for all chassis and never jumps, also when the leader moves sideways or turns on the spot.

use super::driver::{Arrival, Driver, Request};
use super::parameters::{REACH_RADIUS, SPEED, YAW_GAIN};
use super::targets::{Owner, TargetRule, YawUse};
use super::{Demand, Drive, LEADER_FOLLOWER, Law, LawSpec, Observation, ParameterSpec, Parameters};
use crate::scenario::{FieldProblem, MIN_START_GAP_M, Scenario};
use crate::vector::{Vector, add, clip, heading, length, scale, sub, world_from_body, wrap};
use crate::{TICK_S, law::Goal};

pub(super) const SPEC: LawSpec = LawSpec {
    name: LEADER_FOLLOWER,
    title: "Leader and followers: each robot keeps a distance and a bearing behind the one before it",
    source: "Das et al. 2002, separation-bearing control",
    targets: TargetRule {
        owner: Owner::First,
        least: 1,
        most_each: u32::MAX,
        yaw: YawUse::Unused,
        apart: false,
        meaning: "Waypoints of the leader, which is the first robot of the experiment; the others have none.",
    },
    parameters: &[
        SPEED,
        ParameterSpec::quantity(
            "distance_m",
            "m",
            [0.2, 0.75, 3.0],
            "l: distance behind the robot before, between the centres.",
        ),
        ParameterSpec::quantity(
            "bearing_rad",
            "rad",
            [-1.2, 0.0, 1.2],
            "b: 0 follows straight behind, positive follows to its right.",
        ),
        ParameterSpec::quantity(
            "tracking_gain_per_s",
            "1/s",
            [0.2, 1.2, 5.0],
            "k: speed for each metre between robot and place.",
        ),
        YAW_GAIN,
        REACH_RADIUS,
    ],
};

/// Followers may drive faster than the leader by this factor, to catch up.
const CATCH_UP: f64 = 1.3;
/// A follower has arrived this much further from its place than the leader from its target.
const FOLLOWER_REACH: f64 = 3.0;
/// How far ahead in time a follower aims.
const AHEAD_S: f64 = 0.6;
/// Slower than this a robot has no direction of travel.
const STILL_M_PER_S: f64 = 0.01;
/// Gap that the distance must leave between two bounding circles.
const GAP_M: f64 = 0.1;

#[derive(Debug)]
pub struct LeaderFollower {
    robots: Vec<Progress>,
    /// Active target of the leader.
    index: usize,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    driver: Driver,
    arrival: Arrival,
    /// `c`: direction of the trailer behind this robot.
    trailer_rad: Option<f64>,
    finished: bool,
}

impl LeaderFollower {
    pub fn new(scenario: &Scenario) -> LeaderFollower {
        LeaderFollower {
            robots: vec![Progress::default(); scenario.experiment.robots.len()],
            index: 0,
        }
    }

    /// Where the leader goes: its waypoints one after the other.
    fn leader(&mut self, here: Vector, goals: &[Goal], parameters: &Parameters) -> (Vector, bool) {
        let reach_m = parameters.get("reach_radius_m");
        while self.index + 1 < goals.len() && length(sub(goals[self.index].place_m, here)) <= 2.0 * reach_m {
            self.index += 1;
        }
        let Some(goal) = goals.get(self.index) else {
            return ([0.0, 0.0], true);
        };
        let way = sub(goal.place_m, here);
        let last = self.index + 1 == goals.len();
        let arrived = self.robots[0].arrival.update(length(way), reach_m);
        (way, last && arrived)
    }
}

impl Law for LeaderFollower {
    fn name(&self) -> &'static str {
        LEADER_FOLLOWER
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let parameters = observation.parameters;
        let speed = parameters.get("speed_m_per_s");
        let gain_per_s = parameters.get("tracking_gain_per_s");
        let yaw_gain_per_s = parameters.get("yaw_gain_per_s");
        let robots = observation.robots.len().min(observation.bodies.len());
        let mut before_finished = false;
        let last_leg = observation
            .targets
            .first()
            .is_none_or(|goals| self.index + 1 >= goals.len());
        for i in 0..robots.min(demands.len()).min(self.robots.len()) {
            let robot = &observation.robots[i];
            if !robot.pose.is_finite() {
                demands[i].finished = self.robots[i].finished;
                continue;
            }
            let here = [robot.pose.x_m, robot.pose.y_m];
            let (way, forward, finished) = if i == 0 {
                let goals = observation.targets.first().map_or(&[][..], Vec::as_slice);
                let (way, finished) = self.leader(here, goals, parameters);
                (way, [0.0, 0.0], finished)
            } else {
                let Some((place, velocity)) = self.place_behind(i - 1, here, observation) else {
                    continue;
                };
                let way = sub(place, here);
                let reach_m = FOLLOWER_REACH * parameters.get("reach_radius_m");
                let arrived = self.robots[i].arrival.update(length(way), reach_m);
                (way, velocity, before_finished && arrived)
            };
            let stands = before_finished;
            before_finished = finished;
            let most = if i == 0 { speed } else { CATCH_UP * speed };
            let drive = observation.bodies[i].drive;
            let wanted = clip(add(forward, scale(way, gain_per_s)), most);
            let progress = &mut self.robots[i];
            progress.finished = finished;
            let rests = finished && drive != Drive::Holonomic;
            let request = Request {
                velocity: if rests { [0.0, 0.0] } else { wanted },
                way: add(way, scale(forward, AHEAD_S)),
                yaw_rad: None,
                stops: if i == 0 { last_leg } else { stands },
            };
            demands[i] = Demand {
                twist: progress.driver.twist(drive, robot, &request, yaw_gain_per_s),
                target: add(here, way),
                segment: None,
                finished,
            };
        }
    }
}

impl LeaderFollower {
    /// Place behind robot `i` and its velocity, for a follower that is at `follower_m`.
    fn place_behind(
        &mut self,
        i: usize,
        follower_m: Vector,
        observation: &Observation<'_>,
    ) -> Option<(Vector, Vector)> {
        let robot = &observation.robots[i];
        if !robot.pose.is_finite() {
            return None;
        }
        let parameters = observation.parameters;
        let (distance_m, bearing_rad) = (parameters.get("distance_m"), parameters.get("bearing_rad"));
        let here = [robot.pose.x_m, robot.pose.y_m];
        let line = sub(here, follower_m);
        let trailer_rad = self.robots[i]
            .trailer_rad
            .get_or_insert(libm::atan2(line[1], line[0]) - bearing_rad);
        let twist = [robot.twist.forward_m_per_s, robot.twist.left_m_per_s];
        let finite = twist[0].is_finite() && twist[1].is_finite();
        let seen = if finite {
            world_from_body(twist, robot.pose.yaw_rad)
        } else {
            [0.0, 0.0]
        };
        let speed = length(seen);
        let (velocity, rate) = if speed < STILL_M_PER_S {
            ([0.0, 0.0], 0.0)
        } else {
            let off_rad = libm::atan2(seen[1], seen[0]) - *trailer_rad;
            (seen, speed * libm::sin(off_rad) / distance_m)
        };
        *trailer_rad = wrap(*trailer_rad + rate * TICK_S);
        let [c, s] = heading(*trailer_rad + bearing_rad);
        let place = sub(here, scale([c, s], distance_m));
        Some((place, add(velocity, scale([s, -c], distance_m * rate))))
    }
}

pub(super) fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let robots = &scenario.robots;
    let mut problems = Vec::new();
    if robots.len() < 2 {
        problems.push(FieldProblem {
            field: "robots".into(),
            message: "the leader has no follower".into(),
            limit: "at least 2 robots".into(),
            remedy: "add a robot, or use the law waypoints".into(),
        });
    }
    let distance_m = Parameters::of(&scenario.experiment.control).get("distance_m");
    let radii = robots
        .windows(2)
        .map(|two| two[0].bounding_radius_m + two[1].bounding_radius_m);
    let least_m = radii.fold(0.0, f64::max) + GAP_M.max(MIN_START_GAP_M);
    if robots.len() > 1 && distance_m < least_m {
        problems.push(FieldProblem {
            field: "control.parameters.distance_m".into(),
            message: format!("robots {distance_m} m behind each other would touch"),
            limit: format!("at least {least_m:.3} m for these robots"),
            remedy: "choose a larger distance".into(),
        });
    }
    problems
}
