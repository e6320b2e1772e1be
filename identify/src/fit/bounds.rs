//! What effects make worse in one window counts as much as what they may make better there, and no more.
//!
//! A window that is far louder than expected counts at most as three times what is expected ([`Floor::doubt`]), so nothing can gain more in it. A window
//! that is quiet under the present model and far off under another could lose a thousand times that: a wheel that slides in the twin and held in truth,
//! a robot that another camera sees than the one simulated. It would outvote all others.

use crate::floor::{Floor, LOUDEST, Metric};
use crate::record::Record;

/// By how much the energy of windows may rise.
#[derive(Debug, Clone)]
pub struct Bounds {
    /// By record and window; without references, where windows count whatever they hold, infinite.
    most: Vec<Vec<f64>>,
}

/// Residuals under a model, as far as they count.
pub struct Bounded {
    pub residuals: Vec<Vec<f64>>,
    /// Shares of the change from the base that count, by run and window.
    pub shares: Vec<Vec<f64>>,
}

impl Bounds {
    pub fn of(floor: &Floor, records: &[Record]) -> Bounds {
        let is_bounded = !floor.references.is_empty();
        let most = records.iter().map(|record| {
            let expected = floor.expected_of_windows(record);
            let bound = |expected: f64| if is_bounded { LOUDEST * expected } else { f64::INFINITY };
            expected.into_iter().map(bound).collect()
        });
        Bounds { most: most.collect() }
    }

    /// Residuals as far from those of the base, window by window, as they may go before a window's energy has risen by as much as the window may count.
    pub fn keep(&self, metric: &Metric, records: &[Record], base: &[Vec<f64>], mut changed: Vec<Vec<f64>>) -> Bounded {
        let mut shares = Vec::with_capacity(changed.len());
        for (run, (record, most)) in records.iter().zip(&self.most).enumerate() {
            if most.iter().all(|most| most.is_infinite()) {
                shares.push(vec![1.0; most.len()]);
                continue;
            }
            let (base, changed) = (&base[run], &mut changed[run]);
            let step: Vec<f64> = changed.iter().zip(base).map(|(changed, base)| changed - base).collect();
            let (before, moved) = (metric.rest(run, base), metric.rest(run, &step));
            let windows = record.cells_of_windows().into_iter().zip(most);
            let own: Vec<f64> = windows
                .map(|(cells, most)| {
                    let share = share(&before[cells.clone()], &moved[cells.clone()], *most);
                    if share < 1.0 {
                        cells.for_each(|cell| changed[cell] = base[cell] + share * step[cell]);
                    }
                    share
                })
                .collect();
            shares.push(own);
        }
        Bounded {
            residuals: changed,
            shares,
        }
    }
}

/// Largest share of a step, at most all of it, at which the sum of squares has risen by no more than `most`.
fn share(before: &[f64], step: &[f64], most: f64) -> f64 {
    let (mut along, mut own) = (0.0, 0.0);
    for (b, s) in before.iter().zip(step) {
        along += b * s;
        own += s * s;
    }
    let rise = 2.0 * along + own;
    if rise <= most || rise.is_nan() {
        return 1.0;
    }
    // The positive root of s^2 own + 2 s along = most.
    (libm::sqrt(along * along + own * most) - along) / own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::Hypothesis;
    use crate::record::Quantity;
    use crate::record::made::{record, series};

    #[test]
    fn only_the_window_that_would_lose_too_much_is_held() {
        let description = twin::golden::reference_robot("diff2");
        let mut floor = Floor::stated(Hypothesis::nominal(&description), Vec::new());
        let windows = || series(Quantity::Wheel(0), 100).windows;
        let records = [record([windows(), windows()].concat())];
        let metric = floor.metric(&records, &[]);
        let sigma = floor.noise.classes[0].level.sqrt();
        let base = [vec![sigma; 200]];
        let changed = vec![[vec![1.5 * sigma; 100], vec![50.0 * sigma; 100]].concat()];
        let free = Bounds::of(&floor, &records).keep(&metric, &records, &base, changed.clone());
        assert_eq!(free.residuals, changed, "nothing tells how loud is too loud");
        floor.references = vec![series(Quantity::Wheel(0), 1)];
        let kept = Bounds::of(&floor, &records).keep(&metric, &records, &base, changed.clone());
        assert_eq!(kept.residuals[0][..100], changed[0][..100]);
        assert!(kept.shares[0][0] == 1.0 && kept.shares[0][1] < 0.1, "{:?}", kept.shares);
        // As loud as expected, and three times that more.
        let held = kept.residuals[0][150] / sigma;
        assert!((held - 2.0).abs() < 1e-9, "{held}");
    }

    #[test]
    fn a_step_goes_as_far_as_energy_may_rise() {
        let before = [1.0, 2.0];
        assert_eq!(share(&before, &[-1.0, -2.0], 3.0), 1.0, "a gain");
        assert_eq!(share(&before, &[1.0, 0.0], 3.0), 1.0, "as far as it may");
        let step = [30.0, -10.0];
        let share = share(&before, &step, 3.0);
        let energy: f64 = before
            .iter()
            .zip(&step)
            .map(|(b, s)| (b + share * s) * (b + share * s))
            .sum();
        assert!(
            share > 0.0 && share < 0.1 && (energy - 8.0).abs() < 1e-9,
            "{share} {energy}"
        );
    }
}
