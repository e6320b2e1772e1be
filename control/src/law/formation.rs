//! `formation`: the robots make a shape without a leader; where it stands follows from where they started.
//!
//! v_i = k sum_j a_ij ((x_j - d_j) - (x_i - d_i))        [Ren, Beard and Atkins 2007, consensus on x_i - d_i]
//!
//! with d_i the place of robot i in the shape, so the mean of the team stays where it is and the error decays like that
//! of consensus. When the shape may turn, d_i is turned by the angle that makes the squared error least,
//! tan a = sum d x (x - c) / sum d . (x - c)              [Kabsch 1976, in the plane]
//!
//! Robots that cannot move sideways at once would chase each other's detours, so a car-like robot agrees by a reference
//! point x_i that moves as above from where it started, and drives to the place of that.
//!
//! Robots take the places of a line, circle or wedge by the optimal assignment at the start.

use super::driver::{Arrival, Driver, Request};
use super::graph::Graph;
use super::parameters::{GRAPH, KEEP_RIGHT, REACH_RADIUS, SPEED, YAW_GAIN};
use super::targets::{Owner, TargetRule, YawUse};
use super::{Demand, Drive, FORMATION, Law, LawSpec, Observation, ParameterSpec, Parameters, circulation, shape};
use crate::TICK_S;
use crate::scenario::Scenario;
use crate::vector::{Vector, add, clip, dot, length, scale, sub, world_from_body};

pub(super) const SPEC: LawSpec = LawSpec {
    name: FORMATION,
    title: "Formation: the robots make a shape without a leader",
    source: "Ren, Beard and Atkins 2007 (consensus on offsets); Kabsch 1976 for the turn of the shape",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 0,
        most_each: 1,
        yaw: YawUse::Unused,
        apart: true,
        meaning: "With the shape given: one for each robot, its place in the shape; only the differences between them matter. Otherwise none.",
    },
    parameters: &[
        ParameterSpec::choice("shape", shape::SHAPES, "The shape; given takes the targets."),
        ParameterSpec::quantity(
            "spacing_m",
            "m",
            [0.1, 0.75, 3.0],
            "Distance between neighbours in a line, circle or wedge.",
        ),
        ParameterSpec::quantity(
            "turn_rad",
            "rad",
            [-3.2, 0.0, 3.2],
            "Turn of the shape: a line lies along x, a wedge points along x.",
        ),
        ParameterSpec::choice(
            "rotation",
            &["fixed", "free"],
            "Free lets the shape turn to where the robots are nearest to it.",
        ),
        GRAPH,
        ParameterSpec::quantity(
            "formation_gain_per_s",
            "1/s",
            [0.05, 0.5, 3.0],
            "k: speed for each metre of difference to each neighbour.",
        ),
        SPEED,
        KEEP_RIGHT,
        YAW_GAIN,
        REACH_RADIUS,
    ],
};

#[derive(Debug)]
pub struct Formation {
    graph: Graph,
    /// Place of each robot in the shape, about the mean of all.
    offsets_m: Vec<Vector>,
    /// The same, turned as the robots are now.
    turned_m: Vec<Vector>,
    drivers: Vec<Driver>,
    arrivals: Vec<Arrival>,
    /// `x_i`: where each robot is, or the reference point of a car-like one; `None` until it has been seen.
    known_m: Vec<Option<Vector>>,
    /// Sum of the differences that each robot sees.
    pulls_m: Vec<Vector>,
    /// From each robot to its place about the mean of the team.
    ways_m: Vec<Vector>,
}

impl Formation {
    pub fn new(scenario: &Scenario) -> Formation {
        let parameters = Parameters::of(&scenario.experiment.control);
        let offsets_m = shape::offsets(scenario, &parameters);
        Formation {
            graph: Graph::of(parameters.choice("graph")),
            turned_m: offsets_m.clone(),
            drivers: vec![Driver::default(); offsets_m.len()],
            known_m: vec![None; offsets_m.len()],
            arrivals: vec![Arrival::default(); offsets_m.len()],
            pulls_m: vec![[0.0, 0.0]; offsets_m.len()],
            ways_m: vec![[0.0, 0.0]; offsets_m.len()],
            offsets_m,
        }
    }

