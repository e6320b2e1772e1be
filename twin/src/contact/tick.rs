//! One control tick of the bodies that can touch each other.
//!
//! A physics step is a fixed point: the impulse J that the solver finds must be the one under which the kernel moved the
//! wheels. With the kernel's result z(J) for the force J/h, the solver is given z(J) - J/m and finds the next J. The
//! share of the error that stays is that of the wheels' apparent mass in the whole, a few percent for a geared wheel.
//!
//! An obstacle at rest is first held, as if it were of immense mass; if what it is pushed with exceeds its floor
//! friction it breaks loose, and the step is solved again with that friction against it. Where others that broke loose
//! have taken the load off it, so that only the friction would move it, it is held again.

use std::sync::Arc;

use rapier2d_f64::prelude::RigidBodyHandle;

use super::furniture::Furniture;
use super::solver::{HELD, Mark, Place, Solver};
use super::sweep::Sweep;
use crate::command::WheelCommand;
use crate::effect::Runtime;
use crate::free::substep;
use crate::model::{Model, Push};
use crate::state::BodyState;
use crate::world::obstacle::{Obstacle, ObstacleBody};
use crate::world::{self, Arena, Contact, ObstacleContact};
use crate::{PHYSICS_PERIOD_S, SUBSTEPS};

/// Most repetitions of a physics step with the impulse found before.
const MAX_CORRECTIONS: u32 = 4;
/// Change of a robot's velocity by its impulse below which wheels and collision agree, m/s.
const AGREED_M_PER_S: f64 = 1e-5;
/// Most rounds in which held obstacles break loose, each pushing the next, or are held again.
const MAX_BREAKS: u32 = 6;

/// The robots and obstacles of a world.
pub(crate) struct Bodies<'a> {
    pub(crate) models: &'a [Arc<Model>],
    pub(crate) radii_m: &'a [f64],
    pub(crate) runtimes: &'a mut [Option<Runtime>],
    pub(crate) states: &'a mut [BodyState],
    pub(crate) furniture: &'a Furniture,
    pub(crate) obstacles: &'a mut [ObstacleBody],
}

/// Who pushed whom during a tick, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Touches {
    pub(crate) robots: Vec<Contact>,
    pub(crate) obstacles: Vec<ObstacleContact>,
}

impl Touches {
    pub(crate) fn clear(&mut self) {
        self.robots.clear();
        self.obstacles.clear();
    }

    fn add(&mut self, pairs: &[(Mark, Mark)]) {
        for (first, second) in pairs {
            let Mark::Robot(a) = *first else { continue };
            let obstacle = match *second {
                Mark::Robot(b) => {
                    self.robots.push(Contact { a, b: Some(b) });
                    continue;
                }
                Mark::Wall => {
                    self.robots.push(Contact { a, b: None });
                    continue;
                }
                Mark::Pushable(index) => world::Obstacle::Pushable(index),
                Mark::Fixed(index) => world::Obstacle::Fixed(index),
            };
            self.obstacles.push(ObstacleContact { robot: a, obstacle });
        }
    }

    fn in_order(&mut self) {
        self.robots.sort();
        self.robots.dedup();
        self.obstacles.sort();
        self.obstacles.dedup();
    }
}

/// A robot in the solver's hands.
struct Driven {
    robot: usize,
    handle: RigidBodyHandle,
    /// Before the physics step: state and what its effects remember.
    before: BodyState,
    remembered: Vec<f64>,
    /// Impulse under which the kernel moved it, world frame: N s, N s, N m s.
    push: [f64; 3],
    /// Velocity as the solver got it, and the impulse it found.
    loaded: [f64; 3],
    found: [f64; 3],
    touched: bool,
}

/// A pushable obstacle in the solver's hands.
struct Shoved {
    index: usize,
    handle: RigidBodyHandle,
    before: ObstacleBody,
    hold: Hold,
    /// Its velocity after tilt alone.
    own: [f64; 3],
    /// Nothing but a push can keep it moving in this step; it has been held again.
    stoppable: bool,
    regripped: bool,
    /// As the solver has it.
    immense: bool,
    touched: bool,
}

/// What the floor does to an obstacle in this physics step.
#[derive(Clone, Copy)]
enum Hold {
    Held,
    /// It slides; its velocity after floor friction and tilt, before any collision.
    Loose([f64; 3]),
}

