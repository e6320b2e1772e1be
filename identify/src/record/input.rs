//! Measured channels as inputs of a simulation: lines between samples, never derivatives of noise.

use super::smooth::smoothed;
use crate::bundle::Bundle;
use crate::channel::Channel;

/// Samples of a channel with their times.
#[derive(Debug, Clone, Default)]
pub struct Line {
    pub time_s: Vec<f64>,
    pub values: Vec<f64>,
}

/// Longest gap that a line bridges, s.
const LONGEST_BRIDGE_S: f64 = 0.3;

impl Line {
    /// A channel of a run; `None` when it is absent or constant although it should move.
    pub fn of(bundle: &Bundle, channel: Channel) -> Option<Line> {
        let series = bundle.telemetry.series(channel)?;
        if series.values.len() < 10 {
            return None;
        }
        let time_s = series
            .rows
            .iter()
            .map(|row| bundle.telemetry.time_s[*row as usize])
            .collect();
        Some(Line {
            time_s,
            values: series.values.clone(),
        })
    }

    /// Value at a time, linear between samples; the ends hold.
    pub fn at(&self, time_s: f64) -> f64 {
        self.before(self.time_s.partition_point(|t| *t < time_s), time_s)
    }

    /// The same for times that grow from call to call.
    ///
    /// - `after`: the first sample that is not before the time of the call before; 0 at first.
    pub fn next_at(&self, time_s: f64, after: &mut usize) -> f64 {
        if *after == 0 {
            *after = self.time_s.partition_point(|t| *t < time_s);
        }
        while self.time_s.get(*after).is_some_and(|t| *t < time_s) {
            *after += 1;
        }
        self.before(*after, time_s)
    }

    /// Value at a time before which sample `after` is the first that does not lie.
    fn before(&self, after: usize, time_s: f64) -> f64 {
        match (after.checked_sub(1), self.values.get(after)) {
            (Some(before), Some(value)) => {
                let (t0, t1) = (self.time_s[before], self.time_s[after]);
                let part = (time_s - t0) / (t1 - t0);
                self.values[before] + part * (value - self.values[before])
            }
            (None, Some(value)) => *value,
            (Some(before), None) => self.values[before],
            (None, None) => 0.0,
        }
    }

    /// True when there is no long gap in a span of time.
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let first = self.time_s.partition_point(|t| *t < from_s).saturating_sub(1);
        let last = self.time_s.partition_point(|t| *t <= to_s).min(self.time_s.len() - 1);
        self.time_s[first] <= from_s + LONGEST_BRIDGE_S
            && self.time_s[last] >= to_s - LONGEST_BRIDGE_S
            && self.time_s[first..=last]
                .windows(2)
                .all(|pair| pair[1] - pair[0] <= LONGEST_BRIDGE_S)
    }
}

/// What drives the rolling stage: measured wheels and steering.
#[derive(Debug, Clone)]
pub struct RollingInput {
    /// By position in `wheels`; angles where the run has them, else speeds. None for wheels that are not driven.
    pub wheels: Vec<Option<WheelLine>>,
    pub steering: Option<Line>,
}

/// How a wheel's motion was measured.
#[derive(Debug, Clone)]
pub enum WheelLine {
    Angle(Line),
    Speed(Line),
}

impl WheelLine {
    /// Mean speeds of spans of time, rad/s, each `(from_s, to_s)`; their beginnings grow, and their ends.
    pub fn speeds(&self, spans: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
        let (mut first, mut second) = (0, 0);
        spans
            .map(|(from_s, to_s)| match self {
                WheelLine::Angle(line) => {
                    (line.next_at(to_s, &mut second) - line.next_at(from_s, &mut first)) / (to_s - from_s)
                }
                WheelLine::Speed(line) => line.next_at(0.5 * (from_s + to_s), &mut first),
            })
            .collect()
    }

    fn line(&self) -> &Line {
        match self {
            WheelLine::Angle(line) | WheelLine::Speed(line) => line,
        }
    }
}

impl RollingInput {
    /// `None` when a driven wheel has neither angle nor speed.
    pub fn of(bundle: &Bundle) -> Option<RollingInput> {
        let mut wheels = Vec::new();
        for (k, wheel) in bundle.run.robot.wheels.iter().enumerate() {
            if !wheel.driven {
                wheels.push(None);
                continue;
            }
            let angle = Line::of(bundle, Channel::WheelAngle(k)).map(WheelLine::Angle);
            let line = angle.or_else(|| Line::of(bundle, Channel::WheelSpeed(k)).map(WheelLine::Speed))?;
            wheels.push(Some(line));
        }
        wheels.iter().any(Option::is_some).then(|| RollingInput {
            wheels,
            steering: Line::of(bundle, Channel::Steering)
                .filter(|_| bundle.run.robot.steering.is_some())
                .map(|line| smoothed(&line)),
        })
    }

    /// True when all inputs have samples in a span of time.
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        self.wheels
            .iter()
            .flatten()
            .all(|wheel| wheel.line().covers(from_s, to_s))
            && self.steering.as_ref().is_none_or(|line| line.covers(from_s, to_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Line {
        let time_s: Vec<f64> = (0..200)
            .map(|k| 0.01 * k as f64 + 0.003 * libm::sin(k as f64))
            .collect();
        let values = time_s.iter().map(|t| libm::sin(7.0 * t)).collect();
        Line { time_s, values }
    }

    #[test]
    fn values_in_a_row_are_those_one_by_one() {
        let line = line();
        for begin_s in [-0.1, 0.0, 0.55, 1.5, 2.5] {
            let mut after = 0;
            for k in 0..150 {
                let time_s = begin_s + 0.0083 * f64::from(k);
                assert_eq!(
                    line.next_at(time_s, &mut after).to_bits(),
                    line.at(time_s).to_bits(),
                    "{time_s}"
                );
            }
        }
    }

    #[test]
    fn mean_speeds_of_spans_are_differences_of_angles() {
        let spans = || (0..100).map(|k| (0.0083 * f64::from(k), 0.0083 * f64::from(k) + 0.02));
        let speeds = WheelLine::Angle(line()).speeds(spans());
        for ((from_s, to_s), speed) in spans().zip(&speeds) {
            let exact = (line().at(to_s) - line().at(from_s)) / (to_s - from_s);
            assert_eq!(speed.to_bits(), exact.to_bits());
        }
        let measured = WheelLine::Speed(line()).speeds(spans());
        let halfway = spans().map(|(from_s, to_s)| line().at(0.5 * (from_s + to_s)));
        assert!(
            halfway
                .zip(&measured)
                .all(|(exact, speed)| exact.to_bits() == speed.to_bits())
        );
        assert_eq!(measured.len(), 100);
    }
}
