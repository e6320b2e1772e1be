//! Focal lengths, centre and Brown-Conrady distortion of a lens.

use serde::{Deserialize, Serialize};

/// Brown-Conrady coefficients; all zero is a lens without distortion.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distortion {
    pub k1: f64,
    pub k2: f64,
    pub k3: f64,
    pub p1: f64,
    pub p2: f64,
}

/// What turns a direction in the camera frame into a pixel.
///
/// With (x, y) = (X/Z, Y/Z), r2 = x2 + y2, R = 1 + k1 r2 + k2 r2^2 + k3 r2^3:
/// u = fx (x R + 2 p1 x y + p2 (r2 + 2 x2)) + cx, v = fy (y R + p1 (r2 + 2 y2) + 2 p2 x y) + cy  [Brown 1971].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    pub width_px: usize,
    pub height_px: usize,
    pub focal_px: [f64; 2],
    pub centre_px: [f64; 2],
    pub distortion: Distortion,
}

/// Steps of [`Lens::undistort`] before it gives up.
const STEPS_MAX: usize = 12;
/// Residual of [`Lens::undistort`], normalised: 1e-9 of the focal length.
const RESIDUAL: f64 = 1e-9;

impl Lens {
    /// A lens without distortion whose normalised coordinates are pixels from the middle over the width.
    pub fn ideal(width_px: usize, height_px: usize) -> Lens {
        let focal = width_px as f64;
        Lens {
            width_px,
            height_px,
            focal_px: [focal, focal],
            centre_px: [(width_px as f64 - 1.0) / 2.0, (height_px as f64 - 1.0) / 2.0],
            distortion: Distortion::default(),
        }
    }

    /// Pixel of a normalised direction.
    pub fn distort(&self, at: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.bend(at);
        [
            self.focal_px[0] * x + self.centre_px[0],
            self.focal_px[1] * y + self.centre_px[1],
        ]
    }

    /// Normalised direction of a pixel, by Newton's method from the distorted position.
    ///
    /// - Returns `None` where the distortion folds over or the pixel is not finite.
    pub fn undistort(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let target = [
            (pixel[0] - self.centre_px[0]) / self.focal_px[0],
            (pixel[1] - self.centre_px[1]) / self.focal_px[1],
        ];
        let mut at = target;
        for _ in 0..STEPS_MAX {
            let bent = self.bend(at);
            let miss = [target[0] - bent[0], target[1] - bent[1]];
            if miss[0].abs().max(miss[1].abs()) < RESIDUAL {
                return Some(at);
            }
            let [[a, b], [c, d]] = self.bend_jacobian(at);
            let determinant = a * d - b * c;
            if determinant.is_nan() || determinant < 1e-3 {
                return None;
            }
            at[0] += (d * miss[0] - b * miss[1]) / determinant;
            at[1] += (a * miss[1] - c * miss[0]) / determinant;
        }
        None
    }

    /// Derivative of [`Lens::distort`], rows u and v, columns x and y, in px.
    pub fn jacobian(&self, at: [f64; 2]) -> [[f64; 2]; 2] {
        let [[a, b], [c, d]] = self.bend_jacobian(at);
        let [fx, fy] = self.focal_px;
        [[fx * a, fx * b], [fy * c, fy * d]]
    }

    /// Largest undistorted radius the picture's corners can need, if the radial curve rises all the way there.
    pub(crate) fn radius_max(&self) -> Option<f64> {
        let mut needed: f64 = 0.0;
        for u in [-0.5, self.width_px as f64 - 0.5] {
            for v in [-0.5, self.height_px as f64 - 0.5] {
                let x = (u - self.centre_px[0]) / self.focal_px[0];
                let y = (v - self.centre_px[1]) / self.focal_px[1];
                needed = needed.max(x.hypot(y));
            }
        }
        let Distortion { k1, k2, k3, .. } = self.distortion;
        for step in 0..2000 {
            let radius = 0.005 * f64::from(step);
            let r2 = radius * radius;
            if 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) < 0.05 {
                return None;
            }
            if radius * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) >= needed {
                return Some(radius);
            }
        }
        None
    }

    fn bend(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Distortion { k1, k2, k3, p1, p2 } = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    fn bend_jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let Distortion { k1, k2, k3, p1, p2 } = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let cross = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        [
            [radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, cross],
            [cross, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens() -> Lens {
        Lens {
            focal_px: [490.0, 488.0],
            centre_px: [322.0, 237.0],
            distortion: Distortion {
                k1: -0.28,
                k2: 0.07,
                k3: 0.001,
                p1: 0.001,
                p2: -0.0007,
            },
            ..Lens::ideal(640, 480)
        }
    }

    #[test]
    fn undistort_inverts_distort_over_the_picture() {
        for u in 0..=16 {
            for v in 0..=12 {
                let pixel = [f64::from(u) * 40.0, f64::from(v) * 40.0];
                let at = lens().undistort(pixel).expect("the curve rises over the picture");
                let back = lens().distort(at);
                assert!(
                    (back[0] - pixel[0]).abs() < 1e-5 && (back[1] - pixel[1]).abs() < 1e-5,
                    "{pixel:?} {back:?}"
                );
            }
        }
    }

    #[test]
    fn distort_is_the_published_formula() {
        // By hand: x = 0.5, y = -0.2, r2 = 0.29, R = 1 - 0.0812 + 0.005887 + 0.000024389 = 0.924711389.
        let [u, v] = lens().distort([0.5, -0.2]);
        let x = 0.5 * 0.924711389 + 2.0 * 0.001 * -0.1 - 0.0007 * (0.29 + 0.5);
        let y = -0.2 * 0.924711389 + 0.001 * (0.29 + 0.08) + 2.0 * 0.0007 * 0.1;
        assert!((u - (490.0 * x + 322.0)).abs() < 1e-9 && (v - (488.0 * y + 237.0)).abs() < 1e-9);
    }

    #[test]
    fn jacobian_is_the_slope_of_distort() {
        let (at, step) = ([0.4, -0.3], 1e-6);
        let exact = lens().jacobian(at);
        for column in 0..2 {
            let (mut high, mut low) = (at, at);
            high[column] += step;
            low[column] -= step;
            let (high, low) = (lens().distort(high), lens().distort(low));
            for row in 0..2 {
                let slope = (high[row] - low[row]) / (2.0 * step);
                assert!((exact[row][column] - slope).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn a_curve_that_folds_over_is_seen() {
        assert!(lens().radius_max().is_some());
        let mut folded = lens();
        folded.distortion.k1 = -0.9;
        assert_eq!(folded.radius_max(), None);
        assert_eq!(folded.undistort([0.0, 0.0]), None);
    }
}
