//! Inner product of residuals of several runs in which everyday differences do not count.
//!
//! A residual of run r is S_r (c + b_r) + e: sensitivities S of the knobs, what the calibration left of them (c, common to
//! all runs, covariance C), the variation from run to run (b, covariance L), and noise of weight W. The product is that
//! of the inverse covariance, by Woodbury's formula twice; everything small is the number of knobs.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use super::modes::Weighting;
use crate::linear::{Factor, Square};
use crate::record::CLASSES;

/// One run.
#[derive(Debug, Clone)]
struct RunTerms {
    weighting: Weighting,
    /// Sensitivities of the knobs, turned.
    knobs: Vec<Vec<f64>>,
    /// S' W S
    gram: Square,
    /// (L^-1 + S' W S)
    inner: Factor,
    /// The same of a run by itself, where the description's errors are no others' either: C beside L.
    alone: Factor,
}

/// The product over some runs.
#[derive(Debug, Clone)]
pub struct Metric {
    runs: Vec<RunTerms>,
    /// (C^-1 + sum S' V^-1 S)
    common: Factor,
    knobs: usize,
}

/// Sum of a_i b_i in four lanes: the same order on every machine.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a4.zip(b4) {
        for lane in 0..4 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + tail
}

fn weighted(weights: &[f64], values: &[f64]) -> Vec<f64> {
    weights.iter().zip(values).map(|(w, v)| w * v).collect()
}

impl Metric {
    /// - `runs`: weights, and sensitivities of the knobs as they were simulated.
    /// - `variation`: variances L of the knobs from run to run.
    /// - `uncertainty`: covariance C of what the calibration left.
    /// - `own_errors`: a run by itself may have errors of the size of C, its variances alone; without references nothing has taken them up.
    pub fn new(
        runs: Vec<(Weighting, Vec<&[f64]>)>,
        variation: &[f64],
        uncertainty: &Square,
        own_errors: bool,
    ) -> Metric {
        let knobs = variation.len();
        let mut common = uncertainty.cholesky().inverse();
        let mut terms = Vec::with_capacity(runs.len());
        for (weighting, sensitivities) in runs {
            let sensitivities: Vec<Vec<f64>> = sensitivities.iter().map(|knob| weighting.turned(knob)).collect();
            let mut gram = Square::zero(knobs);
            for i in 0..knobs {
                let left = weighted(&weighting.weights, &sensitivities[i]);
                for j in 0..=i {
                    let product = dot(&left, &sensitivities[j]);
                    gram.set(i, j, product);
                    gram.set(j, i, product);
                }
            }
            let mut inner = gram.clone();
            for (k, variance) in variation.iter().enumerate() {
                inner.add(k, k, 1.0 / variance.max(1e-12));
            }
            let inner = inner.cholesky();
            let alone = match own_errors {
                true => {
                    let mut alone = gram.clone();
                    for (k, variance) in variation.iter().enumerate() {
                        alone.add(k, k, 1.0 / (variance + uncertainty.at(k, k)).max(1e-12));
                    }
                    alone.cholesky()
                }
                false => inner.clone(),
            };
            // S' V^-1 S = G - G (L^-1 + G)^-1 G
            for column in 0..knobs {
                let g: Vec<f64> = (0..knobs).map(|row| gram.at(row, column)).collect();
                let solved = inner.solve(&g);
                for row in 0..knobs {
                    let through: f64 = (0..knobs).map(|k| gram.at(row, k) * solved[k]).sum();
                    common.add(row, column, gram.at(row, column) - through);
                }
            }
            terms.push(RunTerms {
                weighting,
                knobs: sensitivities,
                gram,
                inner,
                alone,
            });
        }
        Metric {
            runs: terms,
            common: common.cholesky(),
            knobs,
        }
    }

    /// Number of runs.
    pub fn run_count(&self) -> usize {
        self.runs.len()
    }

    /// Products of all pairs. `vectors[v][run]` are residuals or sensitivities.
    pub fn gram(&self, vectors: &[Vec<&[f64]>]) -> Square {
        self.products(vectors, true)
    }

    /// The same without the common part: each run by itself.
    pub fn gram_of_run(&self, run: usize, vectors: &[&[f64]]) -> Square {
        let terms = &self.runs[run];
        let (mut products, _) = self.run_products(terms, &terms.alone, vectors);
        symmetrise(&mut products);
        products
    }

    /// Weighted energy of a run whose residuals are as large as the noise.
    pub fn expected(&self, run: usize) -> f64 {
        self.expected_of_classes(run).iter().sum()
    }

    /// The same, by class.
    pub fn expected_of_classes(&self, run: usize) -> &[f64; CLASSES] {
        &self.runs[run].weighting.expected
    }

