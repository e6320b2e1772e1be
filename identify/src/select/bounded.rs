//! What a candidate makes worse in one window counts as much as what it may make better there, and no more.
//!
//! A window that is far louder than expected counts at most as three times what is expected ([`crate::floor::Floor::doubt`]), so no candidate can gain more in
//! it. A window that is quiet under the present model and far off under the candidate's could lose a thousand times that: a robot that another camera sees
//! than the one simulated, a wheel that slides in the twin and held in truth. It would outvote all others.

use super::round::{Round, difference};
use crate::floor::LOUDEST;

/// Residuals under a candidate, as far as they count.
pub(super) struct Bounded {
    pub residuals: Vec<Vec<f64>>,
    /// Shares of the candidate's change that count, by run and window.
    pub shares: Vec<Vec<f64>>,
}

/// Residuals of the validation runs under a candidate, as far from those under the present model, window by window, as the candidate may go before the
/// window's energy has risen by as much as the window may count. Without references, where windows count whatever they hold, as they are.
pub(super) fn bounded(data: &Round, changed: Vec<Vec<f64>>) -> Bounded {
    if data.floor.references.is_empty() {
        let shares = data
            .validation
            .records
            .iter()
            .map(|record| vec![1.0; record.windows.len()]);
        return Bounded {
            residuals: changed,
            shares: shares.collect(),
        };
    }
    let side = &data.validation;
    let steps = difference(&changed, side.residuals);
    let mut bounded = Bounded {
        residuals: Vec::with_capacity(changed.len()),
        shares: Vec::with_capacity(changed.len()),
    };
    for (run, record) in side.records.iter().enumerate() {
        let (base, step) = (&side.residuals[run], &steps[run]);
        let (before, moved) = (side.metric.rest(run, base), side.metric.rest(run, step));
        let expected = data.floor.expected_of_windows(record);
        let mut residual = Vec::with_capacity(base.len());
        let mut shares = Vec::with_capacity(expected.len());
        for (cells, expected) in record.cells_of_windows().into_iter().zip(expected) {
            let share = share(&before[cells.clone()], &moved[cells.clone()], LOUDEST * expected);
            residual.extend(cells.map(|cell| base[cell] + share * step[cell]));
            shares.push(share);
        }
        bounded.residuals.push(residual);
        bounded.shares.push(shares);
    }
    bounded
}

/// Largest share of a step, at most all of it, at which the sum of squares has risen by no more than `most`.
fn share(before: &[f64], step: &[f64], most: f64) -> f64 {
    let (mut along, mut own) = (0.0, 0.0);
    for (b, s) in before.iter().zip(step) {
        along += b * s;
        own += s * s;
    }
    if 2.0 * along + own <= most {
        return 1.0;
    }
    // The positive root of s^2 own + 2 s along = most.
    (libm::sqrt(along * along + own * most) - along) / own
}

#[cfg(test)]
mod tests {
    use super::*;

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
