//! Motor control of a driven wheel when the description has a `motor.controller`.
//!
//! At every sample `k`, `T = 1 / sample_rate_hz` apart; `robot/src/motor_control.rs` evaluates the same operations in
//! the same order, and `twin/tests/robot_controllers.rs` compares the two bit for bit:
//! ```text
//! PI(e; k_p, k_i, y_max)   x = clamp(x + e T, +-y_max / k_i), 0 where k_i = 0 ;  y = clamp(k_p e + k_i x, +-y_max)
//! speed estimate           W_k = (c_k - c_{k-w}) 2 pi / (n w T), c = floor(n angle / 2 pi); without n the speed itself
//! speed_pi                 V_k = PI(W_cmd - W_k; k_p, k_i, V_bus)
//! cascade                  i*  = PI(W_cmd - W_k; k_ps, k_is, i_max) ;  V_k = PI(i* - i_k; k_pc, k_ic, V_bus)
//! computation delay        V = V_{k-m} during [t_k, t_{k+1})
//! ```
//! Without the object the speed loop is `speed_pi` at 480 Hz without delay and encoder, and costs nothing of this.

mod drives;

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::PHYSICS_RATE_HZ;
use crate::robot::Motor;

pub(crate) use drives::{Drives, substep};

/// Values of `motor.controller.kind`.
pub const KINDS: [&str; 2] = ["speed_pi", "cascade"];

/// Control of the motors as it stands in a robot description; the same for every driven wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorController {
    /// `speed_pi` (gains in `motor`) or `cascade` (gains here).
    pub kind: String,
    /// A divisor or a multiple of 480 Hz, 10 to 9600. Above 480 Hz the physics steps are as short as the samples.
    pub sample_rate_hz: u32,
    /// Samples from measurement to the voltage made of it; 0 = at once.
    pub computation_delay_samples: u32,
    /// Counts of one turn of the wheel, gear and quadrature included. Absent: the speed is known exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder_ticks_per_rev: Option<u32>,
    /// Samples that the speed is the mean of; given exactly with an encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_window_samples: Option<u32>,
    /// `k_ps`; the four gains are given exactly for a cascade.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_kp_a_s_per_rad: Option<f64>,
    /// `k_is`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_ki_a_per_rad: Option<f64>,
    /// `k_pc`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_kp_v_per_a: Option<f64>,
    /// `k_ic`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_ki_v_per_a_s: Option<f64>,
    /// Largest current a cascade asks for; absent: `motor.current_limit_a`, or the stall current where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_limit_a: Option<f64>,
}

impl MotorController {
    /// Cascade of the reference robots (12 kg, 50 mm wheels, `golden::reference_robot`), stable in grip, in slip and lifted off.
    ///
    /// The inner loop is placed for a winding of 0.2 mH and 0.6 ohm, which the twin does not model: zero on the winding's pole
    /// (k_pc / k_ic = L / R), crossover 600 rad/s. The outer one crosses at k k_ps / J = 19 rad/s with the
    /// robot's whole mass on the wheels (J = 0.0158 kg m^2, omni4 forward), its zero at a quarter of that; lifted off
    /// (J = 0.0008 kg m^2) at 0.45 * 370 rad/s, where window and delay take 0.45 rad of phase.
    pub fn reference_cascade() -> MotorController {
        MotorController {
            kind: "cascade".to_owned(),
            sample_rate_hz: 1920,
            computation_delay_samples: 1,
            encoder_ticks_per_rev: Some(4096),
            speed_window_samples: Some(8),
            speed_kp_a_s_per_rad: Some(0.5),
            speed_ki_a_per_rad: Some(2.5),
            current_kp_v_per_a: Some(0.12),
            current_ki_v_per_a_s: Some(360.0),
            current_limit_a: None,
        }
    }

    /// The loop of a description without a controller, written out.
    pub fn plain_speed_pi() -> MotorController {
        MotorController {
            kind: "speed_pi".to_owned(),
            sample_rate_hz: PHYSICS_RATE_HZ,
            computation_delay_samples: 0,
            encoder_ticks_per_rev: None,
            speed_window_samples: None,
            speed_kp_a_s_per_rad: None,
            speed_ki_a_per_rad: None,
            current_kp_v_per_a: None,
            current_ki_v_per_a_s: None,
            current_limit_a: None,
        }
    }
}

