//! Elementary functions made of add, subtract, multiply, divide and square root only: equal bits everywhere.

use crate::lanes::Real;

/// 1.5 * 2^52: adding it rounds to an integer in the low bits of the sum.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// Hyperbolic tangent.
///
/// tanh x = (e^2x - 1) / (e^2x + 1)
///
/// - Within 4 units in the last place of `libm::tanh` for all finite `x` (tested); odd; |tanh| <= 1.
/// - A NaN gives +-1 or NaN; callers check the finiteness of states, not of forces.
#[inline(always)]
pub fn tanh(x: f64) -> f64 {
    tanh_of(x)
}

#[inline(always)]
pub(crate) fn tanh_of<T: Real>(x: T) -> T {
    let exp_m1 = exp_m1_of_double(x.abs());
    (exp_m1 / (exp_m1 + T::of(2.0))).signed_like(x)
}

/// e^2x - 1 for x >= 0, held from x = 20 on (where tanh is 1), without a branch.
///
/// e^y - 1 = 2^k (e^f - 1) + (2^k - 1), |f| <= ln 2 / 2.
#[inline(always)]
pub(crate) fn exp_m1_of_double<T: Real>(x: T) -> T {
    let y = T::of(2.0) * x.lesser(T::of(20.0));
    let shifted = y * T::of(core::f64::consts::LOG2_E) + T::of(ROUNDER);
    let k = shifted - T::of(ROUNDER);
    let f = (y - k * T::of(LN2_HIGH)) - k * T::of(LN2_LOW);
    let two_k = shifted.power_of_two();
    two_k * exp_m1_small(f) + (two_k - T::of(1.0))
}

/// e^f - 1 for |f| <= 0.35 by its series to f^13 (truncation below 2e-17 relative), summed in pairs (Estrin).
#[inline(always)]
fn exp_m1_small<T: Real>(f: T) -> T {
    const C: [f64; 12] = [
        0.5,
        1.0 / 6.0,
        1.0 / 24.0,
        1.0 / 120.0,
        1.0 / 720.0,
        1.0 / 5_040.0,
        1.0 / 40_320.0,
        1.0 / 362_880.0,
        1.0 / 3_628_800.0,
        1.0 / 39_916_800.0,
        1.0 / 479_001_600.0,
        1.0 / 6_227_020_800.0,
    ];
    let pair = |i: usize| T::of(C[i]) + T::of(C[i + 1]) * f;
    let f2 = f * f;
    let f4 = f2 * f2;
    let (low, middle, high) = (pair(0) + pair(2) * f2, pair(4) + pair(6) * f2, pair(8) + pair(10) * f2);
    f + f2 * (low + f4 * (middle + f4 * high))
}

/// Sine and cosine of a small angle by their series; exact to rounding for |angle| <= 0.25 rad.
#[inline(always)]
pub fn sin_cos_small(angle_rad: f64) -> (f64, f64) {
    let a2 = angle_rad * angle_rad;
    let sin = angle_rad
        * (1.0
            - a2 * (1.0 / 6.0
                - a2 * (1.0 / 120.0 - a2 * (1.0 / 5_040.0 - a2 * (1.0 / 362_880.0 - a2 / 39_916_800.0)))));
    let cos = 1.0
        - a2 * (0.5
            - a2 * (1.0 / 24.0
                - a2 * (1.0 / 720.0 - a2 * (1.0 / 40_320.0 - a2 * (1.0 / 3_628_800.0 - a2 / 479_001_600.0)))));
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_agrees_with_libm() {
        let mut worst = 0.0_f64;
        for i in -400_000..=400_000_i32 {
            let x = f64::from(i) * 6.1e-5;
            let (ours, theirs) = (tanh(x), libm::tanh(x));
            let scale = theirs.abs().max(f64::MIN_POSITIVE);
            worst = worst.max((ours - theirs).abs() / scale);
            assert!(ours.abs() <= 1.0);
            assert_eq!(tanh(-x).to_bits(), (-ours).to_bits());
        }
        assert!(worst <= 4.0 * f64::EPSILON, "worst relative difference {worst:e}");
        for x in [1e-300, 1e-20, 1e-8, 21.0, 1e6, f64::MAX] {
            assert!(
                (tanh(x) - libm::tanh(x)).abs() <= 4.0 * f64::EPSILON * libm::tanh(x),
                "{x}"
            );
        }
        assert_eq!(tanh(0.0), 0.0);
    }

    #[test]
    fn small_sine_and_cosine_agree_with_libm() {
        for i in -1000..=1000_i32 {
            let a = f64::from(i) * 2.5e-4;
            let (s, c) = sin_cos_small(a);
            assert!(
                (s - libm::sin(a)).abs() < 2e-16 && (c - libm::cos(a)).abs() < 3e-16,
                "{a}"
            );
        }
    }
}
