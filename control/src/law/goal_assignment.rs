//! `goal_assignment`: the team shares its goals out and drives to them on straight lines at the same pace.
//!
//! The assignment makes the sum of squared distances least; then, with all robots driving x_i(t) = (1 - b(t)) s_i +
//! b(t) g_i and starts and goals at least 2 sqrt(2) R apart, no two robots of radius R meet
//!                                                        [Turpin, Michael and Kumar 2014, CAPT]
//! because every pair has (s_i - s_j) . (g_i - g_j) >= 0. The common pace b waits for the robot that is furthest behind.
//! Assigned anew from time to time, the squared distances that are left only go down (their D-CAPT).
//!
//! A car-like robot cannot stay on its line; it pursues its goal and relies on the safety filter.

use super::assignment::Assigner;
use super::driver::{Arrival, Driver, Request};
use super::parameters::{REACH_RADIUS, SPEED, YAW_GAIN};
use super::targets::{Owner, TargetRule, YawUse};
use super::{Demand, Drive, GOAL_ASSIGNMENT, Law, LawSpec, Observation, ParameterSpec};
use crate::scenario::{FieldProblem, MIN_START_GAP_M, Scenario};
use crate::vector::{Vector, add, clip, dot, length, scale, sub};
use crate::{TICK_RATE_HZ, TICK_S};

pub(super) const SPEC: LawSpec = LawSpec {
    name: GOAL_ASSIGNMENT,
    title: "Goal assignment: the team shares its goals out so that paths do not cross",
    source: "Turpin, Michael and Kumar 2014 (CAPT); Hungarian method, Kuhn 1955",
    targets: TargetRule {
        owner: Owner::Team,
        least: 1,
        most_each: 50,
        yaw: YawUse::Unused,
        apart: false,
        meaning: "Goals of the team, as many as robots; which robot takes which is the law's choice.",
    },
    parameters: &[
        SPEED,
        ParameterSpec::quantity(
            "tracking_gain_per_s",
            "1/s",
            [0.2, 2.0, 8.0],
            "Speed for each metre between robot and its point on the line.",
        ),
        ParameterSpec::quantity(
            "reassign_period_s",
            "s",
            [0.0, 2.0, 60.0],
            "Time after which the goals are shared out anew; 0 keeps the first assignment.",
        ),
        YAW_GAIN,
        REACH_RADIUS,
    ],
};

/// How fast the common pace rises.
const ACCELERATION_M_PER_S2: f64 = 0.4;
/// The pace waits when a robot is this far behind its point.
const LONGEST_LAG_M: f64 = 0.15;
/// A new assignment must be better by this share.
const GAIN_SHARE: f64 = 0.01;

#[derive(Debug)]
pub struct GoalAssignment {
    goals_m: Vec<Vector>,
    assigner: Assigner,
    goal_of: Vec<usize>,
    proposed: Vec<usize>,
    /// Where the lines begin; empty entries until the first tick.
    from_m: Vec<Vector>,
    drivers: Vec<Driver>,
    arrivals: Vec<Arrival>,
    begun: bool,
    /// `b`, 0 to 1.
    share: f64,
    speed_m_per_s: f64,
}

impl GoalAssignment {
    pub fn new(scenario: &Scenario) -> GoalAssignment {
        let n = scenario.experiment.robots.len();
        let targets = &scenario.experiment.targets;
        GoalAssignment {
            goals_m: targets.iter().take(n).map(|t| [t.x_m, t.y_m]).collect(),
            assigner: Assigner::new(n),
            goal_of: (0..n).collect(),
            proposed: vec![0; n],
            from_m: vec![[0.0, 0.0]; n],
            drivers: vec![Driver::default(); n],
            arrivals: vec![Arrival::default(); n],
            begun: false,
            share: 0.0,
            speed_m_per_s: 0.0,
        }
    }

    /// Shares the goals out from where the robots are, if that is better; all robots must be seen.
    fn assign(&mut self, observation: &Observation<'_>) {
        let n = self.goal_of.len();
        let all_seen = observation.robots.iter().all(|robot| robot.pose.is_finite());
        if observation.robots.len() != n || self.goals_m.len() != n || !all_seen {
            return;
        }
        let goals = &self.goals_m;
        let cost = |i: usize, k: usize| {
            let pose = &observation.robots[i].pose;
            let way = sub(goals[k], [pose.x_m, pose.y_m]);
            dot(way, way)
        };
        self.assigner.solve(cost, &mut self.proposed);
        let sum = |goal_of: &[usize]| goal_of.iter().enumerate().map(|(i, k)| cost(i, *k)).sum::<f64>();
        if self.begun && sum(&self.proposed) >= (1.0 - GAIN_SHARE) * sum(&self.goal_of) {
            return;
        }
        let (same, first) = (self.proposed == self.goal_of, !self.begun);
        if first || !same {
            self.begun = true;
            self.goal_of.copy_from_slice(&self.proposed);
            self.share = 0.0;
            self.speed_m_per_s = 0.0;
            for (from, robot) in self.from_m.iter_mut().zip(observation.robots) {
                *from = [robot.pose.x_m, robot.pose.y_m];
            }
        }
    }

