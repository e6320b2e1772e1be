//! Pose of a flat tag at a known height from the directions of its corners.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::detect::TagDetection;

/// Tag geometry and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct FloorSettings {
    /// Side of the black border.
    pub edge_m: f64,
    /// Height of the tag above the floor.
    pub tag_height_m: f64,
    /// Standard deviation of a corner coordinate in the picture.
    pub corner_sigma_px: f64,
    /// Standard deviation of position that calibration and tag height leave, the same in all directions.
    pub calibration_sigma_m: f64,
    /// Standard deviation of yaw that mounting and calibration leave.
    pub calibration_sigma_rad: f64,
    /// Largest root mean square distance of the corners from where the pose puts them.
    pub residual_max_px: f64,
}

impl Default for FloorSettings {
    fn default() -> FloorSettings {
        FloorSettings {
            edge_m: 0.16,
            tag_height_m: 0.1,
            corner_sigma_px: 0.04,
            calibration_sigma_m: 0.0005,
            calibration_sigma_rad: 0.001,
            residual_max_px: 0.6,
        }
    }
}

/// One tag on the floor as one camera sees it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorPose {
    /// Robot number, the tag's id.
    pub robot: u16,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Of x, y, yaw: m^2, m rad, rad^2.
    pub covariance: [[f64; 3]; 3],
    /// Root mean square distance of the corners from where the pose puts them.
    pub residual_px: f64,
}

/// Why corners are no tag on the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FloorRejection {
    /// A corner's ray does not meet the plane of the tags.
    NoPlane,
    /// The corners are not a square of the given size at the given height: tilted, another size, or misread.
    Residual,
}

/// Gauss-Newton steps; the first guess is already within a hundredth of a pixel.
const STEPS: usize = 3;

/// Corners of the upright tag in its own frame: x forward (right), y up, half an edge each.
const SQUARE: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Least squares pose x, y, yaw: corners in the picture against the square at the tags' height.
///
/// Start: the corners' rays cut with the plane, best rigid fit. Then Gauss-Newton on the distances in the picture.
pub fn locate(camera: &Camera, tag: &TagDetection, settings: &FloorSettings) -> Result<FloorPose, FloorRejection> {
    let mut pose = rigid_fit(camera, tag, settings).ok_or(FloorRejection::NoPlane)?;
    for _ in 0..STEPS {
        let (information, gradient, _) = normal_equations(camera, tag, settings, pose)?;
        let inverse = inverse_3(&information).ok_or(FloorRejection::Residual)?;
        for (value, row) in pose.iter_mut().zip(inverse) {
            *value -= row[0] * gradient[0] + row[1] * gradient[1] + row[2] * gradient[2];
        }
    }
    let (information, _, square_sum) = normal_equations(camera, tag, settings, pose)?;
    let residual_px = (square_sum / 8.0).sqrt();
    // Not-a-number is refused too.
    if residual_px.is_nan() || residual_px > settings.residual_max_px {
        return Err(FloorRejection::Residual);
    }
    let mut covariance = inverse_3(&information).ok_or(FloorRejection::Residual)?;
    for value in covariance.as_flattened_mut() {
        *value *= settings.corner_sigma_px * settings.corner_sigma_px;
    }
    covariance[0][0] += settings.calibration_sigma_m * settings.calibration_sigma_m;
    covariance[1][1] += settings.calibration_sigma_m * settings.calibration_sigma_m;
    covariance[2][2] += settings.calibration_sigma_rad * settings.calibration_sigma_rad;
    Ok(FloorPose {
        robot: tag.id,
        x_m: pose[0],
        y_m: pose[1],
        yaw_rad: crate::fusion::wrap_rad(pose[2]),
        covariance,
        residual_px,
    })
}

fn rigid_fit(camera: &Camera, tag: &TagDetection, settings: &FloorSettings) -> Option<[f64; 3]> {
    let mut places = [[0.0; 2]; 4];
    for (place, &corner) in places.iter_mut().zip(&tag.corners) {
        *place = camera.on_plane(corner, settings.tag_height_m)?;
    }
    let centre = [0, 1].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / 4.0);
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (place, square) in places.iter().zip(SQUARE) {
        let (x, y) = (place[0] - centre[0], place[1] - centre[1]);
        cosine += square[0] * x + square[1] * y;
        sine += square[0] * y - square[1] * x;
    }
    Some([centre[0], centre[1], sine.atan2(cosine)])
}

type NormalEquations = ([[f64; 3]; 3], [f64; 3], f64);

/// J^T J, J^T r and r^T r of the eight picture distances, px.
fn normal_equations(
    camera: &Camera,
    tag: &TagDetection,
    settings: &FloorSettings,
    pose: [f64; 3],
) -> Result<NormalEquations, FloorRejection> {
    let (sine, cosine) = pose[2].sin_cos();
    let half = settings.edge_m / 2.0;
    let (mut information, mut gradient, mut square_sum) = ([[0.0; 3]; 3], [0.0; 3], 0.0);
    for (square, &seen) in SQUARE.iter().zip(&tag.corners) {
        let (x, y) = (
            half * (cosine * square[0] - sine * square[1]),
            half * (sine * square[0] + cosine * square[1]),
        );
        let [cx, cy, cz] = camera.camera_from_world([pose[0] + x, pose[1] + y, settings.tag_height_m]);
        if cz < 0.01 {
            return Err(FloorRejection::NoPlane);
        }
        let at = [cx / cz, cy / cz];
        let lens = camera.lens.jacobian(seen);
        // World steps of the corner by x, y and yaw, turned into steps of the direction.
        let steps = [[1.0, 0.0], [0.0, 1.0], [-y, x]].map(|[dx, dy]| {
            let turn = |row: usize| camera.rotation[row][0] * dx + camera.rotation[row][1] * dy;
            let (px, py, pz) = (turn(0), turn(1), turn(2));
            [(px - at[0] * pz) / cz, (py - at[1] * pz) / cz]
        });
        let miss = [at[0] - seen[0], at[1] - seen[1]];
        for row in lens {
            let residual = row[0] * miss[0] + row[1] * miss[1];
            let slope = steps.map(|step| row[0] * step[0] + row[1] * step[1]);
            square_sum += residual * residual;
            for i in 0..3 {
                gradient[i] += slope[i] * residual;
                for j in 0..3 {
                    information[i][j] += slope[i] * slope[j];
                }
            }
        }
    }
    Ok((information, gradient, square_sum))
}

fn inverse_3(m: &[[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    if !determinant.is_finite() || determinant <= 0.0 {
        return None;
    }
    Some([0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant)))
}
