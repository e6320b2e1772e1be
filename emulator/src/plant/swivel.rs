//! Swivel of a caster: a wheel behind a pivot that follows it, held by friction in the axis.
//!
//! The contact point trails the pivot by t and does not slip sideways: t (dphi/dt + r) = v_across, phi from the body's
//! forward axis to the line from wheel to pivot. The axis' friction M turns the body, and the floor's side force at the
//! wheel, M / t, carries it.

use super::Step;
use super::wheel::{WheelInput, WheelState};

/// Constants of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swivel {
    pub friction_n_m: f64,
    pub trail_m: f64,
}

/// Swivel rate at which friction has half its size.
const HALF_RAD_PER_S: f64 = 0.15;

impl Swivel {
    /// Turns the caster by a step; returns the side force on the pivot in the body frame and leaves the axis' moment in `state`.
    pub fn step(&self, state: &mut WheelState, input: &WheelInput, step: Step) -> [f64; 2] {
        if self.friction_n_m == 0.0 {
            return [0.0; 2];
        }
        let (sin, cos) = state.swivel_rad.sin_cos();
        let [forward, left] = input.hub_m_per_s;
        let (along, across) = (forward * cos + left * sin, left * cos - forward * sin);
        let rate = across / self.trail_m - input.yaw_rate_rad_per_s;
        // Implicit in the pull of the motion along, which turns the wheel behind the pivot or out of its way.
        state.swivel_rad += step.dt_s * rate / (1.0 + step.dt_s * along.abs() / self.trail_m);
        state.swivel_n_m = self.friction_n_m * rate / (rate.abs() + HALF_RAD_PER_S);
        let side_n = -state.swivel_n_m / self.trail_m;
        [-sin * side_n, cos * side_n]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(hub_m_per_s: [f64; 2], yaw_rate_rad_per_s: f64) -> WheelInput {
        WheelInput {
            hub_m_per_s,
            yaw_rate_rad_per_s,
            load_n: 30.0,
            friction: 0.8,
            rolling_resistance: 0.0,
            voltage_v: None,
            stuck: false,
        }
    }

    #[test]
    fn follows_its_pivot_and_only_takes_power() {
        let swivel = Swivel {
            friction_n_m: 0.1,
            trail_m: 0.02,
        };
        let mut state = WheelState::default();
        let step = Step { dt_s: 1.0 / 7680.0 };
        let motion = input([0.3, 0.4], 0.5);
        let mut taken_j = 0.0;
        for _ in 0..7680 {
            let [fx, fy] = swivel.step(&mut state, &motion, step);
            taken_j -= step.dt_s * (fx * 0.3 + fy * 0.4 + state.swivel_n_m * 0.5);
        }
        // In the end it stands still in a body that turns: across / trail = r.
        let across = 0.4 * state.swivel_rad.cos() - 0.3 * state.swivel_rad.sin();
        assert!((across / 0.02 - 0.5).abs() < 1e-3, "{}", state.swivel_rad);
        assert!(taken_j > 0.0, "{taken_j}");
    }
}