    /// Moves the common pace on: limited by the longest line, the acceleration, the braking way and the slowest robot.
    fn advance(&mut self, observation: &Observation<'_>) {
        let (mut longest_m, mut lag_m) = (0.0_f64, 0.0_f64);
        for (i, robot) in observation.robots.iter().enumerate().take(self.goal_of.len()) {
            let line = sub(self.goals_m[self.goal_of[i]], self.from_m[i]);
            longest_m = longest_m.max(length(line));
            let follows = !matches!(observation.bodies[i].drive, Drive::Steered { .. });
            if follows && robot.pose.is_finite() {
                lag_m = lag_m.max(length(sub(self.point(i), [robot.pose.x_m, robot.pose.y_m])));
            }
        }
        if longest_m < 1e-6 {
            self.share = 1.0;
            return;
        }
        let left_m = (1.0 - self.share) * longest_m;
        let waits = (2.0 - 2.0 * lag_m / LONGEST_LAG_M).clamp(0.0, 1.0);
        let fastest = (self.speed_m_per_s + ACCELERATION_M_PER_S2 * TICK_S)
            .min(observation.parameters.get("speed_m_per_s"))
            .min((2.0 * ACCELERATION_M_PER_S2 * left_m).sqrt());
        self.speed_m_per_s = fastest * waits;
        self.share = (self.share + self.speed_m_per_s * TICK_S / longest_m).min(1.0);
    }

    /// The point of robot `i` on its line.
    fn point(&self, i: usize) -> Vector {
        let (from, to) = (self.from_m[i], self.goals_m[self.goal_of[i]]);
        add(from, scale(sub(to, from), self.share))
    }
}

impl Law for GoalAssignment {
    fn name(&self) -> &'static str {
        GOAL_ASSIGNMENT
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let parameters = observation.parameters;
        let period = (parameters.get("reassign_period_s") * f64::from(TICK_RATE_HZ)) as u64;
        if !self.begun || (period > 0 && observation.tick.is_multiple_of(period)) {
            self.assign(observation);
        }
        if !self.begun || observation.bodies.len() < self.goal_of.len() {
            return;
        }
        self.advance(observation);
        let gain_per_s = parameters.get("tracking_gain_per_s");
        let speed = parameters.get("speed_m_per_s");
        for i in 0..self.goal_of.len().min(demands.len()).min(observation.robots.len()) {
            let robot = &observation.robots[i];
            let goal = self.goals_m[self.goal_of[i]];
            demands[i].target = self.point(i);
            if !robot.pose.is_finite() {
                continue;
            }
            let here = [robot.pose.x_m, robot.pose.y_m];
            let drive = observation.bodies[i].drive;
            let to_goal = sub(goal, here);
            let arrived = self.arrivals[i].update(length(to_goal), parameters.get("reach_radius_m"));
            let (way, velocity) = if matches!(drive, Drive::Steered { .. }) {
                (to_goal, clip(scale(to_goal, gain_per_s), speed))
            } else {
                self.along(i, here, gain_per_s, speed)
            };
            let rests = arrived && drive != Drive::Holonomic;
            let request = Request {
                velocity: if rests { [0.0, 0.0] } else { velocity },
                way,
                yaw_rad: None,
                stops: true,
            };
            demands[i] = Demand {
                twist: self.drivers[i].twist(drive, robot, &request, parameters.get("yaw_gain_per_s")),
                target: self.point(i),
                segment: None,
                finished: arrived,
            };
        }
    }
}

impl GoalAssignment {
    /// Way to the point on the line, and its velocity with feedback.
    fn along(&self, i: usize, here: Vector, gain_per_s: f64, speed: f64) -> (Vector, Vector) {
        let line = sub(self.goals_m[self.goal_of[i]], self.from_m[i]);
        let longest = |k: usize| length(sub(self.goals_m[self.goal_of[k]], self.from_m[k]));
        let longest_m = (0..self.goal_of.len()).map(longest).fold(0.0, f64::max);
        let moving = if longest_m > 1e-6 && self.share < 1.0 {
            scale(line, self.speed_m_per_s / longest_m)
        } else {
            [0.0, 0.0]
        };
        let off = sub(self.point(i), here);
        (
            add(off, scale(moving, 0.5)),
            clip(add(moving, scale(off, gain_per_s)), 1.25 * speed),
        )
    }
}

pub(super) fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let experiment = &scenario.experiment;
    let (n, goals) = (experiment.robots.len(), experiment.targets.len());
    if goals != n {
        return vec![FieldProblem {
            field: "targets".into(),
            message: format!("{goals} goals for {n} robots"),
            limit: format!("exactly {n} goals"),
            remedy: "give one goal for each robot; which takes which is decided by the law".into(),
        }];
    }
    // Any robot may come to any goal, so the largest counts.
    let largest_m = scenario
        .robots
        .iter()
        .map(|robot| robot.bounding_radius_m)
        .fold(0.0, f64::max);
    let least_m = 2.0 * largest_m + MIN_START_GAP_M;
    let mut problems = Vec::new();
    for (j, second) in experiment.targets.iter().enumerate() {
        for (i, first) in experiment.targets.iter().enumerate().take(j) {
            let apart_m = length(sub([first.x_m, first.y_m], [second.x_m, second.y_m]));
            if apart_m < least_m {
                problems.push(FieldProblem {
                    field: format!("targets[{j}]"),
                    message: format!("goals {} and {} are {apart_m:.3} m apart", i + 1, j + 1),
                    limit: format!("at least {least_m:.3} m between two goals"),
                    remedy: "move one of the two goals".into(),
                });
            }
        }
    }
    problems
}
