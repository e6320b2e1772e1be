//! One camera's part: frames in, poses on the floor out.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::detect::{Detections, Detector, DetectorSettings, Region, Rejections};
use crate::floor::{FloorPose, FloorSettings, locate};
use crate::frame::Frame;
use crate::problem::Problem;

/// What a camera's process hands to the fusion for one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Number of the frame at its camera, rising by one.
    pub sequence: u64,
    /// Middle of the exposure on the laboratory's monotonic clock.
    pub exposure_us: i64,
    /// [`Frame::digest`] of the pixels.
    pub digest: u64,
    /// Sorted by robot; a robot seen at two places is here twice.
    pub poses: Vec<FloorPose>,
    /// Tags whose corners are no square at the tags' height.
    pub implausible: u32,
    pub rejections: Rejections,
}

/// Where a robot should be in the next frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    pub x_m: f64,
    pub y_m: f64,
    /// Half the side of the square on the floor that certainly holds the tag's centre.
    pub reach_m: f64,
}

/// Detector and calibration of one camera.
#[derive(Debug)]
pub struct CameraLocaliser {
    camera: Camera,
    detector: Detector,
    floor: FloorSettings,
}

impl CameraLocaliser {
    pub fn new(camera: Camera, detector: DetectorSettings, floor: FloorSettings) -> CameraLocaliser {
        CameraLocaliser {
            camera,
            detector: Detector::new(detector),
            floor,
        }
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Searches a frame, around the expected places or all of it.
    ///
    /// - `expected`: `None` searches the whole frame; robots outside the picture are left out.
    /// - Errors: a frame that is not of the calibration's size.
    pub fn locate(
        &mut self,
        frame: &Frame<'_>,
        sequence: u64,
        exposure_us: i64,
        expected: Option<&[Expected]>,
    ) -> Result<Observation, Problem> {
        let lens = self.camera.lens;
        if (frame.width_px(), frame.height_px()) != (lens.width_px, lens.height_px) {
            return Err(Problem::new(
                "frame",
                format!("{} x {} px", frame.width_px(), frame.height_px()),
                format!("{} x {} px", lens.width_px, lens.height_px),
                "send frames of the size that the camera was calibrated with",
            ));
        }
        let Detections { tags, rejections, .. } = match expected {
            None => self.detector.search(frame, &lens),
            Some(expected) => {
                let regions: Vec<Region> = expected.iter().filter_map(|expected| self.region(expected)).collect();
                self.detector.search_around(frame, &lens, &regions)
            }
        };
        let mut observation = Observation {
            sequence,
            exposure_us,
            digest: frame.digest(),
            poses: Vec::with_capacity(tags.len()),
            implausible: 0,
            rejections,
        };
        for tag in &tags {
            match locate(&self.camera, tag, &self.floor) {
                Ok(pose) => observation.poses.push(pose),
                Err(_) => observation.implausible += 1,
            }
        }
        Ok(observation)
    }

    /// Square of the picture that holds the whole tag with its white rim.
    fn region(&self, expected: &Expected) -> Option<Region> {
        let at = [expected.x_m, expected.y_m, self.floor.tag_height_m];
        let centre_px = self.camera.project(at)?;
        // Half the diagonal of the ten modules with the rim, and the reach, in the picture; 4 px for the threshold's tiles.
        let half_m = self.floor.edge_m * (1.25 * std::f64::consts::SQRT_2 / 2.0) + expected.reach_m;
        let direction = self.camera.direction(at)?;
        let depth_m = self.camera.camera_from_world(at)[2];
        let scale = self.camera.lens.jacobian(direction).map(|row| row[0].hypot(row[1]));
        let half_px = scale[0].max(scale[1]) * half_m / depth_m + 4.0;
        Some(Region { centre_px, half_px })
    }
}