/// One control tick of the bodies that `sweep` found; pairs that pushed each other are added to `touches`.
pub(crate) fn resolve_tick(
    arena: &Arena,
    bodies: Bodies<'_>,
    commands: &[WheelCommand],
    sweep: &Sweep,
    touches: &mut Touches,
) {
    let mut tick = Tick::new(arena, bodies, commands, sweep);
    for _ in 0..SUBSTEPS {
        tick.begin();
        for correction in 0..=MAX_CORRECTIONS {
            tick.collide();
            if tick.measure() <= AGREED_M_PER_S || correction == MAX_CORRECTIONS {
                break;
            }
            tick.correct();
        }
        tick.finish();
        touches.add(&tick.pairs);
    }
    touches.in_order();
}

struct Tick<'a> {
    bodies: Bodies<'a>,
    commands: &'a [WheelCommand],
    sweep: &'a Sweep,
    solver: Solver,
    driven: Vec<Driven>,
    shoved: Vec<Shoved>,
    pairs: Vec<(Mark, Mark)>,
}

impl<'a> Tick<'a> {
    fn new(arena: &Arena, bodies: Bodies<'a>, commands: &'a [WheelCommand], sweep: &'a Sweep) -> Tick<'a> {
        let mut solver = Solver::new();
        solver.add_walls(arena);
        for fixed in &sweep.fixed {
            solver.add_fixed(*fixed, &bodies.furniture.fixed[*fixed as usize]);
        }
        let driven = sweep.involved.iter().map(|number| {
            let robot = *number as usize;
            Driven {
                robot,
                handle: solver.add_robot(*number, &bodies.models[robot], bodies.radii_m[robot]),
                before: bodies.states[robot],
                remembered: Vec::new(),
                push: [0.0; 3],
                loaded: [0.0; 3],
                found: [0.0; 3],
                touched: false,
            }
        });
        let driven = driven.collect();
        let shoved = sweep.pushed_list.iter().map(|number| {
            let index = *number as usize;
            Shoved {
                index,
                handle: solver.add_pushable(*number, &bodies.furniture.pushable[index]),
                before: bodies.obstacles[index],
                hold: Hold::Held,
                own: [0.0; 3],
                stoppable: true,
                regripped: false,
                immense: false,
                touched: false,
            }
        });
        let shoved = shoved.collect();
        Tick {
            bodies,
            commands,
            sweep,
            solver,
            driven,
            shoved,
            pairs: Vec::new(),
        }
    }

    /// Starts a physics step; the impulse of the step before is the first guess.
    fn begin(&mut self) {
        for slot in 0..self.driven.len() {
            let one = &mut self.driven[slot];
            one.before = self.bodies.states[one.robot];
            one.remembered.clear();
            if let Some(runtime) = &self.bodies.runtimes[one.robot] {
                one.remembered.extend(runtime.words());
            }
            one.push = one.found;
            self.advance(slot);
        }
        for one in &mut self.shoved {
            let obstacle = &self.bodies.furniture.pushable[one.index];
            one.before = self.bodies.obstacles[one.index];
            one.own = obstacle.pulled(one.before.velocity);
            let slowed = obstacle.slowed(one.own);
            one.stoppable = slowed == [0.0; 3];
            one.regripped = false;
            one.hold = if one.stoppable { Hold::Held } else { Hold::Loose(slowed) };
        }
    }

    /// The kernel's physics step of one robot under its push, from the state before.
    fn advance(&mut self, slot: usize) {
        let one = &mut self.driven[slot];
        let (model, runtime) = (&self.bodies.models[one.robot], &mut self.bodies.runtimes[one.robot]);
        let state = &mut self.bodies.states[one.robot];
        let command = &self.commands[one.robot];
        if one.push == [0.0; 3] {
            *state = one.before;
            return substep(model, runtime, state, command);
        }
        // Body axes halfway through the step, as far as the pass before knows.
        let (cos, sin) = (one.before.cos_yaw + state.cos_yaw, one.before.sin_yaw + state.sin_yaw);
        let length = (cos * cos + sin * sin).sqrt();
        let (cos, sin) = (cos / length, sin / length);
        let [x, y, turn] = one.push.map(|impulse| impulse / PHYSICS_PERIOD_S);
        let force = [x * cos + y * sin, y * cos - x * sin, turn];
        let push = Push {
            force,
            m_per_s2: [force[0] / model.mass_kg, force[1] / model.mass_kg],
        };
        *state = one.before;
        // Steps that are compared under different pushes start from nothing but the state.
        state.carry.clear();
        match runtime {
            None => {
                let mut pushed = Model::clone(model);
                pushed.body_force = push.force;
                pushed.gravity_m_per_s2 = push.m_per_s2;
                substep(&pushed, &mut None, state, command);
            }
            Some(effects) => {
                effects.push = push;
                substep(model, runtime, state, command);
                if let Some(effects) = runtime {
                    effects.push = Push::default();
                }
            }
        }
    }

    /// The same again; what effects remember is as before the step.
    fn advance_again(&mut self, slot: usize) {
        let one = &self.driven[slot];
        if let Some(runtime) = &mut self.bodies.runtimes[one.robot] {
            runtime.restore(&one.remembered, &one.before);
        }
        self.advance(slot);
    }

    /// Solves the collisions of this physics step, again while obstacles break loose or are held again.
    fn collide(&mut self) {
        for _ in 0..MAX_BREAKS {
            self.load();
            self.solver.step();
            if !self.revise_holds() {
                return;
            }
        }
        self.load();
        self.solver.step();
    }

    fn load(&mut self) {
        for one in &mut self.driven {
            let (model, after) = (&self.bodies.models[one.robot], &self.bodies.states[one.robot]);
            one.loaded = [
                after.u * after.cos_yaw - after.v * after.sin_yaw - one.push[0] / model.mass_kg,
                after.u * after.sin_yaw + after.v * after.cos_yaw - one.push[1] / model.mass_kg,
                after.r - one.push[2] / model.yaw_inertia_kg_m2,
            ];
            let place = Place {
                x_m: one.before.x_m,
                y_m: one.before.y_m,
                cos: one.before.cos_yaw,
                sin: one.before.sin_yaw,
            };
            self.solver.load(one.handle, place, one.loaded);
        }
        for one in &mut self.shoved {
            let (held, velocity) = match one.hold {
                Hold::Held => (true, [0.0; 3]),
                Hold::Loose(velocity) => (false, velocity),
            };
            let obstacle = &self.bodies.furniture.pushable[one.index];
            if one.immense != held {
                self.solver.hold(one.handle, obstacle, held);
                one.immense = held;
            }
            let placed = obstacle.placed(&one.before);
            let place = Place {
                x_m: placed.x_m,
                y_m: placed.y_m,
                cos: placed.cos,
                sin: placed.sin,
            };
            self.solver.load(one.handle, place, velocity);
        }
    }

    /// Lets go of obstacles that were pushed harder than their floor holds, and holds those again that only friction
    /// moves; true when there was one.
    fn revise_holds(&mut self) -> bool {
        let mut revised = false;
        for one in &mut self.shoved {
            let obstacle = &self.bodies.furniture.pushable[one.index];
            let velocity = self.solver.velocity(one.handle);
            match one.hold {
                Hold::Held => {
                    let mut pushed = one.own;
                    for axis in 0..3 {
                        pushed[axis] += HELD * velocity[axis];
                    }
                    let slowed = obstacle.slowed(pushed);
                    if slowed != [0.0; 3] {
                        // The friction of that motion, before the push itself.
                        let mut loose = one.own;
                        for axis in 0..3 {
                            loose[axis] += slowed[axis] - pushed[axis];
                        }
                        one.hold = Hold::Loose(loose);
                        revised = true;
                    }
                }
                Hold::Loose(_) if !one.regripped && one.is_moved_by_friction(obstacle, velocity) => {
                    one.hold = Hold::Held;
                    one.regripped = true;
                    revised = true;
                }
                Hold::Loose(_) => {}
            }
        }
        revised
    }

    /// Who was touched and with what impulse; returns the largest disagreement with the kernel's, m/s.
    fn measure(&mut self) -> f64 {
        self.solver.touching(&mut self.pairs);
        self.driven.iter_mut().for_each(|one| one.touched = false);
        self.shoved.iter_mut().for_each(|one| one.touched = false);
        for (first, second) in &self.pairs {
            for mark in [first, second] {
                match mark {
                    Mark::Robot(robot) => {
                        if let Ok(slot) = self.sweep.involved.binary_search(robot) {
                            self.driven[slot].touched = true;
                        }
                    }
                    Mark::Pushable(index) => {
                        if let Ok(slot) = self.sweep.pushed_list.binary_search(index) {
                            self.shoved[slot].touched = true;
                        }
                    }
                    Mark::Fixed(_) | Mark::Wall => {}
                }
            }
        }
        let mut worst = 0.0_f64;
        for one in &mut self.driven {
            let model = &self.bodies.models[one.robot];
            one.found = [0.0; 3];
            if one.touched {
                let after = self.solver.velocity(one.handle);
                let inertia = [model.mass_kg, model.mass_kg, model.yaw_inertia_kg_m2];
                for axis in 0..3 {
                    one.found[axis] = inertia[axis] * (after[axis] - one.loaded[axis]);
                }
            }
            worst = worst.max(one.disagreement_m_per_s(model));
        }
        worst
    }

    /// Repeats the kernel's step of every robot whose impulse was another.
    fn correct(&mut self) {
        for slot in 0..self.driven.len() {
            let one = &mut self.driven[slot];
            if one.disagreement_m_per_s(&self.bodies.models[one.robot]) > AGREED_M_PER_S {
                one.push = one.found;
                self.advance_again(slot);
            }
        }
    }

    /// Takes over what the collisions left; whoever was not touched keeps the step of its own.
    fn finish(&mut self) {
        for slot in 0..self.driven.len() {
            let one = &mut self.driven[slot];
            if one.touched {
                let velocity = self.solver.velocity(one.handle);
                if let Some(position_m) = self.solver.position_m(one.handle) {
                    unload(&mut self.bodies.states[one.robot], &one.before, position_m, velocity);
                }
            } else if one.push != [0.0; 3] {
                one.push = [0.0; 3];
                self.advance_again(slot);
            }
        }
        for one in &self.shoved {
            let obstacle = &self.bodies.furniture.pushable[one.index];
            let velocity = self.solver.velocity(one.handle);
            let held = matches!(one.hold, Hold::Held) || one.is_moved_by_friction(obstacle, velocity);
            self.bodies.obstacles[one.index] = match (one.touched, self.solver.position_m(one.handle)) {
                (true, _) if held => ObstacleBody {
                    velocity: [0.0; 3],
                    ..one.before
                },
                (true, Some([x_m, y_m])) => ObstacleBody {
                    x_m,
                    y_m,
                    yaw_rad: one.before.yaw_rad + PHYSICS_PERIOD_S * velocity[2],
                    velocity,
                },
                _ => obstacle.coast(&one.before),
            };
        }
    }
}

impl Driven {
    /// How far the impulse found is from the one under which the kernel moved the robot, as a velocity.
    fn disagreement_m_per_s(&self, model: &Model) -> f64 {
        let scale = [
            1.0 / model.mass_kg,
            1.0 / model.mass_kg,
            model.lever_m / model.yaw_inertia_kg_m2,
        ];
        let differences = self.found.iter().zip(&self.push).zip(scale);
        differences.fold(0.0_f64, |worst, ((found, push), scale)| {
            worst.max(scale * (found - push).abs())
        })
    }
}

impl Shoved {
    /// True when the friction that was set against a push now does work on a body that it could stop.
    fn is_moved_by_friction(&self, obstacle: &Obstacle, velocity: [f64; 3]) -> bool {
        let Hold::Loose(loose) = self.hold else { return false };
        let inertia = [obstacle.mass_kg, obstacle.mass_kg, obstacle.inertia_kg_m2];
        let work = (0..3).fold(0.0, |sum, axis| {
            sum + inertia[axis] * (loose[axis] - self.own[axis]) * velocity[axis]
        });
        self.stoppable && work > 0.0
    }
}

/// Takes over pose and velocity after a collision; wheels keep their own state.
fn unload(state: &mut BodyState, before: &BodyState, position_m: [f64; 2], velocity: [f64; 3]) {
    [state.x_m, state.y_m] = position_m;
    state.r = velocity[2];
    state.yaw_rad = before.yaw_rad + PHYSICS_PERIOD_S * state.r;
    let (sin, cos) = libm::sincos(state.yaw_rad);
    (state.cos_yaw, state.sin_yaw) = (cos, sin);
    state.u = velocity[0] * cos + velocity[1] * sin;
    state.v = velocity[1] * cos - velocity[0] * sin;
}
