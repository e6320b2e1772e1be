//! State of the robot at a moment of a run, from its measurements around that moment.

use twin::free::Start;
use twin::pose::{Pose, wrapped_rad};
use twin::twist::BodyTwist;

use crate::bundle::{Bundle, Series, Telemetry};
use crate::channel::Channel;
use crate::steering_history::Walk;

/// Half width of the window that poses are fitted over, s; wider where poses are rare, in their median period.
const HALF_WINDOW_S: f64 = 0.1;
const HALF_WINDOW_PERIODS: f64 = 2.6;
const WIDEST_HALF_WINDOW_S: f64 = 0.4;
/// Fewest poses in a window.
const MIN_POSES: usize = 5;
/// Poses on each side that a pose is compared with.
const NEIGHBOURS: usize = 4;
/// Distance from the median of its neighbours that makes a pose a tracker error, m.
const OUTLIER_M: f64 = 0.05;
/// The same for the yaw, rad; trackers flip tags by quarter and half turns.
const OUTLIER_RAD: f64 = 0.5;
/// A step of the path longer than this and what the fastest robot drives in the time is a break, m and m/s.
const BREAK_M: f64 = 0.3;
const BREAK_M_PER_S: f64 = 15.0;
/// Oldest wheel, current or steering sample that still describes the anchor, s.
const MAX_AGE_S: f64 = 0.1;

/// Measured poses of a run.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Row numbers in the telemetry, growing.
    pub rows: Vec<usize>,
    /// `time_s` less the pose latency.
    pub time_s: Vec<f64>,
    /// Yaw not wrapped.
    pub poses: Vec<Pose>,
    /// Poses left out as tracker errors.
    pub outliers: u32,
    /// Half width of the window that poses are fitted over, s.
    pub half_window_s: f64,
}

impl Track {
    /// The rows that have all three pose columns, without flips and jumps of the tracker.
    pub fn of(bundle: &Bundle) -> Track {
        let telemetry = &bundle.telemetry;
        let series = [Channel::PoseX, Channel::PoseY, Channel::PoseYaw].map(|channel| telemetry.series(channel));
        let [Some(x), Some(y), Some(yaw)] = series else {
            return Track::default();
        };
        let at = |series: &Series, row: u32| series.rows.binary_search(&row).ok().map(|index| series.values[index]);
        let mut all: Vec<(usize, Pose)> = Vec::new();
        for (row, x_m) in x.rows.iter().zip(&x.values) {
            let (Some(y_m), Some(yaw_rad)) = (at(y, *row), at(yaw, *row)) else {
                continue;
            };
            all.push((
                *row as usize,
                Pose {
                    x_m: *x_m,
                    y_m,
                    yaw_rad,
                },
            ));
        }
        let mut track = Track::default();
        for (index, (row, pose)) in all.iter().enumerate() {
            if is_outlier(&all, index) {
                track.outliers += 1;
                continue;
            }
            let yaw_rad = track.poses.last().map_or(pose.yaw_rad, |before| {
                before.yaw_rad + wrapped_rad(pose.yaw_rad - before.yaw_rad)
            });
            track.rows.push(*row);
            track.time_s.push(telemetry.time_s[*row] - bundle.run.pose_latency_s);
            track.poses.push(Pose { yaw_rad, ..*pose });
        }
        let mut periods: Vec<f64> = track.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        periods.sort_by(f64::total_cmp);
        let period_s = periods.get(periods.len() / 2).copied().unwrap_or(0.0);
        track.half_window_s = (HALF_WINDOW_PERIODS * period_s).clamp(HALF_WINDOW_S, WIDEST_HALF_WINDOW_S);
        track
    }

    /// Times of poses that do not follow from the one before: the tracker lost the robot, or took up another one.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = Vec::new();
        for k in 1..self.poses.len() {
            let (a, b) = (&self.poses[k - 1], &self.poses[k]);
            let (dx_m, dy_m) = (b.x_m - a.x_m, b.y_m - a.y_m);
            let most_m = BREAK_M + BREAK_M_PER_S * (self.time_s[k] - self.time_s[k - 1]);
            if dx_m * dx_m + dy_m * dy_m > most_m * most_m {
                breaks.push(self.time_s[k]);
            }
        }
        breaks
    }

    /// Pose and world velocity at a time by least squares of a parabola over 0.2 s of poses (more where they are rare).
    ///
    /// - `None` with fewer than five poses there, or all of them on one side.
    pub fn fitted(&self, time_s: f64) -> Option<(Pose, [f64; 3])> {
        let from = self.time_s.partition_point(|t| *t < time_s - self.half_window_s);
        let to = self.time_s.partition_point(|t| *t <= time_s + self.half_window_s);
        if to < from + MIN_POSES || self.time_s[from] > time_s || self.time_s[to - 1] < time_s {
            return None;
        }
        let mut moments = [0.0; 5];
        let mut sums = [[0.0; 3]; 3];
        for index in from..to {
            // In windows, so that the equations are well scaled.
            let t = (self.time_s[index] - time_s) / self.half_window_s;
            let powers = [1.0, t, t * t];
            for (order, moment) in moments.iter_mut().enumerate() {
                *moment += powers[order.min(2)] * powers[order - order.min(2)];
            }
            let pose = &self.poses[index];
            for (sum, value) in sums.iter_mut().zip([pose.x_m, pose.y_m, pose.yaw_rad]) {
                for (part, power) in sum.iter_mut().zip(powers) {
                    *part += power * value;
                }
            }
        }
        let fits = sums.map(|sum| parabola(&moments, &sum));
        let [Some(x), Some(y), Some(yaw)] = fits else {
            return None;
        };
        let pose = Pose {
            x_m: x[0],
            y_m: y[0],
            yaw_rad: yaw[0],
        };
        Some((pose, [x[1], y[1], yaw[1]].map(|slope| slope / self.half_window_s)))
    }
}

