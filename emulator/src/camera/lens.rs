//! Lens distortion after Brown and Conrady, both ways.

use serde::{Deserialize, Serialize};

/// Newton steps of [`Distortion::undistort`]; four are usual.
const MAX_STEPS: usize = 40;
/// Residual of an accepted inverse, in normalised units (1e-13 of a focal length of 620 px is 6e-11 px).
const RESIDUAL: f64 = 1e-13;

/// Coefficients on normalised coordinates (x, y) = (X/Z, Y/Z).
///
/// x_d = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2)
/// y_d = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y,   r2 = x^2 + y^2
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distortion {
    pub k1: f64,
    pub k2: f64,
    #[serde(default)]
    pub k3: f64,
    #[serde(default)]
    pub p1: f64,
    #[serde(default)]
    pub p2: f64,
}

impl Distortion {
    /// Where the lens puts the ray through normalised `(x, y)`.
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        [
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        ]
    }

    /// The ray that the lens puts at normalised `(x_d, y_d)`, by Newton's method.
    ///
    /// `None` if there is none on the branch around the optical axis, where the picture is not folded over.
    pub fn undistort(&self, distorted: [f64; 2]) -> Option<[f64; 2]> {
        let [mut x, mut y] = distorted;
        for _ in 0..MAX_STEPS {
            let [fx, fy] = self.distort([x, y]);
            let (ex, ey) = (fx - distorted[0], fy - distorted[1]);
            let [[a, b], [c, d]] = self.jacobian([x, y]);
            let determinant = a * d - b * c;
            if !determinant.is_finite() || determinant <= 0.0 {
                return None;
            }
            x -= (d * ex - b * ey) / determinant;
            y -= (a * ey - c * ex) / determinant;
            if ex.abs().max(ey.abs()) <= RESIDUAL {
                return self.is_unfolded((x * x + y * y).sqrt()).then_some([x, y]);
            }
        }
        None
    }

    /// Derivative of [`Self::distort`]: rows x_d, y_d; columns x, y.
    pub fn jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        let slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + 3.0 * self.k3 * r2));
        let mixed = x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        [
            [radial + x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x, mixed],
            [mixed, radial + y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x],
        ]
    }

    /// True if the radial part grows all the way from the axis to `radius`.
    pub fn is_unfolded(&self, radius: f64) -> bool {
        const SAMPLES: u32 = 64;
        (0..=SAMPLES).all(|sample| {
            let r = radius * f64::from(sample) / f64::from(SAMPLES);
            let r2 = r * r;
            1.0 + r2 * (3.0 * self.k1 + r2 * (5.0 * self.k2 + 7.0 * self.k3 * r2)) > 0.0
        })
    }

    fn radial(&self, r2: f64) -> f64 {
        1.0 + r2 * (self.k1 + r2 * (self.k2 + self.k3 * r2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENSES: [Distortion; 4] = [
        Distortion {
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            p1: 0.0,
            p2: 0.0,
        },
        Distortion {
            k1: -0.28,
            k2: 0.07,
            k3: 0.0,
            p1: 0.0,
            p2: 0.0,
        },
        Distortion {
            k1: -0.30,
            k2: 0.10,
            k3: -0.01,
            p1: 0.002,
            p2: -0.0015,
        },
        Distortion {
            k1: 0.12,
            k2: -0.02,
            k3: 0.003,
            p1: -0.001,
            p2: 0.0005,
        },
    ];

    #[test]
    fn undistort_is_the_inverse_of_distort_to_1e_9() {
        let mut worst = 0.0f64;
        for lens in LENSES {
            for (i, j) in (-30..=30).flat_map(|i| (-30..=30).map(move |j| (i, j))) {
                let point = [f64::from(i) * 0.02, f64::from(j) * 0.02];
                let back = lens.undistort(lens.distort(point)).expect("an inverse");
                worst = worst.max((back[0] - point[0]).abs()).max((back[1] - point[1]).abs());
            }
        }
        assert!(worst <= 1e-9, "{worst}");
    }

    #[test]
    fn distort_is_the_published_formula() {
        let lens = Distortion {
            k1: 0.1,
            k2: 0.01,
            k3: 0.001,
            p1: 0.02,
            p2: 0.03,
        };
        // x = 1, y = 2: r2 = 5, radial = 1 + 0.5 + 0.25 + 0.125 = 1.875
        // x_d = 1.875 + 2*0.02*2 + 0.03*(5 + 2) = 2.165;  y_d = 3.75 + 0.02*(5 + 8) + 2*0.03*2 = 4.13
        let [x, y] = lens.distort([1.0, 2.0]);
        assert!((x - 2.165).abs() < 1e-12 && (y - 4.13).abs() < 1e-12, "{x} {y}");
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let (at, step) = ([0.31, -0.42], 1e-6);
        for lens in LENSES {
            let jacobian = lens.jacobian(at);
            for column in 0..2 {
                let (mut plus, mut minus) = (at, at);
                plus[column] += step;
                minus[column] -= step;
                let (plus, minus) = (lens.distort(plus), lens.distort(minus));
                for row in 0..2 {
                    let measured = (plus[row] - minus[row]) / (2.0 * step);
                    assert!((measured - jacobian[row][column]).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn a_point_beyond_the_fold_has_no_ray() {
        // r (1 - 0.5 r2) grows up to r = 0.816, where it is 0.544.
        let lens = Distortion {
            k1: -0.5,
            ..Distortion::default()
        };
        assert!(lens.undistort([0.54, 0.0]).is_some());
        assert_eq!(lens.undistort([0.56, 0.0]), None);
        assert!(lens.is_unfolded(0.81) && !lens.is_unfolded(0.83));
    }
}
