//! The hidden error of calibration: what the true camera is, given its file.

use super::calibration::Calibration;
use super::optics::Optics;
use super::problem::{CameraProblem, within};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// Standard deviations of the differences between a camera and its calibration file; each is cut off at three of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Misalignment {
    /// Of each focal length.
    pub focal_px: f64,
    /// Of each coordinate of the principal point.
    pub centre_px: f64,
    /// Of each coordinate of the position.
    pub position_m: f64,
    /// Of the turn about each axis of the camera.
    pub rotation_rad: f64,
}

impl Default for Misalignment {
    /// A good calibration: all together about 1 mm on the floor.
    fn default() -> Self {
        Self {
            focal_px: 0.2,
            centre_px: 0.1,
            position_m: 3e-4,
            rotation_rad: 1e-4,
        }
    }
}

impl Misalignment {
    /// A camera that is exactly as its file says.
    pub const NONE: Self = Self {
        focal_px: 0.0,
        centre_px: 0.0,
        position_m: 0.0,
        rotation_rad: 0.0,
    };

    /// Every rule on its own.
    pub fn check(&self) -> Result<(), CameraProblem> {
        let remedy = "give a standard deviation a calibration can have";
        within("misalignment.focal_px", self.focal_px, 0.0, 50.0, remedy)?;
        within("misalignment.centre_px", self.centre_px, 0.0, 50.0, remedy)?;
        within("misalignment.position_m", self.position_m, 0.0, 0.1, remedy)?;
        within("misalignment.rotation_rad", self.rotation_rad, 0.0, 0.1, remedy)
    }

    /// The true camera of a calibration: same seed, same camera.
    pub fn apply(&self, calibration: &Calibration, seed: u64) -> Optics {
        let mut random = Noise::new(seed, u64::MAX - 7);
        let mut error = |deviation: f64| deviation * random.normal().clamp(-3.0, 3.0);
        let mut optics = Optics::from(calibration);
        for axis in 0..2 {
            optics.focal_px[axis] += error(self.focal_px);
            optics.centre_px[axis] += error(self.centre_px);
        }
        for coordinate in &mut optics.position_m {
            *coordinate += error(self.position_m);
        }
        let turn = [0; 3].map(|_| error(self.rotation_rad));
        optics.rotation = turned(turn, optics.rotation);
        optics
    }
}

/// `exp(turn) rotation` by Rodrigues' formula; `turn` in rad about the camera's axes.
fn turned(turn: [f64; 3], rotation: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let [x, y, z] = turn;
    let square = x * x + y * y + z * z;
    let angle_rad = square.sqrt();
    // sin(a) / a and (1 - cos(a)) / a^2, with their limits at 0
    let (a, b) = if angle_rad < 1e-9 {
        (1.0, 0.5)
    } else {
        (angle_rad.sin() / angle_rad, (1.0 - angle_rad.cos()) / square)
    };
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let mut step = [[0.0; 3]; 3];
    for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
        let square_term = turn[row] * turn[column] - if row == column { square } else { 0.0 };
        step[row][column] = f64::from(u8::from(row == column)) + a * skew[row][column] + b * square_term;
    }
    step.map(|row| [0, 1, 2].map(|column| (0..3).map(|inner| row[inner] * rotation[inner][column]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Calibration {
        Calibration::parse(include_str!("../../../examples/lab/cameras/cam-0.json")).expect("the example")
    }

    #[test]
    fn no_error_leaves_the_camera_as_its_file_says() {
        assert_eq!(Misalignment::NONE.apply(&example(), 5), Optics::from(&example()));
    }

    #[test]
    fn errors_have_the_configured_size_follow_the_seed_and_keep_a_rotation() {
        let sigma = Misalignment {
            focal_px: 2.0,
            centre_px: 1.0,
            position_m: 0.01,
            rotation_rad: 0.02,
        };
        let (calibration, draws) = (example(), 2000u32);
        let (mut focal, mut position) = (0.0, 0.0);
        for seed in 0..draws {
            let optics = sigma.apply(&calibration, u64::from(seed));
            assert_eq!(optics, sigma.apply(&calibration, u64::from(seed)));
            focal += (optics.focal_px[0] - calibration.focal_px[0]).powi(2);
            position += (optics.position_m[2] - calibration.position_m[2]).powi(2);
            for (row, other) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] {
                let dot: f64 = (0..3)
                    .map(|i| optics.rotation[row][i] * optics.rotation[other][i])
                    .sum();
                assert!((dot - f64::from(u8::from(row == other))).abs() < 1e-12);
            }
        }
        let (focal, position) = ((focal / f64::from(draws)).sqrt(), (position / f64::from(draws)).sqrt());
        assert!(
            (focal - 2.0).abs() < 0.1 && (position - 0.01).abs() < 5e-4,
            "{focal} {position}"
        );
    }

    #[test]
    fn a_turn_is_the_closed_form() {
        let angle_rad = 0.3f64;
        let (sin, cos) = angle_rad.sin_cos();
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let about_z = turned([0.0, 0.0, angle_rad], identity);
        let expected = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
            assert!((about_z[row][column] - expected[row][column]).abs() < 1e-14);
        }
    }
}
