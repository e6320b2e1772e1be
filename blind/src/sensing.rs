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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::SetPoint;

    /// Along x at 1 m/s from x = -0.5 at y = 0.3, turning at 0.2 rad/s.
    fn trace() -> Trace {
        let ticks = (0..480).map(|tick| {
            let time_s = f64::from(tick) / 480.0;
            Values {
                pose: [time_s - 0.5, 0.3, 0.2 * time_s],
                gyro_rad_per_s: time_s,
                ..Values::default()
            }
        });
        Trace {
            ticks: ticks.collect(),
            sent: vec![SetPoint::default(); 120],
        }
    }

    fn close(found: [f64; 3], wanted: [f64; 3]) {
        let same = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(same, "{found:?} {wanted:?}");
    }

    #[test]
    fn each_artefact_by_hand() {
        let (trace, neutral) = (trace(), Sensing::default());
        close(neutral.pose(&trace, 0.25), [-0.25, 0.3, 0.05]);
        let late = Sensing {
            latency_s: 0.05,
            ..neutral.clone()
        };
        close(late.pose(&trace, 0.25), [-0.3, 0.3, 0.04]);
        // A tenth of the field is read after a tenth of the readout.
        let rows = Sensing {
            readout_s: 0.02,
            ..neutral.clone()
        };
        close(rows.pose(&trace, 0.25), [-0.248, 0.3, 0.0504]);
        let marker = Sensing {
            marker: [0.1, 0.02, 0.0],
            ..neutral.clone()
        };
        close(marker.pose(&trace, 0.0), [-0.48, 0.3, 0.1]);
        // Height 0.5 m of 2.5 m: distances to the foot at -1 m by 1.25.
        let high = Sensing {
            tag_height_m: 0.5,
            ..neutral.clone()
        };
        close(high.pose(&trace, 0.0), [-1.0 + 1.25 * 0.5, 0.375, 0.0]);
        let lens = Sensing {
            lens_per_m2: 0.1,
            ..neutral.clone()
        };
        close(lens.pose(&trace, 0.0), [-0.5 * 1.034, 0.3 * 1.034, 0.0]);
        let seam = Sensing {
            seam: [0.01, 0.0, 0.0],
            ..neutral.clone()
        };
        close(seam.pose(&trace, 0.25), [-0.25, 0.3, 0.05]);
        close(seam.pose(&trace, 0.75), [0.26, 0.3, 0.15]);
        let clock = Sensing {
            clock_offset_s: 0.1,
            gyro_scale: 2.0,
            gyro_bias_rad_per_s: 0.5,
            ..neutral
        };
        let values = clock.values(&trace, 0.5);
        assert!((values.gyro_rad_per_s - 1.3).abs() < 1e-9);
        close(values.pose, [0.0, 0.3, 0.1]);
    }
}
