//! World to pixel and back, for one true camera.

use super::calibration::Calibration;
use super::lens::Distortion;
use super::problem::CameraProblem;

/// How far beyond the picture's widest ray a point may still be projected.
const REACH: f64 = 1.3;

/// Intrinsics and pose as they really are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    pub width_px: u16,
    pub height_px: u16,
    pub focal_px: [f64; 2],
    pub centre_px: [f64; 2],
    pub distortion: Distortion,
    pub position_m: [f64; 3],
    /// Camera from world, by rows.
    pub rotation: [[f64; 3]; 3],
}

impl From<&Calibration> for Optics {
    fn from(calibration: &Calibration) -> Self {
        Self {
            width_px: calibration.width_px,
            height_px: calibration.height_px,
            focal_px: calibration.focal_px,
            centre_px: calibration.centre_px,
            distortion: calibration.distortion,
            position_m: calibration.position_m,
            rotation: calibration.rotation,
        }
    }
}

impl Optics {
    /// Pixel `[u, v]` of a world point in metres, inside the picture or not.
    ///
    /// `None` for a point that is not in front of the lens, or so far aside that the lens formula folds over.
    pub fn project(&self, world_m: [f64; 3]) -> Option<[f64; 2]> {
        let from = [0, 1, 2].map(|axis| world_m[axis] - self.position_m[axis]);
        let [x, y, z] = self
            .rotation
            .map(|row| row[0] * from[0] + row[1] * from[1] + row[2] * from[2]);
        if !(z > 1e-3 && (x * x + y * y).is_finite()) {
            return None;
        }
        let point = [x / z, y / z];
        if !self
            .distortion
            .is_unfolded((point[0] * point[0] + point[1] * point[1]).sqrt())
        {
            return None;
        }
        let [x_d, y_d] = self.distortion.distort(point);
        Some([
            self.focal_px[0] * x_d + self.centre_px[0],
            self.focal_px[1] * y_d + self.centre_px[1],
        ])
    }

    /// Horizontal metres per metre of descent along the ray of pixel `[u, v]`.
    ///
    /// The ray meets the plane z = h at `position + (position_z - h) slope`. `None` if it does not go down.
    pub fn slope(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        let distorted = [
            (u - self.centre_px[0]) / self.focal_px[0],
            (v - self.centre_px[1]) / self.focal_px[1],
        ];
        let [x, y] = self.distortion.undistort(distorted)?;
        let [a, b, c] = self.rotation;
        let [dx, dy, dz] = [0, 1, 2].map(|axis| a[axis] * x + b[axis] * y + c[axis]);
        (dz < -1e-3).then(|| [dx / -dz, dy / -dz])
    }

    /// Where the ray of pixel `[u, v]` meets the plane `height_m` above the floor.
    pub fn world_at(&self, pixel: [f64; 2], height_m: f64) -> Option<[f64; 2]> {
        let descent_m = self.position_m[2] - height_m;
        let [sx, sy] = self.slope(pixel)?;
        (descent_m > 0.0).then(|| [self.position_m[0] + descent_m * sx, self.position_m[1] + descent_m * sy])
    }

    /// True for a pixel of the picture.
    pub fn contains(&self, [u, v]: [f64; 2]) -> bool {
        u >= -0.5 && v >= -0.5 && u < f64::from(self.width_px) - 0.5 && v < f64::from(self.height_px) - 0.5
    }

    /// [`Self::slope`] of the centre of every pixel, row by row.
    ///
    /// - Errors: a pixel without a ray to the floor, and a lens that folds within or just beyond the picture.
    pub fn slopes(&self) -> Result<Vec<[f32; 2]>, CameraProblem> {
        let (width, height) = (self.width_px, self.height_px);
        let mut slopes = Vec::with_capacity(usize::from(width) * usize::from(height));
        for v in 0..height {
            for u in 0..width {
                let slope = self.slope([f64::from(u), f64::from(v)]).ok_or_else(|| {
                    CameraProblem::new(
                        "rotation, distortion",
                        format!("pixel ({u}, {v}) does not see the floor"),
                        "every pixel must look down, and the lens must not fold",
                        "turn the camera down, or calibrate the lens again",
                    )
                })?;
                slopes.push([slope[0] as f32, slope[1] as f32]);
            }
        }
        let reach = REACH * self.widest_ray();
        if self.distortion.is_unfolded(reach) {
            return Ok(slopes);
        }
        Err(CameraProblem::new(
            "distortion",
            format!("folds within {reach:.2} of the axis"),
            "must grow outwards beyond the corners of the picture",
            "calibrate with points up to the corners",
        ))
    }

    /// Normalised radius of the farthest corner.
    fn widest_ray(&self) -> f64 {
        let (right, bottom) = (f64::from(self.width_px) - 1.0, f64::from(self.height_px) - 1.0);
        [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]]
            .into_iter()
            .filter_map(|[u, v]| {
                let distorted = [
                    (u - self.centre_px[0]) / self.focal_px[0],
                    (v - self.centre_px[1]) / self.focal_px[1],
                ];
                self.distortion.undistort(distorted)
            })
            .map(|[x, y]| (x * x + y * y).sqrt())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Optics {
        let text = include_str!("../../../examples/lab/cameras/cam-1.json");
        Optics::from(&Calibration::parse(text).expect("the example"))
    }

    #[test]
    fn projection_is_the_closed_form_of_a_camera_that_looks_straight_down() {
        let optics = Optics {
            distortion: Distortion::default(),
            focal_px: [600.0, 610.0],
            centre_px: [320.0, 240.0],
            position_m: [1.0, 0.5, 3.0],
            rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            ..example()
        };
        // 2 m below, 0.2 m right of and 0.1 m above (on the page) the camera: u = 320 + 600 * 0.1, v = 240 - 610 * 0.05.
        let [u, v] = optics.project([1.2, 0.6, 1.0]).expect("in front");
        assert!((u - 380.0).abs() < 1e-10 && (v - 209.5).abs() < 1e-10, "{u} {v}");
        assert_eq!(optics.project([1.0, 0.5, 3.5]), None, "behind the lens");
    }

    #[test]
    fn a_ray_comes_back_to_its_pixel() {
        let optics = example();
        for pixel in [
            [0.0, 0.0],
            [639.0, 479.0],
            [12.25, 400.5],
            [320.0, 240.0],
            [-20.0, 500.0],
        ] {
            let [x, y] = optics.world_at(pixel, 0.15).expect("below");
            let back = optics.project([x, y, 0.15]).expect("in front");
            assert!((back[0] - pixel[0]).abs() < 1e-8 && (back[1] - pixel[1]).abs() < 1e-8);
        }
    }

    #[test]
    fn a_camera_that_sees_the_horizon_is_refused() {
        let (sin, cos) = (80.0f64.to_radians().sin(), 80.0f64.to_radians().cos());
        let tilted = Optics {
            rotation: [[1.0, 0.0, 0.0], [0.0, -cos, -sin], [0.0, sin, -cos]],
            ..example()
        };
        assert_eq!(tilted.slopes().expect_err("refused").field, "rotation, distortion");
        let folding = Optics {
            distortion: Distortion {
                k1: -0.5,
                ..Distortion::default()
            },
            ..example()
        };
        assert!(folding.slopes().is_err());
    }
}
