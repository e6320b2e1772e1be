//! Without references: what runs of which nothing is known say of the description.

use super::Floor;
use super::calibrate::word_sigma;
use crate::hypothesis::{Hypothesis, Knob, realised};
use crate::linear::Square;
use crate::record::{Record, Stages};
use crate::workers::{Cancelled, Workers};

/// What each run says of the knobs: S' V^-1 S and S' V^-1 y, y as it would be with all knobs at 0.
#[derive(Debug, Clone)]
pub struct Said {
    runs: Vec<(Square, Vec<f64>)>,
    /// Precision with which the description tells each knob.
    told: Vec<f64>,
}

/// Values of the knobs in practical sizes, with their covariance.
#[derive(Debug, Clone)]
pub struct Estimate {
    pub values: Vec<f64>,
    pub covariance: Square,
}

impl Floor {
    /// What no description tells is calibrated on runs of which nothing is known, all other knobs turned along and then put back. The rest is
    /// stated.
    pub fn told_by_runs(
        workers: &dyn Workers,
        given: Hypothesis,
        knobs: Vec<Knob>,
        stages: &[Stages],
        runs: Vec<Record>,
    ) -> Result<Floor, Cancelled> {
        let calibrated = Floor::calibrated(workers, given.clone(), knobs.clone(), stages, runs)?;
        let pairs = calibrated.values.iter().zip(&knobs);
        let values = pairs.map(|(value, knob)| if knob.is_untold() { *value } else { 0.0 });
        let values = values.collect();
        Ok(Floor::stated(given, knobs).turned_to(values))
    }

    /// The same with its knobs elsewhere.
    pub fn turned_to(mut self, values: Vec<f64>) -> Floor {
        self.model = realised(&self.given, &self.knobs, &values);
        self.values = values;
        self
    }

    /// The twin before anything was learned from runs: calibrated on references, or else as described.
    pub fn before(&self) -> &Hypothesis {
        if self.references.is_empty() {
            &self.given
        } else {
            &self.model
        }
    }

    /// What the runs that it was calibrated on say of its knobs, to first order.
    pub fn said(&self) -> Said {
        let runs = (0..self.references.len()).map(|run| {
            let residual = &self.residuals[run];
            let weighting = self.yardstick.robust_weighting(&self.references[run], residual);
            let (information, mut score) = self.information_from(self.moments_with(run, &weighting, residual));
            for (row, score) in score.iter_mut().enumerate() {
                let turned = self.values.iter().enumerate();
                *score += turned.map(|(k, value)| information.at(row, k) * value).sum::<f64>();
            }
            (information, score)
        });
        Said {
            runs: runs.collect(),
            told: self.knobs.iter().map(told).collect(),
        }
    }
}

fn told(knob: &Knob) -> f64 {
    let sigma = word_sigma(knob);
    1.0 / (sigma * sigma)
}

impl Said {
    /// - `runs`: S' V^-1 S and S' V^-1 y of each, `told` the precisions of the description.
    #[cfg(test)]
    pub(crate) fn made(runs: Vec<(Square, Vec<f64>)>, told: Vec<f64>) -> Said {
        Said { runs, told }
    }

    /// Number of runs.
    pub fn len(&self) -> usize {
        self.runs.len()
    }

    /// True without runs.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Likeliest values of the knobs by some of the runs, the description being believed but for the knobs that are `free`.
    pub fn estimate(&self, runs: impl Iterator<Item = usize>, free: &[usize]) -> Estimate {
        let count = self.told.len();
        let mut precision = Square::zero(count);
        let mut score = vec![0.0; count];
        for run in runs {
            let (information, own) = &self.runs[run];
            for (sum, more) in precision.values.iter_mut().zip(&information.values) {
                *sum += more;
            }
            for (sum, more) in score.iter_mut().zip(own) {
                *sum += more;
            }
        }
        for (k, told) in self.told.iter().enumerate() {
            precision.add(k, k, if free.contains(&k) { 1e-9 } else { *told });
        }
        let factor = precision.cholesky();
        Estimate {
            values: factor.solve(&score),
            covariance: factor.inverse(),
        }
    }

    /// By how much likelier the runs become when the description is not believed on some knobs: decrease of twice the negative logarithm.
    ///
    /// - `estimate`: with the description believed on these.
    pub fn gain(&self, estimate: &Estimate, knobs: &[usize]) -> f64 {
        let own = estimate.covariance.part(knobs);
        let mut room = Square::zero(knobs.len());
        for (row, knob) in knobs.iter().enumerate() {
            for column in 0..knobs.len() {
                room.set(row, column, -own.at(row, column));
            }
            room.add(row, row, 1.0 / self.told[*knob]);
        }
        let values: Vec<f64> = knobs.iter().map(|knob| estimate.values[*knob]).collect();
        let solved = room.cholesky().solve(&values);
        values.iter().zip(solved).map(|(value, solved)| value * solved).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const KNOBS: usize = 3;

    /// Runs that are linear in three knobs, with noise of 1.
    fn runs(truth: [f64; KNOBS], size: f64) -> Said {
        let mut random = Random::new(3, 1);
        let run = |_| {
            let mut information = Square::zero(KNOBS);
            let mut score = vec![0.0; KNOBS];
            for _ in 0..200 {
                let slopes: Vec<f64> = (0..KNOBS).map(|_| size * random.normal()).collect();
                let told: f64 = slopes.iter().zip(truth).map(|(slope, value)| slope * value).sum();
                let y = told + random.normal();
                for i in 0..KNOBS {
                    score[i] += slopes[i] * y;
                    for j in 0..KNOBS {
                        information.add(i, j, slopes[i] * slopes[j]);
                    }
                }
            }
            (information, score)
        };
        Said {
            runs: (0..4).map(run).collect(),
            told: vec![8.0, 8.0, 0.2],
        }
    }

    /// Twice the negative logarithm of the likelihood at an estimate, but for a constant.
    fn surprise(said: &Said, estimate: &Estimate, free: &[usize]) -> f64 {
        let values = &estimate.values;
        let prior = (0..KNOBS).filter(|k| !free.contains(k));
        let mut sum: f64 = prior.map(|k| said.told[k] * values[k] * values[k]).sum();
        for (information, score) in &said.runs {
            let told: f64 = score.iter().zip(values).map(|(score, value)| score * value).sum();
            sum += information.quadratic(values) - 2.0 * told;
        }
        sum
    }

    #[test]
    fn runs_tell_the_knobs_and_a_description_that_is_not_believed_does_not_hold_them_back() {
        let said = runs([2.0, 0.1, -1.0], 0.1);
        let believed = said.estimate(0..4, &[]);
        let free = said.estimate(0..4, &[0]);
        let sigma = free.covariance.at(0, 0).sqrt();
        assert!((free.values[0] - 2.0).abs() < 3.0 * sigma, "{:?}", free.values);
        assert!(believed.values[0] < free.values[0] - 0.5 * sigma);
    }

    /// The closed form is what a second estimate finds.
    #[test]
    fn what_not_believing_gains_is_what_the_likelihood_says() {
        let said = runs([2.0, 0.1, -1.0], 0.1);
        let believed = said.estimate(0..4, &[]);
        for knobs in [&[0][..], &[1], &[0, 2]] {
            let free = said.estimate(0..4, knobs);
            let exact = surprise(&said, &believed, &[]) - surprise(&said, &free, knobs);
            let gain = said.gain(&believed, knobs);
            assert!(
                (gain - exact).abs() < 1e-6 * exact.abs().max(1.0),
                "{knobs:?}: {gain} {exact}"
            );
        }
    }
}
