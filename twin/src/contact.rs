//! Collisions: robots that can touch something in the next tick are solved together by rapier for that tick.
//!
//! The solver's world is built anew every tick from the robots' own states, in robot order, so nothing of it has to
//! be stored. Wheels stay with the kernel: each physics step first integrates the robot with its wheel forces, then
//! gives rapier the pose before and the velocity after; what rapier changes is the impulse of the collision.

use rapier2d_f64::prelude::{
    BroadPhaseBvh, CCDSolver, ColliderBuilder, ColliderSet, ImpulseJointSet, IntegrationParameters, IslandManager,
    MassProperties, MultibodyJointSet, NarrowPhase, PhysicsPipeline, RigidBodyBuilder, RigidBodyHandle, RigidBodySet,
    Rotation, SoftBodySet, Vector,
};

use crate::command::WheelCommand;
use crate::effect::Runtime;
use crate::free::substep;
use crate::model::Model;
use crate::state::BodyState;
use crate::world::{Arena, Contact};
use crate::{CONTROL_PERIOD_S, PHYSICS_PERIOD_S, SUBSTEPS};

/// Friction of a bounding circle on a wall or another circle.
const HULL_FRICTION: f64 = 0.2;
/// Overlap that the solver leaves alone, m.
const ALLOWED_OVERLAP_M: f64 = 1e-5;
/// Gap below which the solver looks ahead for a contact, m: more than two robots close in one physics step at 10 m/s.
const PREDICTION_M: f64 = 0.05;
/// Solver iterations per physics step.
const SOLVER_ITERATIONS: usize = 8;
/// Thickness of a wall behind the arena's edge, m.
const WALL_M: f64 = 2.0;
/// Added to the swept radius against rounding, m.
const SWEEP_MARGIN_M: f64 = 1e-3;
/// Collider mark of a wall; robots carry their index.
const WALL_MARK: u128 = u128::MAX;

/// Distance that any robot may cover in the next tick, m, collisions with faster robots included.
pub(crate) fn reach_m(models: &[Model], states: &[BodyState]) -> f64 {
    let mut reach = 0.0_f64;
    let mut fastest_squared = 0.0_f64;
    for (model, state) in models.iter().zip(states) {
        fastest_squared = fastest_squared.max(state.u * state.u + state.v * state.v);
        reach = reach.max(model.max_acceleration_m_per_s2());
    }
    fastest_squared.sqrt() * CONTROL_PERIOD_S + 0.5 * reach * CONTROL_PERIOD_S * CONTROL_PERIOD_S + SWEEP_MARGIN_M
}

/// Finds who can touch anything in the next tick; buffers are kept between ticks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sweep {
    /// Robots by x, then by index: a function of the state alone.
    order: Vec<u32>,
    /// By robot.
    pub(crate) near: Vec<bool>,
    /// Robots with `near`, in robot order.
    pub(crate) involved: Vec<u32>,
}

impl Sweep {
    pub(crate) fn new(count: usize) -> Sweep {
        Sweep {
            order: (0..count as u32).collect(),
            near: vec![false; count],
            involved: Vec::with_capacity(count),
        }
    }

