//! What sensors make of the truth: tracker, gyro, accelerometer, current and the robot's clock.

use crate::drive::Trace;

/// True or reported values at one instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Values {
    /// x, y, yaw; the yaw is not wrapped.
    pub pose: [f64; 3],
    /// In the world.
    pub velocity_m_per_s: [f64; 2],
    pub gyro_rad_per_s: f64,
    pub accel_m_per_s2: [f64; 2],
    pub bus_v: f64,
    pub steering_rad: f64,
    pub wheel_rad_per_s: [f64; robot::MAX_MOTORS],
    pub wheel_rad: [f64; robot::MAX_MOTORS],
    pub current_a: [f64; robot::MAX_MOTORS],
}

#[derive(Debug, Clone)]
pub struct Sensing {
    pub latency_s: f64,
    /// Time in which the 3 m of the field are read.
    pub readout_s: f64,
    pub clock_offset_s: f64,
    pub gyro_scale: f64,
    pub gyro_bias_rad_per_s: f64,
    pub imu_yaw_rad: f64,
    pub current_scale: f64,
    pub current_bias_a: f64,
    /// Yaw, x, y of the marker on the body.
    pub marker: [f64; 3],
    pub tag_height_m: f64,
    pub lens_per_m2: f64,
    pub pose_scale: f64,
    /// x, y, yaw of the second camera.
    pub seam: [f64; 3],
}

impl Default for Sensing {
    fn default() -> Self {
        Self {
            latency_s: 0.0,
            readout_s: 0.0,
            clock_offset_s: 0.0,
            gyro_scale: 1.0,
            gyro_bias_rad_per_s: 0.0,
            imu_yaw_rad: 0.0,
            current_scale: 1.0,
            current_bias_a: 0.0,
            marker: [0.0; 3],
            tag_height_m: 0.0,
            lens_per_m2: 0.0,
            pose_scale: 1.0,
            seam: [0.0; 3],
        }
    }
}

/// Cameras hang this high above (+-1, 0).
const CAMERA_M: f64 = 2.5;
const FOOT_X_M: f64 = 1.0;
const FIELD_M: f64 = 3.0;

impl Sensing {
    /// What the tracker says of the time `at_s`.
    pub fn pose(&self, trace: &Trace, at_s: f64) -> [f64; 3] {
        let seen_s = at_s - self.latency_s;
        let row_m = trace.at(seen_s).pose[1];
        let [mut x, mut y, mut yaw] = trace.at(seen_s + self.readout_s * row_m / FIELD_M).pose;
        let (sin, cos) = yaw.sin_cos();
        let [turn, ahead, left] = self.marker;
        x += cos * ahead - sin * left;
        y += sin * ahead + cos * left;
        yaw += turn;
        let foot = if x < 0.0 { -FOOT_X_M } else { FOOT_X_M };
        let higher = CAMERA_M / (CAMERA_M - self.tag_height_m);
        (x, y) = (foot + higher * (x - foot), higher * y);
        let bent = self.pose_scale * (1.0 + self.lens_per_m2 * (x * x + y * y));
        (x, y) = (bent * x, bent * y);
        if x > 0.0 {
            let [shift_x, shift_y, turn] = self.seam;
            let (sin, cos) = turn.sin_cos();
            let from_foot = x - FOOT_X_M;
            (x, y) = (
                FOOT_X_M + cos * from_foot - sin * y + shift_x,
                sin * from_foot + cos * y + shift_y,
            );
            yaw += turn;
        }
        [x, y, yaw]
    }

    /// What the robot reports for the time `at_s`; its pose is that of the tracker.
    pub fn values(&self, trace: &Trace, at_s: f64) -> Values {
        let mut out = trace.at(at_s - self.clock_offset_s);
        out.pose = self.pose(trace, at_s);
        out.gyro_rad_per_s = self.gyro_scale * out.gyro_rad_per_s + self.gyro_bias_rad_per_s;
        let (sin, cos) = self.imu_yaw_rad.sin_cos();
        let [ahead, left] = out.accel_m_per_s2;
        out.accel_m_per_s2 = [cos * ahead + sin * left, cos * left - sin * ahead];
        for current in &mut out.current_a {
            *current = self.current_scale * *current + self.current_bias_a;
        }
        out
    }
}
