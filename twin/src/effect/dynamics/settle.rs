//! Where plays and casters stand at a start in motion.

use super::{Law, Runtime, gear};
use crate::free::Start;
use crate::state::BodyState;
use crate::{COULOMB_SCALE_RAD_PER_S, MAX_WHEELS};

/// Slower than this a caster's pivot tells nothing of where the caster points, m/s.
const SLOWEST_M_PER_S: f64 = 0.02;
/// Share of the dry friction, which the rotor has to overcome by itself, that a motor's torque must exceed to push its wheel on.
/// In steady motion it is all of it, and whether the wheel asks for more is lost in the current's noise: such a wheel is pushed.
const HELD_SHARE: f64 = 0.6;

impl Runtime {
    /// Places what the start does not tell by number: the wheels in the play of the steering by the way the steering came,
    /// motors on the pushing side of their gears, casters behind their motion.
    ///
    /// - `state`: already as the start tells.
    pub(crate) fn settle(&mut self, start: &Start, state: &mut BodyState) {
        let laws = core::mem::take(&mut self.dynamics.laws);
        for (law, at) in &laws {
            let memory = &mut self.memory[*at..at + law.words()];
            match law {
                Law::SteeringPlay { half_rad } => {
                    memory[0] = start.steering_history.dragged_rad(*half_rad).unwrap_or(0.0);
                }
                Law::GearPlay { half_rad } => {
                    let base = &self.base;
                    let wheel = state.wheel;
                    let side = |lane: usize| {
                        let torque_n_m = start.current_a[base.wheel_of_lane[lane]] * base.torque_per_current[lane];
                        driven_side(torque_n_m, wheel[lane], base.coulomb_n_m[lane])
                    };
                    gear::settle(memory, *half_rad, side, base, state);
                    gear::show(memory, base, &mut self.live, state);
                }
                Law::CasterSwivel { trail_m, .. } => {
                    let casters = self.base.lanes..self.base.load.count().min(MAX_WHEELS);
                    for caster in casters {
                        let (x, y) = (self.base.x_m[caster], self.base.y_m[caster]);
                        memory[caster] = trailing_rad(state.u - state.r * y, state.v + state.r * x, state.r * trail_m);
                    }
                }
                _ => {}
            }
        }
        self.dynamics.laws = laws;
    }
}

/// Side of the play on which the rotor pushes, -1, 0 (at rest without torque) or 1.
fn driven_side(torque_n_m: f64, wheel_rad_per_s: f64, coulomb_n_m: f64) -> f64 {
    let pushes = torque_n_m - HELD_SHARE * coulomb_n_m * libm::tanh(wheel_rad_per_s / COULOMB_SCALE_RAD_PER_S);
    if pushes == 0.0 { 0.0 } else { 1.0_f64.copysign(pushes) }
}

/// Heading of a caster that has come to rest against the body, rad: across its wheel the pivot moves at `turn_m_per_s`, yaw
/// rate times trail.
fn trailing_rad(vx: f64, vy: f64, turn_m_per_s: f64) -> f64 {
    let speed = (vx * vx + vy * vy).sqrt();
    if speed < SLOWEST_M_PER_S {
        return 0.0;
    }
    libm::atan2(vy, vx) - libm::asin((turn_m_per_s / speed).clamp(-1.0, 1.0))
}
