//! A calibrated camera over the floor.

use crate::lens::Lens;

/// Lens and pose of one camera; only [`crate::CameraDocument::check`] makes one.
///
/// World: x right, y up on the page, z towards the cameras, floor at z = 0. Camera: x right, y down, z along the view;
/// `p_cam = rotation (p_world - position_m)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub(crate) name: String,
    pub(crate) lens: Lens,
    pub(crate) position_m: [f64; 3],
    pub(crate) rotation: [[f64; 3]; 3],
    /// Largest undistorted radius for which the distortion is known.
    pub(crate) radius_max: f64,
}

impl Camera {
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    pub fn position_m(&self) -> [f64; 3] {
        self.position_m
    }

    /// Normalised direction (X/Z, Y/Z) of a world point; `None` less than 1 cm in front of the camera.
    pub fn direction(&self, world_m: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, z] = self.camera_from_world(world_m);
        (z > 0.01).then(|| [x / z, y / z])
    }

    /// Pixel of a world point; `None` behind the camera or beyond the radius for which the distortion is known.
    pub fn project(&self, world_m: [f64; 3]) -> Option<[f64; 2]> {
        let at = self.direction(world_m)?;
        (at[0].hypot(at[1]) <= self.radius_max).then(|| self.lens.distort(at))
    }

    /// Where a normalised direction meets the plane z = `height_m`; `None` if it does not, in front of the camera.
    pub fn on_plane(&self, direction: [f64; 2], height_m: f64) -> Option<[f64; 2]> {
        let camera = [direction[0], direction[1], 1.0];
        let mut ray = [0.0; 3];
        for (axis, out) in ray.iter_mut().enumerate() {
            *out = (0..3).map(|row| self.rotation[row][axis] * camera[row]).sum();
        }
        let length = (height_m - self.position_m[2]) / ray[2];
        let meets = length.is_finite() && length > 0.0;
        meets.then(|| {
            [
                self.position_m[0] + length * ray[0],
                self.position_m[1] + length * ray[1],
            ]
        })
    }

    pub(crate) fn camera_from_world(&self, world_m: [f64; 3]) -> [f64; 3] {
        let mut out = [0.0; 3];
        for (row, value) in out.iter_mut().enumerate() {
            *value = (0..3)
                .map(|axis| self.rotation[row][axis] * (world_m[axis] - self.position_m[axis]))
                .sum();
        }
        out
    }
}
