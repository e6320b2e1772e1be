//! What a physics step of a robot takes as given, laid out by wheel.

use core::ops::Deref;

use wide::f64x4;

use crate::lanes::{LANES, Real, four};
use crate::load::LoadRows;
use crate::model::Model;
use crate::state::BodyState;
use crate::steering::SteeringModel;

/// A robot's constants as vectors over its wheels; made from its [`Model`] whenever that changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fixed {
    pub(super) mass_kg: f64,
    pub(super) yaw_inertia_kg_m2: f64,
    /// Radius of gyration, m.
    pub(super) lever_m: f64,
    pub(super) current_limit_a: f64x4,
    pub(super) radius_m: f64x4,
    pub(super) radius2_m2: f64x4,
    pub(super) spin_inertia_kg_m2: f64x4,
    pub(super) lateral: f64x4,
    /// 1 where the wheel speed is a state.
    pub(super) free: f64x4,
    /// 1 where a speed loop runs.
    driven: f64x4,
    /// 1 where a motor acts, and its torque per current there, N m/A.
    pub(super) present: f64x4,
    pub(super) powered: f64x4,
    /// Torque over wheel speed of a motor within its current limit, N m s.
    pub(super) back_torque: f64x4,
    pub(super) viscous_n_m_s: f64x4,
    pub(super) coulomb_n_m: f64x4,
    pub(super) torque_per_current: f64x4,
    pub(super) per_ohm: f64x4,
    /// 0 where there is no wheel.
    pub(super) friction: f64x4,
    /// One over the described friction.
    pub(super) per_nominal_friction: f64x4,
    pub(super) all_down: Loads,
    /// At steering angle zero.
    pub(super) straight: Lines,
}

/// Directions of the wheels: rolling and sideways, each with its arm about the centre of mass, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lines {
    pub(super) along: [f64x4; 3],
    pub(super) across: [f64x4; 3],
}

impl Lines {
    /// With the steered wheels turned to a bicycle angle of this tangent: their axles point at the turning centre.
    #[inline(always)]
    pub(crate) fn steered(model: &Model, steering: &SteeringModel, tan_bicycle: f64) -> Lines {
        let (x_m, y_m) = (four(&model.x_m), four(&model.y_m));
        let tan = f64x4::splat(tan_bicycle);
        let wheelbase_m = f64x4::splat(steering.wheelbase_m);
        // Positions from the body origin.
        let (x, y) = (x_m + f64x4::splat(model.com_m[0]), y_m + f64x4::splat(model.com_m[1]));
        let along = wheelbase_m - y * tan;
        let across = (x - f64x4::splat(steering.fixed_axle_x_m)) * tan;
        let scale = f64x4::splat(1.0).signed_like(wheelbase_m) / (along * along + across * across).sqrt();
        let turned = four(&model.steered.map(|steered| if steered { 1.0 } else { 0.0 }));
        // (cos, sin) of the turn where the wheel is steered, else (1, 0).
        let turn_cos = turned * (along * scale) + (f64x4::splat(1.0) - turned);
        let turn_sin = turned * (across * scale);
        let (cos, sin) = (model.fixed.straight.along[0], model.fixed.straight.along[1]);
        Lines::new(
            x_m,
            y_m,
            cos * turn_cos - sin * turn_sin,
            sin * turn_cos + cos * turn_sin,
        )
    }

    #[inline(always)]
    pub(super) fn new(x_m: f64x4, y_m: f64x4, cos: f64x4, sin: f64x4) -> Lines {
        Lines {
            along: [cos, sin, x_m * sin - y_m * cos],
            across: [-sin, cos, x_m * cos + y_m * sin],
        }
    }
}

/// Normal loads over the acceleration (a_x, a_y) of the contact forces: N = at_rest + per_x a_x + per_y a_y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Loads {
    pub(super) at_rest_n: f64x4,
    /// N s^2/m.
    pub(super) per_x: f64x4,
    pub(super) per_y: f64x4,
}

impl Loads {
    pub(super) fn new(rows: &LoadRows) -> Loads {
        Loads {
            at_rest_n: four(&rows.at_rest_n),
            per_x: four(&rows.per_x),
            per_y: four(&rows.per_y),
        }
    }

    /// What an acceleration adds, N.
    #[inline(always)]
    pub(super) fn transfer(&self, [a_x, a_y]: [f64; 2]) -> f64x4 {
        self.per_x * f64x4::splat(a_x) + self.per_y * f64x4::splat(a_y)
    }

    #[inline(always)]
    pub(super) fn at(&self, accel: [f64; 2]) -> f64x4 {
        self.at_rest_n + self.transfer(accel)
    }
}

