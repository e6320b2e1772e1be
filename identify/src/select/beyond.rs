//! What windows say beyond their weight.
//!
//! Gains are sums over windows of which each counts at most as three times what is expected ([`crate::floor::Floor::doubt`]). A loud window then says nearly the
//! same of a candidate that leaves a tenth of it and of one that leaves nothing. In the end a window of energy e of which E is expected counts rho(e) = e up
//! to three times E and 3 E (1 + ln(e / 3 E)) beyond (tails between those of Huber 1964 and of Cauchy), under either model: what explains it
//! down to the noise has explained all of it.

use super::evidence::rest_energies;
use super::round::Side;
use crate::floor::{Floor, LOUDEST};

/// Decrease of rho beyond that of the weighted energy, by run and window; nothing without references.
pub(super) fn beyond(floor: &Floor, side: &Side, changed: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut runs = Vec::with_capacity(changed.len());
    for (run, record) in side.records.iter().enumerate() {
        if floor.references.is_empty() {
            runs.push(vec![0.0; record.windows.len()]);
            continue;
        }
        let expected = floor.expected_of_windows(record);
        let before = rest_energies(side.metric, run, record, &side.residuals[run]);
        let after = rest_energies(side.metric, run, record, &changed[run]);
        let windows = record.windows.iter().zip(expected).zip(before.into_iter().zip(after));
        let more = windows.map(|((window, expected), (before, after))| {
            // Of a window in which nothing is compared nothing is expected.
            if expected <= 0.0 {
                return 0.0;
            }
            let counted = |energy: f64| rho(energy / window.trust, LOUDEST * expected);
            counted(before) - counted(after) - (before - after)
        });
        runs.push(more.collect());
    }
    runs
}

pub(super) fn sum(runs: &[Vec<f64>]) -> f64 {
    runs.iter().flatten().sum()
}

/// - `most`: energy from which on windows are too loud.
fn rho(energy: f64, most: f64) -> f64 {
    if energy <= most {
        return energy;
    }
    most * (1.0 + libm::log(energy / most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loud_windows_count_by_their_logarithm() {
        assert_eq!((rho(2.0, 3.0), rho(3.0, 3.0)), (2.0, 3.0));
        assert!((rho(3.0 * libm::exp(2.0), 3.0) - 9.0).abs() < 1e-12);
        // Of a hundred times what is expected, a tenth is left, or nothing.
        let (tenth, all) = (rho(300.0, 3.0) - rho(30.0, 3.0), rho(300.0, 3.0) - rho(1.0, 3.0));
        assert!(all > 2.0 * tenth, "{tenth} {all}");
    }
}
