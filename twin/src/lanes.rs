//! Arithmetic on four numbers at once, with the bits of one at a time.
//!
//! Every operation is IEEE 754 add, subtract, multiply, divide, square root, compare or a bit operation per lane, so a
//! vector gives in each lane what a single number would.

use core::ops::{Add, Div, Mul, Sub};

use wide::{f64x4, u64x4};

/// Wheels that stand side by side in a vector; no chassis has more with a horizontal force.
pub(crate) const LANES: usize = 4;

/// A number or a vector of them.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn of(value: f64) -> Self;
    fn abs(self) -> Self;
    /// `if self < other { self } else { other }`
    fn lesser(self, other: Self) -> Self;
    /// `if self > other { self } else { other }`
    fn greater(self, other: Self) -> Self;
    /// The magnitude of `self` with the sign of `sign`.
    fn signed_like(self, sign: Self) -> Self;
    /// 2^k, where k stands in the low bits of the fraction.
    fn power_of_two(self) -> Self;
}

impl Real for f64 {
    #[inline(always)]
    fn of(value: f64) -> f64 {
        value
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn lesser(self, other: f64) -> f64 {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn greater(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn signed_like(self, sign: f64) -> f64 {
        self.copysign(sign)
    }
    #[inline(always)]
    fn power_of_two(self) -> f64 {
        f64::from_bits((self.to_bits() << 52).wrapping_add(1023 << 52))
    }
}

impl Real for f64x4 {
    #[inline(always)]
    fn of(value: f64) -> f64x4 {
        f64x4::splat(value)
    }
    #[inline(always)]
    fn abs(self) -> f64x4 {
        f64x4::abs(self)
    }
    // Engines differ in which of two zeros, or of a number and NaN, their minimum is.
    #[inline(always)]
    fn lesser(self, other: f64x4) -> f64x4 {
        if cfg!(target_feature = "sse2") {
            f64x4::fast_min(self, other)
        } else if cfg!(target_feature = "simd128") {
            f64x4::fast_min(other, self)
        } else {
            self.simd_lt(other).select(self, other)
        }
    }
    #[inline(always)]
    fn greater(self, other: f64x4) -> f64x4 {
        if cfg!(target_feature = "sse2") {
            f64x4::fast_max(self, other)
        } else if cfg!(target_feature = "simd128") {
            f64x4::fast_max(other, self)
        } else {
            self.simd_gt(other).select(self, other)
        }
    }
    #[inline(always)]
    fn signed_like(self, sign: f64x4) -> f64x4 {
        f64x4::abs(self) | (sign & f64x4::splat(-0.0))
    }
    #[inline(always)]
    fn power_of_two(self) -> f64x4 {
        f64x4::from_bits((self.to_bits() << 52_u32) + u64x4::splat(1023 << 52))
    }
}

/// `[of(0), of(1), of(2)]`
#[inline(always)]
pub(crate) fn each<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

/// The first four of an array by wheel.
#[inline(always)]
pub(crate) fn four(values: &[f64]) -> f64x4 {
    f64x4::new([values[0], values[1], values[2], values[3]])
}

/// (w0 + w2) + (w1 + w3)
#[inline(always)]
pub(crate) fn sum(wheels: f64x4) -> f64 {
    let [a, b, c, d] = wheels.to_array();
    (a + c) + (b + d)
}

#[inline(always)]
pub(crate) fn least(wheels: f64x4) -> f64 {
    let [a, b, c, d] = wheels.to_array();
    a.lesser(c).lesser(b.lesser(d))
}

#[inline(always)]
pub(crate) fn most(wheels: f64x4) -> f64 {
    let [a, b, c, d] = wheels.to_array();
    a.greater(c).greater(b.greater(d))
}

/// 1 where `value < limit`, else 0.
#[inline(always)]
pub(crate) fn one_below(value: f64x4, limit: f64x4) -> f64x4 {
    value.simd_lt(limit) & f64x4::splat(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zeros of both signs and NaN included, where minima differ between engines.
    #[test]
    fn four_at_once_have_the_bits_of_one_at_a_time() {
        let values = [0.0, -0.0, 1.5, -2.5, 1e-310, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        let bits = |four: f64x4| four.to_array().map(f64::to_bits);
        for a in values {
            for b in values {
                let (x, y) = (f64x4::splat(a), f64x4::splat(b));
                assert_eq!(bits(x.lesser(y)), [a.lesser(b).to_bits(); 4], "{a} {b}");
                assert_eq!(bits(x.greater(y)), [a.greater(b).to_bits(); 4], "{a} {b}");
                assert_eq!(bits(x.signed_like(y)), [a.signed_like(b).to_bits(); 4], "{a} {b}");
                let one = if a < b { 1.0_f64 } else { 0.0 };
                assert_eq!(bits(one_below(x, y)), [one.to_bits(); 4], "{a} {b}");
            }
            assert_eq!(bits(Real::abs(f64x4::splat(a))), [Real::abs(a).to_bits(); 4]);
        }
    }
}
