//! Contact of wheels whose tyres differ from the nominal ones.

use wide::f64x4;

use crate::lanes::{Real, most};
use crate::math;
use crate::tread::Tread;

/// Bound on the Newton steps for the slip at the contact; each doubles the digits.
const MOST_STEPS: u32 = 10;
/// A slip that moved less than this is taken, with the force of its tangent, m/s.
const SETTLED_M_PER_S: f64 = 1e-8;
/// Square of the smallest slip, m^2/s^2, so that tanh(q)/q needs no case.
const TINY: f64 = 1e-34;
/// Friction over the described one below which slip scales stay; where there is no wheel it is 0.
const LEAST_FRICTION: f64 = 1e-2;
/// One over the square of the slip at which half of the way from grip to sliding is gone, s^2/m^2.
const PER_SLIDING_2: f64 = 1.0 / (0.06 * 0.06);

/// Deviations from F = mu N tanh(|s| / s0) s / |s|:
///
/// tread: the curve of [`Tread`], in all directions alike; with the floor's friction its slip scales change in proportion, since what little a tyre creeps
/// is the stiffness of its tread, whatever it rolls on (Canudas de Wit et al. 1999: F / N = s / (|s| / mu + kappa |R W| / (L s_0)));
/// longitudinal: s_l = s_c + ratio |R W| F_l / (mu N), where s_c is the slip that the law above takes;
/// side direction: mu replaced by its own value, F_t times side_scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tyre {
    pub(crate) slip_ratio: f64,
    /// Side friction over the floor's.
    pub(crate) side_scale: f64,
    pub(crate) tread: Tread,
    /// The slopes at small slips are the tread's own: it is no nominal contact.
    keeps_stiffness: bool,
}

/// Force over mu N in both directions, and its slopes over the slip, s/m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grip {
    pub(crate) along: f64x4,
    pub(crate) across: f64x4,
    pub(crate) d_ll: f64x4,
    pub(crate) d_lt: f64x4,
    pub(crate) d_tt: f64x4,
}

impl Tyre {
    pub(crate) const NOMINAL: Tyre = Tyre {
        slip_ratio: 0.0,
        side_scale: 1.0,
        tread: Tread::NOMINAL,
        keeps_stiffness: false,
    };

    pub(crate) fn of(tread: Tread) -> Tyre {
        Tyre {
            tread,
            keeps_stiffness: true,
            ..Tyre::NOMINAL
        }
    }

    /// Grip of all wheels at their slips, m/s, rolling at |R W|, m/s.
    ///
    /// - `friction`: of the floor under the wheels over the described one.
    ///
    /// The slopes are those at constant rolling, and d_lt is that of the force along: with a side friction of its own the
    /// two cross slopes differ by its factor.
    #[inline(never)]
    pub(crate) fn grip(&self, along: f64x4, across: f64x4, rolling_m_per_s: f64x4, friction: f64x4) -> Grip {
        let mut scale = f64x4::splat(self.tread.slip_scale_m_per_s) + f64x4::splat(self.tread.creep) * rolling_m_per_s;
        if self.keeps_stiffness {
            scale *= friction.greater(f64x4::splat(LEAST_FRICTION));
        }
        let curve = Curve::new(&self.tread, scale);
        if self.slip_ratio > 0.0 {
            return self.slipping(along, across, f64x4::splat(self.slip_ratio) * rolling_m_per_s, &curve);
        }
        let law = Law::at(along, across, &curve);
        let side = f64x4::splat(self.side_scale);
        Grip {
            along: law.along,
            across: side * law.across,
            d_ll: law.d_ll,
            d_lt: law.d_lt,
            d_tt: side * law.d_tt,
        }
    }

