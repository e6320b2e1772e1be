//! Robots in an arena, one control tick at a time.

use serde::{Deserialize, Serialize};

use crate::SUBSTEPS;
use crate::command::WheelCommand;
use crate::contact::{self, Sweep};
pub use crate::digest::Digest;
use crate::digest::TickHasher;
use crate::effect::Runtime;
use crate::free::substep;
use crate::model::Model;
use crate::pose::Pose;
use crate::robot::Robot;
pub use crate::snapshot::Snapshot;
use crate::snapshot::{decoded, encoded};
pub use crate::state::RobotState;
use crate::state::{BodyState, MAX_WORDS};

/// Most robots in one world.
pub const MAX_ROBOTS: usize = 4096;
/// Overlap of two bounding circles, or of one with a wall, at the start that is taken as touching, m.
const START_OVERLAP_M: f64 = 1e-3;

/// Rectangle with walls, centred at the world origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arena {
    /// Along x.
    pub width_m: f64,
    /// Along y.
    pub height_m: f64,
}

/// Two bodies that pushed each other during a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Contact {
    /// Position of the robot in the world.
    pub a: u32,
    /// The other robot (`b > a`), or `None` for a wall.
    pub b: Option<u32>,
}

/// Why a world cannot be made, stepped or restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    #[error("{count} robots in a world; 1 to {MAX_ROBOTS} are possible")]
    RobotCount { count: usize },
    #[error("arena of {width_m} m x {height_m} m; sides are 0.1 m to 1000 m")]
    Arena { width_m: f64, height_m: f64 },
    #[error("bounding radius of robot {robot} ({name}) is {radius_m} m; 0.001 m to 10 m are possible")]
    BoundingRadius { robot: usize, name: String, radius_m: f64 },
    #[error("start pose of robot {robot} ({name}) is not finite")]
    StartNotFinite { robot: usize, name: String },
    #[error("robot {robot} ({name}) starts {beyond_m} m inside or beyond a wall")]
    StartOutside { robot: usize, name: String, beyond_m: f64 },
    #[error("robots {a} and {b} start with their bounding circles overlapping by {overlap_m} m")]
    StartOverlap { a: usize, b: usize, overlap_m: f64 },
    #[error("{got} commands for {robots} robots")]
    CommandCount { robots: usize, got: usize },
    #[error("tick {tick}: command {field} of robot {robot} ({name}) is not finite")]
    CommandNotFinite {
        tick: u64,
        robot: usize,
        name: String,
        field: String,
    },
    #[error("tick {tick}: {state} of robot {robot} ({name}) left the finite range")]
    NotFinite {
        tick: u64,
        robot: usize,
        name: String,
        state: String,
    },
    #[error("snapshot does not fit: {reason}")]
    Snapshot { reason: String },
}

/// Robots, walls and time.
#[derive(Debug, Clone)]
pub struct World {
    arena: Arena,
    names: Vec<String>,
    models: Vec<Model>,
    radii_m: Vec<f64>,
    /// Around the centre of mass.
    sweep_radii_m: Vec<f64>,
    runtimes: Vec<Option<Runtime>>,
    states: Vec<BodyState>,
    tick: u64,
    sweep: Sweep,
    contacts: Vec<Contact>,
    fingerprint: Digest,
    digest: Digest,
    hashing: bool,
    hasher: TickHasher,
    failure: Option<WorldError>,
}

