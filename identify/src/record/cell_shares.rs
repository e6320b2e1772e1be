//! Which samples make up a cell, and with what weights.

use core::ops::Range;

use super::CELL_S;

/// Samples a cell from which neighbours share them; with fewer there is nothing to be smoothed.
const SAMPLES_TO_SHARE: f64 = 3.0;

/// Samples of one cell with weights that sum to 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellShares {
    pub samples: Range<usize>,
    pub shares: Vec<f64>,
}

/// Weight of a sample in a cell by its distance from the middle: a triangle over twice the cell, so that neighbours share their samples. A
/// motor that rings between two samples leaves half a sample's swing in a plain mean of five, and next to nothing here.
fn triangle(time_s: f64, middle_s: f64) -> f64 {
    (1.0 - (time_s - middle_s).abs() / CELL_S).max(0.0)
}

/// The cells between two times that have samples, in order.
///
/// - `time_s`: of all samples, rising.
pub(super) fn cell_shares(time_s: &[f64], from_s: f64, to_s: f64) -> Vec<CellShares> {
    let inside = |from_s: f64, end_s: f64| {
        time_s.partition_point(|t| *t < from_s)..time_s.partition_point(|t| *t < end_s.min(to_s))
    };
    let all = inside(from_s, to_s);
    let is_dense = all.len() as f64 * CELL_S >= SAMPLES_TO_SHARE * (to_s - from_s);
    let mut cells = Vec::new();
    let mut cell_from_s = from_s;
    while cell_from_s < to_s {
        let end_s = cell_from_s + CELL_S;
        let middle_s = cell_from_s + 0.5 * CELL_S;
        let samples = if is_dense {
            inside((middle_s - CELL_S).max(from_s), middle_s + CELL_S)
        } else {
            inside(cell_from_s, end_s)
        };
        let own = time_s[samples.clone()].iter();
        let weights: Vec<f64> = own
            .map(|time_s| if is_dense { triangle(*time_s, middle_s) } else { 1.0 })
            .collect();
        let total: f64 = weights.iter().sum();
        if total > 0.0 {
            let shares = weights.iter().map(|weight| weight / total).collect();
            cells.push(CellShares { samples, shares });
        }
        cell_from_s = end_s;
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(rate_hz: f64, seconds: f64) -> Vec<f64> {
        (0..(rate_hz * seconds) as usize)
            .map(|sample| (sample as f64 + 0.31) / rate_hz)
            .collect()
    }

    fn means(time_s: &[f64], value: impl Fn(usize) -> f64) -> Vec<f64> {
        let cells = cell_shares(time_s, 0.0, 1.0);
        let mean = |cell: &CellShares| {
            cell.samples
                .clone()
                .zip(&cell.shares)
                .map(|(k, share)| share * value(k))
                .sum()
        };
        cells.iter().map(mean).collect()
    }

    #[test]
    fn weights_sum_to_one_and_constants_stay() {
        for rate_hz in [10.0, 50.0, 62.0, 120.0, 1000.0] {
            let time_s = times(rate_hz, 1.0);
            for cell in cell_shares(&time_s, 0.0, 1.0) {
                let sum: f64 = cell.shares.iter().sum();
                assert!(
                    (sum - 1.0).abs() < 1e-12 && cell.shares.iter().all(|share| *share >= 0.0),
                    "{rate_hz} Hz: {sum}"
                );
            }
            assert!(means(&time_s, |_| 3.5).iter().all(|mean| (mean - 3.5).abs() < 1e-12));
        }
    }

    /// Five samples of one that alternates leave a fifth in a plain mean, six samples of two neighbours' worth a fraction of that.
    #[test]
    fn a_ringing_motor_leaves_next_to_nothing() {
        let time_s = times(100.0, 1.0);
        let inner = means(&time_s, |k| if k % 2 == 0 { 1.0 } else { -1.0 });
        let most = inner[1..inner.len() - 1]
            .iter()
            .fold(0.0_f64, |most, mean| most.max(mean.abs()));
        assert!(most < 0.05, "{most}");
    }

    #[test]
    fn sparse_logs_keep_plain_means_of_their_own_samples() {
        let time_s = times(40.0, 1.0);
        let cells = cell_shares(&time_s, 0.0, 1.0);
        assert_eq!(cells.len(), 20);
        let mut next = 0;
        for cell in cells {
            assert_eq!(cell.samples, next..next + 2);
            assert_eq!(cell.shares, [0.5, 0.5]);
            next += 2;
        }
        let gaps = cell_shares(&times(10.0, 1.0), 0.0, 1.0);
        assert_eq!(gaps.len(), 10, "cells without a sample are none");
    }
}
