//! Overhead cameras in software: what a lens over the arena would see of the robots' tags, frame by frame.
//!
//! ```text
//! calibration file --(hidden error)--> optics --> rays and light of every pixel --+
//! poses within the exposure --------------------> canvas (changed parts only) ----+--> sensor --> frame --> socket
//! ```
//! [`Camera::expose`] is all of it up to the pixels; [`frame`] is the byte layout (`docs/camera-stream.md`), [`sender`] the
//! socket. Nothing here reads a clock: the caller says when the exposure was and where the robots were in it.
//!
//! Conventions. Pixel (0, 0) is the centre of the top left pixel, u to the right, v down. Camera frame: x right, y down, z along
//! the view. World: x right, y up, z towards the cameras, floor at z = 0.

mod blur;
pub mod calibration;
mod canvas;
mod cell_table;
pub mod device;
pub mod exposure;
pub mod faults;
pub mod floor;
pub mod frame;
pub mod lens;
mod light;
pub mod misalignment;
pub mod optics;
mod pattern;
pub mod problem;
mod robot_view;
pub mod sender;
mod sensor;
pub mod set;
pub mod settings;
mod stroke;
pub mod tag;
pub mod tag_codes;

pub use calibration::Calibration;
pub use device::{Camera, Picture};
pub use problem::CameraProblem;
pub use robot_view::{MAX_INSTANTS, RobotInView, RobotShape};
pub use set::{CameraSet, CameraSetError};
pub use settings::CameraSettings;