/// True when a pose lies apart from the median of its neighbours.
fn is_outlier(all: &[(usize, Pose)], index: usize) -> bool {
    let from = index.saturating_sub(NEIGHBOURS);
    let near = &all[from..(index + NEIGHBOURS + 1).min(all.len())];
    let pose = &all[index].1;
    let median = |offset: &dyn Fn(&Pose) -> f64| {
        let mut offsets: Vec<f64> = near.iter().map(|(_, other)| offset(other)).collect();
        offsets.sort_by(f64::total_cmp);
        offsets[offsets.len() / 2]
    };
    let dx_m = median(&|other| other.x_m - pose.x_m);
    let dy_m = median(&|other| other.y_m - pose.y_m);
    // Sizes: half turns to either side are the same.
    let turn_rad = median(&|other| wrapped_rad(other.yaw_rad - pose.yaw_rad).abs());
    dx_m * dx_m + dy_m * dy_m > OUTLIER_M * OUTLIER_M || turn_rad > OUTLIER_RAD
}

/// Solves the normal equations of c0 + c1 t + c2 t^2 by Cramer's rule.
fn parabola(m: &[f64; 5], s: &[f64; 3]) -> Option<[f64; 2]> {
    let det = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1]) + c[0] * (a[1] * b[2] - a[2] * b[1])
    };
    let columns = [[m[0], m[1], m[2]], [m[1], m[2], m[3]], [m[2], m[3], m[4]]];
    let whole = det(columns[0], columns[1], columns[2]);
    if whole.abs() < 1e-9 {
        return None;
    }
    Some([
        det(*s, columns[1], columns[2]) / whole,
        det(columns[0], *s, columns[2]) / whole,
    ])
}

/// The last sample not older than [`MAX_AGE_S`].
fn recent(telemetry: &Telemetry, channel: Channel, row: usize) -> Option<f64> {
    let series = telemetry.series(channel)?;
    let after = series.rows.partition_point(|sample| *sample as usize <= row);
    let index = after.checked_sub(1)?;
    let age_s = telemetry.time_s[row] - telemetry.time_s[series.rows[index] as usize];
    (age_s <= MAX_AGE_S).then(|| series.values[index])
}

/// Start of a prediction at a telemetry row: fitted pose and twist; wheel speeds, currents and steering as last measured.
///
/// - `board_row`: the row up to which on-board channels are read; `row` unless the robot's clock is known to be off.
/// - `steered`: a pass over the steering of the bundle; board rows grow from call to call.
/// - Without wheel speeds the slip-free speeds of the twist are taken; without currents none.
/// - `None` when the poses around the row do not carry a fit.
pub fn start_at(bundle: &Bundle, track: &Track, (row, board_row): (usize, usize), steered: &mut Walk) -> Option<Start> {
    let (pose, [vx, vy, yaw_rate]) = track.fitted(bundle.telemetry.time_s[row])?;
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let twist = BodyTwist {
        forward_m_per_s: vx * cos + vy * sin,
        left_m_per_s: vy * cos - vx * sin,
        yaw_rate_rad_per_s: yaw_rate,
    };
    let telemetry = &bundle.telemetry;
    let steering_rad = recent(telemetry, Channel::Steering, board_row)
        .or_else(|| telemetry.series(Channel::CommandSteering)?.held(row))
        .unwrap_or(0.0);
    let mut start = Start {
        pose,
        twist,
        steering_rad,
        steering_history: steered.until(bundle.telemetry.time_s[board_row]),
        ..Start::default()
    };
    let rolling = bundle.robot.wheel_speeds_holding(twist, steering_rad);
    for (wheel, described) in bundle.run.robot.wheels.iter().enumerate() {
        let measured = recent(telemetry, Channel::WheelSpeed(wheel), board_row);
        // Passive wheels without an encoder roll with the contact point.
        let passive = || {
            let (s, c) = libm::sincos(described.rolling_direction_rad);
            let along = c * (twist.forward_m_per_s - twist.yaw_rate_rad_per_s * described.y_m)
                + s * (twist.left_m_per_s + twist.yaw_rate_rad_per_s * described.x_m);
            described.radius_m.map_or(0.0, |radius_m| along / radius_m)
        };
        let slip_free = if described.driven {
            rolling.wheel_rad_per_s[wheel]
        } else {
            passive()
        };
        start.wheel_rad_per_s[wheel] = measured.unwrap_or(slip_free);
        start.current_a[wheel] = recent(telemetry, Channel::Current(wheel), board_row).unwrap_or(0.0);
    }
    Some(start)
}