impl Fixed {
    pub(crate) const EMPTY: Fixed = {
        let zero = f64x4::ZERO;
        let loads = Loads {
            at_rest_n: zero,
            per_x: zero,
            per_y: zero,
        };
        Fixed {
            mass_kg: 0.0,
            yaw_inertia_kg_m2: 0.0,
            lever_m: 0.0,
            current_limit_a: zero,
            radius_m: zero,
            radius2_m2: zero,
            spin_inertia_kg_m2: zero,
            lateral: zero,
            free: zero,
            driven: zero,
            present: zero,
            powered: zero,
            back_torque: zero,
            viscous_n_m_s: zero,
            coulomb_n_m: zero,
            torque_per_current: zero,
            per_ohm: zero,
            friction: zero,
            per_nominal_friction: zero,
            all_down: loads,
            straight: Lines {
                along: [zero; 3],
                across: [zero; 3],
            },
        }
    };

    #[inline(always)]
    pub(crate) fn straight(&self) -> Lines {
        self.straight
    }

    /// 1 where a speed loop runs.
    #[inline(always)]
    pub(crate) fn driven(&self) -> f64x4 {
        self.driven
    }

    #[inline(always)]
    pub(crate) fn new(model: &Model) -> Fixed {
        const { assert!(LANES == 4) };
        let (present, torque_per_current) = (four(&model.powered), four(&model.torque_per_current));
        let (radius_m, per_ohm) = (four(&model.radius_m), four(&model.per_ohm));
        let limit_a = model
            .motor
            .as_ref()
            .map_or(f64::INFINITY, |motor| motor.current_limit_a);
        let powered = present * torque_per_current;
        Fixed {
            mass_kg: model.mass_kg,
            yaw_inertia_kg_m2: model.yaw_inertia_kg_m2,
            lever_m: model.lever_m,
            current_limit_a: f64x4::splat(limit_a),
            radius_m,
            radius2_m2: radius_m * radius_m,
            spin_inertia_kg_m2: four(&model.spin_inertia_kg_m2),
            lateral: four(&model.lateral),
            free: four(&model.free),
            driven: four(&model.driven.map(|driven| if driven { 1.0 } else { 0.0 })),
            present,
            powered,
            back_torque: powered * (torque_per_current * per_ohm),
            viscous_n_m_s: four(&model.viscous_n_m_s),
            coulomb_n_m: four(&model.coulomb_n_m),
            torque_per_current,
            per_ohm,
            friction: four(&model.friction),
            per_nominal_friction: f64x4::splat(1.0 / model.nominal_friction),
            all_down: Loads::new(&model.load.all_down),
            straight: Lines::new(
                four(&model.x_m),
                four(&model.y_m),
                four(&model.geometry.cos),
                four(&model.geometry.sin),
            ),
        }
    }
}

impl Model {
    /// Lays out anew what effects change from step to step: friction, grip, radii, inertia and strength of the wheels.
    #[inline(always)]
    pub(crate) fn refreeze(&mut self) {
        let (present, per_ohm) = (four(&self.powered), four(&self.per_ohm));
        let radius_m = four(&self.radius_m);
        let fixed = &mut self.fixed;
        fixed.radius_m = radius_m;
        fixed.radius2_m2 = radius_m * radius_m;
        fixed.spin_inertia_kg_m2 = four(&self.spin_inertia_kg_m2);
        fixed.free = four(&self.free);
        fixed.present = present;
        fixed.powered = present * fixed.torque_per_current;
        fixed.back_torque = fixed.powered * (fixed.torque_per_current * per_ohm);
        fixed.viscous_n_m_s = four(&self.viscous_n_m_s);
        fixed.coulomb_n_m = four(&self.coulomb_n_m);
        fixed.per_ohm = per_ohm;
        fixed.friction = four(&self.friction);
    }
}

/// Constants of one step.
pub(super) struct Constants<'a> {
    pub(super) fixed: &'a Fixed,
    pub(super) lines: &'a Lines,
    pub(super) loads: Loads,
    pub(super) voltage_v: f64x4,
    /// Forces that do not change within the step, in body axes: N, N, N m.
    pub(super) body_force: [f64; 3],
    /// Part of the acceleration that an accelerometer does not feel, m/s^2.
    pub(super) gravity_m_per_s2: [f64; 2],
    /// Wheel torque that does not change within the step, N m.
    pub(super) torque_n_m: f64x4,
}

impl Deref for Constants<'_> {
    type Target = Fixed;

    #[inline(always)]
    fn deref(&self) -> &Fixed {
        self.fixed
    }
}

impl<'a> Constants<'a> {
    #[inline(always)]
    pub(super) fn new(model: &'a Model, lines: &'a Lines, state: &BodyState) -> Constants<'a> {
        Constants {
            fixed: &model.fixed,
            lines,
            loads: model.fixed.all_down,
            voltage_v: four(&state.voltage),
            body_force: model.body_force,
            gravity_m_per_s2: model.gravity_m_per_s2,
            torque_n_m: f64x4::ZERO,
        }
    }
}
