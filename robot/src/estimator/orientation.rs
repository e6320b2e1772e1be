//! Orientation: yaw and gyro bias.
//!
//! ```text
//! yaw' = g - b                                   g: gyro
//! standing     g = b + noise                     the bias shows itself
//! magnetometer yaw = north - atan2(m_left, m_forward)
//! ```

use super::{BIAS, Estimator, STATES, Scalar, U, V, YAW, wrapped};

/// A field of another size than expected by this share is disturbed.
const FIELD_SHARE: f64 = 0.4;
/// Velocity of a robot whose wheels stand.
const STANDING_M_PER_S: f64 = 1e-3;

impl Estimator {
    /// A robot at rest shows the gyro's bias and has no velocity.
    pub(super) fn take_standstill(&mut self, gyro_rad_per_s: f64) {
        let sd = self.settings.gyro_rad_per_s.max(1e-5);
        let mut row = [0.0; STATES];
        row[BIAS] = 1.0;
        self.take_gated(&Scalar {
            row,
            innovation: gyro_rad_per_s - self.state[BIAS],
            variance: sd * sd,
        });
        for i in [U, V] {
            let mut row = [0.0; STATES];
            row[i] = 1.0;
            self.take(&Scalar {
                row,
                innovation: -self.state[i],
                variance: STANDING_M_PER_S * STANDING_M_PER_S,
            });
        }
    }

    /// Heading from the horizontal field. A field of the wrong size is left out.
    pub(super) fn take_field(&mut self, field_t: [f64; 2]) {
        let Some(magnetometer) = self.settings.magnetometer else {
            return;
        };
        let [forward, left] = field_t;
        let size_t = libm::sqrt(forward * forward + left * left);
        let off_t = (size_t - magnetometer.field_t).abs();
        if off_t.is_nan() || off_t > FIELD_SHARE * magnetometer.field_t {
            return;
        }
        let yaw_rad = magnetometer.north_rad - libm::atan2(left, forward);
        let samples = (magnetometer.correlation_s / self.settings.step_s).max(1.0);
        let mut row = [0.0; STATES];
        row[YAW] = 1.0;
        let innovation = wrapped(yaw_rad - self.state[YAW]);
        let scalar = Scalar {
            row,
            innovation,
            variance: magnetometer.heading_rad * magnetometer.heading_rad * samples,
        };
        if self.covariance[YAW][YAW] > 1.0 {
            // Nothing is known: a wrapped angle is no small innovation, so it is taken as it is.
            self.state[YAW] += innovation;
            for i in 0..STATES {
                self.covariance[YAW][i] = 0.0;
                self.covariance[i][YAW] = 0.0;
            }
            self.covariance[YAW][YAW] = magnetometer.heading_rad * magnetometer.heading_rad;
        } else {
            self.take_gated(&scalar);
        }
    }
}
