//! Calibration of a camera from pictures of a board of tags.
//!
//! The board lies or is held at several tilts; in one view its places are world places, which gives the camera's pose.
//! Start: plane homographies [Zhang 2000]; then Levenberg-Marquardt on all corners at once.

mod initial;
mod refine;
mod view;

use crate::document::{CameraDocument, FORMAT};
use crate::lens::Lens;
use crate::problem::Problem;
pub use view::{Board, BoardTag, BoardView};
use view::{Points, points};

/// What is asked of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSettings {
    /// Name of the camera in the file.
    pub camera: String,
    pub width_px: usize,
    pub height_px: usize,
    /// View whose board places are world places.
    pub world_view: usize,
    /// Fit k3 as well: only for lenses that need it.
    pub fit_k3: bool,
    /// Least number of views.
    pub views_min: usize,
    /// Least share of the picture's width and height that all corners together must span.
    pub span_min: f64,
    /// Largest root mean square distance of a corner from its prediction.
    pub rms_max_px: f64,
    /// Largest standard deviation of the focal lengths, as a share of them.
    pub focal_deviation_max: f64,
    /// Largest standard deviation of the camera's position.
    pub position_deviation_max_m: f64,
}

impl Default for CalibrationSettings {
    fn default() -> CalibrationSettings {
        CalibrationSettings {
            camera: "cam-0".to_owned(),
            width_px: 640,
            height_px: 480,
            world_view: 0,
            fit_k3: false,
            views_min: 4,
            span_min: 0.75,
            rms_max_px: 0.5,
            focal_deviation_max: 0.005,
            position_deviation_max_m: 0.01,
        }
    }
}

/// Standard deviations that the corners' own scatter leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    pub focal_px: [f64; 2],
    pub centre_px: [f64; 2],
    pub k1: f64,
    pub k2: f64,
    pub position_m: [f64; 3],
}

/// A calibrated camera and how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    pub document: CameraDocument,
    /// Root mean square distance per view.
    pub view_rms_px: Vec<f64>,
    /// Corners used, and corners left out because they stood out (more than five times the root mean square).
    pub corners: usize,
    pub left_out: usize,
    pub steps: usize,
    pub deviation: Deviation,
}

/// Fits lens and pose.
///
/// - Errors: too few or degenerate views, by name; a fit that is not good enough; a result that is no camera.
pub fn calibrate(views: &[BoardView], settings: &CalibrationSettings) -> Result<Calibration, Problem> {
    let mut points = points(views, settings)?;
    let mut model = initial::model(&points, settings)?;
    let mut steps = refine::refine(&mut model, &points, settings.fit_k3)?;
    let left_out = leave_out(&mut points, &model);
    if left_out > 0 {
        steps += refine::refine(&mut model, &points, settings.fit_k3)?;
    }
    let (view_rms_px, rms_px) = refine::residuals(&model, &points);
    Problem::in_range(
        "rms_px",
        rms_px,
        [0.0, settings.rms_max_px],
        "px",
        "measure the board; hold it flat and still",
    )?;
    let deviation = refine::deviation(&model, &points, settings, rms_px)?;
    check_deviation(&model, &deviation, settings)?;
    let pose = &model.poses[settings.world_view];
    let document = CameraDocument {
        format: FORMAT.to_owned(),
        camera: settings.camera.clone(),
        width_px: settings.width_px,
        height_px: settings.height_px,
        focal_px: model.lens.focal_px,
        centre_px: model.lens.centre_px,
        distortion: model.lens.distortion,
        position_m: pose.position(),
        rotation: pose.rotation,
        rms_px,
    };
    document.check()?;
    Ok(Calibration {
        document,
        view_rms_px,
        corners: points.iter().map(|view| view.world.len()).sum(),
        left_out,
        steps,
        deviation,
    })
}

/// Lens and pose of the board in every view.
#[derive(Debug, Clone)]
struct Model {
    lens: Lens,
    poses: Vec<Pose>,
}

/// Camera from board: `p_camera = rotation p_board + shift_m`.
#[derive(Debug, Clone, Copy)]
struct Pose {
    rotation: [[f64; 3]; 3],
    shift_m: [f64; 3],
}

impl Pose {
    fn camera_from_board(&self, board_m: [f64; 3]) -> [f64; 3] {
        let mut out = self.shift_m;
        for (value, row) in out.iter_mut().zip(self.rotation) {
            *value += row[0] * board_m[0] + row[1] * board_m[1] + row[2] * board_m[2];
        }
        out
    }

    /// Place of the camera on the board.
    fn position(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            -(0..3)
                .map(|row| self.rotation[row][axis] * self.shift_m[row])
                .sum::<f64>()
        })
    }
}

fn project(lens: &Lens, pose: &Pose, board_m: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = pose.camera_from_board(board_m);
    lens.distort([x / z, y / z])
}

fn leave_out(points: &mut [Points], model: &Model) -> usize {
    let (_, rms_px) = refine::residuals(model, points);
    let mut left_out = 0;
    for (view, pose) in points.iter_mut().zip(&model.poses) {
        let stands_out: Vec<bool> = view
            .world
            .iter()
            .zip(&view.pixel)
            .map(|(world, pixel)| {
                let at = project(&model.lens, pose, *world);
                (at[0] - pixel[0]).hypot(at[1] - pixel[1]) > 5.0 * rms_px
            })
            .collect();
        left_out += stands_out.iter().filter(|&&out| out).count();
        let keep = |index: usize| !stands_out[index];
        view.world = view
            .world
            .iter()
            .enumerate()
            .filter(|&(i, _)| keep(i))
            .map(|(_, p)| *p)
            .collect();
        view.pixel = view
            .pixel
            .iter()
            .enumerate()
            .filter(|&(i, _)| keep(i))
            .map(|(_, p)| *p)
            .collect();
    }
    left_out
}

fn check_deviation(model: &Model, deviation: &Deviation, settings: &CalibrationSettings) -> Result<(), Problem> {
    let tilt = "tilt the board by 20 to 40 degrees in several directions in other views";
    for axis in 0..2 {
        let share = deviation.focal_px[axis] / model.lens.focal_px[axis];
        let field = format!("deviation of focal_px[{axis}] / focal_px[{axis}]");
        Problem::in_range(&field, share, [0.0, settings.focal_deviation_max], "", tilt)?;
    }
    for axis in 0..3 {
        let most = settings.position_deviation_max_m;
        let field = format!("deviation of position_m[{axis}]");
        Problem::in_range(&field, deviation.position_m[axis], [0.0, most], "m", tilt)?;
    }
    Ok(())
}