    pub(crate) fn find(&mut self, arena: &Arena, states: &[BodyState], radii_m: &[f64], reach_m: f64) {
        let (half_width, half_height) = (0.5 * arena.width_m, 0.5 * arena.height_m);
        for (i, state) in states.iter().enumerate() {
            let wall_m = (half_width - state.x_m.abs()).min(half_height - state.y_m.abs()) - radii_m[i];
            self.near[i] = wall_m < reach_m;
        }
        let before = |a: u32, b: u32| {
            let (xa, xb) = (states[a as usize].x_m, states[b as usize].x_m);
            xa < xb || (xa == xb && a < b)
        };
        for sorted in 1..self.order.len() {
            let mut at = sorted;
            while at > 0 && before(self.order[at], self.order[at - 1]) {
                self.order.swap(at, at - 1);
                at -= 1;
            }
        }
        let largest_m = radii_m.iter().fold(0.0_f64, |largest, radius| largest.max(*radius));
        for (at, a) in self.order.iter().enumerate() {
            let (a, state) = (*a as usize, &states[*a as usize]);
            for b in &self.order[at + 1..] {
                let (b, other) = (*b as usize, &states[*b as usize]);
                let (dx, dy) = (other.x_m - state.x_m, other.y_m - state.y_m);
                if dx > radii_m[a] + largest_m + 2.0 * reach_m {
                    break;
                }
                let limit = radii_m[a] + radii_m[b] + 2.0 * reach_m;
                if dx * dx + dy * dy < limit * limit {
                    self.near[a] = true;
                    self.near[b] = true;
                }
            }
        }
        self.involved.clear();
        self.involved
            .extend((0..states.len() as u32).filter(|robot| self.near[*robot as usize]));
    }
}

/// A rapier world for one tick.
struct Solver {
    pipeline: PhysicsPipeline,
    parameters: IntegrationParameters,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    ccd: CCDSolver,
}

impl Solver {
    fn new() -> Solver {
        let parameters = IntegrationParameters {
            dt: PHYSICS_PERIOD_S,
            normalized_allowed_linear_error: ALLOWED_OVERLAP_M,
            normalized_prediction_distance: PREDICTION_M,
            num_solver_iterations: SOLVER_ITERATIONS,
            contact_recycling: false,
            ..IntegrationParameters::default()
        };
        Solver {
            pipeline: PhysicsPipeline::new(),
            parameters,
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            bodies: RigidBodySet::new(),
            colliders: ColliderSet::new(),
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd: CCDSolver::new(),
        }
    }

    fn add_walls(&mut self, arena: &Arena) {
        let (half_width, half_height) = (0.5 * arena.width_m, 0.5 * arena.height_m);
        let half_wall = 0.5 * WALL_M;
        let sides = [
            (half_width + half_wall, 0.0, half_wall, half_height + WALL_M),
            (-half_width - half_wall, 0.0, half_wall, half_height + WALL_M),
            (0.0, half_height + half_wall, half_width + WALL_M, half_wall),
            (0.0, -half_height - half_wall, half_width + WALL_M, half_wall),
        ];
        for (x, y, half_x, half_y) in sides {
            let wall = ColliderBuilder::cuboid(half_x, half_y).translation(Vector::new(x, y));
            self.colliders.insert(
                wall.friction(HULL_FRICTION)
                    .restitution(0.0)
                    .user_data(WALL_MARK)
                    .build(),
            );
        }
    }

    fn add_robot(&mut self, robot: u32, model: &Model, radius_m: f64) -> RigidBodyHandle {
        let mass = MassProperties::new(Vector::new(0.0, 0.0), model.mass_kg, model.yaw_inertia_kg_m2);
        let body = RigidBodyBuilder::dynamic()
            .additional_mass_properties(mass)
            .gravity_scale(0.0)
            .can_sleep(false);
        let handle = self.bodies.insert(body.build());
        // The body frame of the solver sits at the centre of mass.
        let hull = ColliderBuilder::ball(radius_m)
            .translation(Vector::new(-model.com_m[0], -model.com_m[1]))
            .density(0.0)
            .friction(HULL_FRICTION)
            .restitution(0.0)
            .user_data(u128::from(robot));
        self.colliders
            .insert_with_parent(hull.build(), handle, &mut self.bodies);
        handle
    }

    fn step(&mut self) {
        self.pipeline.step(
            Vector::new(0.0, 0.0),
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            &mut self.ccd,
            &(),
            &(),
        );
    }

