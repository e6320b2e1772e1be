//! Robots in an arena, one control tick at a time.

mod check;
mod contents;
pub(crate) mod floor;
pub(crate) mod obstacle;
mod scene;
pub(crate) mod shape;
mod start;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::SUBSTEPS;
use crate::command::WheelCommand;
use crate::contact::{self, Furniture, Sweep, Swept, Touches};
pub use crate::digest::Digest;
use crate::digest::TickHasher;
use crate::effect::Runtime;
use crate::free::substep;
use crate::model::Model;
use crate::parameter::ParameterError;
use crate::pose::{Pose, wrapped_rad};
use crate::robot::Robot;
pub use crate::snapshot::Snapshot;
use crate::snapshot::{decoded, encoded};
pub use crate::state::RobotState;
use crate::state::{BodyState, MAX_WORDS};
pub use contents::{Contents, FixedObstacle, FloorRegion, MAX_FIXED, MAX_PUSHABLE, MAX_REGIONS, PushableObstacle};
use floor::Floor;
use obstacle::ObstacleBody;
pub use obstacle::ObstacleState;
pub use scene::Scene;
pub use shape::Shape;
use start::{check_start, fingerprint, wall_distance_m};

/// Most robots in one world.
pub const MAX_ROBOTS: usize = 4096;
/// Overlap of two things, or of one with a wall, at the start that is taken as touching, m.
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

/// An obstacle by its position in [`Contents::fixed`] or [`Contents::pushable`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    Fixed(u32),
    Pushable(u32),
}

/// A robot and an obstacle that pushed each other during a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ObstacleContact {
    /// Position of the robot in the world.
    pub robot: u32,
    pub obstacle: Obstacle,
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
    #[error("contents.{0}")]
    Contents(ParameterError),
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
    #[error("tick {tick}: pushable obstacle {obstacle} ({name}) left the finite range")]
    ObstacleNotFinite { tick: u64, obstacle: usize, name: String },
    #[error("snapshot does not fit: {reason}")]
    Snapshot { reason: String },
}

/// Robots, walls and time.
#[derive(Debug, Clone)]
pub struct World {
    arena: Arena,
    contents: Contents,
    floor: Floor,
    furniture: Furniture,
    names: Vec<String>,
    models: Vec<Arc<Model>>,
    radii_m: Vec<f64>,
    /// Around the centre of mass.
    sweep_radii_m: Vec<f64>,
    runtimes: Vec<Option<Runtime>>,
    states: Vec<BodyState>,
    /// Of the pushable obstacles.
    obstacles: Vec<ObstacleBody>,
    tick: u64,
    sweep: Sweep,
    touches: Touches,
    fingerprint: Digest,
    digest: Digest,
    hashing: bool,
    hasher: TickHasher,
    failure: Option<WorldError>,
}

impl World {
    /// Robots at rest at their start poses in an empty arena, each with the radius of its bounding circle, m.
    ///
    /// - Errors: no or too many robots, a start pose that is not finite, outside the walls or overlapping another.
    pub fn new(arena: Arena, robots: Vec<(Robot, Pose, f64)>) -> Result<World, WorldError> {
        World::furnished(arena, Contents::default(), robots)
    }