    /// The same where the slip grows by `extra` at full force, m/s, beyond that of the contact.
    fn slipping(&self, along: f64x4, across: f64x4, extra: f64x4, curve: &Curve) -> Grip {
        let (one, half) = (f64x4::splat(1.0), f64x4::splat(0.5));
        let (size, scale) = (along.abs(), curve.scale_m_per_s);
        // A force over mu N of x / (1 + x), x = s_c / s0, as the first guess, but no less than two lower bounds: the force is
        // at most mu N, and at most mu N x.
        let b = (size - extra) - scale;
        let rational = half * (b + (b * b + f64x4::splat(4.0) * (scale * size)).sqrt());
        let least = (size - extra).greater(size * (scale / (scale + extra)));
        let mut contact = rational.greater(least);
        let mut steps = 0;
        let (law, short) = loop {
            let law = Law::at(contact, across, curve);
            let step = ((size - contact) - extra * law.along) / (one + extra * law.d_ll);
            // The force is concave: a step from above its slip may go too far, never below the bounds.
            let next = (contact + step).greater(least);
            let short = next - contact;
            steps += 1;
            if most(short.abs()) < SETTLED_M_PER_S || steps == MOST_STEPS {
                break (law, short);
            }
            contact = next;
        };
        let through = one / (one + extra * law.d_ll);
        let side = f64x4::splat(self.side_scale);
        Grip {
            along: (law.along + law.d_ll * short).signed_like(along),
            across: side * (law.across + law.d_lt * short),
            d_ll: law.d_ll * through,
            d_lt: (law.d_lt * through) * one.signed_like(along),
            d_tt: side * (law.d_tt - law.d_lt * (law.d_lt * (extra * through))),
        }
    }
}

/// Force over friction times load at the size of a slip.
struct Curve {
    scale_m_per_s: f64x4,
    per_scale: f64x4,
    tail: f64,
    sliding: f64,
}

impl Curve {
    #[inline(always)]
    fn new(tread: &Tread, scale_m_per_s: f64x4) -> Curve {
        Curve {
            scale_m_per_s,
            per_scale: f64x4::splat(1.0) / scale_m_per_s,
            tail: tread.tail,
            sliding: tread.sliding,
        }
    }

    /// The force at a slip of this size, m/s, and its slope, s/m.
    ///
    /// - `square`: of the size; known before it.
    #[inline(always)]
    fn at(&self, size_m_per_s: f64x4, square: f64x4) -> (f64x4, f64x4) {
        let one = f64x4::splat(1.0);
        let q = size_m_per_s * self.per_scale;
        let exp_m1 = math::exp_m1_of_double(q);
        let tanh = exp_m1 * (one / (exp_m1 + f64x4::splat(2.0)));
        let (mut force, mut slope) = (tanh, one - tanh * tanh);
        if self.tail > 0.0 {
            let (tail, left) = (f64x4::splat(self.tail), one / (one + q));
            force += tail * (q * left - force);
            slope += tail * (left * left - slope);
        }
        slope *= self.per_scale;
        if self.sliding < 1.0 {
            let grip = one / (one + f64x4::splat(PER_SLIDING_2) * square);
            let lost = f64x4::splat(1.0 - self.sliding);
            let share = one - lost * (one - grip);
            let fall = (f64x4::splat(2.0 * PER_SLIDING_2) * lost) * (size_m_per_s * (grip * grip));
            slope = slope * share - force * fall;
            force *= share;
        }
        (force, slope)
    }
}

/// The force over friction times load along and across, and its slopes, s/m.
struct Law {
    along: f64x4,
    across: f64x4,
    d_ll: f64x4,
    d_lt: f64x4,
    d_tt: f64x4,
}

