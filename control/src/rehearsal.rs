//! Rehearsal of an experiment: the team drives the twin, and what happens becomes a verdict and a replay.

use serde::Serialize;
use twin::free::RobotState;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::{Obstacle, ObstacleContact, World};

use crate::law::{Fault, Note, RobotObservation, path_error_m};
use crate::notebook::Notebook;
use crate::scenario::{FieldProblem, Scenario};
use crate::team::{Team, TeamOutput, robots};
use crate::verdict::{Finding, REPLAY_FORMAT, Replay, ReplayRobot, Severity, VERDICT_FORMAT, Verdict, sentence};
use crate::{TICK_RATE_HZ, TICK_S};

/// Control ticks between two frames of a replay (30 Hz).
pub const FRAME_TICKS: u64 = 4;
/// Age of the poses that the team sees, as in the laboratory: exposure, detection and arrival.
pub const POSE_AGE_TICKS: usize = 2;
/// Half width of the band around the path (30 px of the paper).
pub const PATH_BAND_M: f64 = 0.075;
/// Most findings of one kind in a verdict.
const MAX_FINDINGS_PER_CODE: usize = 20;

/// A picture of all robots at one tick.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Frame {
    pub tick: u64,
    pub time_s: f64,
    pub robots: Vec<FrameRobot>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameRobot {
    /// `[x_m, y_m, yaw_rad]`.
    pub pose: [f64; 3],
    /// `[x_m, y_m]`.
    pub target: [f64; 2],
    /// What the safety filter changed: `wall`, `robot`, `speed`, `stop`, or nothing.
    pub safety: Option<&'static str>,
}

/// Verdict and replay of a rehearsal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    pub verdict: Verdict,
    pub replay: Replay,
}

/// A running rehearsal; see [`Rehearsal::step`].
#[derive(Debug)]
pub struct Rehearsal {
    names: Vec<String>,
    team: Team,
    world: World,
    ticks: u64,
    /// Poses and twists of the last ticks, newest last.
    seen: [Vec<RobotObservation>; POSE_AGE_TICKS + 1],
    commands: Vec<twin::command::WheelCommand>,
    outputs: Vec<TeamOutput>,
    findings: Vec<Finding>,
    contacts: Vec<(u32, Option<u32>)>,
    obstacle_contacts: Vec<ObstacleContact>,
    smallest_separation_m: Option<f64>,
    smallest_wall_distance_m: f64,
    /// Largest path error so far: value, time, robot.
    path_error: Option<(f64, f64, usize)>,
    replay: Vec<ReplayRobot>,
    notebook: Notebook,
    broken: bool,
    stuck: bool,
    faulty: bool,
}

/// Rehearses a scenario from start to end.
pub fn rehearse_json(scenario_json: &str) -> Result<Outcome, Vec<FieldProblem>> {
    let mut rehearsal = Rehearsal::new(&Scenario::from_json(scenario_json)?)?;
    while rehearsal.step() {}
    Ok(rehearsal.finish())
}

impl Rehearsal {
    /// Sets up team and world; problems name their field.
    pub fn new(scenario: &Scenario) -> Result<Rehearsal, Vec<FieldProblem>> {
        Rehearsal::with_team(scenario, Team::new(scenario)?)
    }

    /// A rehearsal with a team of one's own. Its law sees predicted poses, as in the laboratory: with the answers that the
    /// robots have by their descriptions, since nothing has been measured.
    pub fn with_team(scenario: &Scenario, mut team: Team) -> Result<Rehearsal, Vec<FieldProblem>> {
        let world = world(scenario)?;
        team.look_ahead_as_described();
        let names: Vec<String> = scenario
            .experiment
            .robots
            .iter()
            .map(|robot| robot.name.clone())
            .collect();
        let n = names.len();
        let first = observe(&world, n, 0.0);
        let replay = names
            .iter()
            .map(|name| ReplayRobot {
                name: name.clone(),
                poses: Vec::new(),
                targets: Vec::new(),
            })
            .collect();
        let mut rehearsal = Rehearsal {
            names,
            team,
            ticks: ticks_of(scenario.experiment.duration_s),
            seen: std::array::from_fn(|_| first.clone()),
            commands: vec![Default::default(); n],
            outputs: Vec::with_capacity(n),
            findings: Vec::new(),
            contacts: Vec::new(),
            obstacle_contacts: Vec::new(),
            smallest_separation_m: world.smallest_separation_m(),
            smallest_wall_distance_m: world.smallest_wall_distance_m(),
            path_error: None,
            replay,
            notebook: Notebook::default(),
            broken: false,
            stuck: false,
            faulty: false,
            world,
        };
        rehearsal.add_frame();
        Ok(rehearsal)
    }