impl World {
    /// Robots at rest at their start poses, each with the radius of its bounding circle, m.
    ///
    /// - Errors: no or too many robots, a start pose that is not finite, outside the walls or overlapping another.
    pub fn new(arena: Arena, robots: Vec<(Robot, Pose, f64)>) -> Result<World, WorldError> {
        check_start(&arena, &robots)?;
        let fingerprint = fingerprint(&arena, &robots);
        let count = robots.len();
        Ok(World {
            arena,
            names: robots.iter().map(|(robot, _, _)| robot.name().to_owned()).collect(),
            models: robots.iter().map(|(robot, _, _)| robot.model().clone()).collect(),
            radii_m: robots.iter().map(|(_, _, radius_m)| *radius_m).collect(),
            sweep_radii_m: robots
                .iter()
                .map(|(robot, _, radius_m)| {
                    let [x, y] = robot.model().com_m;
                    radius_m + (x * x + y * y).sqrt()
                })
                .collect(),
            runtimes: robots.iter().map(|(robot, _, _)| robot.runtime()).collect(),
            states: robots
                .iter()
                .map(|(robot, pose, _)| BodyState::at_rest(robot.model(), *pose))
                .collect(),
            tick: 0,
            sweep: Sweep::new(count),
            contacts: Vec::new(),
            fingerprint,
            digest: fingerprint,
            hashing: true,
            hasher: TickHasher::default(),
            failure: None,
        })
    }

    /// Stops hashing; [`World::digest`] then stays as it is. For searches that never compare traces.
    pub fn without_digest(mut self) -> World {
        self.hashing = false;
        self
    }

