//! Whether an effect has the same size wherever it acts: a law of another kind, imitated, has not.
//!
//! Every window estimates by how much the fitted size should differ in it: the residual's part along the effect's own change there.
//! Sizes of a true law differ by noise alone, and by what real laws are off; of an imitated one by as much as the size itself. The
//! variance between windows is that of random effects (DerSimonian and Laird 1986).

use crate::floor::Metric;
use crate::record::Record;

/// Windows with less evidence than this say nothing.
const LEAST_EVIDENCE: f64 = 0.5;
/// Fewest windows with evidence.
pub(super) const FEWEST: usize = 6;

/// A size that differs from window to window by more than this share of itself, when windows differ by so much more than by chance, is
/// that of no one law. What a healthy robot's twin is off by lets weak effects differ as much, hardly more than by chance.
const UNEVEN: f64 = 0.5;
const SURPRISING: f64 = 5.0;
/// Beyond all chance a smaller share tells as well: a drag that grows with the square of speed differs from the best viscous one by a quarter, by forty
/// times what chance does; laws of real friction and tyres by a quarter and ten times, or twenty times and a twentieth.
const HARDLY_EVEN: f64 = 0.2;
const BEYOND_CHANCE: f64 = 20.0;
/// Between the two, where the stretches that tell most are few: spread times the root of the surprise is about the same on the line through all three.
const LESS_EVEN: f64 = 0.35;
const NO_CHANCE: f64 = 10.0;

/// Of one effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Evenness {
    /// Standard deviation of the size from window to window beyond noise, as a share of the size.
    pub spread: f64,
    /// Sum of squares of the windows' deviations over that of noise.
    pub surprise: f64,
    /// What the spread alone adds to the standard error of the mean size, as a share of it.
    pub of_mean: f64,
}

impl Evenness {
    /// The windows ask for sizes that no one law has.
    pub fn is_uneven(&self) -> bool {
        let bars = [
            (UNEVEN, SURPRISING),
            (LESS_EVEN, NO_CHANCE),
            (HARDLY_EVEN, BEYOND_CHANCE),
        ];
        bars.iter()
            .any(|(spread, surprise)| self.spread > *spread && self.surprise > *surprise)
    }
}

/// Evenness of one effect; `None` when too few windows say anything.
///
/// - `changes`: what the effect changes of the residuals, per run.
/// - `residuals`: what is left with the effect.
pub(super) fn evenness(
    metric: &Metric,
    records: &[Record],
    changes: &[Vec<f64>],
    residuals: &[Vec<f64>],
) -> Option<Evenness> {
    let mut windows: Vec<(f64, f64)> = Vec::new();
    for (run, record) in records.iter().enumerate() {
        let change = metric.rest(run, &changes[run]);
        let residual = metric.rest(run, &residuals[run]);
        for cells in record.cells_of_windows() {
            let pairs = || change[cells.clone()].iter().zip(&residual[cells.clone()]);
            let evidence: f64 = pairs().map(|(change, _)| change * change).sum();
            let along: f64 = pairs().map(|(change, residual)| change * residual).sum();
            if evidence > LEAST_EVIDENCE {
                windows.push((evidence, along / evidence));
            }
        }
    }
    spread(&windows)
}

/// - `windows`: evidence (one over variance) and deviation of each.
fn spread(windows: &[(f64, f64)]) -> Option<Evenness> {
    if windows.len() < FEWEST {
        return None;
    }
    let total: f64 = windows.iter().map(|window| window.0).sum();
    let squares: f64 = windows.iter().map(|window| window.0 * window.0).sum();
    let mean = windows
        .iter()
        .map(|(evidence, deviation)| evidence * deviation)
        .sum::<f64>()
        / total;
    let around: f64 = windows
        .iter()
        .map(|(evidence, deviation)| evidence * (deviation - mean) * (deviation - mean))
        .sum();
    let freedom = (windows.len() - 1) as f64;
    let between = ((around - freedom) / (total - squares / total).max(1e-300)).max(0.0);
    let told: f64 = windows.iter().map(|window| 1.0 / (1.0 / window.0 + between)).sum();
    Some(Evenness {
        spread: between.sqrt(),
        surprise: around / freedom,
        of_mean: (1.0 / told - 1.0 / total).max(0.0).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Windows of evidence 100 whose sizes differ by `between`, as a share of the size.
    fn windows(between: f64) -> Vec<(f64, f64)> {
        let mut random = Random::new(5, 1);
        let mut of = |sigma: f64| sigma * random.normal();
        (0..400).map(|_| (100.0, of(0.1) + of(between))).collect()
    }

    #[test]
    fn the_spread_beyond_noise_is_found() {
        for between in [0.0, 0.3, 2.0] {
            let found = spread(&windows(between)).expect("windows enough");
            assert!(
                (found.spread - between).abs() < 0.05 + 0.1 * between,
                "{between}: {found:?}"
            );
            let of_mean = between / 20.0;
            assert!(
                (found.of_mean - of_mean).abs() < 0.002 + 0.1 * of_mean,
                "{between}: {found:?}"
            );
            assert_eq!(found.is_uneven(), between > 1.0, "{found:?}");
        }
        assert_eq!(spread(&windows(0.0)[..5]), None);
    }

    #[test]
    fn a_law_that_is_a_little_other_is_told_where_evidence_is_plenty() {
        let uneven = |spread: f64, surprise: f64| {
            Evenness {
                spread,
                surprise,
                of_mean: 0.0,
            }
            .is_uneven()
        };
        assert!(uneven(0.26, 40.0), "the square of speed as its first power");
        assert!(uneven(0.39, 14.0), "the same where few stretches are fast");
        assert!(!uneven(0.45, 4.3), "a battery that recovers slowly");
        assert!(!uneven(0.23, 6.6), "friction with other corners");
        assert!(!uneven(0.05, 30.0), "a tyre of another curve");
    }

    #[test]
    fn weak_effects_that_differ_hardly_more_than_by_chance_are_let_be() {
        let weak: Vec<(f64, f64)> = windows(1.0).iter().map(|(_, deviation)| (2.0, *deviation)).collect();
        let found = spread(&weak).expect("windows enough");
        assert!(found.spread > UNEVEN && !found.is_uneven(), "{found:?}");
    }
}
