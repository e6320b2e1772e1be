//! What a run says about what was learned in it.

use serde::{Deserialize, Serialize};

/// Share of the predictions at the end that decide.
const DECIDING: f64 = 1.0 / 3.0;
/// Predictions that are judged as one, because they overlap: 1 s.
const BLOCK: usize = 10;
/// Fewest blocks that decide.
const BLOCKS_LEAST: usize = 4;
/// Least share by which the error must fall.
const LEAST_GAIN: f64 = 0.05;
/// 95 %, one-sided.
const QUANTILE: f64 = 1.645;
/// Predictions that are kept: four hours of one run. Later ones are not judged.
const KEPT: usize = 144_000;

/// Errors of both predictors, prediction by prediction.
#[derive(Debug, Clone, Default)]
pub struct Account {
    /// Squares, parent and learnt, m^2.
    errors: Vec<[f64; 2]>,
}

/// Place errors 0.5 s ahead over the last third of a run, and what follows from them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Closing {
    /// Predictions of the whole run, and those that decided.
    pub predictions: usize,
    pub deciding: usize,
    /// RMS over the deciding ones.
    pub parent_rms_m: f64,
    pub learnt_rms_m: f64,
    /// The learnt one is better by 5 % and by 1.645 standard errors of the difference of squares over blocks of 1 s.
    pub is_better: bool,
}

impl Account {
    /// Takes the place errors of one prediction, m.
    pub fn take(&mut self, parent_m: f64, learnt_m: f64) {
        if self.errors.len() < KEPT {
            self.errors.push([parent_m * parent_m, learnt_m * learnt_m]);
        }
    }

    /// Figures so far.
    pub fn close(&self) -> Closing {
        let from = (self.errors.len() as f64 * (1.0 - DECIDING)) as usize;
        let last = &self.errors[from..];
        let mean = |which: usize| last.iter().map(|pair| pair[which]).sum::<f64>() / last.len().max(1) as f64;
        let [parent_m2, learnt_m2] = [mean(0), mean(1)];
        Closing {
            predictions: self.errors.len(),
            deciding: last.len(),
            parent_rms_m: parent_m2.sqrt(),
            learnt_rms_m: learnt_m2.sqrt(),
            is_better: learnt_m2.sqrt() < (1.0 - LEAST_GAIN) * parent_m2.sqrt() && is_clear(last),
        }
    }
}

/// Whether the gain stands out from its scatter over blocks.
fn is_clear(pairs: &[[f64; 2]]) -> bool {
    let gains: Vec<f64> = pairs
        .chunks_exact(BLOCK)
        .map(|block| block.iter().map(|[parent, learnt]| parent - learnt).sum::<f64>() / BLOCK as f64)
        .collect();
    if gains.len() < BLOCKS_LEAST {
        return false;
    }
    let count = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / count;
    let variance = gains.iter().map(|gain| (gain - mean) * (gain - mean)).sum::<f64>() / (count - 1.0);
    mean > QUANTILE * (variance / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn account(learnt_m: impl Fn(usize) -> f64, count: usize) -> Closing {
        let mut account = Account::default();
        (0..count).for_each(|place| account.take(0.010 + 0.001 * ((place / 10) % 3) as f64, learnt_m(place)));
        account.close()
    }

    #[test]
    fn only_the_last_third_decides_and_it_must_be_long_enough() {
        let late = account(|place| if place < 200 { 0.05 } else { 0.005 }, 300);
        assert!(
            late.is_better && late.deciding == 100 && late.predictions == 300,
            "{late:?}"
        );
        assert!(!account(|place| if place < 200 { 0.001 } else { 0.012 }, 300).is_better);
        assert!(!account(|_| 0.001, 100).is_better, "three blocks");
        assert_eq!(Account::default().close(), Closing::default());
    }

    #[test]
    fn a_gain_that_comes_from_one_second_is_no_gain() {
        let lucky = account(|place| if place >= 290 { 0.0 } else { 0.0109 }, 300);
        assert!(!lucky.is_better, "{lucky:?}");
    }
}
