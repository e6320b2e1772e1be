//! Position and velocity.
//!
//! ```text
//! r = g - b,  q = yaw + r T / 2
//! x += (u cos q - v sin q) T,   y += (u sin q + v cos q) T,   yaw += r T
//! u += (a_forward + r v) T,     v += (a_left - r u) T
//! wheels   u, v = twist of slip-free rolling; while r of the wheels contradicts the gyro they slip and count for little
//! ```

use super::{BIAS, Estimator, Measurement, STATES, Scalar, U, V, X, Y, YAW};

/// Yaw rates of wheels and gyro that differ by more mean slip.
const SLIP_RAD_PER_S: f64 = 0.3;
const SLIP_FACTOR: f64 = 10.0;

impl Estimator {
    pub(super) fn predict(&mut self, gyro_rad_per_s: f64, accel_m_per_s2: [f64; 2]) {
        let dt = self.settings.step_s;
        let [_, _, yaw, bias, u, v] = self.state;
        let r = gyro_rad_per_s - bias;
        let (sin, cos) = libm::sincos(yaw + 0.5 * r * dt);
        let (east, north) = ((u * cos - v * sin) * dt, (u * sin + v * cos) * dt);
        self.state[X] += east;
        self.state[Y] += north;
        self.state[YAW] += r * dt;
        self.state[U] += (accel_m_per_s2[0] + r * v) * dt;
        self.state[V] += (accel_m_per_s2[1] - r * u) * dt;
        self.yaw_rate_rad_per_s = r;
        let mut f = [[0.0; STATES]; STATES];
        for (i, row) in f.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        (f[X][YAW], f[X][BIAS], f[X][U], f[X][V]) = (-north, 0.5 * dt * north, cos * dt, -sin * dt);
        (f[Y][YAW], f[Y][BIAS], f[Y][U], f[Y][V]) = (east, -0.5 * dt * east, sin * dt, cos * dt);
        f[YAW][BIAS] = -dt;
        (f[U][BIAS], f[U][V]) = (-v * dt, r * dt);
        (f[V][BIAS], f[V][U]) = (u * dt, -r * dt);
        self.covariance = propagated(&f, &self.covariance);
        let settings = &self.settings;
        let gyro = settings.gyro_rad_per_s * dt;
        let speed = libm::sqrt(u * u + v * v);
        let way = settings.odometry_walk_m * settings.odometry_walk_m * speed * dt;
        let walk = settings.accel_walk_m_per_s * settings.accel_walk_m_per_s * dt;
        let noise = [
            way,
            way,
            gyro * gyro,
            settings.bias_walk_rad_per_s * settings.bias_walk_rad_per_s * dt,
            walk,
            walk,
        ];
        for (i, noise) in noise.iter().enumerate() {
            self.covariance[i][i] += noise;
        }
    }

    /// Velocity that the wheels show.
    pub(super) fn take_wheels(&mut self, measurement: &Measurement) {
        let twist = &measurement.wheel_twist;
        if !twist.is_finite() {
            return;
        }
        let slips = (twist.yaw_rate_rad_per_s - self.yaw_rate_rad_per_s).abs() > SLIP_RAD_PER_S;
        let settings = &self.settings;
        let sd = settings.wheel_velocity_m_per_s * if slips { SLIP_FACTOR } else { 1.0 };
        let variance = sd * sd * (settings.wheel_correlation_s / settings.step_s).max(1.0);
        let measured = [
            (U, twist.forward_m_per_s, true),
            (V, twist.left_m_per_s, measurement.sees_sideways),
        ];
        for (i, value, seen) in measured {
            let mut row = [0.0; STATES];
            row[i] = 1.0;
            self.take(&Scalar {
                row,
                innovation: value - self.state[i],
                // A robot that may slide unseen still does not move sideways as a rule.
                variance: if seen { variance } else { 100.0 * variance },
            });
        }
    }
}

/// F P F', exactly symmetric.
fn propagated(f: &[[f64; STATES]; STATES], p: &[[f64; STATES]; STATES]) -> [[f64; STATES]; STATES] {
    let mut fp = [[0.0; STATES]; STATES];
    for (i, row) in fp.iter_mut().enumerate() {
        for (k, factor) in f[i].iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            for (value, other) in row.iter_mut().zip(&p[k]) {
                *value += factor * other;
            }
        }
    }
    let mut out = [[0.0; STATES]; STATES];
    for i in 0..STATES {
        for j in i..STATES {
            let value: f64 = f[j]
                .iter()
                .zip(&fp[i])
                .filter(|(factor, _)| **factor != 0.0)
                .map(|(factor, value)| factor * value)
                .sum();
            out[i][j] = value;
            out[j][i] = value;
        }
    }
    out
}
