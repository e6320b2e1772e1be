//! What the laws of the named effects leave: real laws are off those of the library, and the rest looks like further effects.

use super::curve;
use crate::floor::Metric;
use crate::record::{CLASSES, Record};

/// Part of what is explained on a channel that the laws of the explanation leave there as a rest of their own. Such a rest is of many
/// kinds: what explains [`REST_SHARE`] of all that is left on the channel is no part of it.
const LAW_REST: f64 = 0.01;
const REST_SHARE: f64 = 0.3;
/// No law is truer than this: what explains a smaller share of what is explained already may be its rest, however much of what is left it is.
const LAW_LEAST: f64 = 0.001;

/// Weighted energies by class of channels.
pub type Energies = [f64; CLASSES];

/// Energies of all runs, everyday differences taken out of each.
pub fn energies(metric: &Metric, records: &[Record], residuals: &[Vec<f64>]) -> Energies {
    let mut sums = [0.0; CLASSES];
    for (run, (record, residual)) in records.iter().zip(residuals).enumerate() {
        for (place, rest) in record.places().iter().zip(metric.rest(run, residual)) {
            if let Some(quantity) = place.quantity {
                sums[quantity.class()] += rest * rest;
            }
        }
    }
    sums
}

/// Energies that noise alone would have.
pub fn expected(metric: &Metric) -> Energies {
    let mut sums = [0.0; CLASSES];
    for run in 0..metric.run_count() {
        for (sum, expected) in sums.iter_mut().zip(metric.expected_of_classes(run)) {
            *sum += expected;
        }
    }
    sums
}

pub fn decrease(before: &Energies, after: &Energies) -> Energies {
    core::array::from_fn(|class| before[class] - after[class])
}

/// What named effects have explained and what is left.
#[derive(Debug, Clone, Default)]
pub struct Explained {
    /// By the named effects together.
    pub gain: Energies,
}

impl Explained {
    /// Part of a gain that the laws of the named effects could not have left: on channels where it is large beside what they explain there.
    ///
    /// - `left`: energies beyond the noise before the gain.
    /// - `candidate`, `members`: names of the effect that gains, and of the named ones.
    pub(super) fn own_part<'a>(
        &self,
        gain: &Energies,
        left: &Energies,
        candidate: &str,
        members: impl Iterator<Item = &'a str>,
    ) -> f64 {
        let curve_share = curve::share(candidate, members);
        let counts = |class: &usize| {
            let explained = self.gain[*class].max(0.0);
            let law_rest = (LAW_REST * explained).min(REST_SHARE * left[*class].max(0.0));
            gain[*class] >= law_rest.max(curve_share.max(LAW_LEAST) * explained)
        };
        (0..CLASSES).filter(counts).map(|class| gain[class].max(0.0)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUS: usize = 3;
    const POSE: usize = 6;

    fn of(class: usize, value: f64) -> Energies {
        let mut energies = [0.0; CLASSES];
        energies[class] = value;
        energies
    }

    fn own_part(explained: Energies, gain: Energies, left: Energies) -> f64 {
        Explained { gain: explained }.own_part(&gain, &left, "payload", ["battery_droop"].into_iter())
    }

    #[test]
    fn a_rest_is_looked_for_on_the_channels_of_what_is_explained() {
        let droop = of(BUS, 1e6);
        let left = [2000.0; CLASSES];
        assert!(
            (own_part(droop, of(POSE, 100.0), left) - 100.0).abs() < 1e-9,
            "elsewhere"
        );
        assert_eq!(own_part(droop, of(BUS, 900.0), left), 0.0, "no law is so true");
        assert!(
            (own_part(droop, of(BUS, 1100.0), left) - 1100.0).abs() < 1e-9,
            "half of what is left"
        );
        assert_eq!(
            own_part(droop, of(BUS, 1100.0), [20_000.0; CLASSES]),
            0.0,
            "a part of the rest"
        );
        let mut both = of(POSE, 100.0);
        both[BUS] = 900.0;
        assert!(
            (own_part(droop, both, left) - 100.0).abs() < 1e-9,
            "what is elsewhere counts"
        );
    }

    #[test]
    fn parts_of_a_curve_need_a_share_of_what_the_other_explains_there() {
        let explained = Explained { gain: of(0, 1000.0) };
        let of_stribeck = |gain: f64, named: &'static str| {
            explained.own_part(&of(0, gain), &of(0, 150.0), "stribeck_friction", [named].into_iter())
        };
        assert_eq!(of_stribeck(90.0, "coulomb_friction"), 0.0);
        assert!((of_stribeck(110.0, "coulomb_friction") - 110.0).abs() < 1e-9);
        assert!((of_stribeck(90.0, "payload") - 90.0).abs() < 1e-9);
    }
}
