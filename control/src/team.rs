//! A law, the acceleration limit and the safety filter for one experiment: the same code in the browser's twin, the
//! service and the laboratory.

use twin::robot::Robot;
use twin::twist::BodyTwist;

use crate::TICK_S;
use crate::answer::{Answer, assumed_latency_s};
use crate::interaction::{Interaction, Settings, TURNS};
pub use crate::law::RobotObservation;
use crate::law::{self, Body, Demand, Drive, Fault, Goal, Law, Note, Observation, Parameters, Standing};
use crate::prediction::Predictor;
use crate::rehearsal::modelled;
use crate::safety::{Deadlock, FilterBody, Filtered, Geofence, Intervention, Limits, SafeCommand, SafetyFilter};
use crate::scenario::{FieldProblem, Scenario};
use crate::vector::{add, clip, sub};

/// Fastest change of the commanded body velocity that is not a safety stop.
pub const ACCELERATION_M_PER_S2: f64 = 1.5;
/// Fastest change of the commanded yaw rate.
pub const YAW_ACCELERATION_RAD_PER_S2: f64 = 8.0;
/// The team is done when all robots have been finished for this long.
pub const REST_TICKS: u64 = crate::TICK_RATE_HZ as u64;

/// What the team decided for one robot on one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TeamOutput {
    /// The only thing that may be sent to the robot.
    pub safe: SafeCommand,
    /// What the law wanted.
    pub desired: BodyTwist,
    /// Moving reference point or goal, `[x_m, y_m]`.
    pub target: [f64; 2],
    /// What the safety filter changed.
    pub intervention: Option<Intervention>,
    /// The robot has reached the last of its targets.
    pub finished: bool,
    /// Active segment of the robot's path; see [`law::path_error_m`].
    pub segment: Option<[[f64; 2]; 2]>,
}

/// Control of all robots of one experiment.
#[derive(Debug)]
pub struct Team {
    law: Box<dyn Law>,
    parameters: Parameters,
    bodies: Vec<Body>,
    arena_m: [f64; 2],
    targets: Vec<Vec<Goal>>,
    filter: SafetyFilter,
    predictors: Vec<Predictor>,
    /// Of the robots as described.
    described: Vec<Answer>,
    /// By robot; empty without correction.
    interactions: Vec<Interaction>,
    /// The law sees what was measured, and nothing is learnt.
    feedback_alone: bool,
    /// What the law sees.
    seen: Vec<RobotObservation>,
    demands: Vec<Demand>,
    wanted: Vec<BodyTwist>,
    intended: Vec<BodyTwist>,
    outputs: Vec<TeamOutput>,
    tick: u64,
    rest_ticks: u64,
}

impl Team {
    /// Control for a scenario that passes its checks; with the interaction where its experiment asks for it, by the model versions
    /// of its robots.
    pub fn new(scenario: &Scenario) -> Result<Team, Vec<FieldProblem>> {
        let problems = scenario.check();
        if !problems.is_empty() {
            return Err(problems);
        }
        let law = law::build(scenario).ok_or_else(|| vec![no_law(&scenario.experiment.control.law)])?;
        Team::corrected(scenario, law)
    }

    /// [`Team::with_law`], with the interaction where the experiment asks for it.
    pub fn corrected(scenario: &Scenario, law: Box<dyn Law>) -> Result<Team, Vec<FieldProblem>> {
        let team = Team::with_law(scenario, law)?;
        match scenario.interaction() {
            Some(settings) => Ok(team.with_interaction(&modelled(scenario)?, settings)),
            None => Ok(team),
        }
    }