    /// One control tick: four physics steps at 480 Hz with these set-points, in robot order.
    ///
    /// - Errors: a wrong number of commands, a command that is not finite (the world is unchanged and can go on), or a
    ///   state that left the finite range (the world stays failed: every later call returns the same error).
    pub fn step(&mut self, commands: &[WheelCommand]) -> Result<(), WorldError> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        self.check_commands(commands)?;
        self.contacts.clear();
        let reach_m = contact::reach_m(&self.models, &self.states);
        self.sweep.find(&self.arena, &self.states, &self.sweep_radii_m, reach_m);
        for state in &mut self.states {
            state.refresh_heading();
        }
        for (robot, state) in self.states.iter_mut().enumerate() {
            if self.sweep.near[robot] {
                continue;
            }
            for _ in 0..SUBSTEPS {
                substep(&self.models[robot], &mut self.runtimes[robot], state, &commands[robot]);
            }
        }
        if !self.sweep.involved.is_empty() {
            let bodies = contact::Bodies {
                models: &self.models,
                radii_m: &self.radii_m,
                runtimes: &mut self.runtimes,
                states: &mut self.states,
            };
            contact::resolve_tick(&self.arena, bodies, commands, &self.sweep.involved, &mut self.contacts);
        }
        self.tick += 1;
        self.check_states()?;
        if self.hashing {
            self.hash_tick();
        }
        Ok(())
    }

    fn check_commands(&self, commands: &[WheelCommand]) -> Result<(), WorldError> {
        if commands.len() != self.states.len() {
            return Err(WorldError::CommandCount {
                robots: self.states.len(),
                got: commands.len(),
            });
        }
        for (robot, command) in commands.iter().enumerate() {
            if let Some(field) = command.non_finite_field() {
                return Err(WorldError::CommandNotFinite {
                    tick: self.tick,
                    robot,
                    name: self.names[robot].clone(),
                    field,
                });
            }
        }
        Ok(())
    }

    fn check_states(&mut self) -> Result<(), WorldError> {
        let Some(robot) = self.states.iter().position(|state| !state.is_finite()) else {
            return Ok(());
        };
        let state = self.states[robot].non_finite_field(&self.models[robot]);
        let failure = WorldError::NotFinite {
            tick: self.tick,
            robot,
            name: self.names[robot].clone(),
            state,
        };
        // No NaN is ever shown: a failed robot stands at the origin.
        for (state, model) in self.states.iter_mut().zip(&self.models) {
            if !state.is_finite() {
                *state = BodyState::at_rest(model, Pose::default());
            }
        }
        self.failure = Some(failure.clone());
        Err(failure)
    }

    fn hash_tick(&mut self) {
        self.hasher.begin(self.digest, self.tick);
        for ((state, model), runtime) in self.states.iter().zip(&self.models).zip(&self.runtimes) {
            self.hasher.robot(state, model.lanes);
            if let Some(runtime) = runtime {
                self.hasher.numbers(runtime.words());
            }
        }
        self.digest = self.hasher.finish();
    }

    /// Control ticks taken.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Number of robots.
    pub fn robot_count(&self) -> usize {
        self.states.len()
    }

    /// The arena.
    pub fn arena(&self) -> Arena {
        self.arena
    }

    /// State of a robot after the last tick.
    ///
    /// # Panics
    /// If `robot` is not below [`World::robot_count`].
    pub fn state(&self, robot: usize) -> RobotState {
        let model = self.runtimes[robot]
            .as_ref()
            .map_or(&self.models[robot], |runtime| &runtime.live);
        self.states[robot].view(model)
    }

    /// Pairs that pushed each other during the last tick, in order.
    pub fn contacts_this_tick(&self) -> &[Contact] {
        &self.contacts
    }

    /// Smallest distance between two bounding circles, m (negative: overlap); `None` with one robot.
    pub fn smallest_separation_m(&self) -> Option<f64> {
        let mut smallest: Option<f64> = None;
        for a in 0..self.states.len() {
            for b in a + 1..self.states.len() {
                let gap_m = gap_m(self.origin_m(a), self.origin_m(b), self.radii_m[a] + self.radii_m[b]);
                smallest = Some(smallest.map_or(gap_m, |before| before.min(gap_m)));
            }
        }
        smallest
    }

    /// Smallest distance of a bounding circle to a wall, m (negative: beyond it).
    pub fn smallest_wall_distance_m(&self) -> f64 {
        let distances = self.radii_m.iter().enumerate();
        distances.fold(f64::INFINITY, |smallest, (robot, radius_m)| {
            let (x_m, y_m) = self.origin_m(robot);
            smallest.min(wall_distance_m(&self.arena, x_m, y_m, *radius_m))
        })
    }

    fn origin_m(&self, robot: usize) -> (f64, f64) {
        self.states[robot].origin_m(&self.models[robot])
    }

    /// Witness of the trace so far; depends on arena, robots, start poses, commands and nothing else.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// The state after the last tick, exact to the bit.
    pub fn snapshot(&self) -> Snapshot {
        let robots = self.states.iter().zip(&self.models).zip(&self.runtimes);
        let robots = robots.map(|((state, model), runtime)| {
            let mut words = [0.0; MAX_WORDS];
            let count = state.words(model.lanes, &mut words);
            let mut all = words[..count].to_vec();
            all.extend(runtime.iter().flat_map(Runtime::words));
            encoded(&all)
        });
        Snapshot {
            twin_version: crate::VERSION.to_owned(),
            world: self.fingerprint.to_string(),
            tick: self.tick,
            digest: self.digest.to_string(),
            robots: robots.collect(),
        }
    }

    /// Continues from a snapshot of this world or of one made alike.
    ///
    /// - Errors: another twin version, arena, robots, or damaged text; the world is then unchanged.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), WorldError> {
        let refused = |reason: String| WorldError::Snapshot { reason };
        if snapshot.twin_version != crate::VERSION {
            return Err(refused(format!(
                "written by {}, this is {}",
                snapshot.twin_version,
                crate::VERSION
            )));
        }
        if snapshot.world != self.fingerprint.to_string() || snapshot.robots.len() != self.states.len() {
            return Err(refused("arena, robots or start poses differ".to_owned()));
        }
        let digest = Digest::parse(&snapshot.digest).ok_or_else(|| refused("damaged digest".to_owned()))?;
        let mut states = Vec::with_capacity(self.states.len());
        let mut runtimes = self.runtimes.clone();
        for (robot, (text, model)) in snapshot.robots.iter().zip(&self.models).enumerate() {
            let restored = decoded(text).and_then(|words| restored(&words, model, &mut runtimes[robot]));
            match restored {
                Some(state) => states.push(state),
                None => return Err(refused(format!("damaged state of robot {robot}"))),
            }
        }
        self.runtimes = runtimes;
        self.states = states;
        self.tick = snapshot.tick;
        self.digest = digest;
        self.contacts.clear();
        self.failure = None;
        Ok(())
    }
}