    /// One control tick; false when the rehearsal has ended.
    pub fn step(&mut self) -> bool {
        if self.is_finished() {
            return false;
        }
        self.outputs.clear();
        self.outputs.extend_from_slice(self.team.tick(&self.seen[0]));
        for (command, out) in self.commands.iter_mut().zip(&self.outputs) {
            *command = out.safe.wheel_command();
        }
        let tick = self.world.tick();
        self.notebook
            .take(tick, self.team.notes(), tick.is_multiple_of(FRAME_TICKS));
        if let Err(error) = self.world.step(&self.commands) {
            self.broken = true;
            let message = format!("the simulation cannot go on: {error}");
            self.find(Severity::Error, "left_finite_numbers", Vec::new(), message, None);
            return false;
        }
        self.seen.rotate_left(1);
        self.seen[POSE_AGE_TICKS] = observe(&self.world, self.names.len(), POSE_AGE_TICKS as f64 * TICK_S);
        self.judge();
        self.look_for_deadlock();
        self.look_for_fault();
        if self.world.tick().is_multiple_of(FRAME_TICKS) {
            self.add_frame();
        }
        !self.is_finished()
    }

    /// The duration is over, the team is done or stuck, or the numbers are no longer finite.
    pub fn is_finished(&self) -> bool {
        self.broken || self.stuck || self.faulty || self.world.tick() >= self.ticks || self.team.is_done()
    }

    /// The numbers are no longer finite.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    /// A deadlock was given up.
    pub fn is_stuck(&self) -> bool {
        self.stuck
    }

    /// Why the user's own controller cannot go on.
    pub fn fault(&self) -> Option<&Fault> {
        self.team.fault()
    }

    /// What the controller said and drew in the last tick.
    pub fn notes(&self) -> &[Note] {
        self.team.notes()
    }

    /// What can be seen of a robot now.
    ///
    /// - `robot`: its place in the experiment; panics beyond the last.
    pub fn state(&self, robot: usize) -> RobotState {
        self.world.state(robot)
    }

    /// What the team ordered in the last tick, in the order of the experiment; empty before the first.
    pub fn outputs(&self) -> &[TeamOutput] {
        &self.outputs
    }

    /// Control ticks so far and at most.
    pub fn progress(&self) -> (u64, u64) {
        (self.world.tick(), self.ticks)
    }

    /// Trace digest so far.
    pub fn digest(&self) -> String {
        self.world.digest().to_string()
    }

    /// All robots now.
    pub fn frame(&self) -> Frame {
        let tick = self.world.tick();
        let robots = (0..self.names.len()).map(|i| {
            let pose = self.world.state(i).pose;
            let out = self.outputs.get(i);
            FrameRobot {
                pose: [pose.x_m, pose.y_m, pose.yaw_rad],
                target: out.map_or([pose.x_m, pose.y_m], |out| out.target),
                safety: out
                    .and_then(|out| out.intervention.as_ref())
                    .map(|intervention| intervention.label()),
            }
        });
        Frame {
            tick,
            time_s: tick as f64 * TICK_S,
            robots: robots.collect(),
        }
    }

    /// Verdict and replay; of an unfinished rehearsal, what is known so far.
    pub fn finish(mut self) -> Outcome {
        let last = self.world.tick();
        if !last.is_multiple_of(FRAME_TICKS) {
            self.add_frame();
        }
        let unreached: Vec<usize> = (0..self.outputs.len()).filter(|i| !self.outputs[*i].finished).collect();
        if !self.broken && !self.faulty {
            for i in unreached {
                self.target_not_reached(i);
            }
        }
        self.path_error_large();
        self.findings.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        let accepted = self.findings.iter().all(|finding| finding.severity != Severity::Error);
        let simulated_s = last as f64 * TICK_S;
        let verdict = Verdict {
            format: VERDICT_FORMAT.into(),
            accepted,
            sentence: sentence(
                &self.findings,
                self.names.len(),
                simulated_s,
                self.smallest_separation_m,
            ),
            findings: self.findings,
            digest: self.world.digest().to_string(),
            twin_version: twin::VERSION.into(),
            ticks: last,
            smallest_separation_m: self.smallest_separation_m,
            smallest_wall_distance_m: self.smallest_wall_distance_m,
            largest_path_error_m: self.path_error.map(|(value, _, _)| value),
        };
        let replay = Replay {
            format: REPLAY_FORMAT.into(),
            period_s: FRAME_TICKS as f64 * TICK_S,
            robots: self.replay,
            notes: self.notebook.finish(),
        };
        Outcome { verdict, replay }
    }