/// What a controller sees at its sampling instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ControlSample {
    pub command_rad_per_s: f64,
    /// Read without an encoder only.
    pub wheel_rad_per_s: f64,
    /// Counted since the start; read with an encoder only.
    pub encoder_count: i64,
    /// Read by the cascade only.
    pub current_a: f64,
    pub bus_v: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Gains {
    proportional: f64,
    integral: f64,
}

impl Gains {
    /// One sample: the new integral of the error and the output, within `limit` either way.
    ///
    /// An input that is not finite gives 0 and leaves the integral as it is.
    #[inline]
    fn step(&self, error_integral: f64, error: f64, sample_s: f64, limit: f64) -> (f64, f64) {
        if !error.is_finite() || !limit.is_finite() {
            return (error_integral, 0.0);
        }
        let limit = limit.max(0.0);
        let most = self.most(limit);
        let sum = (error_integral + error * sample_s).min(most).max(-most);
        let wanted = self.proportional * error + self.integral * sum;
        (sum, wanted.min(limit).max(-limit))
    }

    /// Largest integral.
    fn most(&self, limit: f64) -> f64 {
        if self.integral > 0.0 {
            limit / self.integral
        } else {
            0.0
        }
    }

    /// Integral that gives an output without an error.
    fn settled(&self, output: f64, limit: f64) -> f64 {
        if self.integral > 0.0 {
            let most = self.most(limit);
            (output / self.integral).min(most).max(-most)
        } else {
            0.0
        }
    }
}

/// A moving wheel that a controller takes over.
#[derive(Debug, Clone, Copy)]
struct Motion {
    wheel_rad: f64,
    wheel_rad_per_s: f64,
    current_a: f64,
    voltage_v: f64,
    bus_v: f64,
}

/// Motor control of one wheel: constants and what it remembers from sample to sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    sample_s: f64,
    speed: Gains,
    /// Current loop and largest current; absent in a speed PI.
    inner: Option<(Gains, f64)>,
    ticks_per_rev: Option<f64>,
    /// Speed of one count in the window.
    tick_rad_per_s: f64,
    speed_integral: f64,
    current_integral: f64,
    /// Voltages on their way, oldest first.
    delayed_v: Vec<f64>,
    /// Counts of the last samples, oldest first.
    counts: Vec<i64>,
}

impl Controller {
    /// Controller of a wheel at rest, its counter at 0; [`MotorController::plain_speed_pi`] where the motor has none.
    ///
    /// - The description is taken as checked: what a kind lacks counts as 0.
    pub fn new(motor: &Motor) -> Controller {
        let plain = MotorController::plain_speed_pi();
        let settings = motor.controller.as_ref().unwrap_or(&plain);
        let gains = |proportional: Option<f64>, integral: Option<f64>| Gains {
            proportional: proportional.unwrap_or(0.0),
            integral: integral.unwrap_or(0.0),
        };
        let cascade = settings.kind == "cascade";
        let limit_a = settings
            .current_limit_a
            .or(motor.current_limit_a)
            .unwrap_or(motor.supply_v / motor.resistance_ohm);
        let window = settings.encoder_ticks_per_rev.and(settings.speed_window_samples);
        let window = window.unwrap_or(1).max(1);
        let ticks = f64::from(settings.encoder_ticks_per_rev.unwrap_or(1));
        let rate_hz = f64::from(settings.sample_rate_hz);
        Controller {
            sample_s: 1.0 / rate_hz,
            speed: if cascade {
                gains(settings.speed_kp_a_s_per_rad, settings.speed_ki_a_per_rad)
            } else {
                gains(
                    Some(motor.speed_loop_kp_v_s_per_rad),
                    Some(motor.speed_loop_ki_v_per_rad),
                )
            },
            inner: cascade.then(|| {
                (
                    gains(settings.current_kp_v_per_a, settings.current_ki_v_per_a_s),
                    limit_a,
                )
            }),
            ticks_per_rev: settings.encoder_ticks_per_rev.map(f64::from),
            tick_rad_per_s: TAU * rate_hz / (ticks * f64::from(window)),
            speed_integral: 0.0,
            current_integral: 0.0,
            delayed_v: vec![0.0; settings.computation_delay_samples as usize],
            counts: vec![0; window as usize],
        }
    }