    /// What the knobs, turned as is likeliest for this run alone, leave of a run's vector, in units of the noise: roots of weighted energies.
    pub fn rest(&self, run: usize, vector: &[f64]) -> Vec<f64> {
        let terms = &self.runs[run];
        let weights = &terms.weighting.weights;
        let mut rest = terms.weighting.turned(vector);
        let left = weighted(weights, &rest);
        let seen: Vec<f64> = terms.knobs.iter().map(|knob| dot(&left, knob)).collect();
        for (knob, amount) in terms.knobs.iter().zip(terms.alone.solve(&seen)) {
            for (r, k) in rest.iter_mut().zip(knob) {
                *r -= amount * k;
            }
        }
        rest.iter().zip(weights).map(|(r, w)| r * w.sqrt()).collect()
    }

    /// Products a' V^-1 b of one run, and S' V^-1 a of every vector.
    fn run_products(&self, terms: &RunTerms, inner: &Factor, vectors: &[&[f64]]) -> (Square, Vec<Vec<f64>>) {
        let count = vectors.len();
        let mut products = Square::zero(count);
        let mut seen: Vec<Vec<f64>> = Vec::with_capacity(count);
        let turned: Vec<Vec<f64>> = vectors.iter().map(|vector| terms.weighting.turned(vector)).collect();
        for i in 0..count {
            let left = weighted(&terms.weighting.weights, &turned[i]);
            for j in 0..=i {
                products.set(i, j, dot(&left, &turned[j]));
            }
            seen.push(terms.knobs.iter().map(|knob| dot(&left, knob)).collect());
        }
        let solved: Vec<Vec<f64>> = seen.iter().map(|u| inner.solve(u)).collect();
        for i in 0..count {
            for j in 0..=i {
                products.add(i, j, -dot(&seen[i], &solved[j]));
            }
        }
        let through = (0..count)
            .map(|v| {
                (0..self.knobs)
                    .map(|row| {
                        let back: f64 = (0..self.knobs).map(|k| terms.gram.at(row, k) * solved[v][k]).sum();
                        seen[v][row] - back
                    })
                    .collect()
            })
            .collect();
        (products, through)
    }

    fn products(&self, vectors: &[Vec<&[f64]>], with_common: bool) -> Square {
        let count = vectors.len();
        let mut sum = Square::zero(count);
        let mut common = vec![vec![0.0; self.knobs]; count];
        for (number, terms) in self.runs.iter().enumerate() {
            let here: Vec<&[f64]> = vectors.iter().map(|runs| runs[number]).collect();
            let (products, through) = self.run_products(terms, &terms.inner, &here);
            for (total, more) in sum.values.iter_mut().zip(&products.values) {
                *total += more;
            }
            for (total, more) in common.iter_mut().zip(&through) {
                for (t, m) in total.iter_mut().zip(more) {
                    *t += m;
                }
            }
        }
        if with_common {
            let solved: Vec<Vec<f64>> = common.iter().map(|m| self.common.solve(m)).collect();
            for i in 0..count {
                for j in 0..=i {
                    sum.add(i, j, -dot(&common[i], &solved[j]));
                }
            }
        }
        symmetrise(&mut sum);
        sum
    }
}

/// Copies the lower triangle to the upper one.
fn symmetrise(square: &mut Square) {
    for i in 0..square.size {
        for j in 0..i {
            square.set(j, i, square.at(i, j));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the inverse of the full covariance.
    #[test]
    fn equals_the_inverse_covariance() {
        let (n, runs) = (5, 2);
        let value = |i: usize| libm::sin(1.7 * i as f64 + 0.3);
        let weights: Vec<f64> = (0..n).map(|i| 1.0 + 0.2 * i as f64).collect();
        let knobs: Vec<Vec<Vec<f64>>> = (0..runs)
            .map(|r| {
                (0..2)
                    .map(|k| (0..n).map(|i| value(i + 7 * k + 13 * r)).collect())
                    .collect()
            })
            .collect();
        let variation = [0.5, 0.2];
        let mut uncertainty = Square::zero(2);
        uncertainty.values = vec![0.3, 0.1, 0.1, 0.4];
        let metric = Metric::new(
            knobs
                .iter()
                .map(|k| {
                    (
                        Weighting::diagonal(weights.clone()),
                        k.iter().map(Vec::as_slice).collect(),
                    )
                })
                .collect(),
            &variation,
            &uncertainty,
            false,
        );
        let mut covariance = Square::zero(n * runs);
        for a in 0..n * runs {
            for b in 0..n * runs {
                let ((ra, ia), (rb, ib)) = ((a / n, a % n), (b / n, b % n));
                let mut sum = if a == b { 1.0 / weights[ia] } else { 0.0 };
                for k in 0..2 {
                    if ra == rb {
                        sum += knobs[ra][k][ia] * variation[k] * knobs[rb][k][ib];
                    }
                    for l in 0..2 {
                        sum += knobs[ra][k][ia] * uncertainty.at(k, l) * knobs[rb][l][ib];
                    }
                }
                covariance.set(a, b, sum);
            }
        }
        let y: Vec<f64> = (0..n * runs).map(|i| value(3 * i + 1)).collect();
        let exact = covariance.cholesky().inverse().quadratic(&y);
        let vectors = vec![vec![&y[..n], &y[n..]]];
        let found = metric.gram(&vectors).at(0, 0);
        assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    }
}