    /// Control for a scenario with a law of one's own in place of the one it names; other rules are not checked.
    pub fn with_law(scenario: &Scenario, law: Box<dyn Law>) -> Result<Team, Vec<FieldProblem>> {
        let robots = robots(scenario)?;
        let arena_m = [scenario.arena.width_m, scenario.arena.height_m];
        let radii = scenario.robots.iter().map(|robot| robot.bounding_radius_m);
        let bodies = law::bodies(scenario, &robots);
        let limits = Limits::default();
        let described: Vec<Answer> = robots.iter().map(Answer::of).collect();
        let answers = robots.iter().zip(&described);
        let latencies_s: Vec<f64> = answers
            .map(|(robot, answer)| assumed_latency_s(robot, answer, &limits))
            .collect();
        let filter_bodies = robots
            .into_iter()
            .zip(radii)
            .map(|(robot, bounding_radius_m)| FilterBody {
                robot,
                bounding_radius_m,
            });
        let contents = &scenario.arena.contents;
        let mut filter = SafetyFilter::new(limits, arena_m, filter_bodies.collect()).with_contents(contents);
        if let Some(fence) = Geofence::of(contents).map_err(|problem| vec![problem])? {
            filter = filter.with_geofence(fence);
        }
        for (place, latency_s) in latencies_s.into_iter().enumerate() {
            filter.set_latency_s(place, latency_s);
        }
        let outputs = filter
            .stop()
            .iter()
            .map(|stop| output(stop, &Demand::default()))
            .collect();
        Ok(Team {
            law,
            arena_m,
            parameters: Parameters::of(&scenario.experiment.control),
            targets: law::goals(scenario),
            filter,
            predictors: bodies.iter().map(|body| Predictor::new(axle_x_m(body.drive))).collect(),
            described,
            interactions: Vec::new(),
            feedback_alone: scenario.experiment.control.feedback_alone,
            seen: Vec::with_capacity(bodies.len()),
            demands: vec![Demand::default(); bodies.len()],
            wanted: vec![BodyTwist::default(); bodies.len()],
            intended: vec![BodyTwist::default(); bodies.len()],
            bodies,
            outputs,
            tick: 0,
            rest_ticks: 0,
        })
    }

    /// One control tick: observations as measured, in the order of the experiment's robots; outputs in the same order.
    ///
    /// Missing observations count as robots that are offline.
    pub fn tick(&mut self, observations: &[RobotObservation]) -> &[TeamOutput] {
        if observations.len() != self.bodies.len() {
            return self.stop_all();
        }
        self.demands.fill(Demand::default());
        self.seen.clear();
        let predicted = self.predictors.iter_mut().zip(observations);
        self.seen
            .extend(predicted.map(|(predictor, seen)| predictor.predict(seen)));
        let corrected = self.interactions.iter_mut().zip(&self.predictors).zip(observations);
        for (slot, ((interaction, predictor), seen)) in self.seen.iter_mut().zip(corrected) {
            if let Some(ideal) = interaction.observe(seen, predictor.answer()) {
                *slot = ideal;
            }
        }
        let observation = Observation {
            arena_m: self.arena_m,
            tick: self.tick,
            robots: &self.seen,
            bodies: &self.bodies,
            targets: &self.targets,
            parameters: &self.parameters,
        };
        self.law.step(&observation, &mut self.demands);
        match self.law.standing() {
            Standing::Answered => {}
            Standing::Late => return self.missed_tick(observations),
            Standing::Faulty(_) => {
                self.tick += 1;
                return self.stop_all();
            }
        }
        let wishes = self.demands.iter().zip(&self.predictors).zip(&self.outputs);
        for (wanted, ((demand, predictor), last)) in self.wanted.iter_mut().zip(wishes) {
            *wanted = accelerated(&last.safe.twist(), &predictor.command(&demand.twist));
        }
        let corrected = self.interactions.iter_mut().zip(&self.demands).zip(&self.outputs);
        for (place, (wanted, ((interaction, demand), last))) in (0..).zip(self.wanted.iter_mut().zip(corrected)) {
            let turn = (self.tick + place).is_multiple_of(TURNS);
            if let Some(command) = interaction.command(&demand.twist, turn) {
                *wanted = accelerated(&last.safe.twist(), &command);
            }
        }
        for (intended, demand) in self.intended.iter_mut().zip(&self.demands) {
            *intended = demand.twist;
        }
        let filtered = self.filter.apply_towards(observations, &self.wanted, &self.intended);
        for ((out, filtered), demand) in self.outputs.iter_mut().zip(filtered).zip(&self.demands) {
            *out = output(filtered, demand);
        }
        self.note_sent();
        let rests = self.outputs.iter().all(|out| out.finished);
        self.rest_ticks = if rests { self.rest_ticks + 1 } else { 0 };
        self.tick += 1;
        &self.outputs
    }

