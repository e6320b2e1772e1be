//! Steering gear and Ackermann geometry.

use crate::PHYSICS_PERIOD_S;
use crate::robot::Steering;

/// Largest usable bicycle angle, rad; Ackermann geometry ends at pi/2.
pub(crate) const STEERING_LIMIT_RAD: f64 = 1.5;

/// Periods whose decay is at hand, s.
const DECAY_S: [f64; 2] = [PHYSICS_PERIOD_S, 0.5 * PHYSICS_PERIOD_S];

fn decay(period_s: f64, lag_s: f64) -> f64 {
    if lag_s > 0.0 { libm::exp(-period_s / lag_s) } else { 0.0 }
}

/// Constants of the steering equations.
///
/// d(delta)/dt = clamp((clamp(cmd, +-limit) - delta) / lag, +-rate)
#[derive(Debug, Clone)]
pub(crate) struct SteeringModel {
    pub(crate) lag_s: f64,
    /// exp(-t / lag) after a physics step and after half of one.
    decay: [f64; 2],
    pub(crate) rate_limit_rad_per_s: f64,
    pub(crate) angle_limit_rad: f64,
    /// `L`: distance of the steered axle ahead of the fixed axle, m (negative for rear steering).
    pub(crate) wheelbase_m: f64,
    /// x of the fixed axle, m.
    pub(crate) fixed_axle_x_m: f64,
}

impl SteeringModel {
    pub(crate) fn new(steering: &Steering, wheelbase_m: f64, fixed_axle_x_m: f64) -> SteeringModel {
        SteeringModel {
            lag_s: steering.lag_s,
            decay: DECAY_S.map(|period_s| decay(period_s, steering.lag_s)),
            rate_limit_rad_per_s: steering.rate_limit_rad_per_s.unwrap_or(f64::INFINITY),
            angle_limit_rad: steering
                .angle_limit_rad
                .unwrap_or(STEERING_LIMIT_RAD)
                .min(STEERING_LIMIT_RAD),
            wheelbase_m,
            fixed_axle_x_m,
        }
    }

    /// The angle a command can ask for, rad.
    pub(crate) fn limited_rad(&self, command_rad: f64) -> f64 {
        command_rad.min(self.angle_limit_rad).max(-self.angle_limit_rad)
    }

    /// Bicycle angle after `period_s`: exact solution of the equation above (straight at the rate limit, then exponential).
    pub(crate) fn advanced_rad(&self, angle_rad: f64, command_rad: f64, period_s: f64) -> f64 {
        let goal = self.limited_rad(command_rad);
        let gap = goal - angle_rad;
        let slow_gap = self.rate_limit_rad_per_s * self.lag_s;
        let mut left_s = period_s;
        let mut size = gap.abs();
        if size > slow_gap {
            let limited_s = ((size - slow_gap) / self.rate_limit_rad_per_s).min(left_s);
            size -= limited_s * self.rate_limit_rad_per_s;
            left_s -= limited_s;
        }
        if left_s > 0.0 {
            size *= if left_s == DECAY_S[0] {
                self.decay[0]
            } else if left_s == DECAY_S[1] {
                self.decay[1]
            } else {
                decay(left_s, self.lag_s)
            };
        }
        goal - size.copysign(gap)
    }

    /// Cosine and sine of the angle of a wheel at `(x, y)` when the bicycle angle has tangent `tan_bicycle`.
    ///
    /// The wheel's axle points at the turning centre `(x_fixed, L / tan delta)`:
    /// tan delta_i = (x_i - x_fixed) tan delta / (L - y_i tan delta).
    #[inline(always)]
    pub(crate) fn wheel_cos_sin(&self, tan_bicycle: f64, x_m: f64, y_m: f64) -> (f64, f64) {
        let along = self.wheelbase_m - y_m * tan_bicycle;
        let across = (x_m - self.fixed_axle_x_m) * tan_bicycle;
        // A wheel never turns past 90 degrees: a turning centre inside the track keeps the sign of the wheelbase.
        let scale = 1.0_f64.copysign(self.wheelbase_m) / (along * along + across * across).sqrt();
        (along * scale, across * scale)
    }
}