impl Law {
    #[inline(always)]
    fn at(along_m_per_s: f64x4, across_m_per_s: f64x4, curve: &Curve) -> Law {
        let (l, t) = (along_m_per_s, across_m_per_s);
        let square = (l * l + t * t) + f64x4::splat(TINY);
        let (size, per_square) = (square.sqrt(), f64x4::splat(1.0) / square);
        let (force, slope) = curve.at(size, square);
        let secant = force * (size * per_square);
        let bend = (slope - secant) * per_square;
        Law {
            along: secant * l,
            across: secant * t,
            d_ll: secant + bend * (l * l),
            d_lt: bend * (l * t),
            d_tt: secant + bend * (t * t),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SLIP_SCALE_M_PER_S;

    fn grip(tyre: &Tyre, along: f64, across: f64, rolling: f64) -> [f64; 5] {
        grip_on(tyre, along, across, rolling, 1.0)
    }

    fn grip_on(tyre: &Tyre, along: f64, across: f64, rolling: f64, friction: f64) -> [f64; 5] {
        let four = f64x4::splat;
        let grip = tyre.grip(four(along), four(across), four(rolling), four(friction));
        [grip.along, grip.across, grip.d_ll, grip.d_lt, grip.d_tt].map(|lanes| lanes.to_array()[0])
    }

    /// The force of the law at a slip of the contact, by libm.
    fn nominal(along: f64, across: f64) -> [f64; 2] {
        let size = libm::hypot(along, across).max(1e-300);
        let force = libm::tanh(size / SLIP_SCALE_M_PER_S);
        [force * along / size, force * across / size]
    }

    #[test]
    fn the_slip_is_that_of_the_contact_and_the_ratios_part() {
        for ratio in [0.0, 0.005, 0.05, 0.3] {
            let tyre = Tyre {
                slip_ratio: ratio,
                side_scale: 0.7,
                ..Tyre::NOMINAL
            };
            for rolling in [0.0, 0.02, 0.5, 3.0] {
                for contact in [0.0, 1e-9, 1e-4, 0.003, 0.02, 0.1, 2.0] {
                    for across in [0.0, 1e-5, -0.01, 0.3] {
                        let [along_force, across_force] = nominal(contact, across);
                        let slip = contact + ratio * rolling * along_force;
                        let [along, side, ..] = grip(&tyre, -slip, across, rolling);
                        let expected = [-along_force, 0.7 * across_force];
                        let off = (along - expected[0]).abs().max((side - expected[1]).abs());
                        assert!(off < 1e-10, "{ratio} {rolling} {contact} {across}: {off:e}");
                    }
                }
            }
        }
    }

    const TREAD: Tread = Tread {
        slip_scale_m_per_s: 0.005,
        creep: 0.04,
        tail: 0.6,
        sliding: 0.85,
    };

    #[test]
    fn a_tread_creeps_with_rolling_and_slides_with_less() {
        let tyre = Tyre::of(TREAD);
        let expected = |size: f64, rolling: f64| {
            let q = size / (0.005 + 0.04 * rolling);
            let grip = 0.4 * libm::tanh(q) + 0.6 * q / (1.0 + q);
            grip * (0.85 + 0.15 / (1.0 + (size / 0.06) * (size / 0.06)))
        };
        for rolling in [0.0, 0.1, 1.5] {
            for (along, across) in [(1e-5, 0.0), (0.003, -0.004), (-0.03, 0.04), (0.0, 0.5), (3.0, 0.1)] {
                let size = libm::hypot(along, across);
                let [force_along, force_across, ..] = grip(&tyre, along, across, rolling);
                let off = libm::hypot(
                    force_along - expected(size, rolling) * along / size,
                    force_across - expected(size, rolling) * across / size,
                );
                assert!(off < 1e-12, "{rolling} {along} {across}: {off:e}");
            }
        }
        assert!(expected(0.002, 1.5) < 0.35 * expected(0.002, 0.0));
        assert!(expected(3.0, 0.0) < 0.87);
    }

    /// Force over load, so friction times what a grip is.
    #[test]
    fn a_tread_creeps_as_stiffly_on_any_floor_and_slides_by_its_friction() {
        let tyre = Tyre::of(TREAD);
        let force = |slip: f64, friction: f64| friction * grip_on(&tyre, slip, 0.0, 0.5, friction)[0];
        for friction in [0.3, 0.7, 1.4] {
            assert!((force(1e-6, friction) / force(1e-6, 1.0) - 1.0).abs() < 1e-3);
            assert!((force(3.0, friction) / force(3.0, 1.0) / friction - 1.0).abs() < 0.01);
        }
        let nominal = Tyre {
            slip_ratio: 0.05,
            ..Tyre::NOMINAL
        };
        assert_eq!(
            grip_on(&nominal, 0.01, 0.0, 0.5, 0.3),
            grip_on(&nominal, 0.01, 0.0, 0.5, 1.0)
        );
    }

    #[test]
    fn slopes_are_those_of_the_forces() {
        for (slip_ratio, tread) in [(0.06, Tread::NOMINAL), (0.0, TREAD), (0.06, TREAD)] {
            slopes_of(&Tyre {
                slip_ratio,
                ..Tyre::of(tread)
            });
        }
    }

    fn slopes_of(tyre: &Tyre) {
        for (along, across) in [(0.004, 0.0), (0.03, 0.01), (-0.05, 0.02), (0.2, -0.1), (-0.01, -0.03)] {
            let at = |l: f64, t: f64| grip(tyre, l, t, 0.8);
            let [.., d_ll, d_lt, d_tt] = at(along, across);
            let h = 1e-6;
            let by =
                |j: usize, l: f64, t: f64| (at(along + l, across + t)[j] - at(along - l, across - t)[j]) / (2.0 * h);
            for (slope, measured) in [
                (d_ll, by(0, h, 0.0)),
                (d_lt, by(0, 0.0, h)),
                (d_lt, by(1, h, 0.0)),
                (d_tt, by(1, 0.0, h)),
            ] {
                assert!((slope - measured).abs() < 1e-3, "{along} {across}: {slope} {measured}");
            }
        }
    }
}
