//! Where one picture shows the robots, and when each stage of finding that out was over.

use crate::record::CameraName;

/// One picture of one camera, as the localisation understood it. Times are `CLOCK_MONOTONIC` microseconds.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFrame {
    /// Number of the picture at its camera.
    pub frame: u64,
    pub camera: CameraName,
    /// Mid-exposure.
    pub exposure_us: i64,
    /// The whole picture had arrived at the localiser; the exposure for a tracker, which does not tell.
    pub received_us: i64,
    /// The tags were found; the arrival for a tracker.
    pub located_us: i64,
    /// The poses reached the laboratory's process.
    pub arrival_us: i64,
    pub poses: Vec<SeenPose>,
    /// Robots that were seen where the cameras together do not believe them; without velocity.
    pub refused: Vec<SeenPose>,
}

/// A robot in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenPose {
    pub number: u8,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Velocity in the world at the exposure, m/s, m/s, rad/s, where all cameras together tell it.
    pub velocity: Option<[f64; 3]>,
    /// Standard deviations of place (its most uncertain direction) and yaw, m and rad, of all cameras together at the exposure.
    pub spread: Option<[f64; 2]>,
}
