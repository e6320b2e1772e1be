//! A prediction through a window.

use twin::MAX_WHEELS;
use twin::free::RobotState;
use twin::pose::wrapped_rad;
use twin::replay::{Tick, replay_pushed};
use twin::residual::AXES;
use twin::robot::Robot;

use crate::window::Window;

/// Predicted motion at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    pub time_s: f64,
    pub x_m: f64,
    pub y_m: f64,
    /// Not wrapped.
    pub yaw_rad: f64,
    /// Forward, left, yaw rate.
    pub twist: [f64; 3],
    pub wheel_rad_per_s: [f64; MAX_WHEELS],
    pub gyro_rad_per_s: f64,
}

/// Something that predicts a robot's motion from a window's start and its commands.
pub trait Predictor: Sync {
    /// Moments in the order of time over the whole window; `None` when it cannot predict.
    fn path(&self, window: &Window) -> Option<Vec<Moment>>;
}

impl Predictor for Robot {
    fn path(&self, window: &Window) -> Option<Vec<Moment>> {
        driven(self, window, &mut |_| None)
    }
}

/// The twin driven through a window.
///
/// - `push`: outputs besides the model's own; see [`replay_pushed`].
pub fn driven(
    robot: &Robot,
    window: &Window,
    push: &mut dyn FnMut(&Tick) -> Option<[f64; AXES]>,
) -> Option<Vec<Moment>> {
    let mut start = window.start;
    if robot.description().motor.is_none() {
        start.current_a = Default::default();
    }
    let rows = replay_pushed(robot, &start, window.before, &window.earlier, &window.rows, push).ok()?;
    let mut path: Vec<Moment> = Vec::with_capacity(rows.len());
    for row in rows {
        let mut moment = Moment::of(row.time_s, &row.state);
        if let Some(before) = path.last() {
            moment.yaw_rad = before.yaw_rad + wrapped_rad(moment.yaw_rad - before.yaw_rad);
        }
        path.push(moment);
    }
    Some(path)
}

impl Moment {
    fn of(time_s: f64, state: &RobotState) -> Moment {
        Moment {
            time_s,
            x_m: state.pose.x_m,
            y_m: state.pose.y_m,
            yaw_rad: state.pose.yaw_rad,
            twist: [
                state.twist.forward_m_per_s,
                state.twist.left_m_per_s,
                state.twist.yaw_rate_rad_per_s,
            ],
            wheel_rad_per_s: state.wheel_rad_per_s,
            gyro_rad_per_s: state.gyro_z_rad_per_s,
        }
    }

    /// Linear between two; the ends hold.
    pub fn at(path: &[Moment], time_s: f64) -> Option<Moment> {
        let after = path.partition_point(|moment| moment.time_s < time_s);
        let (Some(before), Some(b)) = (after.checked_sub(1), path.get(after)) else {
            return path.get(after.min(path.len().saturating_sub(1))).copied();
        };
        let a = &path[before];
        let part = (time_s - a.time_s) / (b.time_s - a.time_s);
        let mix = |a: f64, b: f64| a + part * (b - a);
        let mut out = *a;
        out.time_s = time_s;
        (out.x_m, out.y_m) = (mix(a.x_m, b.x_m), mix(a.y_m, b.y_m));
        out.yaw_rad = mix(a.yaw_rad, b.yaw_rad);
        out.gyro_rad_per_s = mix(a.gyro_rad_per_s, b.gyro_rad_per_s);
        for (value, end) in out.twist.iter_mut().zip(b.twist) {
            *value = mix(*value, end);
        }
        for (value, end) in out.wheel_rad_per_s.iter_mut().zip(b.wheel_rad_per_s) {
            *value = mix(*value, end);
        }
        Some(out)
    }
}
