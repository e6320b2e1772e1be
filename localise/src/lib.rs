//! Overhead cameras to world poses: tags in grey frames, poses on the floor, one fused pose per robot.
//!
//! [`CameraLocaliser`] is one camera's part (frames in, [`Observation`] out) and runs in a process of its own;
//! [`Fusion`] joins the observations of all cameras. No clock, no IO, no threads: time is an argument.
//! Conventions, calibration file and error budget: `docs/localisation.md`.

mod calibrate;
mod camera;
mod detect;
mod document;
mod family;
mod floor;
mod frame;
mod fusion;
mod lens;
mod localiser;
mod problem;

pub use calibrate::{Board, BoardTag, BoardView, Calibration, CalibrationSettings, Deviation, calibrate};
pub use camera::Camera;
pub use detect::{Detections, Detector, DetectorSettings, Region, Rejections, TagDetection};
pub use document::{CameraDocument, FORMAT};
pub use family::{CODES, DISTANCE_MIN, MODULES_ACROSS, code};
pub use floor::{FloorPose, FloorRejection, FloorSettings, locate};
pub use frame::Frame;
pub use fusion::{
    Admission, CameraHealth, CameraState, Fusion, FusionCounts, FusionSettings, TagOutcome, WorldPose, wrap_rad,
};
pub use lens::{Distortion, Lens};
pub use localiser::{CameraLocaliser, Expected, Observation};
pub use problem::Problem;
