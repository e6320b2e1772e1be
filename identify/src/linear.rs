//! Small dense symmetric systems.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

/// A square matrix, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Square {
    pub size: usize,
    pub values: Vec<f64>,
}

impl Square {
    pub fn zero(size: usize) -> Square {
        Square {
            size,
            values: vec![0.0; size * size],
        }
    }

    #[inline]
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.size + column]
    }

    #[inline]
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.size + column] = value;
    }

    #[inline]
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.size + column] += value;
    }

    /// All entries times a factor.
    pub fn scale(&mut self, factor: f64) {
        for value in &mut self.values {
            *value *= factor;
        }
    }

    /// The rows and columns of a list, in its order.
    pub fn part(&self, chosen: &[usize]) -> Square {
        let mut part = Square::zero(chosen.len());
        for (i, row) in chosen.iter().enumerate() {
            for (j, column) in chosen.iter().enumerate() {
                part.set(i, j, self.at(*row, *column));
            }
        }
        part
    }

    /// v' A v
    pub fn quadratic(&self, v: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (row, left) in v.iter().enumerate() {
            for (column, right) in v.iter().enumerate() {
                sum += left * self.at(row, column) * right;
            }
        }
        sum
    }

    /// Lower triangle L with A = L L'. A pivot that is not positive is raised to 1e-12 of its diagonal: a direction
    /// without information.
    pub fn cholesky(&self) -> Factor {
        let n = self.size;
        let mut lower = vec![0.0; n * n];
        for column in 0..n {
            let mut pivot = self.at(column, column);
            for k in 0..column {
                pivot -= lower[column * n + k] * lower[column * n + k];
            }
            let least = 1e-12 * self.at(column, column).abs() + 1e-300;
            let root = pivot.max(least).sqrt();
            lower[column * n + column] = root;
            for row in column + 1..n {
                let mut sum = self.at(row, column);
                for k in 0..column {
                    sum -= lower[row * n + k] * lower[column * n + k];
                }
                lower[row * n + column] = sum / root;
            }
        }
        Factor { size: n, lower }
    }
}

/// Cholesky factor.
#[derive(Debug, Clone)]
pub struct Factor {
    size: usize,
    lower: Vec<f64>,
}

impl Factor {
    /// L^-1 b
    pub fn forward(&self, b: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut x = b.to_vec();
        for row in 0..n {
            let mut sum = x[row];
            for k in 0..row {
                sum -= self.lower[row * n + k] * x[k];
            }
            x[row] = sum / self.lower[row * n + row];
        }
        x
    }

    /// L v
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let n = self.size;
        (0..n)
            .map(|row| (0..=row).map(|k| self.lower[row * n + k] * v[k]).sum())
            .collect()
    }

    /// A^-1 b
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut x = self.forward(b);
        for row in (0..n).rev() {
            let mut sum = x[row];
            for k in row + 1..n {
                sum -= self.lower[k * n + row] * x[k];
            }
            x[row] = sum / self.lower[row * n + row];
        }
        x
    }

    /// A^-1
    pub fn inverse(&self) -> Square {
        let n = self.size;
        let mut inverse = Square::zero(n);
        for column in 0..n {
            let mut unit = vec![0.0; n];
            unit[column] = 1.0;
            for (row, value) in self.solve(&unit).into_iter().enumerate() {
                inverse.set(row, column, value);
            }
        }
        inverse
    }
}

/// Sweeps of Jacobi's method; small matrices need six or seven.
const SWEEPS: usize = 30;

/// Principal directions of a symmetric matrix, one a row, in the order of the variances, smallest first (Jacobi 1846, cyclic).
/// The largest component of every direction is positive.
pub fn principal(symmetric: &Square) -> Square {
    let n = symmetric.size;
    let mut a = symmetric.clone();
    let mut v = Square::zero(n);
    (0..n).for_each(|k| v.set(k, k, 1.0));
    for _ in 0..SWEEPS {
        let off: f64 = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| a.at(i, j) * a.at(i, j))
            .sum();
        let all: f64 = (0..n).map(|k| a.at(k, k) * a.at(k, k)).sum();
        if off <= 1e-30 * all {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a.at(p, q) == 0.0 {
                    continue;
                }
                let theta = (a.at(q, q) - a.at(p, p)) / (2.0 * a.at(p, q));
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a.at(k, p), a.at(k, q));
                    a.set(k, p, c * x - s * y);
                    a.set(k, q, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (a.at(p, k), a.at(q, k));
                    a.set(p, k, c * x - s * y);
                    a.set(q, k, s * x + c * y);
                    let (x, y) = (v.at(p, k), v.at(q, k));
                    v.set(p, k, c * x - s * y);
                    v.set(q, k, s * x + c * y);
                }
            }
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|i, j| a.at(*i, *i).total_cmp(&a.at(*j, *j)).then(i.cmp(j)));
    let mut directions = Square::zero(n);
    for (row, from) in order.into_iter().enumerate() {
        let largest = (0..n).fold(0.0_f64, |best, k| {
            if v.at(from, k).abs() > best.abs() {
                v.at(from, k)
            } else {
                best
            }
        });
        let sign = if largest < 0.0 { -1.0 } else { 1.0 };
        (0..n).for_each(|k| directions.set(row, k, sign * v.at(from, k)));
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_and_inverts() {
        let a = Square {
            size: 3,
            values: vec![4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0],
        };
        let x = a.cholesky().solve(&[1.0, 2.0, 3.0]);
        for row in 0..3 {
            let back: f64 = (0..3).map(|k| a.at(row, k) * x[k]).sum();
            assert!((back - (row + 1) as f64).abs() < 1e-12);
        }
        let inverse = a.cholesky().inverse();
        assert!((inverse.quadratic(&[1.0, 2.0, 3.0]) - (x[0] + 2.0 * x[1] + 3.0 * x[2])).abs() < 1e-12);
    }

    /// Directions are orthonormal, take the matrix to its diagonal, and stand in order.
    #[test]
    fn principal_directions() {
        let a = Square {
            size: 3,
            values: vec![4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0],
        };
        let v = principal(&a);
        let row = |i: usize| -> Vec<f64> { (0..3).map(|k| v.at(i, k)).collect() };
        let product = |left: &[f64], right: &[f64]| -> f64 {
            (0..3)
                .map(|i| (0..3).map(|j| left[i] * a.at(i, j) * right[j]).sum::<f64>())
                .sum()
        };
        let mut last = 0.0;
        for i in 0..3 {
            let variance = product(&row(i), &row(i));
            assert!(variance > last);
            last = variance;
            for j in 0..i {
                let dot: f64 = row(i).iter().zip(row(j)).map(|(x, y)| x * y).sum();
                assert!(dot.abs() < 1e-14 && product(&row(i), &row(j)).abs() < 1e-13);
            }
        }
        // Trace.
        let sum: f64 = (0..3).map(|i| product(&row(i), &row(i))).sum();
        assert!((sum - 9.0).abs() < 1e-13);
    }
}
