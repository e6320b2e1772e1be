//! Wheel speed control: PI on the wheel speed with a voltage as its output.

use crate::motor_control::{Pi, PiSettings};

/// Gains and sample time of a wheel's speed loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedLoopSettings {
    pub kp_v_s_per_rad: f64,
    pub ki_v_per_rad: f64,
    pub sample_s: f64,
}

/// V = clamp(k_p e + k_i int e, +-V_bus) with e = W_cmd - W and |k_i int e| <= V_bus; sampled, output held.
///
/// The integral takes the present error before the output is computed. The twin's speed loop is the same to the bit.
#[derive(Debug, Clone, Copy)]
pub struct SpeedLoop {
    pi: Pi,
}

impl SpeedLoop {
    pub fn new(settings: SpeedLoopSettings) -> Self {
        Self {
            pi: Pi::new(PiSettings {
                proportional: settings.kp_v_s_per_rad,
                integral: settings.ki_v_per_rad,
                sample_s: settings.sample_s,
            }),
        }
    }

    /// Forgets the integral, for a wheel that stands.
    pub fn reset(&mut self) {
        self.pi.reset();
    }

    /// Motor voltage for the next sample.
    ///
    /// - Never NaN: an input that is not finite gives 0 V and leaves the integral as it is.
    pub fn step(&mut self, wheel: WheelSpeed, bus_v: f64) -> f64 {
        self.pi.step(wheel.command_rad_per_s - wheel.measured_rad_per_s, bus_v)
    }
}

/// Wanted and measured speed of one wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelSpeed {
    pub command_rad_per_s: f64,
    pub measured_rad_per_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: SpeedLoopSettings = SpeedLoopSettings {
        kp_v_s_per_rad: 0.8,
        ki_v_per_rad: 6.0,
        sample_s: 1.0 / 480.0,
    };

    fn error(rad_per_s: f64) -> WheelSpeed {
        WheelSpeed {
            command_rad_per_s: rad_per_s,
            measured_rad_per_s: 0.0,
        }
    }

    #[test]
    fn a_held_error_gives_the_closed_form() {
        let mut speed_loop = SpeedLoop::new(SETTINGS);
        let mut voltage = 0.0;
        for _ in 0..240 {
            voltage = speed_loop.step(error(2.0), 24.0);
        }
        assert!((voltage - (0.8 * 2.0 + 6.0 * 2.0 * 0.5)).abs() < 1e-9, "{voltage}");
    }

    #[test]
    fn the_integral_does_not_wind_up() {
        let mut speed_loop = SpeedLoop::new(SETTINGS);
        for _ in 0..48_000 {
            assert_eq!(speed_loop.step(error(100.0), 24.0), 24.0);
        }
        let steps_to_leave = (0..1000).find(|_| speed_loop.step(error(-10.0), 24.0) < 0.0).unwrap();
        assert!(steps_to_leave < 480 * 24 / 60, "{steps_to_leave}");
    }

    #[test]
    fn nonsense_gives_zero_volts() {
        let mut speed_loop = SpeedLoop::new(SETTINGS);
        assert_eq!(speed_loop.step(error(f64::NAN), 24.0), 0.0);
        assert_eq!(speed_loop.step(error(f64::INFINITY), 24.0), 0.0);
        assert_eq!(speed_loop.step(error(1.0), f64::NAN), 0.0);
        assert_eq!(speed_loop.step(error(1.0), -1.0), 0.0);
    }
}
