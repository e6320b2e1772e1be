//! Constant-velocity Kalman filter of one robot.
//!
//! State (x, y, vx, vy) and, apart from it, (yaw, yaw rate). Accelerations are white with spectral density q, so over T
//! the covariance grows by q [T^3/3, T^2/2; T^2/2, T] per axis [Bar-Shalom, Li, Kirubarajan 2001, eq. 6.2.2-4].
//! A measurement d older than the state is compared with position - d velocity, which is exact but for the noise within d.

use super::{FusionSettings, WorldPose, wrap_rad};
use crate::floor::FloorPose;

/// Whether a measurement can be this robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Agreement {
    Agrees,
    /// Outside the covariance's gate.
    Unlikely,
    /// Faster than a robot can be.
    TooFast,
    /// Older than measurements are used.
    TooOld,
    /// The track has been without measurements for too long to judge.
    Lost,
}

type Square<const N: usize> = [[f64; N]; N];

#[derive(Debug, Clone)]
pub(super) struct Track {
    time_us: i64,
    plane: [f64; 4],
    plane_p: Square<4>,
    yaw: [f64; 2],
    yaw_p: Square<2>,
    /// Last measurement that was used, and its time.
    measured: [f64; 3],
    measured_us: i64,
    camera: u16,
    hits: u32,
}

/// Slack of the speed limit for the noise of two measurements, m and rad.
const SLACK_M: f64 = 0.01;
const SLACK_RAD: f64 = 0.1;

fn seconds(us: i64) -> f64 {
    us as f64 * 1e-6
}

impl Track {
    /// A robot that may move in any way it can.
    pub(super) fn new(pose: &FloorPose, camera: u16, time_us: i64, settings: &FusionSettings) -> Track {
        let c = &pose.covariance;
        let (v, w) = (settings.speed_max_m_per_s / 2.0, settings.yaw_rate_max_rad_per_s / 2.0);
        let mut plane_p = [[0.0; 4]; 4];
        for row in 0..2 {
            plane_p[row][..2].copy_from_slice(&c[row][..2]);
            plane_p[row + 2][row + 2] = v * v;
        }
        Track {
            time_us,
            plane: [pose.x_m, pose.y_m, 0.0, 0.0],
            plane_p,
            yaw: [pose.yaw_rad, 0.0],
            yaw_p: [[c[2][2], 0.0], [0.0, w * w]],
            measured: [pose.x_m, pose.y_m, pose.yaw_rad],
            measured_us: time_us,
            camera,
            hits: 1,
        }
    }

    pub(super) fn time_us(&self) -> i64 {
        self.time_us
    }

    pub(super) fn hits(&self) -> u32 {
        self.hits
    }

    pub(super) fn camera(&self) -> u16 {
        self.camera
    }

    pub(super) fn speed_m_per_s(&self) -> f64 {
        self.plane[2].hypot(self.plane[3])
    }

    pub(super) fn agreement(&self, pose: &FloorPose, time_us: i64, settings: &FusionSettings) -> Agreement {
        if self.time_us - time_us > settings.measurement_age_max_us {
            return Agreement::TooOld;
        }
        // After so long almost any place would agree.
        if time_us - self.time_us > settings.lost_after_us {
            return Agreement::Lost;
        }
        let apart_s = seconds((time_us - self.measured_us).abs());
        let moved = (pose.x_m - self.measured[0]).hypot(pose.y_m - self.measured[1]);
        let turned = wrap_rad(pose.yaw_rad - self.measured[2]).abs();
        let noise = 5.0 * (pose.covariance[0][0].max(pose.covariance[1][1])).sqrt();
        if moved > settings.speed_max_m_per_s * apart_s + SLACK_M + noise
            || turned > settings.yaw_rate_max_rad_per_s * apart_s + SLACK_RAD
        {
            return Agreement::TooFast;
        }
        let at = self.carried(time_us.max(self.time_us), settings);
        let back_s = seconds((self.time_us - time_us).max(0));
        let (miss, s) = at.plane_innovation(pose, back_s);
        let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let distance = (s[1][1] * miss[0] * miss[0] - 2.0 * s[0][1] * miss[0] * miss[1] + s[0][0] * miss[1] * miss[1])
            / determinant;
        let (yaw_miss, yaw_s, _) = at.yaw_innovation(pose, back_s);
        // Not-a-number does not agree.
        if distance <= settings.gate && yaw_miss * yaw_miss <= settings.gate * yaw_s {
            Agreement::Agrees
        } else {
            Agreement::Unlikely
        }
    }

