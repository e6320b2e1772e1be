//! One linearly implicit step of wheels, contact and body together.
//!
//! With y = (u, v, r, W_i), the equations are M y' = f(y). Each wheel's load follows the acceleration that the contact
//! forces give, N = N0 + n . a, so the force it adds in proportion to a belongs to the matrix M. The step is the
//! two-stage Rosenbrock method with gamma = 1 - 1/sqrt 2 whose stages are both evaluated at the start:
//!
//! ```text
//! (M - gamma h J) k1 = f(y0)
//! (M - gamma h J) k2 = M k1
//! y1 = y0 + h (gamma k1 + (1 - gamma) k2)
//! ```
//!
//! It is of second order (y'' = J y') and L-stable, and takes one evaluation of the contact, which the step before has
//! already made to see its own error: what f(y1) is beyond its linear model f(y0) + J (y1 - y0) grows with the square
//! of time where J is that of y0, and linearly where it is that of a state a few steps ago; so a third or a half of it,
//! pulled through the same matrix, is the error.

use wide::f64x4;

use super::constants::Constants;
use super::matrix::Matrix;
use super::shape::{Shape, Speeds, slips};
use crate::COULOMB_SCALE_RAD_PER_S;
use crate::lanes::{Real, each, most, one_below, sum};

/// 1 - 1/sqrt 2.
pub(super) const GAMMA: f64 = 0.292_893_218_813_452_5;
/// Allowed error of the body's velocity in one part of a step (heading at the radius of gyration), m/s.
const BODY_TOLERANCE_M_PER_S: f64 = 1e-5;
/// The same for the rim of a wheel, m/s.
const RIM_TOLERANCE_M_PER_S: f64 = 3e-2;

/// What a step makes of a state.
#[derive(Clone, Copy)]
pub(super) struct Advance {
    pub(super) end: Speeds,
    /// Mean speeds over the step.
    pub(super) mean: Speeds,
    /// Mean acceleration of all forces but gravity, body axes, m/s^2.
    pub(super) accel: [f64; 2],
}

/// Torques on the wheels but for the contact.
#[derive(Clone, Copy)]
pub(super) struct Drive {
    /// Before the limit, A.
    free_a: f64x4,
    spin_sign: f64x4,
    pub(super) current_a: f64x4,
    torque_n_m: f64x4,
}

impl Drive {
    #[inline(always)]
    pub(super) fn at(c: &Constants, wheel: f64x4, spin_sign: f64x4) -> Drive {
        let free_a = (c.voltage_v - c.torque_per_current * wheel) * c.per_ohm;
        let current_a = free_a.lesser(c.current_limit_a).greater(-c.current_limit_a);
        Drive {
            free_a,
            spin_sign,
            current_a,
            torque_n_m: c.powered * current_a - (c.viscous_n_m_s * wheel + c.coulomb_n_m * spin_sign),
        }
    }

    /// Minus the slope of the torque over the wheel speed, N m s.
    #[inline(always)]
    pub(super) fn slope(&self, c: &Constants) -> f64x4 {
        let motor = one_below(self.free_a.abs(), c.current_limit_a) * c.back_torque;
        let flat = f64x4::splat(1.0) - self.spin_sign * self.spin_sign;
        motor + (c.viscous_n_m_s + c.coulomb_n_m * (flat * f64x4::splat(1.0 / COULOMB_SCALE_RAD_PER_S)))
    }
}

/// Where a step starts.
#[derive(Clone, Copy)]
pub(super) struct Start {
    pub(super) speeds: Speeds,
    pub(super) shape: Shape,
    pub(super) drive: Drive,
    /// Acceleration of the contact forces in the part before, m/s^2, and the loads at it, N.
    pub(super) accel: [f64; 2],
    pub(super) load_n: f64x4,
}

impl Start {
    #[inline(always)]
    pub(super) fn new(c: &Constants, speeds: Speeds, shape: Shape, accel: [f64; 2]) -> Start {
        Start {
            speeds,
            shape,
            drive: Drive::at(c, speeds.wheel, shape.spin_sign),
            accel,
            load_n: c.loads.at(accel),
        }
    }
}

impl Start {
    /// Acceleration of the contact forces with the loads of the part before, m/s^2.
    pub(super) fn explicit_accel(&self, c: &Constants) -> [f64; 2] {
        let force_l = c.friction * (self.shape.along * self.load_n);
        let force_t = c.friction * (self.shape.across * self.load_n);
        [0, 1].map(|j| sum(c.lines.along[j] * force_l + c.lines.across[j] * force_t) / c.mass_kg)
    }
}