/// A robot's state from the numbers of a snapshot; none when they do not fit or are not finite.
fn restored(words: &[f64], model: &Model, runtime: &mut Option<Runtime>) -> Option<BodyState> {
    let body = BodyState::word_count(model.lanes);
    let rest = runtime.as_ref().map_or(0, Runtime::word_count);
    if words.len() != body + rest || words.iter().any(|word| !word.is_finite()) {
        return None;
    }
    let state = BodyState::from_words(&words[..body], model)?;
    if let Some(runtime) = runtime {
        runtime.restore(&words[body..]);
    }
    Some(state)
}

fn gap_m(a: (f64, f64), b: (f64, f64), radii_m: f64) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    (dx * dx + dy * dy).sqrt() - radii_m
}

fn wall_distance_m(arena: &Arena, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
    (0.5 * arena.width_m - x_m.abs()).min(0.5 * arena.height_m - y_m.abs()) - radius_m
}

fn check_start(arena: &Arena, robots: &[(Robot, Pose, f64)]) -> Result<(), WorldError> {
    let side = 0.1..=1000.0;
    if !side.contains(&arena.width_m) || !side.contains(&arena.height_m) {
        return Err(WorldError::Arena {
            width_m: arena.width_m,
            height_m: arena.height_m,
        });
    }
    if robots.is_empty() || robots.len() > MAX_ROBOTS {
        return Err(WorldError::RobotCount { count: robots.len() });
    }
    for (index, (robot, pose, radius_m)) in robots.iter().enumerate() {
        let name = || robot.name().to_owned();
        if !(0.001..=10.0).contains(radius_m) {
            return Err(WorldError::BoundingRadius {
                robot: index,
                name: name(),
                radius_m: *radius_m,
            });
        }
        if !pose.is_finite() {
            return Err(WorldError::StartNotFinite {
                robot: index,
                name: name(),
            });
        }
        let distance_m = wall_distance_m(arena, pose.x_m, pose.y_m, *radius_m);
        if distance_m < -START_OVERLAP_M {
            return Err(WorldError::StartOutside {
                robot: index,
                name: name(),
                beyond_m: -distance_m,
            });
        }
        for (before, (_, other, other_radius_m)) in robots[..index].iter().enumerate() {
            let overlap_m = radius_m + other_radius_m - pose.distance_m(other);
            if overlap_m > START_OVERLAP_M {
                return Err(WorldError::StartOverlap {
                    a: before,
                    b: index,
                    overlap_m,
                });
            }
        }
    }
    Ok(())
}

/// Hash of everything a trace starts from.
fn fingerprint(arena: &Arena, robots: &[(Robot, Pose, f64)]) -> Digest {
    let mut bytes = crate::VERSION.as_bytes().to_vec();
    let mut number = |value: f64| bytes.extend_from_slice(&value.to_bits().to_le_bytes());
    number(arena.width_m);
    number(arena.height_m);
    for (_, pose, radius_m) in robots {
        for value in [pose.x_m, pose.y_m, pose.yaw_rad, *radius_m] {
            number(value);
        }
    }
    for (robot, _, _) in robots {
        let text = serde_json::to_string(robot.description()).unwrap_or_default();
        bytes.extend_from_slice(text.as_bytes());
        if !robot.effects().is_empty() {
            let text = serde_json::to_string(robot.effects()).unwrap_or_default();
            bytes.extend_from_slice(text.as_bytes());
        }
        if let Some(residual) = robot.residual() {
            let text = serde_json::to_string(residual.document()).unwrap_or_default();
            bytes.extend_from_slice(text.as_bytes());
        }
    }
    Digest::of_bytes(&bytes)
}
