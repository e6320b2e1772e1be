//! Calibration of a camera as its file tells it, `robopheus.camera/1`.

use super::lens::Distortion;
use super::problem::{CameraProblem, within};
use serde::{Deserialize, Serialize};

/// What stands in `format`.
pub const FORMAT: &str = "robopheus.camera/1";
/// Longest side of a picture.
pub const MAX_SIDE_PX: u16 = 2048;
/// Rows and columns of a rotation may miss length 1 and right angles by this much.
const ROTATION_ERROR: f64 = 1e-6;

/// Intrinsics and pose of one camera.
///
/// p_cam = rotation (p_world - position_m); (x, y) = (X/Z, Y/Z); distortion; u = fx x_d + cx, v = fy y_d + cy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Always [`FORMAT`].
    pub format: String,
    /// Name of the camera.
    pub camera: String,
    pub width_px: u16,
    pub height_px: u16,
    /// `[fx, fy]`
    pub focal_px: [f64; 2],
    /// `[cx, cy]`; (0, 0) is the centre of the top left pixel.
    pub centre_px: [f64; 2],
    pub distortion: Distortion,
    /// The optical centre in the world.
    pub position_m: [f64; 3],
    /// Camera from world, by rows: the camera's x, y and z axes in the world.
    pub rotation: [[f64; 3]; 3],
    /// What the calibration was left with.
    pub rms_px: f64,
}

impl Calibration {
    /// Reads and checks a calibration file's text.
    ///
    /// - Errors: the first field that is missing, unknown or out of its limits.
    pub fn parse(text: &str) -> Result<Self, CameraProblem> {
        let calibration: Self = serde_json::from_str(text).map_err(|error| {
            CameraProblem::new(
                "(file)",
                format!("is not a calibration: {error}"),
                format!("must be JSON of format {FORMAT}"),
                "compare it with examples/lab/cameras/cam-0.json",
            )
        })?;
        calibration.check()?;
        Ok(calibration)
    }

    /// Every rule on its own; whether all pixels see the floor is checked where the rays are made.
    pub fn check(&self) -> Result<(), CameraProblem> {
        if self.format != FORMAT {
            return Err(CameraProblem::new(
                "format",
                format!("is {:?}", self.format),
                format!("must be {FORMAT:?}"),
                "use a calibration file of this version",
            ));
        }
        if self.camera.is_empty() || self.camera.len() > 64 {
            return Err(CameraProblem::new(
                "camera",
                format!("has {} bytes", self.camera.len()),
                "must have 1 to 64 bytes",
                "name the camera",
            ));
        }
        let size = "give the size of the pictures the camera delivers";
        within("width_px", f64::from(self.width_px), 16.0, f64::from(MAX_SIDE_PX), size)?;
        within(
            "height_px",
            f64::from(self.height_px),
            16.0,
            f64::from(MAX_SIDE_PX),
            size,
        )?;
        let sides = [self.width_px, self.height_px].map(f64::from);
        let again = "calibrate again";
        for (axis, side) in sides.into_iter().enumerate() {
            within(&format!("focal_px[{axis}]"), self.focal_px[axis], 16.0, 20_000.0, again)?;
            within(&format!("centre_px[{axis}]"), self.centre_px[axis], 0.0, side, again)?;
        }
        let d = self.distortion;
        for (name, value) in [("k1", d.k1), ("k2", d.k2), ("k3", d.k3), ("p1", d.p1), ("p2", d.p2)] {
            within(&format!("distortion.{name}"), value, -10.0, 10.0, again)?;
        }
        let far = "give the camera's place in metres in the arena's world frame";
        within("position_m[0]", self.position_m[0], -100.0, 100.0, far)?;
        within("position_m[1]", self.position_m[1], -100.0, 100.0, far)?;
        within("position_m[2]", self.position_m[2], 0.3, 100.0, far)?;
        within("rms_px", self.rms_px, 0.0, 10.0, again)?;
        self.check_rotation()
    }

    fn check_rotation(&self) -> Result<(), CameraProblem> {
        let [a, b, c] = self.rotation;
        let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let cross = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        let errors = [
            dot(a, a) - 1.0,
            dot(b, b) - 1.0,
            dot(c, c) - 1.0,
            dot(a, b),
            dot(b, c),
            dot(c, a),
            dot(cross, c) - 1.0,
        ];
        if errors.iter().all(|error| error.abs() <= ROTATION_ERROR) {
            return Ok(());
        }
        Err(CameraProblem::new(
            "rotation",
            "is not a rotation",
            format!("rows must have length 1, be at right angles and right-handed to {ROTATION_ERROR}"),
            "make the matrix orthonormal before writing the file",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../../examples/lab/cameras/cam-0.json");

    #[test]
    fn the_example_is_read_and_written_without_loss() {
        let calibration = Calibration::parse(TEXT).expect("the example");
        let again = Calibration::parse(&serde_json::to_string(&calibration).expect("JSON")).expect("itself");
        assert_eq!(calibration, again);
        assert_eq!((again.width_px, again.height_px), (640, 480));
    }

    /// Changes one value of the example.
    fn refused(change: impl Fn(&mut Calibration)) -> String {
        let mut calibration = Calibration::parse(TEXT).expect("the example");
        change(&mut calibration);
        calibration.check().expect_err("refused").field
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        assert_eq!(refused(|c| c.format = "robopheus.camera/2".to_owned()), "format");
        assert_eq!(refused(|c| c.camera.clear()), "camera");
        assert_eq!(refused(|c| c.width_px = 8), "width_px");
        assert_eq!(refused(|c| c.height_px = 4000), "height_px");
        assert_eq!(refused(|c| c.focal_px[1] = f64::NAN), "focal_px[1]");
        assert_eq!(refused(|c| c.centre_px[0] = -5.0), "centre_px[0]");
        assert_eq!(refused(|c| c.distortion.k2 = f64::INFINITY), "distortion.k2");
        assert_eq!(refused(|c| c.position_m[2] = 0.0), "position_m[2]");
        assert_eq!(refused(|c| c.rotation[0] = [1.1, 0.0, 0.0]), "rotation");
        assert_eq!(
            refused(|c| c.rotation.swap(0, 1)),
            "rotation",
            "a mirror is not a rotation"
        );
        assert_eq!(refused(|c| c.rms_px = -0.1), "rms_px");
        let unknown = TEXT.replacen("\"camera\"", "\"lens\": 1, \"camera\"", 1);
        assert_eq!(Calibration::parse(&unknown).expect_err("refused").field, "(file)");
        assert_eq!(Calibration::parse(&TEXT[..40]).expect_err("refused").field, "(file)");
    }
}
