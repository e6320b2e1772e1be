//! Wheel encoders: ticks, and the speed that a robot makes of them.

use core::f64::consts::TAU;
use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::state::RobotState;
use crate::{MAX_WHEELS, PHYSICS_PERIOD_S, SUBSTEPS};

/// Most samples in the window of the speed estimate.
pub const MAX_WINDOW_SAMPLES: u32 = 64;

/// Encoders of the driven wheels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// Absent: the angle is continuous and the speed that of the sampling instant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks: Option<TickSettings>,
    /// One standard deviation, added to the speed only.
    pub noise_rad_per_s: f64,
}

/// How an angle becomes ticks and ticks become a speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TickSettings {
    /// Edges of one turn of the wheel, gear and quadrature included.
    pub encoder_ticks_per_rev: u32,
    /// Samples back to the one that the speed is the mean since.
    pub window_samples: u32,
}

impl EncoderSettings {
    pub(super) fn ideal() -> EncoderSettings {
        EncoderSettings {
            every_steps: SUBSTEPS,
            ticks: None,
            noise_rad_per_s: 0.0,
        }
    }
}

impl TickSettings {
    /// Ticks counted at an absolute wheel angle: floor(n angle / 2 pi). Positive along the rolling direction.
    pub fn ticks(&self, wheel_rad: f64) -> i64 {
        (wheel_rad * f64::from(self.encoder_ticks_per_rev) / TAU).floor() as i64
    }

    /// Wheel angle of a tick, rad; never above the true angle and less than one tick below it.
    pub fn angle_rad(&self, ticks: i64) -> f64 {
        ticks as f64 * (TAU / f64::from(self.encoder_ticks_per_rev))
    }

    /// Mean speed over a window, rad/s: 2 pi ticks / (n interval); resolution 2 pi / (n interval).
    pub fn speed_rad_per_s(&self, window: TickWindow) -> f64 {
        self.angle_rad(window.ticks) / window.interval_s
    }
}

/// Ticks counted during an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TickWindow {
    pub ticks: i64,
    pub interval_s: f64,
}

/// What the encoders say; indexed by position in `wheels`, 0 where no motor drives the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EncoderReading {
    /// Absent without ticks in the settings.
    pub ticks: Option<[i64; MAX_WHEELS]>,
    /// Absolute, not wrapped, a whole number of ticks. Positive along the rolling direction.
    pub wheel_rad: [f64; MAX_WHEELS],
    pub wheel_rad_per_s: [f64; MAX_WHEELS],
}

/// Samples that the speed estimate looks back on, oldest first.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EncoderWindow {
    samples: VecDeque<(u64, [i64; MAX_WHEELS])>,
}

impl EncoderWindow {
    /// Reads the driven wheels. The first speed of a window is 0; until the window is full it reaches back to the first sample.
    pub(super) fn sample(
        &mut self,
        settings: &EncoderSettings,
        driven: &[bool; MAX_WHEELS],
        state: &RobotState,
        step: u64,
        noise: &mut NoiseStream,
    ) -> EncoderReading {
        let mut reading = EncoderReading {
            ticks: None,
            wheel_rad: [0.0; MAX_WHEELS],
            wheel_rad_per_s: [0.0; MAX_WHEELS],
        };
        for wheel in (0..MAX_WHEELS).filter(|wheel| driven[*wheel]) {
            reading.wheel_rad[wheel] = state.wheel_rad[wheel];
            reading.wheel_rad_per_s[wheel] = state.wheel_rad_per_s[wheel];
        }
        if let Some(counter) = &settings.ticks {
            self.count(counter, driven, step, &mut reading);
        }
        for wheel in (0..MAX_WHEELS).filter(|wheel| driven[*wheel]) {
            reading.wheel_rad_per_s[wheel] += noise.error(settings.noise_rad_per_s);
        }
        reading
    }

    /// Replaces continuous angles and speeds by counted ones.
    fn count(&mut self, counter: &TickSettings, driven: &[bool; MAX_WHEELS], step: u64, reading: &mut EncoderReading) {
        let mut ticks = [0; MAX_WHEELS];
        for wheel in (0..MAX_WHEELS).filter(|wheel| driven[*wheel]) {
            ticks[wheel] = counter.ticks(reading.wheel_rad[wheel]);
            reading.wheel_rad[wheel] = counter.angle_rad(ticks[wheel]);
        }
        let (oldest_step, oldest_ticks) = self.samples.front().copied().unwrap_or((step, ticks));
        let interval_s = step.saturating_sub(oldest_step) as f64 * PHYSICS_PERIOD_S;
        for wheel in (0..MAX_WHEELS).filter(|wheel| driven[*wheel]) {
            reading.wheel_rad_per_s[wheel] = if interval_s > 0.0 {
                counter.speed_rad_per_s(TickWindow {
                    ticks: ticks[wheel].saturating_sub(oldest_ticks[wheel]),
                    interval_s,
                })
            } else {
                0.0
            };
        }
        self.samples.push_back((step, ticks));
        while self.samples.len() as u64 > u64::from(counter.window_samples) {
            self.samples.pop_front();
        }
        reading.ticks = Some(ticks);
    }
}
