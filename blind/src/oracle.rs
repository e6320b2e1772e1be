//! What the plant itself says of a truth, frozen before anything is named: how far an effect shows.

use crate::drive::Trace;
use crate::sensing::Sensing;
use serde::{Deserialize, Serialize};
use twin::robot::RobotDescription;

/// An effect shows when the root mean square of what it changes is this many standard deviations of a sensor's noise, on
/// some channel.
pub const DETECTABLE: f64 = 0.5;
/// Channels of a report.
pub const CHANNELS: [&str; 8] = ["pose", "yaw", "wheel", "steering", "current", "bus", "gyro", "accel"];
/// Poses are compared as increments over this time, as windows of the diagnosis are.
const INCREMENT_S: f64 = 2.0;
const SAMPLE_S: f64 = 0.05;

/// One noise-free run with an effect and one without it on the same set-points.
pub struct Pair<'a> {
    pub with: (&'a Trace, &'a Sensing),
    pub without: (&'a Trace, &'a Sensing),
}

/// How far an effect shows on every channel: root mean square over the sensor's noise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Visible {
    pub ratios: Vec<f64>,
}

impl Visible {
    pub fn largest(&self) -> f64 {
        self.ratios.iter().copied().fold(0.0, f64::max)
    }

    pub fn is_detectable(&self) -> bool {
        self.largest() >= DETECTABLE
    }

    pub fn of(&self, channel: &str) -> f64 {
        let position = CHANNELS.iter().position(|other| *other == channel);
        position
            .and_then(|position| self.ratios.get(position))
            .copied()
            .unwrap_or(0.0)
    }
}

/// Sums of squares and counts by channel.
type Sums = [(f64, f64); CHANNELS.len()];

/// How far an effect shows in runs.
pub fn visible(robot: &RobotDescription, pairs: &[Pair<'_>]) -> Visible {
    let mut sums: Sums = Sums::default();
    let mut add = |channel: usize, square: f64| {
        sums[channel].0 += square;
        sums[channel].1 += 1.0;
    };
    let sigma = sigmas(robot);
    let motors = robot.wheels.iter().filter(|wheel| wheel.driven).count();
    for pair in pairs {
        let values = |side: (&Trace, &Sensing), at_s: f64| side.1.values(side.0, at_s);
        let count = (pair.with.0.duration_s().min(pair.without.0.duration_s()) / SAMPLE_S) as usize;
        for step in 1..count {
            let at_s = step as f64 * SAMPLE_S;
            let (a, b) = (values(pair.with, at_s), values(pair.without, at_s));
            for m in 0..motors {
                add(2, (a.wheel_rad_per_s[m] - b.wheel_rad_per_s[m]).powi(2));
                add(4, (a.current_a[m] - b.current_a[m]).powi(2));
            }
            add(3, (a.steering_rad - b.steering_rad).powi(2));
            add(5, (a.bus_v - b.bus_v).powi(2));
            add(6, (a.gyro_rad_per_s - b.gyro_rad_per_s).powi(2));
            for axis in 0..2 {
                add(7, (a.accel_m_per_s2[axis] - b.accel_m_per_s2[axis]).powi(2));
            }
            if at_s > INCREMENT_S {
                let before = at_s - INCREMENT_S;
                let moved_a = increment(pair.with.1.pose(pair.with.0, before), a.pose);
                let moved_b = increment(pair.without.1.pose(pair.without.0, before), b.pose);
                add(
                    0,
                    0.5 * ((moved_a[0] - moved_b[0]).powi(2) + (moved_a[1] - moved_b[1]).powi(2)),
                );
                add(1, (moved_a[2] - moved_b[2]).powi(2));
            }
        }
    }
    let ratios = sums.iter().zip(sigma).map(|((sum, count), sigma)| {
        let rms = (sum / count.max(1.0)).sqrt();
        (rms / sigma * 1e4).round() / 1e4
    });
    Visible {
        ratios: ratios.collect(),
    }
}

/// From one pose to the next in the axes of the first.
fn increment(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = from[2].sin_cos();
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    [cos * dx + sin * dy, cos * dy - sin * dx, to[2] - from[2]]
}

pub(crate) fn sigmas(robot: &RobotDescription) -> [f64; CHANNELS.len()] {
    let noise = robot.noise.clone().unwrap_or_default();
    [
        noise.pose_xy_m,
        noise.pose_yaw_rad,
        noise.wheel_rad_per_s,
        noise.steering_rad,
        noise.current_a,
        noise.bus_v,
        noise.gyro_rad_per_s,
        noise.accel_m_per_s2,
    ]
    .map(|sigma| sigma.unwrap_or(f64::INFINITY))
}
