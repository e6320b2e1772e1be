//! What is worn, bent or mounted wrong on a robot, beyond the tolerances of a healthy one.

use serde::Deserialize;

/// Everything neutral: a healthy robot. Wheel lists go by position in the description's `wheels`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wear {
    /// Time constant with which the motors' controllers smooth their set-points.
    pub motor_lag_s: f64,
    /// Dry friction added to every motor, at the wheel.
    pub coulomb_n_m: f64,
    /// Viscous friction added to every motor, at the wheel.
    pub viscous_n_m_s: f64,
    /// Dry friction at rest over that in motion, and the wheel speed at which half of the excess is gone.
    pub breakaway_ratio: f64,
    pub breakaway_rad_per_s: f64,
    /// Friction times (1 + this) when a wheel turns forward, (1 - this) backward.
    pub friction_asymmetry: f64,
    /// Rise of the winding's resistance at full current, and its time.
    pub heating: f64,
    pub heating_s: f64,
    /// Relative amplitude and phase of a wheel that runs out of true, over the wheel's angle.
    pub run_out: Vec<[f64; 2]>,
    /// Against the free direction of each omni wheel.
    pub roller_viscous_n_s_per_m: f64,
    /// Friction of the tread across the rolling direction over that along it.
    pub side_friction_scale: f64,
    /// Slip ratio added to a wheel that carries all the force the floor allows.
    pub slip_ratio_at_full_force: f64,
    /// How much a rolling tread creeps, over that of the reference rubber; 0: a tread so hard that it does not.
    pub creep_scale: f64,
    /// Distances of the wheels from the middle; of omni wheels along both axes, of others to the side.
    pub track_scale: f64,
    /// Dry friction about the casters' swivel axes, and their trail.
    pub swivel_n_m: f64,
    pub swivel_trail_m: f64,
    /// Between servo and wheels.
    pub steering_offset_rad: f64,
    pub steering_scale: f64,
    /// Added to the servo's lag.
    pub steering_lag_s: f64,
}

impl Default for Wear {
    fn default() -> Self {
        Self {
            motor_lag_s: 0.0,
            coulomb_n_m: 0.0,
            viscous_n_m_s: 0.0,
            breakaway_ratio: 1.0,
            breakaway_rad_per_s: 2.0,
            friction_asymmetry: 0.0,
            heating: 0.0,
            heating_s: 30.0,
            run_out: Vec::new(),
            roller_viscous_n_s_per_m: 0.0,
            side_friction_scale: 1.0,
            slip_ratio_at_full_force: 0.0,
            creep_scale: 1.0,
            track_scale: 1.0,
            swivel_n_m: 0.0,
            swivel_trail_m: 0.02,
            steering_offset_rad: 0.0,
            steering_scale: 1.0,
            steering_lag_s: 0.0,
        }
    }
}
