//! Play in the gears: rotor and wheel are one body while they push each other, and two while the rotor crosses.
//!
//! ```text
//! pushing   J dW/dt = t_m - friction + contact
//! crossing  s J dO/dt = t_m - friction          (1 - s) J dW/dt = contact
//! ```
//! `s`: share of the wheel's spin inertia that turns with the rotor. All dry and viscous friction of motor and gear is the
//! rotor's. They meet without rebound, with the momentum of both, and part as soon as the rotor alone would lag behind
//! (Nordin and Gutman, "Controlling mechanical systems with backlash", Automatica 38, 2002).
//!
//! Rotors that are told how they turn ([`Model::follow`]: an encoder at the rotor said it) do not answer to their wheels: a wheel goes as
//! its rotor does while it is pushed, and parts when the floor, less what drags on the wheel, would move it away from its rotor.

use crate::command::WheelCommand;
use crate::kernel;
use crate::model::Model;
use crate::state::BodyState;
use crate::{COULOMB_SCALE_RAD_PER_S, MAX_WHEELS, PHYSICS_PERIOD_S};

/// Share of the spin inertia that turns with the rotor: a rotor's inertia counts by the square of the gear ratio, some 20 to 100
/// for mobile robots, and is then several times that of wheel and hub.
const ROTOR_SHARE: f64 = 0.9;
/// Half plays below this are none, rad: a rotor crosses them in much less than a step, which would then be one without torque.
const NEGLIGIBLE_RAD: f64 = 1e-5;
/// A rotor this close to an end, as a share of half the play, after it parted.
const PARTED: f64 = 1.0 - 1e-9;

/// What the law remembers: place in the play, rotor's speed, wheel's speed at the end of the step before, all at the wheel.
pub(super) const WORDS: usize = 3 * MAX_WHEELS;

struct Memory<'a> {
    place_rad: &'a mut [f64],
    rotor_rad_per_s: &'a mut [f64],
    before_rad_per_s: &'a mut [f64],
}

impl Memory<'_> {
    fn of(words: &mut [f64]) -> Memory<'_> {
        let (place_rad, speeds) = words.split_at_mut(MAX_WHEELS);
        let (rotor_rad_per_s, before_rad_per_s) = speeds.split_at_mut(MAX_WHEELS);
        Memory {
            place_rad,
            rotor_rad_per_s,
            before_rad_per_s,
        }
    }
}

/// Puts rotors on the sides told (-1, 0 or 1), at the speeds of their wheels. The encoder sits at the rotor and starts at zero.
pub(super) fn settle(
    words: &mut [f64],
    half_rad: f64,
    side: impl Fn(usize) -> f64,
    base: &Model,
    state: &mut BodyState,
) {
    let memory = Memory::of(words);
    for lane in geared(base) {
        memory.place_rad[lane] = half_rad * side(lane);
        memory.rotor_rad_per_s[lane] = state.wheel[lane];
        memory.before_rad_per_s[lane] = state.wheel[lane];
        state.angle[lane] = -memory.place_rad[lane];
    }
}

/// Constants of the coming step: while a rotor crosses, its wheel is alone.
pub(super) fn prepare(words: &mut [f64], half_rad: f64, base: &Model, live: &mut Model) {
    let memory = Memory::of(words);
    for lane in geared(base) {
        live.spin_inertia_kg_m2[lane] = base.spin_inertia_kg_m2[lane];
        live.free[lane] = base.free[lane];
        if memory.place_rad[lane].abs() < half_rad && half_rad > NEGLIGIBLE_RAD {
            live.powered[lane] = 0.0;
            live.free[lane] = 1.0;
            live.spin_inertia_kg_m2[lane] *= 1.0 - ROTOR_SHARE;
            // What else drags on the wheel stays there.
            live.coulomb_n_m[lane] = (live.coulomb_n_m[lane] - base.coulomb_n_m[lane]).max(0.0);
            live.viscous_n_m_s[lane] = (live.viscous_n_m_s[lane] - base.viscous_n_m_s[lane]).max(0.0);
        }
    }
}

/// Rotors after a step of the wheels; `command` told those that follow it.
pub(super) fn finish(
    words: &mut [f64],
    half_rad: f64,
    base: &Model,
    live: &mut Model,
    state: &mut BodyState,
    command: &WheelCommand,
) {
    if half_rad <= NEGLIGIBLE_RAD {
        return;
    }
    if base.follows {
        followed(words, half_rad, base, live, state, command);
        return show(words, base, live, state);
    }
    let memory = Memory::of(words);
    for lane in geared(base) {
        let wheel = state.wheel[lane];
        let before = memory.before_rad_per_s[lane];
        let place = memory.place_rad[lane];
        if place.abs() < half_rad {
            let rotor_before = memory.rotor_rad_per_s[lane];
            let rotor = rotor_after(base, lane, rotor_before, state.voltage[lane]);
            let moved = 0.5 * PHYSICS_PERIOD_S * ((rotor_before + rotor) - (before + wheel));
            let reached = (place + moved).min(half_rad).max(-half_rad);
            memory.place_rad[lane] = reached;
            memory.rotor_rad_per_s[lane] = rotor;
            if reached.abs() >= half_rad {
                // Behind the end the relative motion ends.
                let joint = ROTOR_SHARE * rotor + (1.0 - ROTOR_SHARE) * wheel;
                memory.rotor_rad_per_s[lane] = joint;
                state.wheel[lane] = joint;
            }
            if let Some(motor) = &base.motor {
                let speed = memory.rotor_rad_per_s[lane];
                state.current[lane] = base.current_a(motor, lane, state.voltage[lane], speed);
            }
        } else {
            memory.rotor_rad_per_s[lane] = wheel;
            // Over the step just done: what the wheel was spared or had to give.
            let lag = rotor_after(base, lane, before, state.voltage[lane]) - wheel;
            if place * lag < 0.0 {
                // A play that is crossed within a step, 2 half = lag / T t^2 / 2, is not worth one without torque.
                let within = 4.0 * half_rad < lag.abs() * PHYSICS_PERIOD_S;
                memory.place_rad[lane] = if within { -place } else { place * PARTED };
            }
        }
        memory.before_rad_per_s[lane] = state.wheel[lane];
    }
    show(words, base, live, state);
}

