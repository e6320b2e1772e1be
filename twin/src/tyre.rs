//! Contact of a wheel whose tyre differs from the nominal one.

use crate::{MAX_WHEELS, SLIP_SCALE_M_PER_S};

/// Newton steps for the slip at the contact; each doubles the digits, starting below the solution of a concave function.
const SLIP_STEPS: u32 = 8;
/// Square of the smallest scaled slip.
const TINY: f64 = 1e-30;

/// Two deviations from F = mu N tanh(|s| / s0) s / |s|:
///
/// longitudinal: s_l = s_c + ratio |R W| F_l / (mu N), where s_c is the slip that the law above takes;
/// side direction: mu replaced by its own value, F_t times side_scale.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tyre {
    pub(crate) slip_ratio: f64,
    /// Side friction over the floor's.
    pub(crate) side_scale: f64,
    /// |R W| at the start of the step.
    pub(crate) rolling_m_per_s: [f64; MAX_WHEELS],
}

/// Force over mu N in both directions, and its slopes over the slip, s/m.
pub(crate) struct Grip {
    pub(crate) along: f64,
    pub(crate) across: f64,
    pub(crate) slope_along: f64,
    pub(crate) slope_across: f64,
}

impl Tyre {
    pub(crate) const NOMINAL: Tyre = Tyre {
        slip_ratio: 0.0,
        side_scale: 1.0,
        rolling_m_per_s: [0.0; MAX_WHEELS],
    };

    /// Grip of a lane at a slip, m/s.
    pub(crate) fn grip(&self, lane: usize, along: f64, across: f64) -> Grip {
        let extra = self.slip_ratio * self.rolling_m_per_s[lane];
        let size = along.abs();
        // Two lower bounds: the force is at most mu N, and at most mu N s_c / s0.
        let mut contact = (size - extra).max(size / (1.0 + extra / SLIP_SCALE_M_PER_S));
        let mut law = Law::at(contact, across);
        if extra > 0.0 {
            for _ in 0..SLIP_STEPS {
                contact -= (contact + extra * law.along - size) / (1.0 + extra * law.slope_along);
                law = Law::at(contact, across);
            }
        }
        Grip {
            along: law.along.copysign(along),
            across: self.side_scale * law.across,
            slope_along: law.slope_along / (1.0 + extra * law.slope_along),
            slope_across: self.side_scale * law.secant,
        }
    }
}

/// tanh(|s| / s0) s / |s|.
struct Law {
    along: f64,
    across: f64,
    slope_along: f64,
    secant: f64,
}

impl Law {
    fn at(along_m_per_s: f64, across_m_per_s: f64) -> Law {
        const PER_SCALE: f64 = 1.0 / SLIP_SCALE_M_PER_S;
        let (ql, qt) = (PER_SCALE * along_m_per_s, PER_SCALE * across_m_per_s);
        let q2 = ql * ql + qt * qt + TINY;
        let q = q2.sqrt();
        let tanh = crate::math::tanh(q);
        let secant = tanh / q;
        let bend = ((1.0 - tanh * tanh) - secant) / q2;
        Law {
            along: secant * ql,
            across: secant * qt,
            slope_along: PER_SCALE * (secant + bend * ql * ql),
            secant: PER_SCALE * secant,
        }
    }
}
