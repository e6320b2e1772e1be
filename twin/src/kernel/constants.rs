//! What a physics step of a robot takes as given.

use wide::f64x4;

use crate::lanes::four;
use crate::load::LoadRows;
use crate::model::{Geometry, Model};
use crate::state::BodyState;

/// Constants of one step; vectors run over the wheels.
#[derive(Clone, Copy)]
pub(super) struct Constants {
    pub(super) mass_kg: f64,
    pub(super) yaw_inertia_kg_m2: f64,
    /// Radius of gyration, m.
    pub(super) lever_m: f64,
    /// Forces that do not change within the step, in body axes: N, N, N m.
    pub(super) body_force: [f64; 3],
    /// Part of the acceleration that an accelerometer does not feel, m/s^2.
    pub(super) gravity_m_per_s2: [f64; 2],
    pub(super) current_limit_a: f64x4,
    /// Rolling direction, and its arm about the centre of mass.
    pub(super) along: [f64x4; 3],
    /// Sideways direction.
    pub(super) across: [f64x4; 3],
    pub(super) radius_m: f64x4,
    pub(super) spin_inertia_kg_m2: f64x4,
    pub(super) lateral: f64x4,
    pub(super) free: f64x4,
    /// Torque per current where a motor acts, N m/A.
    pub(super) powered: f64x4,
    pub(super) viscous_n_m_s: f64x4,
    pub(super) coulomb_n_m: f64x4,
    pub(super) torque_per_current: f64x4,
    pub(super) per_ohm: f64x4,
    pub(super) voltage_v: f64x4,
    /// 0 where there is no wheel.
    pub(super) friction: f64x4,
    pub(super) loads: Loads,
    /// Wheel torque that does not change within the step, N m.
    pub(super) torque_n_m: f64x4,
}

/// Normal loads over the acceleration (a_x, a_y) of the contact forces: N = at_rest + per_x a_x + per_y a_y.
#[derive(Clone, Copy)]
pub(super) struct Loads {
    pub(super) at_rest_n: f64x4,
    /// N s^2/m.
    pub(super) per_x: f64x4,
    pub(super) per_y: f64x4,
}

impl Loads {
    #[inline(always)]
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

impl Constants {
    #[inline(always)]
    pub(super) fn new(model: &Model, geometry: &Geometry, state: &BodyState) -> Constants {
        let (cos, sin) = (four(&geometry.cos), four(&geometry.sin));
        let torque_per_current = four(&model.torque_per_current);
        let limit_a = model.motor.as_ref().map_or(f64::INFINITY, |motor| motor.current_limit_a);
        Constants {
            mass_kg: model.mass_kg,
            yaw_inertia_kg_m2: model.yaw_inertia_kg_m2,
            lever_m: model.lever_m,
            body_force: model.body_force,
            gravity_m_per_s2: model.gravity_m_per_s2,
            current_limit_a: f64x4::splat(limit_a),
            along: [cos, sin, four(&geometry.arm_along_m)],
            across: [-sin, cos, four(&geometry.arm_across_m)],
            radius_m: four(&model.radius_m),
            spin_inertia_kg_m2: four(&model.spin_inertia_kg_m2),
            lateral: four(&model.lateral),
            free: four(&model.free),
            powered: four(&model.powered) * torque_per_current,
            viscous_n_m_s: four(&model.viscous_n_m_s),
            coulomb_n_m: four(&model.coulomb_n_m),
            torque_per_current,
            per_ohm: four(&model.per_ohm),
            voltage_v: four(&state.voltage),
            friction: four(&model.friction),
            loads: Loads::new(&model.load.all_down),
            torque_n_m: f64x4::splat(0.0),
        }
    }
}
