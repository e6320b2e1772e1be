//! Recursive least squares with forgetting and a bounded covariance.
//!
//! ```text
//! nu = y - h.w        s = h.P h + r        k = P h / s
//! w <- w + k nu       P <- P - k (P h)'    then  P <- P / lambda,  bounded
//! ```

/// See the module. One state holds all weights; rows come one at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Recursion {
    weights: Vec<f64>,
    /// Row by row.
    covariance: Vec<f64>,
    /// Bound on the variance of each weight: what it was before anything was seen.
    bound: Vec<f64>,
}

impl Recursion {
    /// - `deviation`: of each weight before anything is seen, in its unit; positive. Later ones never grow beyond it.
    pub fn new(weights: &[f64], deviation: &[f64]) -> Recursion {
        let n = weights.len();
        let bound: Vec<f64> = deviation.iter().take(n).map(|sigma| sigma * sigma).collect();
        let mut covariance = vec![0.0; n * n];
        for (place, variance) in bound.iter().enumerate() {
            covariance[place * n + place] = *variance;
        }
        Recursion {
            weights: weights.to_vec(),
            covariance,
            bound,
        }
    }

    /// The weights now.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Variance of each weight.
    pub fn variances(&self) -> impl Iterator<Item = f64> + '_ {
        self.covariance.iter().step_by(self.weights.len() + 1).copied()
    }

    /// Takes y = h.w with noise of this variance.
    ///
    /// - Returns `false`, and changes nothing, when a number is not finite, the shape is wrong or the variance not positive.
    pub fn take(&mut self, h: &[f64], y: f64, variance: f64) -> bool {
        let n = self.weights.len();
        if h.len() != n || !y.is_finite() || !variance.is_finite() || variance <= 0.0 {
            return false;
        }
        let ph: Vec<f64> = self.covariance.chunks_exact(n.max(1)).map(|row| dot(row, h)).collect();
        let s = dot(&ph, h) + variance;
        let innovation = y - dot(&self.weights, h);
        let next: Vec<f64> = self
            .weights
            .iter()
            .zip(&ph)
            .map(|(w, p)| w + p / s * innovation)
            .collect();
        if !s.is_finite() || s <= 0.0 || !next.iter().all(|weight| weight.is_finite()) {
            return false;
        }
        self.weights = next;
        for (row, pi) in self.covariance.chunks_exact_mut(n.max(1)).zip(&ph) {
            for (entry, pj) in row.iter_mut().zip(&ph) {
                *entry -= pi * pj / s;
            }
        }
        true
    }

    /// Lets what was seen so far count less, by `share` of its weight per call, within the bound.
    pub fn forget(&mut self, share: f64) {
        let n = self.weights.len();
        let grown = 1.0 / (1.0 - share);
        let variances: Vec<f64> = self.variances().map(|variance| variance * grown).collect();
        // Rows and columns are scaled alike, which keeps the matrix one of variances.
        let shrink: Vec<f64> = variances
            .iter()
            .zip(&self.bound)
            .map(|(variance, bound)| {
                if *variance > *bound {
                    (bound / variance).sqrt()
                } else {
                    1.0
                }
            })
            .collect();
        for (row, i) in self.covariance.chunks_exact_mut(n.max(1)).zip(&shrink) {
            for (entry, j) in row.iter_mut().zip(&shrink) {
                *entry *= grown * i * j;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (x, y)| sum + x * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1, the same every time.
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// Solves A x = b by elimination with pivots.
    fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for column in 0..n {
            let pivot = (column..n)
                .max_by(|i, j| a[*i][column].abs().total_cmp(&a[*j][column].abs()))
                .expect("rows");
            a.swap(column, pivot);
            b.swap(column, pivot);
            for row in 0..n {
                if row == column {
                    continue;
                }
                let share = a[row][column] / a[column][column];
                let pivot = a[column].clone();
                for (value, above) in a[row].iter_mut().zip(&pivot).skip(column) {
                    *value -= share * above;
                }
                b[row] -= share * b[column];
            }
        }
        (0..n).map(|i| b[i] / a[i][i]).collect()
    }

    #[test]
    fn equals_batch_least_squares_with_the_same_prior_and_forgetting() {
        let (n, rows, share) = (5, 200, 0.01);
        let mut random = numbers(7);
        let truth: Vec<f64> = (0..n).map(|_| random()).collect();
        let start: Vec<f64> = (0..n).map(|_| random()).collect();
        // So wide that the bound is not met.
        let sigma = vec![1e3; n];
        let mut recursion = Recursion::new(&start, &sigma);
        let mut normal = vec![vec![0.0; n]; n];
        let mut right = vec![0.0; n];
        for i in 0..n {
            normal[i][i] = 1e-6;
            right[i] = 1e-6 * start[i];
        }
        for _ in 0..rows {
            let h: Vec<f64> = (0..n).map(|_| random()).collect();
            let variance = 0.01 + 0.005 * random();
            let y = dot(&truth, &h) + 0.1 * random();
            assert!(recursion.take(&h, y, variance));
            for i in 0..n {
                for j in 0..n {
                    normal[i][j] += h[i] * h[j] / variance;
                }
                right[i] += h[i] * y / variance;
            }
            recursion.forget(share);
            normal.iter_mut().flatten().for_each(|entry| *entry *= 1.0 - share);
            right.iter_mut().for_each(|entry| *entry *= 1.0 - share);
        }
        let batch = solved(normal, right);
        for (one, other) in recursion.weights().iter().zip(&batch) {
            assert!((one - other).abs() < 1e-6, "{:?} {batch:?}", recursion.weights());
        }
        let apart = recursion.weights().iter().zip(&truth).map(|(w, t)| (w - t).abs());
        assert!(apart.fold(0.0, f64::max) < 0.1);
    }

    #[test]
    fn hours_without_excitation_leave_the_covariance_bounded_and_later_data_count() {
        let mut recursion = Recursion::new(&[0.0, 0.0], &[2.0, 3.0]);
        for _ in 0..1_000_000 {
            assert!(recursion.take(&[1.0, 0.0], 0.5, 0.01));
            recursion.forget(0.01);
        }
        let variances: Vec<f64> = recursion.variances().collect();
        assert!(variances[0] > 0.0 && variances[0] < 0.01, "{variances:?}");
        assert!((variances[1] - 9.0).abs() < 1e-6, "{variances:?}");
        assert!((recursion.weights()[0] - 0.5).abs() < 1e-9 && recursion.weights()[1] == 0.0);
        assert!(recursion.take(&[0.0, 1.0], 2.0, 0.01));
        assert!((recursion.weights()[1] - 2.0).abs() < 0.01);
    }

    #[test]
    fn what_is_no_number_changes_nothing() {
        let mut recursion = Recursion::new(&[1.0, 2.0], &[1.0, 1.0]);
        let before = recursion.clone();
        let bad = [
            (vec![1.0, f64::NAN], 1.0, 1.0),
            (vec![1.0, f64::INFINITY], 1.0, 1.0),
            (vec![1.0, 1e308], 1e308, 1.0),
            (vec![1.0, 1.0], f64::NAN, 1.0),
            (vec![1.0, 1.0], f64::INFINITY, 1.0),
            (vec![1.0, 1.0], 1.0, f64::NAN),
            (vec![1.0, 1.0], 1.0, 0.0),
            (vec![1.0, 1.0], 1.0, -1.0),
            (vec![1.0], 1.0, 1.0),
        ];
        for (h, y, variance) in bad {
            assert!(!recursion.take(&h, y, variance), "{h:?} {y} {variance}");
            assert_eq!(recursion, before);
        }
    }
}
