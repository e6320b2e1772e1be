//! The rapier world of one tick.

use rapier2d_f64::prelude::{
    BroadPhaseBvh, CCDSolver, ColliderBuilder, ColliderSet, Group, ImpulseJointSet, IntegrationParameters,
    InteractionGroups, InteractionTestMode, IslandManager, MassProperties, MultibodyJointSet, NarrowPhase,
    PhysicsPipeline, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Rotation, SoftBodySet, SpringCoefficients,
    Vector,
};

use crate::PHYSICS_PERIOD_S;
use crate::model::Model;
use crate::world::Arena;
use crate::world::obstacle::Obstacle;
use crate::world::shape::{Placed, Shape};

/// Friction of a bounding circle on a wall, an obstacle or another circle.
const HULL_FRICTION: f64 = 0.2;
/// Overlap that the solver leaves alone, m.
const ALLOWED_OVERLAP_M: f64 = 1e-5;
/// Gap below which the solver looks ahead for a contact, m: more than two robots close in one physics step at 10 m/s.
const PREDICTION_M: f64 = 0.05;
/// Solver iterations per physics step.
const SOLVER_ITERATIONS: usize = 8;
/// Passes in each that take the velocity of pushing overlaps apart out again; one leaves mm/s in a squeezed row.
const STABILIZATION_ITERATIONS: usize = 4;
/// Stiffness of a contact between moving bodies and with a fixed one, Hz: rapier's own values for 60 steps a second,
/// at our rate. Softer, a robot that squeezes a light obstacle sinks in by millimetres.
const SOFTNESS_HZ: [f64; 2] = [30.0 * 8.0, 60.0 * 8.0];
const SOFTNESS_DAMPING: f64 = 10.0;
/// Thickness of a wall behind the arena's edge, m.
const WALL_M: f64 = 2.0;

/// Mass of a held obstacle over its own.
pub(super) const HELD: f64 = 1e6;
/// What does not move, and what is held. Held bodies meet only what can push them: between two of them, or with a wall,
/// the smallest overlap would be an impulse beyond all others.
const UNMOVED: Group = Group::GROUP_1;
const HOLDING: Group = Group::GROUP_2;
const MOVED: Group = Group::GROUP_3;

/// What a collider stands for; the order is that of the reported pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mark {
    Robot(u32),
    Pushable(u32),
    Fixed(u32),
    Wall,
}

impl Mark {
    fn number(self) -> u128 {
        let (kind, index) = match self {
            Mark::Robot(index) => (0_u128, index),
            Mark::Pushable(index) => (1, index),
            Mark::Fixed(index) => (2, index),
            Mark::Wall => (3, 0),
        };
        kind << 32 | u128::from(index)
    }

    fn of_number(number: u128) -> Mark {
        let index = number as u32;
        match number >> 32 {
            0 => Mark::Robot(index),
            1 => Mark::Pushable(index),
            2 => Mark::Fixed(index),
            _ => Mark::Wall,
        }
    }
}

/// Position and heading of a body of the solver: its centre of mass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

/// A rapier world for one tick.
pub(super) struct Solver {
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
    pub(super) fn new() -> Solver {
        let parameters = IntegrationParameters {
            dt: PHYSICS_PERIOD_S,
            normalized_allowed_linear_error: ALLOWED_OVERLAP_M,
            normalized_prediction_distance: PREDICTION_M,
            contact_softness: SpringCoefficients::new(SOFTNESS_HZ[0], SOFTNESS_DAMPING),
            static_contact_softness: SpringCoefficients::new(SOFTNESS_HZ[1], SOFTNESS_DAMPING),
            num_solver_iterations: SOLVER_ITERATIONS,
            num_internal_stabilization_iterations: STABILIZATION_ITERATIONS,
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

    pub(super) fn add_walls(&mut self, arena: &Arena) {
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
                hull(wall, Mark::Wall)
                    .solver_groups(groups(UNMOVED, Group::ALL))
                    .build(),
            );
        }
    }

    pub(super) fn add_fixed(&mut self, fixed: u32, placed: &Placed) {
        let mut body = RigidBodyBuilder::fixed().build();
        body.set_translation(Vector::new(placed.x_m, placed.y_m), false);
        body.set_rotation(Rotation::from_cos_sin_unchecked(placed.cos, placed.sin), false);
        let handle = self.bodies.insert(body);
        let outline = hull(outline(placed.shape), Mark::Fixed(fixed)).solver_groups(groups(UNMOVED, Group::ALL));
        self.colliders
            .insert_with_parent(outline.build(), handle, &mut self.bodies);
    }

