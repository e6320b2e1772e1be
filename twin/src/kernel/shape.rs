//! Contact and drive friction at given speeds, before loads.

use wide::f64x4;

use super::constants::Constants;
use crate::lanes::{Real, each, least};
use crate::math;
use crate::tyre::Tyre;
use crate::{COULOMB_SCALE_RAD_PER_S, SLIP_SCALE_M_PER_S};

/// Square of the smallest scaled slip, so that tanh(q)/q needs no case.
const TINY: f64 = 1e-30;
/// tanh is 1 to the last bit from here on.
const SATURATED: f64 = 20.0;
const PER_SCALE_S_PER_M: f64 = 1.0 / SLIP_SCALE_M_PER_S;

/// Speeds: body twist and wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Speeds {
    pub(super) twist: [f64; 3],
    pub(super) wheel: f64x4,
}

/// Force per unit of friction times load, and its slopes over the slip, s/m; the sign of spin of the drive's friction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) along: f64x4,
    pub(super) across: f64x4,
    pub(super) d_ll: f64x4,
    pub(super) d_lt: f64x4,
    pub(super) d_tt: f64x4,
    pub(super) spin_sign: f64x4,
}

/// Change of the slips with the speeds, or the slips themselves: R W - a along, -b across, m/s.
#[inline(always)]
pub(super) fn slips<const SIDE: bool>(c: &Constants, at: &Speeds) -> (f64x4, f64x4) {
    let [u, v, r] = each(|j| f64x4::splat(at.twist[j]));
    let line = |[x, y, arm]: &[f64x4; 3]| (*x * u + *y * v) + *arm * r;
    let along = c.radius_m * at.wheel - line(&c.lines.along);
    let across = if SIDE {
        -(c.lateral * line(&c.lines.across))
    } else {
        f64x4::ZERO
    };
    (along, across)
}

/// tanh(W / 0.3); fast wheels are spared the function.
#[inline(always)]
fn spin_sign(wheel: f64x4) -> f64x4 {
    let scaled = wheel * f64x4::splat(1.0 / COULOMB_SCALE_RAD_PER_S);
    if least(scaled.abs()) >= SATURATED {
        f64x4::splat(1.0).signed_like(scaled)
    } else {
        math::tanh_of(scaled)
    }
}

impl Shape {
    pub(super) const ZERO: Shape = Shape {
        along: f64x4::ZERO,
        across: f64x4::ZERO,
        d_ll: f64x4::ZERO,
        d_lt: f64x4::ZERO,
        d_tt: f64x4::ZERO,
        spin_sign: f64x4::ZERO,
    };

    /// F = tanh(|s| / s0) s / |s|
    ///
    /// With E = e^2q - 1, q = |s| / s0: tanh q = E / (E + 2); one division gives it, tanh(q) / q and 1 / q^2. Without
    /// wheels that resist sideways motion (`SIDE` false) it is tanh(s_l / s0).
    #[inline(always)]
    pub(super) fn at<const SIDE: bool>(c: &Constants, speeds: &Speeds) -> Shape {
        let (along, across) = slips::<SIDE>(c, speeds);
        let (one, per_scale) = (f64x4::splat(1.0), f64x4::splat(PER_SCALE_S_PER_M));
        let ql = per_scale * along;
        let spin_sign = spin_sign(speeds.wheel);
        if !SIDE {
            let tanh = math::tanh_of(ql);
            return Shape {
                along: tanh,
                across: f64x4::ZERO,
                d_ll: per_scale * (one - tanh * tanh),
                d_lt: f64x4::ZERO,
                d_tt: f64x4::ZERO,
                spin_sign,
            };
        }
        let qt = per_scale * across;
        let q2 = (ql * ql + qt * qt) + f64x4::splat(TINY);
        let q = q2.sqrt();
        let exp_m1 = math::exp_m1_of_double(q);
        let sum = exp_m1 + f64x4::splat(2.0);
        let inverse = one / (sum * q2);
        let secant = exp_m1 * (q * inverse);
        let tanh = exp_m1 * (q2 * inverse);
        let bend = ((one - tanh * tanh) - secant) * (sum * inverse);
        Shape {
            along: secant * ql,
            across: secant * qt,
            d_ll: per_scale * (secant + bend * (ql * ql)),
            d_lt: per_scale * (bend * (ql * qt)),
            d_tt: c.lateral * (per_scale * (secant + bend * (qt * qt))),
            spin_sign,
        }
    }

    /// The same with a tyre of its own in each direction.
    #[inline(always)]
    pub(super) fn of_tyre(tyre: &Tyre, c: &Constants, speeds: &Speeds) -> Shape {
        let (along, across) = slips::<true>(c, speeds);
        let friction = c.friction * c.per_nominal_friction;
        let grip = tyre.grip(along, across, (c.radius_m * speeds.wheel).abs(), friction);
        Shape {
            along: grip.along,
            across: grip.across,
            d_ll: grip.d_ll,
            d_lt: c.lateral * grip.d_lt,
            d_tt: c.lateral * grip.d_tt,
            spin_sign: spin_sign(speeds.wheel),
        }
    }
}
