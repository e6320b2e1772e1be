//! Motor control of one driven wheel: speed PI, or an outer speed PI around an inner current PI.
//!
//! At every sample `k`, `T = 1 / sample_rate_hz` apart (`docs/notation.md`; the twin evaluates the same operations in
//! the same order, and its tests compare the two bit for bit):
//! ```text
//! PI(e; k_p, k_i, y_max)   x = clamp(x + e T, +-y_max / k_i), 0 where k_i = 0 ;  y = clamp(k_p e + k_i x, +-y_max)
//! speed estimate           W_k = (c_k - c_{k-w}) 2 pi / (n w T), or the speed as measured without an encoder
//! speed_pi                 V_k = PI(W_cmd - W_k; k_p, k_i, V_bus)
//! cascade                  i*  = PI(W_cmd - W_k; k_ps, k_is, i_max) ;  V_k = PI(i* - i_k; k_pc, k_ic, V_bus)
//! computation delay        V = V_{k-m} during [t_k, t_{k+1})
//! ```

use core::f64::consts::TAU;

/// Longest computation delay, samples.
pub const MAX_DELAY_SAMPLES: usize = 8;
/// Longest window of the speed estimate, samples.
pub const MAX_WINDOW_SAMPLES: usize = 64;

/// Gains of a PI law and its sample time; output unit per unit of error, and per unit of error and second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiSettings {
    pub proportional: f64,
    pub integral: f64,
    pub sample_s: f64,
}

/// PI law with a limited output; the error's integral is limited to what gives the largest output alone.
#[derive(Debug, Clone, Copy)]
pub struct Pi {
    settings: PiSettings,
    error_integral: f64,
}

impl Pi {
    pub const fn new(settings: PiSettings) -> Self {
        Self {
            settings,
            error_integral: 0.0,
        }
    }

    /// Forgets the integral.
    pub fn reset(&mut self) {
        self.error_integral = 0.0;
    }

    /// Output for this sample's error, within `limit` either way.
    ///
    /// - The integral takes the present error before the output is computed.
    /// - Never NaN: an input that is not finite gives 0 and leaves the integral as it is.
    pub fn step(&mut self, error: f64, limit: f64) -> f64 {
        if !error.is_finite() || !limit.is_finite() {
            return 0.0;
        }
        let limit = limit.max(0.0);
        let PiSettings {
            proportional,
            integral,
            sample_s,
        } = self.settings;
        let most = if integral > 0.0 { limit / integral } else { 0.0 };
        self.error_integral = (self.error_integral + error * sample_s).min(most).max(-most);
        let wanted = proportional * error + integral * self.error_integral;
        wanted.min(limit).max(-limit)
    }
}

/// What turns a wheel's speed error into a voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    SpeedPi {
        kp_v_s_per_rad: f64,
        ki_v_per_rad: f64,
    },
    Cascade {
        speed_kp_a_s_per_rad: f64,
        speed_ki_a_per_rad: f64,
        current_kp_v_per_a: f64,
        current_ki_v_per_a_s: f64,
        current_limit_a: f64,
    },
}

/// A quantised encoder and the window of the speed made of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EncoderSettings {
    /// Counts of one turn of the wheel, gear and quadrature included.
    pub ticks_per_rev: u32,
    /// 1 to [`MAX_WINDOW_SAMPLES`]; more are taken as that.
    pub window_samples: usize,
}

/// Motor control of a wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControllerSettings {
    pub law: Law,
    pub sample_rate_hz: u32,
    /// At most [`MAX_DELAY_SAMPLES`]; more are taken as that.
    pub computation_delay_samples: usize,
    /// Absent: the speed comes measured with the sample.
    pub encoder: Option<EncoderSettings>,
}

/// What a controller sees at its sampling instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ControlSample {
    pub command_rad_per_s: f64,
    /// Read without an encoder only.
    pub wheel_rad_per_s: f64,
    /// Hardware counter, may wrap; read with an encoder only.
    pub encoder_count: i32,
    /// Read by the cascade only.
    pub current_a: f64,
    pub bus_v: f64,
}

/// Motor control of one wheel in motion.
#[derive(Debug, Clone)]
pub struct Controller {
    settings: ControllerSettings,
    /// Speed of one count in the window.
    tick_rad_per_s: f64,
    window: usize,
    delay: usize,
    speed: Pi,
    current: Pi,
    /// Oldest first.
    delayed_v: [f64; MAX_DELAY_SAMPLES],
    counts: [i32; MAX_WINDOW_SAMPLES],
}

impl Controller {
    /// A wheel at rest whose counter stands at `first_count`.
    pub fn new(settings: ControllerSettings, first_count: i32) -> Self {
        let sample_s = 1.0 / f64::from(settings.sample_rate_hz.max(1));
        let pi = |proportional, integral| {
            Pi::new(PiSettings {
                proportional,
                integral,
                sample_s,
            })
        };
        let (speed, current) = match settings.law {
            Law::SpeedPi {
                kp_v_s_per_rad,
                ki_v_per_rad,
            } => (pi(kp_v_s_per_rad, ki_v_per_rad), pi(0.0, 0.0)),
            Law::Cascade {
                speed_kp_a_s_per_rad,
                speed_ki_a_per_rad,
                current_kp_v_per_a,
                current_ki_v_per_a_s,
                ..
            } => (
                pi(speed_kp_a_s_per_rad, speed_ki_a_per_rad),
                pi(current_kp_v_per_a, current_ki_v_per_a_s),
            ),
        };
        let (ticks, window) = settings.encoder.map_or((1, 1), |encoder| {
            let window = encoder.window_samples.clamp(1, MAX_WINDOW_SAMPLES);
            (encoder.ticks_per_rev.max(1), window)
        });
        Self {
            settings,
            tick_rad_per_s: TAU * f64::from(settings.sample_rate_hz.max(1)) / (f64::from(ticks) * window as f64),
            window,
            delay: settings.computation_delay_samples.min(MAX_DELAY_SAMPLES),
            speed,
            current,
            delayed_v: [0.0; MAX_DELAY_SAMPLES],
            counts: [first_count; MAX_WINDOW_SAMPLES],
        }
    }