    /// The same in an arena with obstacles, floor regions and tilt. Empty contents change no bit.
    ///
    /// - Errors: as [`World::new`], the first problem of [`Contents::check`], or a robot that starts in an obstacle.
    pub fn furnished(arena: Arena, contents: Contents, robots: Vec<(Robot, Pose, f64)>) -> Result<World, WorldError> {
        check_start(&arena, &contents, &robots)?;
        let fingerprint = fingerprint(&arena, &contents, &robots);
        let floor = Floor::new(&contents);
        Ok(World {
            arena,
            furniture: Furniture::new(&contents),
            names: robots.iter().map(|(robot, _, _)| robot.name().to_owned()).collect(),
            models: robots.iter().map(|(robot, _, _)| Arc::clone(robot.model())).collect(),
            radii_m: robots.iter().map(|(_, _, radius_m)| *radius_m).collect(),
            sweep_radii_m: robots
                .iter()
                .map(|(robot, _, radius_m)| {
                    let [x, y] = robot.model().com_m;
                    radius_m + (x * x + y * y).sqrt()
                })
                .collect(),
            runtimes: robots.iter().map(|(robot, _, _)| robot.runtime_on(&floor)).collect(),
            states: robots
                .iter()
                .map(|(robot, pose, _)| BodyState::at_rest(robot.model(), *pose))
                .collect(),
            obstacles: contents
                .pushable
                .iter()
                .map(|one| ObstacleBody::at_rest(one.pose))
                .collect(),
            tick: 0,
            sweep: Sweep::new(robots.len(), contents.pushable.len()),
            touches: Touches::default(),
            contents,
            floor,
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
        self.touches.clear();
        let obstacles = (&self.furniture, self.obstacles.as_slice());
        self.sweep.find(&Swept {
            arena: &self.arena,
            states: &self.states,
            radii_m: &self.sweep_radii_m,
            furniture: &self.furniture,
            obstacles: &self.obstacles,
            reach_m: contact::reach_m(&self.models, &self.states, &self.floor, obstacles),
        });
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
        self.coast_obstacles();
        if !self.sweep.involved.is_empty() || !self.sweep.pushed_list.is_empty() {
            let bodies = contact::Bodies {
                models: &self.models,
                radii_m: &self.radii_m,
                runtimes: &mut self.runtimes,
                states: &mut self.states,
                furniture: &self.furniture,
                obstacles: &mut self.obstacles,
            };
            contact::resolve_tick(&self.arena, bodies, commands, &self.sweep, &mut self.touches);
        }
        self.tick += 1;
        self.check_states()?;
        if self.hashing {
            self.hash_tick();
        }
        Ok(())
    }

    /// Obstacles that move and can touch nothing in this tick; those at rest are left alone.
    fn coast_obstacles(&mut self) {
        for (index, body) in self.obstacles.iter_mut().enumerate() {
            body.yaw_rad = wrapped_rad(body.yaw_rad);
            let constants = &self.furniture.pushable[index];
            if self.sweep.pushed[index] || !constants.is_restless(body) {
                continue;
            }
            for _ in 0..SUBSTEPS {
                *body = constants.coast(body);
            }
        }
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
            return self.check_obstacles();
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

    fn check_obstacles(&mut self) -> Result<(), WorldError> {
        let Some(obstacle) = self.obstacles.iter().position(|body| !body.is_finite()) else {
            return Ok(());
        };
        let failure = WorldError::ObstacleNotFinite {
            tick: self.tick,
            obstacle,
            name: self.contents.pushable[obstacle].name.clone(),
        };
        for body in self.obstacles.iter_mut().filter(|body| !body.is_finite()) {
            *body = ObstacleBody::at_rest(Pose::default());
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
        for body in &self.obstacles {
            self.hasher.numbers(body.words().into_iter());
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

    /// What stands in the arena, as it was at the start.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// State of a pushable obstacle after the last tick, by its position in [`Contents::pushable`].
    ///
    /// # Panics
    /// If `obstacle` is not below the number of pushable obstacles.
    pub fn obstacle(&self, obstacle: usize) -> ObstacleState {
        self.obstacles[obstacle].view()
    }

    /// What stands around a robot now, for its range sensors: walls, obstacles, bounding circles of the other robots.
    pub fn scene_around(&self, robot: usize) -> Scene {
        let mut scene = Scene {
            arena: self.arena,
            circles: Vec::new(),
            boxes: Vec::new(),
        };
        for other in (0..self.states.len()).filter(|other| *other != robot) {
            let (x_m, y_m) = self.origin_m(other);
            let pose = Pose { x_m, y_m, yaw_rad: 0.0 };
            let radius_m = self.radii_m[other];
            scene.add(Shape::Circle { radius_m }, pose);
        }
        for one in &self.contents.fixed {
            scene.add(one.shape, one.pose);
        }
        for (one, body) in self.contents.pushable.iter().zip(&self.obstacles) {
            scene.add(one.shape, body.pose());
        }
        scene
    }

    /// State of a robot after the last tick.
    ///
    /// # Panics
    /// If `robot` is not below [`World::robot_count`].
    pub fn state(&self, robot: usize) -> RobotState {
        let model = self.runtimes[robot]
            .as_ref()
            .map_or(self.models[robot].as_ref(), |runtime| runtime.live.as_ref());
        self.states[robot].view(model)
    }

    /// Pairs that pushed each other during the last tick, in order.
    pub fn contacts_this_tick(&self) -> &[Contact] {
        &self.touches.robots
    }

    /// Robots and obstacles that pushed each other during the last tick, in order.
    pub fn obstacle_contacts_this_tick(&self) -> &[ObstacleContact] {
        &self.touches.obstacles
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

    /// Witness of the trace so far; depends on arena, contents, robots, start poses, commands and nothing else.
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
            obstacles: self.obstacles.iter().map(|body| encoded(&body.words())).collect(),
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
        let counts = [snapshot.robots.len(), snapshot.obstacles.len()];
        if snapshot.world != self.fingerprint.to_string() || counts != [self.states.len(), self.obstacles.len()] {
            return Err(refused("arena, contents, robots or start poses differ".to_owned()));
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
        let mut obstacles = Vec::with_capacity(self.obstacles.len());
        for (obstacle, text) in snapshot.obstacles.iter().enumerate() {
            match decoded(text).and_then(|words| ObstacleBody::from_words(&words)) {
                Some(body) => obstacles.push(body),
                None => return Err(refused(format!("damaged state of obstacle {obstacle}"))),
            }
        }
        self.runtimes = runtimes;
        self.states = states;
        self.obstacles = obstacles;
        self.tick = snapshot.tick;
        self.digest = digest;
        self.touches.clear();
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
        runtime.restore(&words[body..], &state);
    }
    Some(state)
}

fn gap_m(a: (f64, f64), b: (f64, f64), radii_m: f64) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    (dx * dx + dy * dy).sqrt() - radii_m
}