    /// Takes a measurement that agrees.
    pub(super) fn update(&mut self, pose: &FloorPose, camera: u16, time_us: i64, settings: &FusionSettings) {
        let back_s = seconds((self.time_us - time_us).max(0));
        *self = self.carried(time_us.max(self.time_us), settings);
        let (miss, s) = self.plane_innovation(pose, back_s);
        let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let inverse = [[s[1][1], -s[0][1]], [-s[1][0], s[0][0]]].map(|row| row.map(|value| value / determinant));
        // P H^T, with H = [I, -d I].
        let ph = self
            .plane_p
            .map(|row| [row[0] - back_s * row[2], row[1] - back_s * row[3]]);
        let gain = ph.map(|row| [0, 1].map(|c| row[0] * inverse[0][c] + row[1] * inverse[1][c]));
        for (row, gain) in gain.iter().enumerate() {
            self.plane[row] += gain[0] * miss[0] + gain[1] * miss[1];
            for (value, ph) in self.plane_p[row].iter_mut().zip(&ph) {
                *value -= gain[0] * ph[0] + gain[1] * ph[1];
            }
        }
        symmetrise(&mut self.plane_p);
        let (yaw_miss, yaw_s, yaw_ph) = self.yaw_innovation(pose, back_s);
        for row in 0..2 {
            self.yaw[row] += yaw_ph[row] / yaw_s * yaw_miss;
            for column in 0..2 {
                self.yaw_p[row][column] -= yaw_ph[row] * yaw_ph[column] / yaw_s;
            }
        }
        symmetrise(&mut self.yaw_p);
        self.yaw[0] = wrap_rad(self.yaw[0]);
        if time_us >= self.measured_us {
            (self.measured, self.measured_us) = ([pose.x_m, pose.y_m, pose.yaw_rad], time_us);
        }
        self.camera = camera;
        self.hits = self.hits.saturating_add(1);
    }

    pub(super) fn pose(&self, robot: u16, now_us: i64, settings: &FusionSettings) -> WorldPose {
        let at = self.carried(now_us.max(self.time_us), settings);
        let back_s = seconds((self.time_us - now_us).max(0));
        let p = &at.plane_p;
        WorldPose {
            robot,
            time_us: now_us,
            age_us: now_us - self.measured_us,
            x_m: at.plane[0] - back_s * at.plane[2],
            y_m: at.plane[1] - back_s * at.plane[3],
            yaw_rad: wrap_rad(at.yaw[0] - back_s * at.yaw[1]),
            vx_m_per_s: at.plane[2],
            vy_m_per_s: at.plane[3],
            yaw_rate_rad_per_s: at.yaw[1],
            covariance: [
                [p[0][0], p[0][1], 0.0],
                [p[1][0], p[1][1], 0.0],
                [0.0, 0.0, at.yaw_p[0][0]],
            ],
            velocity_variance: [p[2][2], p[3][3], at.yaw_p[1][1]],
            camera: self.camera,
        }
    }

