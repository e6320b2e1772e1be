//! Small symmetric systems whose rank may be short.

use nalgebra::{SMatrix, SVector};

/// A pivot below this part of its diagonal marks a row that depends on the rows before it.
const RANK_TOLERANCE: f64 = 1e-9;

/// Solves `a x = b` for a symmetric positive semi-definite `a` by L D L^T in row order.
///
/// Rows that depend on earlier ones are dropped (their unknown is zero), so earlier rows have priority.
pub(crate) fn solve_semidefinite(a: &SMatrix<f64, 3, 3>, b: &SVector<f64, 3>) -> SVector<f64, 3> {
    let mut l = SMatrix::<f64, 3, 3>::identity();
    let mut d = [0.0; 3];
    let mut y = [0.0; 3];
    for row in 0..3 {
        let mut rest = b[row];
        let mut pivot = a[(row, row)];
        for col in 0..row {
            if d[col] == 0.0 {
                l[(row, col)] = 0.0;
                continue;
            }
            let mut sum = a[(row, col)];
            for k in 0..col {
                sum -= l[(row, k)] * l[(col, k)] * d[k];
            }
            l[(row, col)] = sum / d[col];
            pivot -= l[(row, col)] * l[(row, col)] * d[col];
            rest -= l[(row, col)] * y[col];
        }
        let kept = pivot > RANK_TOLERANCE * a[(row, row)];
        d[row] = if kept { pivot } else { 0.0 };
        y[row] = if kept { rest } else { 0.0 };
    }
    let mut x = SVector::<f64, 3>::zeros();
    for row in (0..3).rev() {
        if d[row] == 0.0 {
            continue;
        }
        let mut sum = y[row] / d[row];
        for k in row + 1..3 {
            sum -= l[(k, row)] * x[k];
        }
        x[row] = sum;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_full_and_short_rank() {
        let a = SMatrix::<f64, 3, 3>::new(4.0, 1.0, 0.5, 1.0, 3.0, 0.2, 0.5, 0.2, 2.0);
        let x = SVector::<f64, 3>::new(1.0, -2.0, 3.0);
        assert!((solve_semidefinite(&a, &(a * x)) - x).amax() < 1e-14);
        let short = SMatrix::<f64, 3, 3>::new(2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5);
        let x = solve_semidefinite(&short, &SVector::<f64, 3>::new(2.0, 7.0, 1.0));
        assert_eq!((x[0], x[1], x[2]), (1.0, 0.0, 2.0));
    }
}