    pub(super) fn add_robot(&mut self, robot: u32, model: &Model, radius_m: f64) -> RigidBodyHandle {
        let mass = MassProperties::new(Vector::new(0.0, 0.0), model.mass_kg, model.yaw_inertia_kg_m2);
        // The body frame of the solver sits at the centre of mass.
        let circle = ColliderBuilder::ball(radius_m).translation(Vector::new(-model.com_m[0], -model.com_m[1]));
        self.add_body(mass, hull(circle, Mark::Robot(robot)))
    }

    pub(super) fn add_pushable(&mut self, index: u32, obstacle: &Obstacle) -> RigidBodyHandle {
        self.add_body(
            mass_of(obstacle, 1.0),
            hull(outline(obstacle.shape), Mark::Pushable(index)),
        )
    }

    fn add_body(&mut self, mass: MassProperties, outline: ColliderBuilder) -> RigidBodyHandle {
        let body = RigidBodyBuilder::dynamic()
            .additional_mass_properties(mass)
            .gravity_scale(0.0)
            .can_sleep(false);
        let handle = self.bodies.insert(body.build());
        self.colliders
            .insert_with_parent(outline.density(0.0).build(), handle, &mut self.bodies);
        handle
    }

    /// Holds an obstacle by giving it an immense mass, or lets it go.
    pub(super) fn hold(&mut self, handle: RigidBodyHandle, obstacle: &Obstacle, held: bool) {
        let Some(body) = self.bodies.get_mut(handle) else {
            return;
        };
        let (factor, groups) = if held {
            (HELD, groups(HOLDING, MOVED))
        } else {
            (1.0, InteractionGroups::all())
        };
        body.set_additional_mass_properties(mass_of(obstacle, factor), true);
        for collider in body.colliders() {
            if let Some(collider) = self.colliders.get_mut(*collider) {
                collider.set_solver_groups(groups);
            }
        }
    }

    /// Sets a body's place and its velocity in the world frame, `[m/s, m/s, rad/s]`.
    pub(super) fn load(&mut self, handle: RigidBodyHandle, place: Place, velocity: [f64; 3]) {
        let Some(body) = self.bodies.get_mut(handle) else {
            return;
        };
        body.set_translation(Vector::new(place.x_m, place.y_m), true);
        // Turns the hull about the centre of mass; nothing where they coincide.
        body.set_rotation(Rotation::from_cos_sin_unchecked(place.cos, place.sin), true);
        body.set_linvel(Vector::new(velocity[0], velocity[1]), true);
        body.set_angvel(velocity[2], true);
    }

    /// Velocity of a body after the last step.
    pub(super) fn velocity(&self, handle: RigidBodyHandle) -> [f64; 3] {
        self.bodies.get(handle).map_or([0.0; 3], |body| {
            let linear = body.linvel();
            [linear.x, linear.y, body.angvel()]
        })
    }

    /// Centre of mass of a body after the last step.
    pub(super) fn position_m(&self, handle: RigidBodyHandle) -> Option<[f64; 2]> {
        let position = self.bodies.get(handle)?.translation();
        Some([position.x, position.y])
    }

    pub(super) fn step(&mut self) {
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
    pub(super) fn touching(&self, pairs: &mut Vec<(Mark, Mark)>) {
        let mark = |handle| {
            self.colliders
                .get(handle)
                .map_or(Mark::Wall, |collider| Mark::of_number(collider.user_data))
        };
        pairs.clear();
        for pair in self.narrow_phase.contact_pairs() {
            if pair.total_impulse_magnitude() <= 0.0 {
                continue;
            }
            let (first, second) = (mark(pair.collider1), mark(pair.collider2));
            pairs.push((first.min(second), first.max(second)));
        }
        pairs.sort();
        pairs.dedup();
    }
}

fn outline(shape: Shape) -> ColliderBuilder {
    match shape {
        Shape::Circle { radius_m } => ColliderBuilder::ball(radius_m),
        Shape::Rectangle { length_m, width_m } => ColliderBuilder::cuboid(0.5 * length_m, 0.5 * width_m),
    }
}

fn hull(outline: ColliderBuilder, mark: Mark) -> ColliderBuilder {
    outline
        .friction(HULL_FRICTION)
        .restitution(0.0)
        .user_data(mark.number())
}

fn groups(memberships: Group, filter: Group) -> InteractionGroups {
    InteractionGroups::new(memberships, filter, InteractionTestMode::And)
}

fn mass_of(obstacle: &Obstacle, factor: f64) -> MassProperties {
    MassProperties::new(
        Vector::new(0.0, 0.0),
        factor * obstacle.mass_kg,
        factor * obstacle.inertia_kg_m2,
    )
}
