//! First guess: homographies of the board, one focal length, the poses.

use nalgebra::{DMatrix, Matrix3, SymmetricEigen, Vector3};

use super::view::Points;
use super::{CalibrationSettings, Model, Pose};
use crate::lens::Lens;
use crate::problem::Problem;

/// Lens without distortion, centre in the middle of the picture, square pixels.
pub(super) fn model(views: &[Points], settings: &CalibrationSettings) -> Result<Model, Problem> {
    let mut lens = Lens::ideal(settings.width_px, settings.height_px);
    let mut maps = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        maps.push(homography(view, &lens).ok_or_else(|| {
            Problem::new(
                format!("views[{index}]"),
                "the tags do not fit a plane",
                "a flat board",
                "check the board's places",
            )
        })?);
    }
    let focal = focal(&maps)? * lens.focal_px[0];
    lens.focal_px = [focal, focal];
    let scale = focal / settings.width_px as f64;
    let poses = maps
        .iter()
        .zip(views)
        .map(|(map, view)| pose(map, view, scale))
        .collect();
    Ok(Model { lens, poses })
}

/// Plane of the board, centred and scaled, to directions of the ideal lens: direct linear transform.
fn homography(view: &Points, lens: &Lens) -> Option<Matrix3<f64>> {
    let (centre, scale) = frame(view);
    let mut normal = DMatrix::<f64>::zeros(9, 9);
    for (world, &pixel) in view.world.iter().zip(&view.pixel) {
        let [x, y] = [0, 1].map(|axis| (world[axis] - centre[axis]) * scale);
        let [u, v] = [0, 1].map(|axis| (pixel[axis] - lens.centre_px[axis]) / lens.focal_px[axis]);
        for row in [
            [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u],
            [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v],
        ] {
            for i in 0..9 {
                for j in 0..9 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    let eigen = SymmetricEigen::new(normal);
    let smallest = eigen.eigenvalues.imin();
    let column = eigen.eigenvectors.column(smallest);
    let map = Matrix3::from_row_slice(column.as_slice());
    // The board is in front of the camera: its centre has a positive third coordinate.
    let map = if map[(2, 2)] < 0.0 { -map } else { map };
    map.iter().all(|value| value.is_finite()).then_some(map)
}

/// Centre of a view's places, and one over their spread.
fn frame(view: &Points) -> ([f64; 2], f64) {
    let count = view.world.len() as f64;
    let centre = [0, 1].map(|axis| view.world.iter().map(|p| p[axis]).sum::<f64>() / count);
    let squares: f64 = view
        .world
        .iter()
        .map(|p| (p[0] - centre[0]).powi(2) + (p[1] - centre[1]).powi(2))
        .sum();
    (centre, (count / squares).sqrt())
}

/// Focal length in widths from h1 w h2 = 0 and h1 w h1 = h2 w h2, w = diag(1/f^2, 1/f^2, 1): both linear in 1/f^2.
fn focal(maps: &[Matrix3<f64>]) -> Result<f64, Problem> {
    let (mut squares, mut product, mut size) = (0.0, 0.0, 0.0);
    for map in maps {
        let (h1, h2) = (map.column(0), map.column(1));
        let scale = h1.norm() * h2.norm();
        let rows = [
            (h1[0] * h2[0] + h1[1] * h2[1], h1[2] * h2[2]),
            (
                h1[0] * h1[0] + h1[1] * h1[1] - h2[0] * h2[0] - h2[1] * h2[1],
                h1[2] * h1[2] - h2[2] * h2[2],
            ),
        ];
        for (a, b) in rows {
            squares += a * a / (scale * scale);
            product -= a * b / (scale * scale);
            size += 1.0;
        }
    }
    let degenerate = |message: String| {
        Err(Problem::new(
            "views",
            message,
            "several views with the board tilted by more than about 10 degrees",
            "tilt the board by 20 to 40 degrees in several directions",
        ))
    };
    // Tilt makes the two directions of the board unequally long or oblique; without it nothing tells the focal length.
    if (squares / size).sqrt() < 0.01 {
        return degenerate(
            "the board faces the camera squarely in all views: the focal length is not observable".to_owned(),
        );
    }
    let inverse_square = product / squares;
    if inverse_square.is_nan() || !(1.0 / 400.0..=25.0).contains(&inverse_square) {
        return degenerate(format!(
            "no focal length fits the views (1/f^2 = {inverse_square:.3} per picture width)"
        ));
    }
    Ok((1.0 / inverse_square).sqrt())
}

/// Rotation and shift of a homography of directions at focal length `focal` widths.
fn pose(map: &Matrix3<f64>, view: &Points, focal: f64) -> Pose {
    let inverse = Matrix3::from_diagonal(&Vector3::new(1.0 / focal, 1.0 / focal, 1.0));
    let map = inverse * map;
    let length = (map.column(0).norm() + map.column(1).norm()) / 2.0;
    let (first, second) = (map.column(0) / length, map.column(1) / length);
    // Nearest orthonormal pair: their sum and difference are orthogonal.
    let sum = (first.normalize() + second.normalize()).normalize();
    let difference = (first.normalize() - second.normalize()).normalize();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (x, y) = ((sum + difference) * half, (sum - difference) * half);
    let z = x.cross(&y);
    let (centre, scale) = frame(view);
    let height = view.world[0][2];
    let origin = map.column(2) / (length * scale);
    let shift = origin - x * centre[0] - y * centre[1] - z * height;
    Pose {
        rotation: [0, 1, 2].map(|row| [x[row], y[row], z[row]]),
        shift_m: [shift[0], shift[1], shift[2]],
    }
}
