//! Fitted sizes with their 95 % intervals.

use super::Case;
use super::evenness::Evenness;
use crate::fit::{Fit, NORMAL_95};
use crate::hypothesis::{Axis, LOST};
use crate::report::schema::{ParameterValue, rounded};
use crate::select::Finalist;

/// Standard deviation of a size for the plant's other law, as a share of the change, at least; limits change by this share of themselves.
const LAW_LEAST: f64 = 0.01;
/// A larger rest, as a share of what is explained, is of other effects.
const LAW_MOST: f64 = 0.04;
const LIMIT_SHARE: f64 = 0.2;

/// All sizes of a named effect may be none: their intervals reach to where it has no effect.
///
/// - `uneven`: standard deviation of a size as a share of it, for what stretches differ by.
pub(super) fn may_be_none(case: &Case, position: usize, uneven: impl Fn(&Evenness) -> f64) -> bool {
    let finalist = &case.taken[position].finalist;
    let candidate = &finalist.member.candidate;
    let found = sizes_with(case, position, finalist, uneven);
    let mut pairs = candidate.axes.iter().zip(&found).filter(|(axis, _)| axis.carries_size);
    pairs.all(|(axis, found)| reaches_none(axis, found))
}

fn reaches_none(axis: &Axis, found: &ParameterValue) -> bool {
    let (Some(low), Some(high)) = (found.low, found.high) else {
        return false;
    };
    axis.neutral.is_finite() && low <= axis.neutral && axis.neutral <= high
}

/// Parameters of a named effect, as any stretch has them.
pub(super) fn sizes(case: &Case, position: usize, finalist: &Finalist) -> Vec<ParameterValue> {
    sizes_with(case, position, finalist, |even| even.spread)
}

fn sizes_with(
    case: &Case,
    position: usize,
    finalist: &Finalist,
    uneven: impl Fn(&Evenness) -> f64,
) -> Vec<ParameterValue> {
    let uneven = case.taken[position].evenness.as_ref().map_or(0.0, uneven);
    let width = NORMAL_95 * case.floor.inflation().sqrt();
    let member = &finalist.member;
    let axes = member.candidate.axes.iter().zip(&member.values).enumerate();
    axes.map(|(a, (axis, value))| {
        let fitted = case
            .fit
            .as_ref()
            .map_or(f64::INFINITY, |fit: &Fit| fit.sigma(position, a));
        let scatter = case
            .scatter
            .iter()
            .find(|(free, _)| *free == (position, a))
            .map_or(0.0, |(_, scatter)| *scatter);
        let beyond = beyond_noise(axis, *value, case.law_rest, uneven);
        let fitted = match (member.candidate.entry.name == LOST, axis.carries_size) {
            (true, true) => case.lost_sigma,
            (true, false) => 0.0,
            (false, _) => fitted,
        };
        let sigma = (fitted * fitted + scatter * scatter + beyond * beyond).sqrt();
        let end = |value: f64| value.is_finite().then(|| rounded(value));
        let known = value.is_finite() && sigma.is_finite();
        ParameterValue {
            name: axis.name.to_owned(),
            value: end(*value),
            low: end(if known {
                (value - width * sigma).max(axis.low)
            } else {
                *value
            }),
            high: end(if known {
                (value + width * sigma).min(axis.high)
            } else {
                *value
            }),
            unit: axis.unit.to_owned(),
        }
    })
    .collect()
}

/// Standard deviation of a size for what is no noise and does not average out.
///
/// - `law_rest`: what the fit leaves over, as a share of what it explains. An effect of another law leaves a rest, and its best size by
///   our law is off by about as much.
/// - `uneven`: how far the size differs from stretch to stretch (prediction interval of random effects: Higgins, Thompson and
///   Spiegelhalter 2009) or, for a mean size, what that adds to its standard error (DerSimonian and
///   Laird 1986), as a share.
fn beyond_noise(axis: &Axis, value: f64, law_rest: f64, uneven: f64) -> f64 {
    if !axis.carries_size {
        return 0.0;
    }
    let change = if axis.neutral.is_finite() {
        (value - axis.neutral).abs()
    } else {
        LIMIT_SHARE * value.abs()
    };
    let law = LAW_LEAST + 0.5 * law_rest.min(LAW_MOST).sqrt();
    change * (law * law + uneven * uneven).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(neutral: f64, carries_size: bool) -> Axis {
        Axis {
            name: "gain",
            unit: "1",
            neutral,
            low: 0.0,
            high: 2.0,
            practical: 0.1,
            carries_size,
        }
    }

    #[test]
    fn laws_and_uneven_sizes_widen_an_interval_by_shares_of_the_change() {
        let close = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-12, "{found}, {wanted}");
        close(beyond_noise(&axis(1.0, true), 0.8, 0.0, 0.0), 0.2 * 0.01);
        close(beyond_noise(&axis(1.0, true), 0.8, 1.0, 0.0), 0.2 * 0.11);
        close(
            beyond_noise(&axis(1.0, true), 0.8, 1.0, 0.3),
            0.2 * (0.11_f64 * 0.11 + 0.09).sqrt(),
        );
        // A limit changes by a share of itself; a place is no size.
        close(
            beyond_noise(&axis(f64::INFINITY, true), 2.0, 0.0, 0.3),
            0.4 * (1e-4_f64 + 0.09).sqrt(),
        );
        close(beyond_noise(&axis(1.0, false), 0.8, 1.0, 0.3), 0.0);
    }

    #[test]
    fn an_interval_that_reaches_no_effect_is_told() {
        let found = |low: f64, high: f64| ParameterValue {
            name: "gain".to_owned(),
            value: Some(0.5 * (low + high)),
            low: Some(low),
            high: Some(high),
            unit: "1".to_owned(),
        };
        assert!(reaches_none(&axis(1.0, true), &found(0.9, 1.1)));
        assert!(
            reaches_none(&axis(0.0, true), &found(0.0, 0.4)),
            "ends where it has no effect"
        );
        assert!(!reaches_none(&axis(1.0, true), &found(0.7, 0.9)));
        assert!(!reaches_none(&axis(f64::INFINITY, true), &found(0.7, 0.9)), "a limit");
    }
}
