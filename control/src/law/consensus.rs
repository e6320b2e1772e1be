//! `consensus`: the robots agree on a place, or on one coordinate of it.
//!
//! v_i = k sum_j a_ij (x_j - x_i)                        [Olfati-Saber, Fax and Murray 2007, linear consensus protocol]
//!
//! On a connected graph the values go to their mean, and the disagreement decays at least as exp(-k lambda_2 t) with
//! lambda_2 the second eigenvalue of the graph's Laplacian. With a leader, which listens to nobody, they go to its value.
//! A car-like robot agrees on a coordinate by a reference point that moves as above from where it started, and drives to
//! it: others need not follow its detours.
//! Bodies cannot be in one place: a difference is shortened by the distance at which two robots count as together, nobody
//! pushes into a robot that is that close, and the team has gathered when pairs that are together connect all of it.

use super::driver::{Arrival, Driver, Request};
use super::graph::Graph;
use super::parameters::{GRAPH, KEEP_RIGHT, SPEED, YAW_GAIN};
use super::targets::{Owner, TargetRule, YawUse};
use super::{CONSENSUS, Demand, Drive, Law, LawSpec, Observation, ParameterSpec, Parameters, circulation};
use crate::TICK_S;
use crate::scenario::{FieldProblem, Scenario};
use crate::vector::{Vector, add, clip, dot, length, scale, sub};

const VALUES: &[&str] = &["place", "x", "y"];

pub(super) const SPEC: LawSpec = LawSpec {
    name: CONSENSUS,
    title: "Consensus: the robots agree on a place or a coordinate, on its mean or on the leader's",
    source: "Olfati-Saber, Fax and Murray 2007, linear consensus protocol",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 0,
        most_each: 1,
        yaw: YawUse::Unused,
        apart: true,
        meaning: "Only the leader may have one: it drives there. Without a leader there are none.",
    },
    parameters: &[
        ParameterSpec::choice("value", VALUES, "What is agreed on."),
        GRAPH,
        ParameterSpec::quantity(
            "leader",
            "",
            [0.0, 0.0, 50.0],
            "Number of the leader in the order of the robots, from 1; 0 for the mean of all.",
        ),
        ParameterSpec::quantity(
            "consensus_gain_per_s",
            "1/s",
            [0.05, 0.4, 3.0],
            "k: speed for each metre of difference to each neighbour.",
        ),
        SPEED,
        ParameterSpec::quantity(
            "gap_m",
            "m",
            [0.0, 0.15, 2.0],
            "Two robots count as together when the gap between their bounding circles is this small (value place).",
        ),
        ParameterSpec::quantity(
            "reach_radius_m",
            "m",
            [0.005, 0.05, 0.5],
            "A robot is finished when the sum of its differences is this small.",
        ),
        KEEP_RIGHT,
        YAW_GAIN,
    ],
};

/// Speed of a car-like robot for each metre to its reference point.
const REFERENCE_GAIN_PER_S: f64 = 1.5;
/// A gap counts as closed this much above `gap_m`, and as opened again this much.
const GAP_SLACK_M: [f64; 2] = [0.02, 0.08];

#[derive(Debug)]
pub struct Consensus {
    graph: Graph,
    drivers: Vec<Driver>,
    /// Sum of the differences of each robot; the leader's way to its target.
    ways_m: Vec<Vector>,
    arrivals: Vec<Arrival>,
    /// Reference points of car-like robots that agree on a coordinate.
    references_m: Vec<Option<Vector>>,
    gathered: bool,
    /// Robots found from the first one by steps between robots that are together, in the order they were found.
    found: Vec<usize>,
    is_found: Vec<bool>,
}

impl Consensus {
    pub fn new(scenario: &Scenario) -> Consensus {
        let parameters = Parameters::of(&scenario.experiment.control);
        Consensus {
            graph: Graph::of(parameters.choice("graph")),
            drivers: vec![Driver::default(); scenario.experiment.robots.len()],
            ways_m: vec![[0.0, 0.0]; scenario.experiment.robots.len()],
            arrivals: vec![Arrival::default(); scenario.experiment.robots.len()],
            references_m: vec![None; scenario.experiment.robots.len()],
            gathered: false,
            found: Vec::with_capacity(scenario.experiment.robots.len()),
            is_found: vec![false; scenario.experiment.robots.len()],
        }
    }