    /// The track at a later time.
    fn carried(&self, time_us: i64, settings: &FusionSettings) -> Track {
        let mut out = self.clone();
        let t = seconds(time_us - self.time_us);
        if t <= 0.0 {
            return out;
        }
        let grown = |q: f64| [[q * t * t * t / 3.0, q * t * t / 2.0], [q * t * t / 2.0, q * t]];
        out.time_us = time_us;
        out.plane[0] += t * self.plane[2];
        out.plane[1] += t * self.plane[3];
        // F P F^T with F = [I, t I; 0, I]: rows, then columns.
        for row in 0..2 {
            for column in 0..4 {
                out.plane_p[row][column] += t * out.plane_p[row + 2][column];
            }
        }
        let noise = grown(settings.acceleration_density_m2_per_s3);
        for row in &mut out.plane_p {
            row[0] += t * row[2];
            row[1] += t * row[3];
        }
        for axis in 0..2 {
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                out.plane_p[axis + 2 * i][axis + 2 * j] += noise[i][j];
            }
        }
        let noise = grown(settings.yaw_acceleration_density_rad2_per_s3);
        let p = self.yaw_p;
        out.yaw[0] = wrap_rad(self.yaw[0] + t * self.yaw[1]);
        out.yaw_p = [
            [
                p[0][0] + t * (p[0][1] + p[1][0]) + t * t * p[1][1] + noise[0][0],
                p[0][1] + t * p[1][1] + noise[0][1],
            ],
            [p[1][0] + t * p[1][1] + noise[1][0], p[1][1] + noise[1][1]],
        ];
        out
    }

    /// Measurement minus prediction, and its covariance.
    fn plane_innovation(&self, pose: &FloorPose, back_s: f64) -> ([f64; 2], Square<2>) {
        let miss = [
            pose.x_m - (self.plane[0] - back_s * self.plane[2]),
            pose.y_m - (self.plane[1] - back_s * self.plane[3]),
        ];
        let p = &self.plane_p;
        let s = [0, 1].map(|i| {
            [0, 1].map(|j| {
                p[i][j] - back_s * (p[i][j + 2] + p[i + 2][j])
                    + back_s * back_s * p[i + 2][j + 2]
                    + pose.covariance[i][j]
            })
        });
        (miss, s)
    }

    /// Measurement minus prediction, its variance, and P H^T.
    fn yaw_innovation(&self, pose: &FloorPose, back_s: f64) -> (f64, f64, [f64; 2]) {
        let miss = wrap_rad(pose.yaw_rad - (self.yaw[0] - back_s * self.yaw[1]));
        let ph = self.yaw_p.map(|row| row[0] - back_s * row[1]);
        (miss, ph[0] - back_s * ph[1] + pose.covariance[2][2], ph)
    }
}

fn symmetrise<const N: usize>(matrix: &mut Square<N>) {
    let before = *matrix;
    for (row, values) in matrix.iter_mut().enumerate() {
        for (column, value) in values.iter_mut().enumerate() {
            *value = 0.5 * (before[row][column] + before[column][row]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(x_m: f64) -> FloorPose {
        FloorPose {
            robot: 1,
            x_m,
            y_m: 0.0,
            yaw_rad: 0.0,
            covariance: [[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-5]],
            residual_px: 0.0,
        }
    }

    /// Steady state of the continuous filter: P_vv = sqrt(2) q^(3/4) (r T)^(1/4)  [Bar-Shalom et al., 8.2-2].
    #[test]
    fn velocity_variance_settles_at_the_continuous_filters() {
        let settings = FusionSettings {
            acceleration_density_m2_per_s3: 0.001,
            ..FusionSettings::default()
        };
        let mut track = Track::new(&seen(0.0), 0, 0, &settings);
        for step in 1..4000 {
            track.update(&seen(0.5 * seconds(step * 1000)), 0, step * 1000, &settings);
        }
        let expected = 2f64.sqrt() * 0.001f64.powf(0.75) * (1e-6f64 * 1e-3).powf(0.25);
        assert!(
            (track.plane_p[2][2] / expected - 1.0).abs() < 0.05,
            "{} {expected}",
            track.plane_p[2][2]
        );
        assert!((track.plane[2] - 0.5).abs() < 1e-4);
    }

    #[test]
    fn a_measurement_from_the_past_is_compared_with_the_past() {
        let settings = FusionSettings::default();
        let mut track = Track::new(&seen(0.0), 0, 0, &settings);
        for step in 1..100 {
            track.update(&seen(seconds(step * 8000)), 0, step * 8000, &settings);
        }
        let late = 99 * 8000 - 5000;
        assert_eq!(
            track.agreement(&seen(seconds(late)), late, &settings),
            Agreement::Agrees
        );
        assert_eq!(
            track.agreement(&seen(seconds(late) - 0.02), late, &settings),
            Agreement::Unlikely
        );
        assert_eq!(track.agreement(&seen(2.0), late, &settings), Agreement::TooFast);
        let before = track.plane;
        track.update(&seen(seconds(late)), 1, late, &settings);
        assert!((track.plane[0] - before[0]).abs() < 1e-6 && (track.plane[2] - before[2]).abs() < 1e-4);
        assert_eq!(track.time_us(), 99 * 8000);
    }
}
