//! Calibration files: `robopheus.camera/1`.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::frame::SIDE_PX;
use crate::lens::{Distortion, Lens};
use crate::problem::Problem;

/// The format this crate reads and writes.
pub const FORMAT: &str = "robopheus.camera/1";

/// A camera as a file (`docs/localisation.md` has the conventions).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraDocument {
    pub format: String,
    pub camera: String,
    pub width_px: usize,
    pub height_px: usize,
    pub focal_px: [f64; 2],
    pub centre_px: [f64; 2],
    pub distortion: Distortion,
    /// World position of the centre of projection.
    pub position_m: [f64; 3],
    /// Camera from world, row by row.
    pub rotation: [[f64; 3]; 3],
    /// Root mean square distance between measured and predicted corners when the file was made.
    pub rms_px: f64,
}

const REMEDY: &str = "calibrate the camera again";

impl CameraDocument {
    /// - Errors: no JSON of this shape, unknown fields included.
    pub fn from_json(text: &str) -> Result<CameraDocument, Problem> {
        serde_json::from_str(text).map_err(|error| {
            Problem::new(
                "document",
                error.to_string(),
                FORMAT,
                "write the fields as docs/localisation.md shows them",
            )
        })
    }

    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and names always serialise")
    }

    /// The camera, if the file describes one that can look at a floor.
    pub fn check(&self) -> Result<Camera, Problem> {
        if self.format != FORMAT {
            return Err(Problem::new(
                "format",
                format!("{:?}", self.format),
                FORMAT,
                "use a file of this version",
            ));
        }
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
        if self.camera.is_empty() || self.camera.len() > 64 || !self.camera.bytes().all(allowed) {
            return Err(Problem::new(
                "camera",
                format!("{:?} is no name", self.camera),
                "1 to 64 letters, digits, - or _",
                "name the camera as the laboratory's configuration does",
            ));
        }
        let (lens, radius_max) = self.lens()?;
        self.check_pose()?;
        Problem::in_range("rms_px", self.rms_px, [0.0, 2.0], "px", REMEDY)?;
        Ok(Camera {
            name: self.camera.clone(),
            lens,
            position_m: self.position_m,
            rotation: self.rotation,
            radius_max,
        })
    }

    fn lens(&self) -> Result<(Lens, f64), Problem> {
        let sides = [self.width_px as f64, self.height_px as f64];
        for (name, side) in ["width_px", "height_px"].iter().zip(sides) {
            Problem::in_range(name, side, SIDE_PX, "px", "give the size of the frames")?;
        }
        for axis in 0..2 {
            let focal = [sides[0] * 0.2, sides[0] * 20.0];
            Problem::in_range(&format!("focal_px[{axis}]"), self.focal_px[axis], focal, "px", REMEDY)?;
            let centre = [0.0, sides[axis] - 1.0];
            Problem::in_range(
                &format!("centre_px[{axis}]"),
                self.centre_px[axis],
                centre,
                "px",
                REMEDY,
            )?;
        }
        let ratio = self.focal_px[0] / self.focal_px[1];
        Problem::in_range("focal_px[0]/focal_px[1]", ratio, [0.8, 1.25], "", REMEDY)?;
        let Distortion { k1, k2, k3, p1, p2 } = self.distortion;
        for (name, value, most) in [
            ("k1", k1, 2.0),
            ("k2", k2, 5.0),
            ("k3", k3, 20.0),
            ("p1", p1, 0.1),
            ("p2", p2, 0.1),
        ] {
            Problem::in_range(&format!("distortion.{name}"), value, [-most, most], "", REMEDY)?;
        }
        let lens = Lens {
            width_px: self.width_px,
            height_px: self.height_px,
            focal_px: self.focal_px,
            centre_px: self.centre_px,
            distortion: self.distortion,
        };
        let folds = || {
            Problem::new(
                "distortion",
                "the radial curve folds over inside the picture",
                "rising up to the picture's corners",
                "calibrate again with tags near all corners of the picture, or with fewer coefficients",
            )
        };
        let radius_max = lens.radius_max().ok_or_else(folds)?;
        Ok((lens, radius_max))
    }

    fn check_pose(&self) -> Result<(), Problem> {
        let limits = [[-1000.0, 1000.0], [-1000.0, 1000.0], [0.1, 100.0]];
        for (axis, limit) in limits.into_iter().enumerate() {
            Problem::in_range(
                &format!("position_m[{axis}]"),
                self.position_m[axis],
                limit,
                "m",
                "world z is up, floor 0",
            )?;
        }
        for row in 0..3 {
            for other in 0..=row {
                let product: f64 = (0..3)
                    .map(|axis| self.rotation[row][axis] * self.rotation[other][axis])
                    .sum();
                let wanted = if row == other { 1.0 } else { 0.0 };
                let field = format!("rotation[{row}] . rotation[{other}]");
                Problem::in_range(
                    &field,
                    product,
                    [wanted - 1e-6, wanted + 1e-6],
                    "",
                    "rows are orthogonal unit vectors",
                )?;
            }
        }
        let [a, b, c] = self.rotation;
        let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        Problem::in_range(
            "det rotation",
            determinant,
            [0.999, 1.001],
            "",
            "camera y points down: no mirror image",
        )?;
        Problem::in_range(
            "rotation[2][2]",
            c[2],
            [-1.0, -0.2],
            "",
            "the camera looks down to the floor",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> CameraDocument {
        CameraDocument {
            format: FORMAT.to_owned(),
            camera: "cam-0".to_owned(),
            width_px: 640,
            height_px: 480,
            focal_px: [490.0, 490.0],
            centre_px: [320.0, 240.0],
            distortion: Distortion {
                k1: -0.28,
                k2: 0.07,
                ..Distortion::default()
            },
            position_m: [-1.0, 0.0, 2.8],
            rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            rms_px: 0.2,
        }
    }

    #[test]
    fn a_camera_over_the_floor_projects_by_hand() {
        let camera = document().check().expect("a good file");
        // Straight below; then 0.5 m to the right and 0.25 m up the page, 2.6 m away.
        assert_eq!(camera.project([-1.0, 0.0, 0.2]), Some([320.0, 240.0]));
        let (x, y) = (0.5 / 2.6, -0.25 / 2.6);
        let r2: f64 = x * x + y * y;
        let radial = 1.0 - 0.28 * r2 + 0.07 * r2 * r2;
        let [u, v] = camera.project([-0.5, 0.25, 0.2]).expect("in view");
        assert!((u - (320.0 + 490.0 * x * radial)).abs() < 1e-9 && (v - (240.0 + 490.0 * y * radial)).abs() < 1e-9);
        let back = camera.on_plane([x, y], 0.2).expect("the floor is below");
        assert!((back[0] + 0.5).abs() < 1e-12 && (back[1] - 0.25).abs() < 1e-12);
        assert_eq!(camera.project([0.0, 0.0, 5.0]), None);
    }

    #[test]
    fn files_survive_writing_and_unknown_fields_are_refused() {
        let text = document().to_json();
        assert_eq!(CameraDocument::from_json(&text).expect("own output"), document());
        let wrong = text.replace("\"rms_px\"", "\"quality\": 1, \"rms_px\"");
        assert!(
            CameraDocument::from_json(&wrong)
                .expect_err("unknown field")
                .message
                .contains("quality")
        );
    }

    #[test]
    fn every_limit_refuses_with_its_field() {
        type Spoil = fn(&mut CameraDocument);
        let cases: [(&str, Spoil); 12] = [
            ("format", |d| d.format = "robopheus.camera/2".to_owned()),
            ("camera", |d| d.camera = "cam 0".to_owned()),
            ("width_px", |d| d.width_px = 0),
            ("focal_px[1]", |d| d.focal_px[1] = f64::NAN),
            ("focal_px[0]/focal_px[1]", |d| d.focal_px[0] = 900.0),
            ("centre_px[0]", |d| d.centre_px[0] = 640.0),
            ("distortion.p1", |d| d.distortion.p1 = 1.0),
            ("distortion", |d| d.distortion.k1 = -0.9),
            ("position_m[2]", |d| d.position_m[2] = -1.0),
            ("rotation[1] . rotation[1]", |d| d.rotation[1][1] = -1.1),
            ("det rotation", |d| d.rotation[1][1] = 1.0),
            ("rms_px", |d| d.rms_px = 7.0),
        ];
        for (field, spoil) in cases {
            let mut wrong = document();
            spoil(&mut wrong);
            let problem = wrong.check().expect_err(field);
            assert_eq!(problem.field, field);
            assert!(!problem.remedy.is_empty() && !problem.limit.is_empty());
        }
        let mut up = document();
        up.rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(up.check().expect_err("looks at the ceiling").field, "rotation[2][2]");
    }

    #[test]
    fn the_example_of_the_documentation_is_a_camera() {
        let page = include_str!("../../docs/localisation.md");
        let (_, rest) = page.split_once("```json").expect("the page has an example");
        let (example, _) = rest.split_once("```").expect("the example ends");
        let camera = CameraDocument::from_json(example)
            .expect("JSON")
            .check()
            .expect("a camera");
        assert_eq!(camera.name(), "cam-0");
    }
}