    /// Whether pairs that are together connect the whole team.
    fn gathers(&mut self, observation: &Observation<'_>) -> bool {
        let n = self.is_found.len().min(observation.robots.len());
        let slack_m = GAP_SLACK_M[usize::from(self.gathered)];
        self.is_found.fill(false);
        self.found.clear();
        self.found.push(0);
        self.is_found[0] = true;
        let mut next = 0;
        while let Some(i) = self.found.get(next).copied() {
            next += 1;
            for j in 0..n {
                let near = |line: Vector| length(line) <= together_m(i, j, observation) + slack_m;
                if !self.is_found[j] && line(i, j, observation).is_some_and(near) {
                    self.is_found[j] = true;
                    self.found.push(j);
                }
            }
        }
        self.found.len() == n
    }

    /// Way and velocity of robot `i`; moves its reference point if it has one.
    fn onward(&mut self, i: usize, here: Vector, gain_per_s: f64, parameters: &Parameters) -> (Vector, Vector) {
        let (way, speed) = (self.ways_m[i], parameters.get("speed_m_per_s"));
        let Some(reference) = &mut self.references_m[i] else {
            return (way, clip(scale(way, gain_per_s), speed));
        };
        *reference = add(*reference, scale(way, gain_per_s * TICK_S));
        let to_reference = sub(*reference, here);
        (to_reference, clip(scale(to_reference, REFERENCE_GAIN_PER_S), speed))
    }

    /// Distance of robot `i` from its reference point.
    fn lag_m(&self, i: usize, here: Vector) -> f64 {
        self.references_m[i].map_or(0.0, |at| length(sub(at, here)))
    }

    fn way(&self, i: usize, leader: usize, observation: &Observation<'_>) -> Vector {
        let pose = &observation.robots[i].pose;
        if !pose.is_finite() {
            return [0.0, 0.0];
        }
        if leader == i + 1 {
            let goal = observation.targets.get(i).and_then(|goals| goals.first());
            return goal.map_or([0.0, 0.0], |goal| sub(goal.place_m, [pose.x_m, pose.y_m]));
        }
        let pull = self.pull(i, observation);
        if observation.parameters.choice("value") == 0 {
            unblocked(pull, i, observation)
        } else {
            pull
        }
    }

    /// Sum of the differences that robot `i` sees.
    fn pull(&self, i: usize, observation: &Observation<'_>) -> Vector {
        let n = observation.robots.len();
        let value = observation.parameters.choice("value");
        let mut sum = [0.0, 0.0];
        for j in (0..n).filter(|j| self.graph.links(i, *j, n)) {
            let Some(seen) = line(i, j, observation) else { continue };
            let ahead = |k: usize| {
                let pose = &observation.robots[k].pose;
                let here = [pose.x_m, pose.y_m];
                self.references_m
                    .get(k)
                    .copied()
                    .flatten()
                    .map_or([0.0, 0.0], |at| sub(at, here))
            };
            let line = sub(add(seen, ahead(j)), ahead(i));
            let part = match value {
                1 => [line[0], 0.0],
                2 => [0.0, line[1]],
                _ => {
                    let (far_m, together_m) = (length(line), together_m(i, j, observation));
                    scale(
                        line,
                        if far_m > together_m {
                            1.0 - together_m / far_m
                        } else {
                            0.0
                        },
                    )
                }
            };
            sum = add(sum, part);
        }
        sum
    }
}

/// From robot `i` to robot `j`.
fn line(i: usize, j: usize, observation: &Observation<'_>) -> Option<Vector> {
    let (own, other) = (&observation.robots[i].pose, &observation.robots[j].pose);
    (own.is_finite() && other.is_finite()).then(|| sub([other.x_m, other.y_m], [own.x_m, own.y_m]))
}

/// Distance of the centres at which two robots count as together.
fn together_m(i: usize, j: usize, observation: &Observation<'_>) -> f64 {
    let radii_m = observation.bodies[i].bounding_radius_m + observation.bodies[j].bounding_radius_m;
    radii_m + observation.parameters.get("gap_m")
}

/// `pull` without the part that would push into robots that are already together with `i`.
fn unblocked(mut pull: Vector, i: usize, observation: &Observation<'_>) -> Vector {
    for _ in 0..2 {
        for j in (0..observation.robots.len()).filter(|j| *j != i) {
            let Some(line) = line(i, j, observation) else { continue };
            let far_m = length(line);
            let into = dot(pull, line);
            if far_m <= together_m(i, j, observation) && far_m > 0.0 && into > 0.0 {
                pull = sub(pull, scale(line, into / (far_m * far_m)));
            }
        }
    }
    pull
}