    /// Stop commands for all robots, in order.
    pub fn stop(&mut self) -> Vec<SafeCommand> {
        self.stop_all().iter().map(|out| out.safe).collect()
    }

    /// Commands for a tick whose deadline has passed: those of the tick before, decelerated; from the second in a row
    /// on, stop. The law is not asked. Robots that are not seen well enough to be driven stop at once.
    pub fn missed_tick(&mut self, observations: &[RobotObservation]) -> &[TeamOutput] {
        for (out, late) in self.outputs.iter_mut().zip(self.filter.missed_tick(observations)) {
            out.safe = late.command;
            out.intervention = late.intervention;
        }
        self.interactions.iter_mut().for_each(Interaction::doubt);
        self.note_sent();
        self.tick += 1;
        &self.outputs
    }

    /// Lets the law see where a robot will be when the command of this tick takes effect, in place of the pose as it was
    /// measured; off until then, with `None`, and in experiments that ask for feedback alone. The safety filter goes on with what
    /// was measured.
    ///
    /// - `answer`: delay of link and robot, s.
    pub fn set_answer(&mut self, robot: usize, answer: Option<Answer>) {
        if let Some(predictor) = self.predictors.get_mut(robot) {
            predictor.set_answer(answer.filter(|_| !self.feedback_alone));
        }
    }

    /// [`Self::set_answer`] for all robots, with the answers that they have by their descriptions.
    pub fn look_ahead_as_described(&mut self) {
        for (predictor, answer) in self.predictors.iter_mut().zip(&self.described) {
            predictor.set_answer(Some(*answer).filter(|_| !self.feedback_alone));
        }
    }

    /// Lets the team learn during the run how much of the yaw rate that it is told each robot turns, and tell it accordingly
    /// more, ahead of acceleration limit and safety filter ([`crate::effectiveness`]); off until then, and while a robot's answer is not known ([`Self::set_answer`]).
    /// Experiments that ask for feedback alone are left as they are, and so are
    /// robots that steer: their arcs follow from the steering angle, not from what the wheels push.
    #[must_use]
    pub fn learning(mut self) -> Team {
        if self.feedback_alone {
            return self;
        }
        for (predictor, body) in self.predictors.iter_mut().zip(&self.bodies) {
            if !matches!(body.drive, Drive::Steered { .. }) {
                *predictor = Predictor::new(axle_x_m(body.drive)).learning();
            }
        }
        self
    }

    /// Takes [`Self::learning`] back.
    #[must_use]
    pub fn without_learning(mut self) -> Team {
        for (predictor, body) in self.predictors.iter_mut().zip(&self.bodies) {
            *predictor = Predictor::new(axle_x_m(body.drive));
        }
        self
    }

    /// Corrects the commands of all robots by models of them ([`crate::interaction`]); off until then, and while a robot's answer
    /// is not known ([`Self::set_answer`]).
    ///
    /// - `models`: in the order of the experiment's robots; robots beyond their number are not corrected.
    #[must_use]
    pub fn with_interaction(mut self, models: &[Robot], settings: Settings) -> Team {
        let robots = models.iter().zip(&mut self.bodies);
        self.interactions = robots
            .map(|(model, body)| {
                let interaction = Interaction::new(model, body.drive, settings);
                body.turn_point_x_m = match body.drive {
                    Drive::TurnInPlace { .. } => interaction.point_x_m(),
                    _ => 0.0,
                };
                interaction
            })
            .collect();
        self
    }

    /// The corrections, in the order of the experiment's robots; empty without any.
    pub fn interactions(&self) -> &[Interaction] {
        &self.interactions
    }

    /// What the law saw on the last tick.
    pub fn seen(&self) -> &[RobotObservation] {
        &self.seen
    }

    /// The commands of this tick are on their way.
    fn note_sent(&mut self) {
        for (predictor, out) in self.predictors.iter_mut().zip(&self.outputs) {
            predictor.sent(&out.safe.twist());
        }
        for (interaction, out) in self.interactions.iter_mut().zip(&self.outputs) {
            interaction.sent(&out.safe, out.intervention.as_ref());
        }
    }

    /// Keeps all robots inside a region, besides the walls.
    pub fn with_geofence(mut self, fence: Geofence) -> Team {
        self.filter = self.filter.with_geofence(fence);
        self
    }