    /// Sum of the differences that robot `i` sees, and the way to its place about the mean of the team.
    fn pull(&self, i: usize) -> (Vector, Vector) {
        let Some(own) = self.known_m[i] else {
            return ([0.0, 0.0], [0.0, 0.0]);
        };
        let (mut sum, mut all, mut count) = ([0.0, 0.0], [0.0, 0.0], 1.0);
        for (j, other) in self.known_m.iter().enumerate().filter(|(j, _)| *j != i) {
            let Some(other) = other else { continue };
            let wanted = sub(self.turned_m[i], self.turned_m[j]);
            let way = add(sub(*other, own), wanted);
            all = add(all, way);
            count += 1.0;
            if self.graph.links(i, j, self.known_m.len()) {
                sum = add(sum, way);
            }
        }
        (sum, scale(all, 1.0 / count))
    }

    /// Takes in where the robots are.
    fn look(&mut self, observation: &Observation<'_>) {
        let seen = observation.robots.iter().zip(observation.bodies);
        for (known, (robot, body)) in self.known_m.iter_mut().zip(seen) {
            let here = robot.pose.is_finite().then_some([robot.pose.x_m, robot.pose.y_m]);
            *known = match body.drive {
                Drive::Steered { .. } => known.or(here),
                _ => here,
            };
        }
    }

    fn turn(&mut self, observation: &Observation<'_>) {
        if observation.parameters.choice("rotation") == 0 {
            return;
        }
        let seen = |i: usize| self.known_m[i];
        let (mut middle, mut place, mut count) = ([0.0, 0.0], [0.0, 0.0], 0.0);
        for (i, offset) in self.offsets_m.iter().enumerate() {
            if let Some(here) = seen(i) {
                middle = add(middle, here);
                place = add(place, *offset);
                count += 1.0;
            }
        }
        if count < 2.0 {
            return;
        }
        let (middle, place) = (scale(middle, 1.0 / count), scale(place, 1.0 / count));
        let (mut along, mut across) = (0.0, 0.0);
        for (i, offset) in self.offsets_m.iter().enumerate() {
            if let Some(here) = seen(i) {
                let (d, x) = (sub(*offset, place), sub(here, middle));
                along += dot(d, x);
                across += d[0] * x[1] - d[1] * x[0];
            }
        }
        let turn_rad = libm::atan2(across, along);
        for (turned, offset) in self.turned_m.iter_mut().zip(&self.offsets_m) {
            *turned = world_from_body(*offset, turn_rad);
        }
    }
}

impl Law for Formation {
    fn name(&self) -> &'static str {
        FORMATION
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        self.look(observation);
        self.turn(observation);
        let parameters = observation.parameters;
        let robots = observation.robots.len().min(observation.bodies.len());
        let count = robots.min(demands.len()).min(self.drivers.len());
        let mut largest_m = 0.0_f64;
        for i in 0..count {
            (self.pulls_m[i], self.ways_m[i]) = self.pull(i);
            largest_m = largest_m.max(length(self.pulls_m[i]));
        }
        // One factor for all, so that the mean of the team stays where it is.
        let gain_per_s = parameters.get("formation_gain_per_s");
        let gain_per_s = gain_per_s.min(parameters.get("speed_m_per_s") / largest_m.max(1e-9));
        for (i, demand) in demands.iter_mut().enumerate().take(count) {
            let robot = &observation.robots[i];
            if !robot.pose.is_finite() {
                continue;
            }
            let here = [robot.pose.x_m, robot.pose.y_m];
            let place = add(self.known_m[i].unwrap_or(here), self.ways_m[i]);
            let way = sub(place, here);
            let finished = self.arrivals[i].update(length(way), parameters.get("reach_radius_m"));
            let drive = observation.bodies[i].drive;
            let straight = match (drive, &mut self.known_m[i]) {
                (Drive::Steered { .. }, Some(reference)) => {
                    *reference = add(*reference, scale(self.pulls_m[i], gain_per_s * TICK_S));
                    let pace_per_s = parameters.get("formation_gain_per_s") * count as f64;
                    clip(scale(way, pace_per_s), parameters.get("speed_m_per_s"))
                }
                _ => scale(self.pulls_m[i], gain_per_s),
            };
            let keep_right = parameters.get("keep_right");
            let velocity = circulation::keep_right(straight, i, place, keep_right, observation);
            let rests = finished && drive != Drive::Holonomic;
            let request = Request {
                velocity: if rests { [0.0, 0.0] } else { velocity },
                way,
                yaw_rad: None,
                stops: true,
            };
            *demand = Demand {
                twist: self.drivers[i].twist(drive, robot, &request, parameters.get("yaw_gain_per_s")),
                target: place,
                segment: None,
                finished,
            };
        }
    }
}
