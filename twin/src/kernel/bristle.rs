//! Sticking at rest: small deflections of the contacts that carry a load without slip.
//!
//! ```text
//! dz/dt = s - (w / w0)^2 z / T        force  (1 - |g|) mu N z / d        |z| <= d, z = 0 where w > w0
//! ```
//!
//! z is the deflection of a contact, s its slip, g = tanh(|s| / s0) s / |s| what slip alone gives, d = 1 mm the deflection
//! that carries mu N, w the fastest rim or slip of the robot, w0 = s0/2 and T = 1/480 s. Without it F = mu N g creeps:
//! s = 1.3 mm/s on a slope of 3 degrees. A robot that moves has none. The force is held during a physics step, which is
//! short against the 50 ms (d / s0) in which it settles.

use wide::f64x4;

use super::constants::{Constants, Lines};
use super::shape::{Shape, Speeds, slips};
use crate::lanes::{Real, each, four, most, one_below, sum};
use crate::model::Model;
use crate::state::BodyState;
use crate::{PHYSICS_PERIOD_S, SLIP_SCALE_M_PER_S};

/// Deflection that carries the whole friction, m.
const REACH_M: f64 = 1e-3;
/// Rim speed or slip beyond which nothing sticks, m/s.
const LOOSE_M_PER_S: f64 = 0.5 * SLIP_SCALE_M_PER_S;

/// Adds the forces of the deflections to those that do not change within the step.
#[cold]
#[inline(never)]
pub(super) fn load(c: &mut Constants, lines: &Lines, state: &BodyState, shape: &Shape) {
    let load_n = c.loads.at([state.accel_x, state.accel_y]).greater(f64x4::ZERO);
    let slip_share = (shape.along * shape.along + shape.across * shape.across).sqrt();
    let left = (f64x4::splat(1.0) - slip_share).greater(f64x4::ZERO);
    let per_m = c.friction * load_n * left * f64x4::splat(1.0 / REACH_M);
    let along = per_m * four(&state.bristle_along_m);
    let across = per_m * four(&state.bristle_across_m);
    c.torque_n_m = -(c.radius_m * along);
    let force = c.body_force;
    c.body_force = each(|j| force[j] + sum(lines.along[j] * along + lines.across[j] * across));
}

/// Energy in the deflections, J, with the loads at rest.
pub(crate) fn stored_j(model: &Model, state: &BodyState) -> f64 {
    let square_m2 = |lane: usize| {
        let (along, across) = (state.bristle_along_m[lane], state.bristle_across_m[lane]);
        along * along + across * across
    };
    let stiffness = |lane: usize| model.friction[lane] * model.load.all_down.at_rest_n[lane] / REACH_M;
    (0..model.lanes)
        .map(|lane| 0.5 * stiffness(lane) * square_m2(lane))
        .sum()
}

/// Whether all wheels roll slowly enough to stick.
#[inline(always)]
pub(super) fn is_slow(c: &Constants, wheel: f64x4) -> bool {
    most((c.radius_m * wheel).abs()) < LOOSE_M_PER_S
}

/// Moves the deflections through a step with these mean speeds; true while there are any.
#[cold]
#[inline(never)]
pub(super) fn advance<const SIDE: bool>(c: &Constants, state: &mut BodyState, mean: &Speeds, period_s: f64) -> bool {
    let (along, across) = slips::<SIDE>(c, mean);
    let h = f64x4::splat(period_s);
    let slip = (along * along + across * across).sqrt();
    let fastest = most((c.radius_m * mean.wheel).abs()).greater(most(slip)) * (1.0 / LOOSE_M_PER_S);
    let left = 1.0 - fastest * fastest * (period_s / PHYSICS_PERIOD_S);
    let left = if fastest < 1.0 { left } else { 0.0 };
    // Where there is no wheel nothing sticks.
    let sticking = f64x4::splat(left) * one_below(-c.friction, f64x4::ZERO);
    let z_l = sticking * (four(&state.bristle_along_m) + h * along);
    let z_t = sticking * (four(&state.bristle_across_m) + h * across);
    let size = (z_l * z_l + z_t * z_t).sqrt();
    let scale = f64x4::splat(REACH_M) / size.greater(f64x4::splat(REACH_M));
    let (z_l, z_t) = (scale * z_l, scale * z_t);
    state.bristle_along_m[..4].copy_from_slice(&z_l.to_array());
    state.bristle_across_m[..4].copy_from_slice(&z_t.to_array());
    most(size) > 0.0
}