/// Advances by `period_s`.
#[inline(always)]
pub(super) fn advance<const SIDE: bool>(c: &Constants, start: &Start, matrix: &Matrix, period_s: f64) -> Advance {
    let kappa = GAMMA * period_s;
    let [u, v, r] = start.speeds.twist;
    let turning = [-(r * v), r * u];
    let g = c.gravity_m_per_s2;
    let m = c.mass_kg;

    // First stage, about the acceleration of the part before.
    let force_l = c.friction * (start.shape.along * start.load_n);
    let force_t = c.friction * (start.shape.across * start.load_n);
    let known = c.loads.transfer([
        (start.accel[0] - turning[0]) + g[0],
        (start.accel[1] - turning[1]) + g[1],
    ]);
    let wheel_1 = (start.drive.torque_n_m + c.torque_n_m) - c.radius_m * (force_l - matrix.grip[0] * known);
    let sum_1 = |j: usize| {
        let wheels = matrix.push[j] * wheel_1 - matrix.per_load[j] * known;
        let along = wheels + c.lines.along[j] * force_l;
        sum(if SIDE {
            along + c.lines.across[j] * force_t
        } else {
            along
        })
    };
    let k1 = matrix.body([
        (sum_1(0) + c.body_force[0]) - m * turning[0],
        (sum_1(1) + c.body_force[1]) - m * turning[1],
        sum_1(2) + c.body_force[2],
    ]);
    let wheel_k1 = matrix.wheels(wheel_1, k1);

    // Second stage.
    let change = c.loads.transfer([k1[0], k1[1]]);
    let wheel_2 = c.spin_inertia_kg_m2 * wheel_k1 + c.radius_m * (matrix.grip[0] * change);
    let sum_2 = |j: usize| sum(matrix.push[j] * wheel_2 - matrix.per_load[j] * change);
    let k2 = matrix.body([
        m * k1[0] + sum_2(0),
        m * k1[1] + sum_2(1),
        c.yaw_inertia_kg_m2 * k1[2] + sum_2(2),
    ]);
    let wheel_k2 = matrix.wheels(wheel_2, k2);

    // y1 = y0 + h (gamma k1 + (1 - gamma) k2); its mean is y0 + gamma h (k1 + (1 - gamma) k2).
    let second = 1.0 - GAMMA;
    let rate = each(|j| GAMMA * k1[j] + second * k2[j]);
    let later = f64x4::splat(second) * wheel_k2;
    let mean = Speeds {
        twist: each(|j| start.speeds.twist[j] + kappa * (k1[j] + second * k2[j])),
        wheel: start.speeds.wheel + f64x4::splat(kappa) * (wheel_k1 + later),
    };
    Advance {
        end: Speeds {
            twist: each(|j| start.speeds.twist[j] + period_s * rate[j]),
            wheel: start.speeds.wheel + f64x4::splat(period_s) * (f64x4::splat(GAMMA) * wheel_k1 + later),
        },
        mean,
        accel: [
            rate[0] - (mean.twist[2] * mean.twist[1] + g[0]),
            rate[1] + (mean.twist[2] * mean.twist[0] - g[1]),
        ],
    }
}

/// Estimated error of a step: over the allowed one, and what to add to the speeds. `weight` is that of the defect: 1/3 for a matrix of the start itself,
/// 1/2 for an older one.
#[inline(always)]
pub(super) fn error<const SIDE: bool>(
    c: &Constants,
    start: &Start,
    matrix: &Matrix,
    after: &Advance,
    (shape, drive, load_n): (&Shape, &Drive, f64x4),
    (weight, period_s): (f64, f64),
) -> (f64, Speeds) {
    let change = Speeds {
        twist: each(|j| after.end.twist[j] - start.speeds.twist[j]),
        wheel: after.end.wheel - start.speeds.wheel,
    };
    let (along, across) = slips::<SIDE>(c, &change);
    let (before, moved) = (start.load_n, load_n - start.load_n);
    let [s_ll, s_lt, s_tt] = matrix.slope;
    let defect = |now: f64x4, then: f64x4, grip: f64x4, linear: f64x4| {
        (c.friction * (now * load_n - then * before) - grip * moved) - linear
    };
    let linear_l = if SIDE {
        s_ll * along + s_lt * across
    } else {
        s_ll * along
    };
    let force_l = defect(shape.along, start.shape.along, matrix.grip[0], linear_l);
    let force_t = if SIDE {
        defect(
            shape.across,
            start.shape.across,
            matrix.grip[1],
            s_lt * along + s_tt * across,
        )
    } else {
        f64x4::ZERO
    };
    let torque = (drive.torque_n_m - start.drive.torque_n_m) + matrix.torque_slope * change.wheel;
    let wheel = torque - c.radius_m * force_l;
    let part = |j: usize| {
        let along = c.lines.along[j] * force_l + matrix.push[j] * wheel;
        sum(if SIDE {
            along + c.lines.across[j] * force_t
        } else {
            along
        })
    };
    let spin = c.mass_kg * change.twist[2];
    let body = matrix.body([
        part(0) + spin * change.twist[1],
        part(1) - spin * change.twist[0],
        part(2),
    ]);
    let weight_s = weight * period_s;
    let missing = Speeds {
        twist: each(|j| weight_s * body[j]),
        wheel: f64x4::splat(weight_s) * matrix.wheels(wheel, body),
    };
    let rim = most((c.radius_m * missing.wheel).abs());
    let [x, y, z] = each(|j| missing.twist[j].abs());
    let largest = x.greater(y).greater(c.lever_m * z);
    let error = (largest * (1.0 / BODY_TOLERANCE_M_PER_S)).greater(rim * (1.0 / RIM_TOLERANCE_M_PER_S));
    (error, missing)
}

/// The step with its estimated error taken off. The error grows with the cube of time: its mean is a quarter.
pub(super) fn corrected(after: &Advance, missing: &Speeds, period_s: f64) -> Advance {
    let plus = |speeds: &Speeds, part: f64| Speeds {
        twist: each(|j| speeds.twist[j] + part * missing.twist[j]),
        wheel: speeds.wheel + f64x4::splat(part) * missing.wheel,
    };
    let per_s = 1.0 / period_s;
    Advance {
        end: plus(&after.end, 1.0),
        mean: plus(&after.mean, 0.25),
        accel: [
            after.accel[0] + per_s * missing.twist[0],
            after.accel[1] + per_s * missing.twist[1],
        ],
    }
}