    /// Speed of one encoder count in the window, 2 pi / (n w T), rad/s: the resolution of the estimate. `None` without an encoder.
    pub fn speed_resolution_rad_per_s(&self) -> Option<f64> {
        self.ticks_per_rev.map(|_| self.tick_rad_per_s)
    }

    /// Counts at an absolute wheel angle: floor(n angle / 2 pi); 0 without an encoder.
    pub fn count_at(&self, wheel_rad: f64) -> i64 {
        self.ticks_per_rev
            .map_or(0, |ticks| (wheel_rad * ticks / TAU).floor() as i64)
    }

    /// Motor voltage until the next sample, V.
    ///
    /// - Never NaN: an input that is not finite gives 0 V in its place and leaves the integrals as they are.
    pub fn step(&mut self, sample: &ControlSample) -> f64 {
        let error_rad_per_s = sample.command_rad_per_s - self.speed_rad_per_s(sample);
        let outer_limit = self.inner.map_or(sample.bus_v, |(_, limit_a)| limit_a);
        let (integral, wanted) = self
            .speed
            .step(self.speed_integral, error_rad_per_s, self.sample_s, outer_limit);
        self.speed_integral = integral;
        let mut voltage_v = wanted;
        if let Some((gains, _)) = &self.inner {
            let error_a = wanted - sample.current_a;
            (self.current_integral, voltage_v) =
                gains.step(self.current_integral, error_a, self.sample_s, sample.bus_v);
        }
        shifted(&mut self.delayed_v, voltage_v)
    }

    fn speed_rad_per_s(&mut self, sample: &ControlSample) -> f64 {
        if self.ticks_per_rev.is_none() {
            return sample.wheel_rad_per_s;
        }
        let oldest = shifted(&mut self.counts, sample.encoder_count);
        sample.encoder_count.saturating_sub(oldest) as f64 * self.tick_rad_per_s
    }

    /// As if the wheel had long moved like this under this control.
    fn take_over(&mut self, motion: &Motion) {
        let outer = match &self.inner {
            None => (motion.voltage_v, motion.bus_v),
            Some((gains, limit_a)) => {
                self.current_integral = gains.settled(motion.voltage_v, motion.bus_v);
                (motion.current_a, *limit_a)
            }
        };
        self.speed_integral = self.speed.settled(outer.0, outer.1);
        self.delayed_v
            .fill(motion.voltage_v.min(motion.bus_v).max(-motion.bus_v));
        let window = self.counts.len();
        for index in 0..window {
            let ago_s = (window - index) as f64 * self.sample_s;
            self.counts[index] = self.count_at(motion.wheel_rad - ago_s * motion.wheel_rad_per_s);
        }
    }

    /// What it remembers, in a fixed order.
    fn words(&self) -> impl Iterator<Item = f64> + '_ {
        [self.speed_integral, self.current_integral]
            .into_iter()
            .chain(self.delayed_v.iter().copied())
            .chain(self.counts.iter().map(|count| *count as f64))
    }

    fn word_count(&self) -> usize {
        2 + self.delayed_v.len() + self.counts.len()
    }

    /// Inverse of [`Controller::words`]; `words` must be as many.
    fn restore(&mut self, words: &[f64]) {
        (self.speed_integral, self.current_integral) = (words[0], words[1]);
        let (delayed, counts) = words[2..].split_at(self.delayed_v.len());
        self.delayed_v.copy_from_slice(delayed);
        for (count, word) in self.counts.iter_mut().zip(counts) {
            *count = *word as i64;
        }
    }
}

/// Puts a value at the end of a line and takes the oldest; the value itself when the line has no length.
fn shifted<T: Copy>(line: &mut [T], value: T) -> T {
    let Some(oldest) = line.first().copied() else {
        return value;
    };
    line.rotate_left(1);
    if let Some(last) = line.last_mut() {
        *last = value;
    }
    oldest
}