/// Wheels of rotors that have turned as they were told.
fn followed(
    words: &mut [f64],
    half_rad: f64,
    base: &Model,
    live: &Model,
    state: &mut BodyState,
    command: &WheelCommand,
) {
    let memory = Memory::of(words);
    let rim_n = kernel::rim_forces_n(live, state);
    let mut has_changed = false;
    for lane in geared(base) {
        let wheel = state.wheel[lane];
        let place = memory.place_rad[lane];
        let rotor = command.wheel_rad_per_s[base.wheel_of_lane[lane]] / base.encoder[lane];
        memory.rotor_rad_per_s[lane] = rotor;
        if place.abs() < half_rad {
            let moved = PHYSICS_PERIOD_S * (rotor - 0.5 * (memory.before_rad_per_s[lane] + wheel));
            let reached = (place + moved).min(half_rad).max(-half_rad);
            memory.place_rad[lane] = reached;
            if reached.abs() >= half_rad {
                state.wheel[lane] = rotor;
                has_changed = true;
            }
        } else {
            // What its rotor had to give, the wheel's own inertia aside: it is small beside the body's, and measured speeds jump.
            let drag_n_m = (live.viscous_n_m_s[lane] - base.viscous_n_m_s[lane]).max(0.0) * wheel
                + (live.coulomb_n_m[lane] - base.coulomb_n_m[lane]).max(0.0)
                    * libm::tanh(wheel / COULOMB_SCALE_RAD_PER_S);
            if place * (live.radius_m[lane] * rim_n[lane] + drag_n_m) < 0.0 {
                memory.place_rad[lane] = place * PARTED;
                has_changed = true;
            }
        }
        memory.before_rad_per_s[lane] = state.wheel[lane];
    }
    if has_changed {
        // The matrix was that of wheels that follow, or do not.
        state.carry.clear();
    }
}

/// What encoders see of the play, for views and speed loops.
pub(super) fn show(words: &mut [f64], base: &Model, live: &mut Model, state: &BodyState) {
    let memory = Memory::of(words);
    for lane in geared(base) {
        live.gear_place_rad[lane] = memory.place_rad[lane];
        live.gear_rate_rad_per_s[lane] = memory.rotor_rad_per_s[lane] - state.wheel[lane];
    }
}

/// Speed of a rotor that nothing holds after a step under a voltage.
fn rotor_after(base: &Model, lane: usize, rotor_rad_per_s: f64, voltage_v: f64) -> f64 {
    let Some(motor) = &base.motor else {
        return rotor_rad_per_s;
    };
    let (k, per_ohm) = (base.torque_per_current[lane], base.per_ohm[lane]);
    let share = PHYSICS_PERIOD_S / (ROTOR_SHARE * base.spin_inertia_kg_m2[lane]);
    // As resistances, so that they can stop the rotor but not turn it round.
    let turns = (rotor_rad_per_s / COULOMB_SCALE_RAD_PER_S).abs();
    let rounding = if turns > 0.0 { libm::tanh(turns) / turns } else { 1.0 };
    let friction = base.coulomb_n_m[lane] / COULOMB_SCALE_RAD_PER_S * rounding + base.viscous_n_m_s[lane];
    let current_a = base.current_a(motor, lane, voltage_v, rotor_rad_per_s);
    if current_a.abs() < motor.current_limit_a {
        (rotor_rad_per_s + share * k * per_ohm * voltage_v) / (1.0 + share * (k * k * per_ohm + friction))
    } else {
        (rotor_rad_per_s + share * k * current_a) / (1.0 + share * friction)
    }
}

fn geared(base: &Model) -> impl Iterator<Item = usize> + use<> {
    let (lanes, present, driven, follows) = (base.lanes, base.powered, base.driven, base.follows);
    (0..lanes).filter(move |lane| present[*lane] > 0.0 || (follows && driven[*lane]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::reference_robot;
    use crate::pose::Pose;

    #[test]
    fn rotor_and_wheel_meet_with_the_momentum_of_both() {
        let base = Model::new(&reference_robot("diff2"));
        let (mut live, mut state) = (base.clone(), BodyState::at_rest(&base, Pose::default()));
        let half_rad = 0.01;
        let mut words = [0.0; WORDS];
        (words[0], words[MAX_WHEELS]) = (0.99 * half_rad, 10.0);
        // The voltage that keeps 10 rad/s but for friction.
        state.voltage[0] = 10.0 * base.torque_per_current[0];
        let alone = rotor_after(&base, 0, 10.0, state.voltage[0]);
        finish(
            &mut words,
            half_rad,
            &base,
            &mut live,
            &mut state,
            &WheelCommand::default(),
        );
        assert!(
            (state.wheel[0] - ROTOR_SHARE * alone).abs() < 1e-12,
            "{}",
            state.wheel[0]
        );
        assert_eq!((words[0], live.gear_rate_rad_per_s[0]), (half_rad, 0.0));
        assert_eq!(
            live.gear_place_rad[0], half_rad,
            "the encoder has turned with the rotor"
        );
    }
}