    /// Pairs with an impulse in the last step, in order.
    fn touching(&self) -> Vec<Contact> {
        let mark = |handle| {
            self.colliders
                .get(handle)
                .map_or(WALL_MARK, |collider| collider.user_data)
        };
        let mut pairs: Vec<Contact> = Vec::new();
        for pair in self.narrow_phase.contact_pairs() {
            if pair.total_impulse_magnitude() <= 0.0 {
                continue;
            }
            let (first, second) = (mark(pair.collider1), mark(pair.collider2));
            let (a, b) = (first.min(second), first.max(second));
            pairs.push(Contact {
                a: a as u32,
                b: if b == WALL_MARK { None } else { Some(b as u32) },
            });
        }
        pairs.sort();
        pairs.dedup();
        pairs
    }
}

/// The robots of a world.
pub(crate) struct Bodies<'a> {
    pub(crate) models: &'a [Model],
    pub(crate) radii_m: &'a [f64],
    pub(crate) runtimes: &'a mut [Option<Runtime>],
    pub(crate) states: &'a mut [BodyState],
}

/// One control tick of the robots in `involved`; pairs that pushed each other are added to `contacts`.
pub(crate) fn resolve_tick(
    arena: &Arena,
    bodies: Bodies<'_>,
    commands: &[WheelCommand],
    involved: &[u32],
    contacts: &mut Vec<Contact>,
) {
    let Bodies {
        models,
        radii_m,
        runtimes,
        states,
    } = bodies;
    let mut solver = Solver::new();
    solver.add_walls(arena);
    let handles: Vec<RigidBodyHandle> = involved
        .iter()
        .map(|robot| solver.add_robot(*robot, &models[*robot as usize], radii_m[*robot as usize]))
        .collect();
    let mut befores: Vec<BodyState> = involved.iter().map(|robot| states[*robot as usize]).collect();
    for _ in 0..SUBSTEPS {
        for (slot, robot) in involved.iter().enumerate() {
            let robot = *robot as usize;
            befores[slot] = states[robot];
            substep(
                &models[robot],
                &mut runtimes[robot],
                &mut states[robot],
                &commands[robot],
            );
            load(&mut solver.bodies, handles[slot], &befores[slot], &states[robot]);
        }
        solver.step();
        let touching = solver.touching();
        for (slot, robot) in involved.iter().enumerate() {
            if touching
                .iter()
                .any(|contact| contact.a == *robot || contact.b == Some(*robot))
            {
                unload(
                    &solver.bodies,
                    handles[slot],
                    &befores[slot],
                    &mut states[*robot as usize],
                );
            }
        }
        contacts.extend(touching);
    }
    contacts.sort();
    contacts.dedup();
}

/// Pose before the step, velocity after it.
fn load(bodies: &mut RigidBodySet, handle: RigidBodyHandle, before: &BodyState, after: &BodyState) {
    let Some(body) = bodies.get_mut(handle) else { return };
    let velocity = Vector::new(
        after.u * after.cos_yaw - after.v * after.sin_yaw,
        after.u * after.sin_yaw + after.v * after.cos_yaw,
    );
    body.set_translation(Vector::new(before.x_m, before.y_m), true);
    // Turns the hull about the centre of mass; nothing where they coincide.
    body.set_rotation(Rotation::from_cos_sin_unchecked(before.cos_yaw, before.sin_yaw), true);
    body.set_linvel(velocity, true);
    body.set_angvel(after.r, true);
}

/// Takes over pose and velocity after a collision; wheels keep their own state.
fn unload(bodies: &RigidBodySet, handle: RigidBodyHandle, before: &BodyState, state: &mut BodyState) {
    let Some(body) = bodies.get(handle) else { return };
    let (position, velocity) = (body.translation(), body.linvel());
    state.x_m = position.x;
    state.y_m = position.y;
    state.r = body.angvel();
    state.yaw_rad = before.yaw_rad + PHYSICS_PERIOD_S * state.r;
    let (sin, cos) = libm::sincos(state.yaw_rad);
    (state.cos_yaw, state.sin_yaw) = (cos, sin);
    state.u = velocity.x * cos + velocity.y * sin;
    state.v = velocity.y * cos - velocity.x * sin;
}
