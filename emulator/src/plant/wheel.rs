//! One wheel with what hangs on it: contact, and a motor behind its gear where it is driven.

use super::Step;
use super::contact::{Bristles, Slip, renewal_per_m};
use super::motor::{Gear, Motor, MotorState};
use super::swivel::Swivel;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelKind {
    /// Free across its rolling direction.
    Omni,
    Standard,
    /// Carries load and drags a little.
    Caster,
}

/// Constants of one wheel.
#[derive(Debug, Clone, Copy)]
pub struct Wheel {
    pub kind: WheelKind,
    /// From the centre of mass.
    pub x_m: f64,
    pub y_m: f64,
    /// Cosine and sine of the rolling direction of a wheel that is not turned by a steering gear.
    pub straight: [f64; 2],
    pub steered: bool,
    pub radius_m: f64,
    /// Without the rotor.
    pub inertia_kg_m2: f64,
    /// Friction of the bearing of a wheel without motor.
    pub viscous_n_m_s: f64,
    /// Drag of rollers and casters over load.
    pub roller_drag: f64,
    /// Viscous drag of an omni wheel across.
    pub roller_viscous_n_s_per_m: f64,
    /// Friction across over that along.
    pub side_friction_scale: f64,
    /// Slip ratio added under all the force that friction allows.
    pub slip_ratio_at_full_force: f64,
    /// Creep of the rolling tread over that of the reference rubber.
    pub creep_scale: f64,
    /// Relative amplitude and phase of the radius over the wheel's angle.
    pub run_out: [f64; 2],
    pub swivel: Swivel,
    pub drive: Option<(Motor, Gear)>,
}

/// Moving parts of one wheel.
#[derive(Debug, Clone, Copy, Default)]
pub struct WheelState {
    pub speed_rad_per_s: f64,
    pub motor: MotorState,
    /// Rotor angle minus wheel angle.
    pub twist_rad: f64,
    pub bristles: Bristles,
    /// Cosine and sine of the rolling direction.
    pub direction: [f64; 2],
    /// Load of the last step.
    pub load_n: f64,
    /// A caster's direction from its wheel to its pivot, and the moment of its axis on the body.
    pub swivel_rad: f64,
    pub swivel_n_m: f64,
}

/// What a wheel meets in a step.
#[derive(Debug, Clone, Copy)]
pub struct WheelInput {
    /// Velocity of the wheel's hub over the floor in the body frame.
    pub hub_m_per_s: [f64; 2],
    /// Of the body.
    pub yaw_rate_rad_per_s: f64,
    pub load_n: f64,
    pub friction: f64,
    pub rolling_resistance: f64,
    /// `None`: power stage off.
    pub voltage_v: Option<f64>,
    /// Held by a fault.
    pub stuck: bool,
}

/// Slip speed at which roller and rolling drag have half their size.
const DRAG_HALF_M_PER_S: f64 = 0.01;

impl Wheel {
    /// Moves the wheel by a step and returns the force on the body in the body frame.
    pub fn step(&self, state: &mut WheelState, input: &WheelInput, step: Step) -> [f64; 2] {
        state.load_n = input.load_n;
        let [cos, sin] = state.direction;
        let [forward, left] = input.hub_m_per_s;
        if self.kind == WheelKind::Caster {
            let drag = (self.roller_drag + input.rolling_resistance) * input.load_n
                / ((forward * forward + left * left).sqrt() + DRAG_HALF_M_PER_S);
            let [fx, fy] = self.swivel.step(state, input, step);
            return [fx - drag * forward, fy - drag * left];
        }
        let (along, across) = (forward * cos + left * sin, left * cos - forward * sin);
        let [amplitude, phase_rad] = self.run_out;
        let mut radius_m = self.radius_m;
        if amplitude != 0.0 {
            radius_m *= 1.0 + amplitude * (state.motor.angle_rad - state.twist_rad + phase_rad).sin();
        }
        let rim_m_per_s = radius_m * state.speed_rad_per_s;
        let across_slip = if self.kind == WheelKind::Omni { 0.0 } else { -across };
        let slip = Slip {
            velocity_m_per_s: [rim_m_per_s - along, across_slip],
            rolling_m_per_s: rim_m_per_s.abs(),
            friction: input.friction,
            load_n: input.load_n,
            side_scale: self.side_friction_scale,
            creep_scale: self.creep_scale,
            more_renewal_per_m: renewal_per_m(self.slip_ratio_at_full_force, input.friction),
        };
        let [force_along, mut force_across] = state.bristles.step(&slip, step.dt_s);
        if self.kind == WheelKind::Omni {
            force_across = -self.roller_drag * input.load_n * across / (across.abs() + DRAG_HALF_M_PER_S)
                - self.roller_viscous_n_s_per_m * across;
        }
        self.spin(state, input, radius_m * force_along, step);
        [
            force_along * cos - force_across * sin,
            force_along * sin + force_across * cos,
        ]
    }

    fn spin(&self, state: &mut WheelState, input: &WheelInput, braking_n_m: f64, step: Step) {
        let dt_s = step.dt_s;
        let mut gear_n_m = 0.0;
        let mut viscous_n_m_s = self.viscous_n_m_s;
        if let Some((motor, gear)) = &self.drive {
            let rate = state.motor.speed_rad_per_s - state.speed_rad_per_s;
            gear_n_m = gear.torque_n_m(state.twist_rad, rate);
            motor.step(&mut state.motor, input.voltage_v, gear_n_m, step);
            viscous_n_m_s = 0.0;
        }
        if input.stuck {
            state.speed_rad_per_s = 0.0;
        } else {
            let torque_n_m = gear_n_m - braking_n_m;
            let rolling_n_m_s = input.rolling_resistance * input.load_n * self.radius_m
                / (state.speed_rad_per_s.abs() + DRAG_HALF_M_PER_S / self.radius_m);
            let braking = 1.0 + dt_s * (viscous_n_m_s + rolling_n_m_s) / self.inertia_kg_m2;
            state.speed_rad_per_s = (state.speed_rad_per_s + dt_s * torque_n_m / self.inertia_kg_m2) / braking;
        }
        if self.drive.is_some() {
            state.twist_rad += dt_s * (state.motor.speed_rad_per_s - state.speed_rad_per_s);
        }
    }

    /// Kinetic and elastic energy of the wheel and its motor.
    pub fn energy_j(&self, state: &WheelState) -> f64 {
        let spinning = 0.5 * self.inertia_kg_m2 * state.speed_rad_per_s * state.speed_rad_per_s
            + state.bristles.energy_j(state.load_n);
        let driven = self.drive.map_or(0.0, |(motor, gear)| {
            0.5 * motor.rotor_inertia_kg_m2 * state.motor.speed_rad_per_s * state.motor.speed_rad_per_s
                + 0.5 * motor.inductance_h * state.motor.current_a * state.motor.current_a
                + gear.energy_j(state.twist_rad)
        });
        spinning + driven
    }
}
