//! Steering gear: a rate-limited servo of second order with play; Ackermann angles at the wheels.

use super::Step;

/// Limits and speed of the servo.
#[derive(Debug, Clone, Copy)]
pub struct Steering {
    pub lag_s: f64,
    pub rate_limit_rad_per_s: f64,
    pub angle_limit_rad: f64,
    pub play_rad: f64,
    /// Between servo and wheels.
    pub offset_rad: f64,
    pub scale: f64,
    /// Steered to unsteered axle, positive when the steered one is in front.
    pub wheelbase_m: f64,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct SteeringState {
    pub servo_rad: f64,
    servo_rad_per_s: f64,
    /// Bicycle angle behind the play.
    pub angle_rad: f64,
}

impl Steering {
    /// Moves servo and linkage by a step towards the commanded angle.
    pub fn step(&self, state: &mut SteeringState, command_rad: f64, step: Step) {
        let wanted_rad = command_rad.clamp(-self.angle_limit_rad, self.angle_limit_rad);
        let natural_rad_per_s = 2.0 / self.lag_s.max(1e-3);
        let acceleration = natural_rad_per_s * natural_rad_per_s * (wanted_rad - state.servo_rad)
            - 2.0 * natural_rad_per_s * state.servo_rad_per_s;
        let rate = state.servo_rad_per_s + step.dt_s * acceleration;
        state.servo_rad_per_s = rate.clamp(-self.rate_limit_rad_per_s, self.rate_limit_rad_per_s);
        state.servo_rad += step.dt_s * state.servo_rad_per_s;
        state.angle_rad = state
            .angle_rad
            .clamp(state.servo_rad - self.play_rad, state.servo_rad + self.play_rad);
    }

    /// Tangent of the bicycle angle of the wheels.
    pub fn tangent(&self, state: &SteeringState) -> f64 {
        (self.scale * state.angle_rad + self.offset_rad).tan()
    }

    /// Cosine and sine of the angle of a wheel at `left_m` so that all axes meet in one point: tan = L t / (L - y t).
    pub fn wheel_direction(&self, tangent: f64, left_m: f64) -> [f64; 2] {
        let (across, along) = (self.wheelbase_m * tangent, self.wheelbase_m - left_m * tangent);
        let scale = along.signum() / (across * across + along * along).sqrt();
        [along * scale, across * scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEERING: Steering = Steering {
        lag_s: 0.08,
        rate_limit_rad_per_s: 6.0,
        angle_limit_rad: 0.5,
        play_rad: 0.0,
        offset_rad: 0.0,
        scale: 1.0,
        wheelbase_m: 0.26,
    };

    #[test]
    fn reaches_the_limited_angle_without_breaking_the_rate_limit() {
        let mut state = SteeringState::default();
        for _ in 0..7680 {
            let before = state.angle_rad;
            STEERING.step(&mut state, 0.9, Step { dt_s: 1.0 / 7680.0 });
            assert!(state.angle_rad - before <= 6.0 / 7680.0 + 1e-12);
        }
        assert!((state.angle_rad - 0.5).abs() < 1e-4, "{state:?}");
    }

    #[test]
    fn wheel_axes_meet_in_one_point() {
        let state = SteeringState {
            angle_rad: 0.3,
            ..SteeringState::default()
        };
        let centre = |left_m: f64| {
            left_m
                + 0.26 / {
                    let [cos, sin] = STEERING.wheel_direction(STEERING.tangent(&state), left_m);
                    sin / cos
                }
        };
        assert!((centre(0.12) - centre(-0.12)).abs() < 1e-9 && centre(0.12) > 0.0);
    }
}