    fn add_frame(&mut self) {
        for (i, robot) in self.frame().robots.into_iter().enumerate() {
            self.replay[i].poses.push(robot.pose);
            self.replay[i].targets.push(robot.target);
        }
    }

    /// Contacts, distances and path error of the tick that just ended.
    fn judge(&mut self) {
        let time_s = self.world.tick() as f64 * TICK_S;
        if let Some(now_m) = self.world.smallest_separation_m() {
            self.smallest_separation_m = Some(self.smallest_separation_m.map_or(now_m, |m| m.min(now_m)));
        }
        self.smallest_wall_distance_m = self.smallest_wall_distance_m.min(self.world.smallest_wall_distance_m());
        for k in 0..self.world.contacts_this_tick().len() {
            let contact = self.world.contacts_this_tick()[k];
            self.touch(contact.a, contact.b);
        }
        for k in 0..self.world.obstacle_contacts_this_tick().len() {
            self.touch_obstacle(self.world.obstacle_contacts_this_tick()[k]);
        }
        for (i, out) in self.outputs.iter().enumerate() {
            let Some(segment) = out.segment else { continue };
            let pose = self.world.state(i).pose;
            let error_m = path_error_m([pose.x_m, pose.y_m], segment);
            if self.path_error.is_none_or(|(largest, _, _)| error_m > largest) {
                self.path_error = Some((error_m, time_s, i));
            }
        }
    }

    /// Reports a contact once per pair, and once per robot and the walls.
    fn touch(&mut self, a: u32, b: Option<u32>) {
        if self.contacts.contains(&(a, b)) {
            return;
        }
        self.contacts.push((a, b));
        let time_s = self.world.tick() as f64 * TICK_S;
        let first = self.names[a as usize].clone();
        match b {
            Some(b) => {
                let second = self.names[b as usize].clone();
                let gap_m = self.world.smallest_separation_m();
                let message = format!("{first} and {second} touch at {time_s:.2} s");
                self.find(
                    Severity::Error,
                    "robots_collide",
                    vec![first, second],
                    message,
                    gap_m.map(|m| (m, 0.0)),
                );
            }
            None => {
                let gap_m = self.world.smallest_wall_distance_m();
                let message = format!("{first} touches a wall at {time_s:.2} s");
                self.find(
                    Severity::Error,
                    "robot_hits_wall",
                    vec![first],
                    message,
                    Some((gap_m, 0.0)),
                );
            }
        }
    }

    /// Reports a contact once per robot and obstacle; only fixed ones speak against the experiment.
    fn touch_obstacle(&mut self, contact: ObstacleContact) {
        if self.obstacle_contacts.contains(&contact) {
            return;
        }
        self.obstacle_contacts.push(contact);
        let time_s = self.world.tick() as f64 * TICK_S;
        let robot = self.names[contact.robot as usize].clone();
        let contents = self.world.contents();
        let (severity, code, verb, obstacle) = match contact.obstacle {
            Obstacle::Fixed(at) => {
                let name = &contents.fixed[at as usize].name;
                (Severity::Error, "robot_hits_obstacle", "hits the fixed", name)
            }
            Obstacle::Pushable(at) => {
                let name = &contents.pushable[at as usize].name;
                (Severity::Warning, "robot_pushes_obstacle", "pushes the", name)
            }
        };
        let message = format!("{robot} {verb} obstacle {obstacle:?} at {time_s:.2} s");
        self.find(severity, code, vec![robot], message, None);
    }

    /// As in the laboratory, a deadlock that was given up ends the run.
    fn look_for_deadlock(&mut self) {
        self.stuck = self.team.is_stuck();
        if !self.stuck {
            return;
        }
        let held: Vec<String> = self.team.deadlocks().map(|one| self.names[one.robot].clone()).collect();
        let attempts = self.team.deadlocks().map(|one| one.attempts).max().unwrap_or(0);
        let message = format!(
            "{} hold each other and did not get past one another in {} attempts; the run ends",
            held.join(" and "),
            attempts - 1
        );
        self.find(Severity::Warning, "deadlock", held, message, None);
    }

