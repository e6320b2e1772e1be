//! Measured less predicted in a window.

use twin::pose::wrapped_rad;

use crate::rollout::Moment;
use crate::window::{PoseSample, Reading, Window};

/// What errors are counted together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Place, forward and left.
    Position,
    Yaw,
    /// From the poses.
    Twist,
    YawRate,
    Wheel,
    Gyro,
}

/// Number of [`Class`]es.
pub const CLASSES: usize = 6;

/// One difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    pub class: Class,
    /// Since the window's start.
    pub time_s: f64,
    pub value: f64,
}

/// The prediction as it is laid on the measurement at the anchor.
struct Laid {
    cos: f64,
    sin: f64,
    turn_rad: f64,
    x_m: f64,
    y_m: f64,
}

impl Laid {
    /// The rigid motion that takes predicted to measured poses around the anchor, on average.
    fn on(window: &Window, path: &[Moment]) -> Option<Laid> {
        let near = |pose: &&PoseSample| (pose.time_s - window.anchor_s()).abs() <= window.half_window_s;
        let (mut measured, mut predicted, mut count) = ([0.0; 3], [0.0; 3], 0.0);
        let mut base_rad = None;
        for pose in window.poses.iter().filter(near) {
            let moment = Moment::at(path, pose.time_s)?;
            let base = *base_rad.get_or_insert(pose.yaw_rad - moment.yaw_rad);
            measured[0] += pose.x_m;
            measured[1] += pose.y_m;
            measured[2] += base + wrapped_rad(pose.yaw_rad - moment.yaw_rad - base);
            predicted[0] += moment.x_m;
            predicted[1] += moment.y_m;
            count += 1.0;
        }
        if count == 0.0 {
            return None;
        }
        let turn_rad = measured[2] / count;
        let (sin, cos) = libm::sincos(turn_rad);
        Some(Laid {
            cos,
            sin,
            turn_rad,
            x_m: (measured[0] - (cos * predicted[0] - sin * predicted[1])) / count,
            y_m: (measured[1] - (sin * predicted[0] + cos * predicted[1])) / count,
        })
    }

    /// Forward, left and yaw error of a pose, in the measured body frame.
    fn error(&self, pose: &PoseSample, moment: &Moment) -> [f64; 3] {
        let dx = pose.x_m - (self.x_m + self.cos * moment.x_m - self.sin * moment.y_m);
        let dy = pose.y_m - (self.y_m + self.sin * moment.x_m + self.cos * moment.y_m);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        [
            dx * cos + dy * sin,
            dy * cos - dx * sin,
            wrapped_rad(pose.yaw_rad - moment.yaw_rad - self.turn_rad),
        ]
    }
}

/// Differences after the anchor; always in the same order for a window.
///
/// - `poses`: place and yaw; without them twists of the poses stand in.
pub fn differences(window: &Window, path: &[Moment], poses: bool) -> Option<Vec<Difference>> {
    let mut out = Vec::with_capacity(3 * window.poses.len() + window.samples.len());
    if poses {
        let laid = Laid::on(window, path)?;
        for pose in window.poses.iter().filter(|pose| pose.time_s > window.anchor_s()) {
            let error = laid.error(pose, &Moment::at(path, pose.time_s)?);
            for (class, value) in [Class::Position, Class::Position, Class::Yaw].into_iter().zip(error) {
                out.push(Difference {
                    class,
                    time_s: pose.time_s,
                    value,
                });
            }
        }
    }
    for sample in &window.samples {
        let moment = Moment::at(path, sample.time_s)?;
        let (class, predicted) = match sample.reading {
            Reading::Wheel(k) => (Class::Wheel, moment.wheel_rad_per_s[k]),
            Reading::Gyro => (Class::Gyro, moment.gyro_rad_per_s),
            _ if poses => continue,
            Reading::Forward => (Class::Twist, moment.twist[0]),
            Reading::Left => (Class::Twist, moment.twist[1]),
            Reading::YawRate => (Class::YawRate, moment.twist[2]),
        };
        out.push(Difference {
            class,
            time_s: sample.time_s,
            value: sample.value - predicted,
        });
    }
    Some(out)
}

/// A measured pose this close to a horizon stands for it, s; as in `identify::gap`.
const HORIZON_TOLERANCE_S: f64 = 0.05;

/// Forward, left and yaw error at a horizon after the anchor; `None` without a pose there.
pub fn pose_error(window: &Window, path: &[Moment], horizon_s: f64) -> Option<[f64; 3]> {
    let wanted_s = window.anchor_s() + horizon_s;
    let distance = |pose: &&PoseSample| (pose.time_s - wanted_s).abs();
    let nearest = window.poses.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    if distance(&nearest) > HORIZON_TOLERANCE_S {
        return None;
    }
    Some(Laid::on(window, path)?.error(nearest, &Moment::at(path, nearest.time_s)?))
}