    /// As [`Controller::new`]: for a wheel that stood without power.
    pub fn reset(&mut self, first_count: i32) {
        *self = Self::new(self.settings, first_count);
    }

    /// Motor voltage until the next sample.
    ///
    /// - Never NaN: an input that is not finite gives 0 V in its place and leaves the integrals as they are.
    pub fn step(&mut self, sample: &ControlSample) -> f64 {
        let error_rad_per_s = sample.command_rad_per_s - self.speed_rad_per_s(sample);
        let voltage_v = match self.settings.law {
            Law::SpeedPi { .. } => self.speed.step(error_rad_per_s, sample.bus_v),
            Law::Cascade { current_limit_a, .. } => {
                let wanted_a = self.speed.step(error_rad_per_s, current_limit_a);
                self.current.step(wanted_a - sample.current_a, sample.bus_v)
            }
        };
        let Some(line) = self.delayed_v.get_mut(..self.delay).filter(|line| !line.is_empty()) else {
            return voltage_v;
        };
        line.rotate_left(1);
        // What was the oldest stands last now, and makes room.
        line.last_mut()
            .map_or(voltage_v, |last| core::mem::replace(last, voltage_v))
    }

    fn speed_rad_per_s(&mut self, sample: &ControlSample) -> f64 {
        let Some(counts) = self
            .counts
            .get_mut(..self.window)
            .filter(|_| self.settings.encoder.is_some())
        else {
            return sample.wheel_rad_per_s;
        };
        counts.rotate_left(1);
        let turned = counts.last_mut().map_or(0, |last| {
            sample
                .encoder_count
                .wrapping_sub(core::mem::replace(last, sample.encoder_count))
        });
        f64::from(turned) * self.tick_rad_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASCADE: ControllerSettings = ControllerSettings {
        law: Law::Cascade {
            speed_kp_a_s_per_rad: 0.5,
            speed_ki_a_per_rad: 2.5,
            current_kp_v_per_a: 0.12,
            current_ki_v_per_a_s: 360.0,
            current_limit_a: 3.0,
        },
        sample_rate_hz: 1920,
        computation_delay_samples: 0,
        encoder: Some(EncoderSettings {
            ticks_per_rev: 4096,
            window_samples: 8,
        }),
    };

    fn sample(command_rad_per_s: f64, encoder_count: i32, current_a: f64) -> ControlSample {
        ControlSample {
            command_rad_per_s,
            encoder_count,
            current_a,
            bus_v: 24.0,
            ..ControlSample::default()
        }
    }

    #[test]
    fn a_counter_that_wraps_keeps_its_speed() {
        let mut wrapping = Controller::new(CASCADE, i32::MAX - 50);
        let mut plain = Controller::new(CASCADE, 0);
        for k in 1..100 {
            let a = wrapping.step(&sample(5.0, (i32::MAX - 50).wrapping_add(3 * k), 0.5));
            let b = plain.step(&sample(5.0, 3 * k, 0.5));
            assert_eq!(a.to_bits(), b.to_bits(), "{k}");
        }
    }

    #[test]
    fn a_delay_shifts_the_voltages_and_changes_nothing_else() {
        for delay in 0..=MAX_DELAY_SAMPLES {
            let mut now = Controller::new(CASCADE, 0);
            let mut late = Controller::new(
                ControllerSettings {
                    computation_delay_samples: delay,
                    ..CASCADE
                },
                0,
            );
            let mut voltages = [0.0; 40];
            for (k, voltage) in voltages.iter_mut().enumerate() {
                *voltage = now.step(&sample(2.0, k as i32, 0.1 * k as f64));
            }
            for k in 0..40 {
                let expected = if k < delay { 0.0 } else { voltages[k - delay] };
                assert_eq!(
                    late.step(&sample(2.0, k as i32, 0.1 * k as f64)),
                    expected,
                    "{delay} {k}"
                );
            }
        }
    }

    #[test]
    fn nonsense_never_becomes_a_voltage() {
        let mut controller = Controller::new(CASCADE, 0);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for turn in 0..3 {
                let mut sample = sample(1.0, 0, 0.2);
                match turn {
                    0 => sample.command_rad_per_s = bad,
                    1 => sample.current_a = bad,
                    _ => sample.bus_v = bad,
                }
                assert!(controller.step(&sample).is_finite());
            }
        }
        let mut fresh = Controller::new(CASCADE, 0);
        fresh.step(&sample(1.0, 0, f64::NAN));
        // The outer loop went on, the inner one did not move: i* = 0.5 + 2.5 * 2 / 1920, V = (k_pc + k_ic T) i*.
        let wanted_a = 0.5 + 2.5 * 2.0 / 1920.0;
        let voltage_v = fresh.step(&sample(1.0, 0, 0.0));
        assert!(
            (voltage_v - (0.12 + 360.0 / 1920.0) * wanted_a).abs() < 1e-12,
            "{voltage_v}"
        );
    }
}