    /// As in the laboratory, the run ends when the user's own controller cannot go on.
    fn look_for_fault(&mut self) {
        let Some(message) = self
            .team
            .fault()
            .map(|fault| format!("the controller cannot go on: {fault}"))
        else {
            return;
        };
        self.faulty = true;
        self.find(Severity::Error, "controller_fault", Vec::new(), message, None);
    }

    fn target_not_reached(&mut self, i: usize) {
        let pose = self.world.state(i).pose;
        let [x_m, y_m] = self.outputs[i].segment.map_or(self.outputs[i].target, |[_, to]| to);
        let left_m = pose.distance_m(&Pose { x_m, y_m, yaw_rad: 0.0 });
        let name = self.names[i].clone();
        let message = format!("{name} is still {left_m:.2} m from its target at the end");
        self.find(
            Severity::Warning,
            "target_not_reached",
            vec![name],
            message,
            Some((left_m, 0.0)),
        );
    }

    fn path_error_large(&mut self) {
        let Some((error_m, at_s, i)) = self.path_error.filter(|(error_m, _, _)| *error_m > PATH_BAND_M) else {
            return;
        };
        let name = self.names[i].clone();
        self.findings.push(Finding {
            severity: Severity::Warning,
            code: "path_error_large".into(),
            at_s,
            message: format!("{name} is {error_m:.3} m off its path at {at_s:.2} s"),
            robots: vec![name],
            value: Some(error_m),
            limit: Some(PATH_BAND_M),
            unit: Some("m".into()),
        });
    }

    /// Adds a finding at the present time; `figure` is (value, limit) in metres.
    fn find(
        &mut self,
        severity: Severity,
        code: &str,
        robots: Vec<String>,
        message: String,
        figure: Option<(f64, f64)>,
    ) {
        if self.findings.iter().filter(|finding| finding.code == code).count() >= MAX_FINDINGS_PER_CODE {
            return;
        }
        self.findings.push(Finding {
            severity,
            code: code.into(),
            at_s: self.world.tick() as f64 * TICK_S,
            robots,
            value: figure.map(|(value, _)| value),
            limit: figure.map(|(_, limit)| limit),
            unit: figure.map(|_| "m".into()),
            message,
        });
    }
}

/// Control ticks of a duration, rounded up.
pub fn ticks_of(duration_s: f64) -> u64 {
    (duration_s * f64::from(TICK_RATE_HZ)).ceil().max(0.0) as u64
}

/// The twin's world at the start of a scenario.
pub fn world(scenario: &Scenario) -> Result<World, Vec<FieldProblem>> {
    let arena = &scenario.arena;
    let starts = scenario.experiment.robots.iter().map(|robot| robot.start);
    let placed = modelled(scenario)?
        .into_iter()
        .zip(starts)
        .zip(&scenario.robots)
        .map(|((robot, start), lab)| {
            (
                robot,
                Pose {
                    x_m: start.x_m,
                    y_m: start.y_m,
                    yaw_rad: start.yaw_rad,
                },
                lab.bounding_radius_m,
            )
        });
    World::furnished(arena.walls(), arena.contents.clone(), placed.collect()).map_err(|error| {
        vec![FieldProblem {
            field: "robots".into(),
            message: format!("the world cannot be set up: {error}"),
            limit: "robots apart and inside the arena".into(),
            remedy: "correct the start poses or the laboratory's description".into(),
        }]
    })
}

/// The robots as the twin simulates them: with their model versions where there are any.
pub fn modelled(scenario: &Scenario) -> Result<Vec<Robot>, Vec<FieldProblem>> {
    let mut made = robots(scenario)?;
    for (robot, lab) in made.iter_mut().zip(&scenario.robots) {
        let description = &lab.description;
        let Some(model) = scenario.models.get(&description.name) else {
            continue;
        };
        let problem = |message: String| {
            vec![FieldProblem {
                field: format!("models.{}", description.name),
                message,
                limit: "a model version of this robot".into(),
                remedy: "choose another version on the Gap page, or the nominal twin".into(),
            }]
        };
        if model.robot.chassis != description.chassis || model.robot.wheels.len() != description.wheels.len() {
            return Err(problem("the model is of a robot with another chassis".into()));
        }
        *robot = model.robot().map_err(|error| problem(error.to_string()))?;
    }
    Ok(made)
}

fn observe(world: &World, robots: usize, pose_age_s: f64) -> Vec<RobotObservation> {
    let seen = |i: usize| {
        let state = world.state(i);
        let twist: BodyTwist = state.twist;
        RobotObservation {
            pose: state.pose,
            pose_age_s,
            twist,
            online: true,
        }
    };
    (0..robots).map(seen).collect()
}