    /// Room for so many things that others move; see [`SafetyFilter::see_moving`].
    pub fn with_moving(mut self, most: usize) -> Team {
        self.filter = self.filter.with_moving(most);
        self
    }

    /// The filter, for what was measured: link delays, tracked obstacles and what others move.
    pub fn filter_mut(&mut self) -> &mut SafetyFilter {
        &mut self.filter
    }

    /// Robots that hold each other or did a moment ago; those that are given up will not move again by themselves.
    pub fn deadlocks(&self) -> impl Iterator<Item = Deadlock> + '_ {
        self.filter.deadlocks()
    }

    /// Robots hold each other and every attempt to resolve it has failed: the run should end.
    pub fn is_stuck(&self) -> bool {
        self.deadlocks().any(|deadlock| deadlock.given_up)
    }

    /// All robots have been finished for [`REST_TICKS`].
    pub fn is_done(&self) -> bool {
        self.rest_ticks >= REST_TICKS
    }

    /// Control ticks so far.
    pub fn ticks(&self) -> u64 {
        self.tick
    }

    /// Limits of the safety filter.
    pub fn limits(&self) -> &Limits {
        self.filter.limits()
    }

    /// Why the law will not answer again; the robots stop from then on.
    pub fn fault(&self) -> Option<&Fault> {
        match self.law.standing() {
            Standing::Faulty(fault) => Some(fault),
            Standing::Answered | Standing::Late => None,
        }
    }

    /// What the law said and drew on the last tick.
    pub fn notes(&self) -> &[Note] {
        self.law.notes()
    }

    /// Name of the law.
    pub fn law(&self) -> &'static str {
        self.law.name()
    }

    fn stop_all(&mut self) -> &[TeamOutput] {
        for (out, stop) in self.outputs.iter_mut().zip(self.filter.stop()) {
            out.safe = stop.command;
            out.intervention = stop.intervention;
        }
        self.interactions.iter_mut().for_each(Interaction::doubt);
        self.note_sent();
        &self.outputs
    }
}

/// Axle that cannot slide, ahead of the body origin.
fn axle_x_m(drive: Drive) -> f64 {
    match drive {
        Drive::Steered { axle_x_m, .. } => axle_x_m,
        Drive::Holonomic | Drive::TurnInPlace { .. } => 0.0,
    }
}

/// The validated robots of a scenario.
pub fn robots(scenario: &Scenario) -> Result<Vec<Robot>, Vec<FieldProblem>> {
    let made = scenario.robots.iter().enumerate().map(|(i, robot)| {
        Robot::new(robot.description.clone()).map_err(|error| {
            let field = format!("laboratory.robots[{i}].description.{}", error.field);
            vec![FieldProblem {
                field,
                message: error.message,
                limit: error.limit,
                remedy: error.remedy,
            }]
        })
    });
    made.collect()
}

fn no_law(name: &str) -> FieldProblem {
    FieldProblem {
        field: "control.law".into(),
        message: format!("the control law {name:?} is not known"),
        limit: law::LAWS.iter().map(|spec| spec.name).collect::<Vec<_>>().join(", "),
        remedy: "choose one of these".into(),
    }
}

fn output(filtered: &Filtered, demand: &Demand) -> TeamOutput {
    TeamOutput {
        safe: filtered.command,
        desired: demand.twist,
        target: demand.target,
        intervention: filtered.intervention,
        finished: demand.finished,
        segment: demand.segment,
    }
}

/// `desired`, no further from the last command than the acceleration limits allow.
pub(crate) fn accelerated(last: &BodyTwist, desired: &BodyTwist) -> BodyTwist {
    let from = [last.forward_m_per_s, last.left_m_per_s];
    let change = clip(
        sub([desired.forward_m_per_s, desired.left_m_per_s], from),
        ACCELERATION_M_PER_S2 * TICK_S,
    );
    let [forward_m_per_s, left_m_per_s] = add(from, change);
    let turn = YAW_ACCELERATION_RAD_PER_S2 * TICK_S;
    let yaw_rate_rad_per_s =
        last.yaw_rate_rad_per_s + (desired.yaw_rate_rad_per_s - last.yaw_rate_rad_per_s).clamp(-turn, turn);
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}