impl Law for Consensus {
    fn name(&self) -> &'static str {
        CONSENSUS
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let parameters = observation.parameters;
        let leader = parameters.get("leader") as usize;
        let robots = observation.robots.len().min(observation.bodies.len());
        let count = robots.min(demands.len()).min(self.drivers.len());
        for i in 0..count {
            let pose = &observation.robots[i].pose;
            let refers = parameters.choice("value") != 0
                && leader != i + 1
                && matches!(observation.bodies[i].drive, Drive::Steered { .. });
            if refers && pose.is_finite() {
                self.references_m[i].get_or_insert([pose.x_m, pose.y_m]);
            }
        }
        let mut largest_m = 0.0_f64;
        for i in 0..count {
            self.ways_m[i] = self.way(i, leader, observation);
            if leader != i + 1 {
                largest_m = largest_m.max(length(self.ways_m[i]));
            }
        }
        let place = parameters.choice("value") == 0;
        let reach_m = parameters.get("reach_radius_m");
        let leads = leader.checked_sub(1).and_then(|k| self.ways_m.get(k));
        let led = leads.is_none_or(|way| length(*way) <= 2.0 * reach_m);
        self.gathered = place && led && self.gathers(observation);
        // One factor for all, so that the mean of the team stays where it is.
        let speed = parameters.get("speed_m_per_s");
        let gain_per_s = parameters.get("consensus_gain_per_s").min(speed / largest_m.max(1e-9));
        for (i, demand) in demands.iter_mut().enumerate().take(count) {
            let robot = &observation.robots[i];
            if !robot.pose.is_finite() {
                continue;
            }
            let here = [robot.pose.x_m, robot.pose.y_m];
            let (way, straight) = self.onward(i, here, gain_per_s, parameters);
            let left_m = if leader == i + 1 {
                length(way)
            } else {
                length(self.ways_m[i]).max(self.lag_m(i, here))
            };
            let finished = self.gathered || self.arrivals[i].update(left_m, reach_m);
            let goal = add(here, way);
            let velocity = if place {
                straight
            } else {
                circulation::keep_right(straight, i, goal, parameters.get("keep_right"), observation)
            };
            let drive = observation.bodies[i].drive;
            let rests = self.gathered || (finished && drive != Drive::Holonomic);
            let request = Request {
                velocity: if rests { [0.0, 0.0] } else { velocity },
                way,
                yaw_rad: None,
                stops: !place,
            };
            *demand = Demand {
                twist: self.drivers[i].twist(drive, robot, &request, parameters.get("yaw_gain_per_s")),
                target: add(here, clip(way, 1.0)),
                segment: None,
                finished,
            };
        }
    }
}

pub(super) fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let robots = &scenario.experiment.robots;
    let parameters = Parameters::of(&scenario.experiment.control);
    let leader = parameters.get("leader");
    let mut problems = Vec::new();
    if robots.len() < 2 {
        problems.push(FieldProblem {
            field: "robots".into(),
            message: "one robot has nobody to agree with".into(),
            limit: "at least 2 robots".into(),
            remedy: "add a robot, or use the law go_to_point".into(),
        });
    }
    if leader.fract() != 0.0 || leader > robots.len() as f64 {
        problems.push(FieldProblem {
            field: "control.parameters.leader".into(),
            message: format!("there is no robot number {leader}"),
            limit: format!("whole numbers from 0 (no leader) to {}", robots.len()),
            remedy: "give the number of a robot of the experiment, from 1".into(),
        });
    }
    for (t, target) in scenario.experiment.targets.iter().enumerate() {
        let of = |name: &String| robots.iter().position(|robot| robot.name == *name);
        let owner = target.robot.as_ref().and_then(of).unwrap_or(0);
        if leader != owner as f64 + 1.0 {
            problems.push(FieldProblem {
                field: format!("targets[{t}].robot"),
                message: format!("{} is not the leader and takes no target", robots[owner].name),
                limit: "a target of the leader only".into(),
                remedy: "leave the target out, or choose its robot as leader".into(),
            });
        }
    }
    problems
}
