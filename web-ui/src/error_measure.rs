//! How far a robot is from its path, and how far twin and measurement are apart.

use api::experiment::Experiment;
use api::verdict::{Replay, ReplayRobot};

/// Threshold of the paper: 30 px at 2.5 mm a pixel.
pub const BAND_M: f64 = 0.075;

/// How far along the path the search for the active point reaches beyond the progress made, metres.
/// Long enough to turn round at a waypoint before it is touched, too short to leave out a leg.
const AHEAD_M: f64 = 0.3;

/// The path of a robot that follows waypoints: its start, then its targets in order. `None` for laws without a path.
pub fn path(experiment: &Experiment, robot: usize) -> Option<Vec<[f64; 2]>> {
    if experiment.control.law != "waypoints" {
        return None;
    }
    let robot = experiment.robots.get(robot)?;
    let mut path = vec![[robot.start.x_m, robot.start.y_m]];
    for target in experiment
        .targets
        .iter()
        .filter(|t| t.robot.as_ref().is_none_or(|name| *name == robot.name))
    {
        let point = [target.x_m, target.y_m];
        if path.last().is_none_or(|last| distance(*last, point) > 1e-3) {
            path.push(point);
        }
    }
    (path.len() > 1).then_some(path)
}

/// Distance of each position to the active segment of the path, metres.
///
/// Progress along the path is monotone: a point of the path that lies behind the progress made counts no more, and the
/// search looks [`AHEAD_M`] ahead. So the way back is not mistaken for the way out where both lie on each other.
pub fn path_errors_m(path: &[[f64; 2]], positions: impl Iterator<Item = [f64; 2]>) -> Vec<f64> {
    let mut starts_m = vec![0.0];
    for leg in path.windows(2) {
        starts_m.push(starts_m.last().copied().unwrap_or(0.0) + distance(leg[0], leg[1]));
    }
    let mut progress_m = 0.0;
    positions
        .map(|position| {
            let (error_m, at_m) = nearest(path, &starts_m, progress_m, position);
            progress_m = at_m;
            error_m
        })
        .collect()
}

/// Distance to, and place of, the nearest point between the progress made and [`AHEAD_M`] beyond it.
fn nearest(path: &[[f64; 2]], starts_m: &[f64], progress_m: f64, position: [f64; 2]) -> (f64, f64) {
    let reach_m = progress_m + AHEAD_M;
    let mut best = (f64::INFINITY, progress_m);
    for (leg, ends_m) in path.windows(2).zip(starts_m.windows(2)) {
        let length_m = ends_m[1] - ends_m[0];
        let from_m = progress_m.max(ends_m[0]);
        let to_m = reach_m.min(ends_m[1]);
        if from_m > to_m || length_m <= 0.0 {
            continue;
        }
        let along = [(leg[1][0] - leg[0][0]) / length_m, (leg[1][1] - leg[0][1]) / length_m];
        let foot_m = (position[0] - leg[0][0]) * along[0] + (position[1] - leg[0][1]) * along[1];
        let at_m = (ends_m[0] + foot_m).clamp(from_m, to_m);
        let offset_m = at_m - ends_m[0];
        let point = [leg[0][0] + along[0] * offset_m, leg[0][1] + along[1] * offset_m];
        let error_m = distance(point, position);
        // A later point must be clearly nearer: at a turn both legs hold the same points.
        if error_m < best.0 - 1e-9 {
            best = (error_m, at_m);
        }
    }
    best
}

/// Distance between two motions of one robot at the times of `a`, as long as both last; `[time_s, metres]`.
pub fn gap_m(a: (&ReplayRobot, f64), b: (&ReplayRobot, f64)) -> Vec<[f64; 2]> {
    a.0.poses
        .iter()
        .enumerate()
        .map_while(|(frame, pose)| {
            let time_s = frame as f64 * a.1;
            let other = position_at(b.0, b.1, time_s)?;
            Some([time_s, distance([pose[0], pose[1]], other)])
        })
        .collect()
}

fn position_at(robot: &ReplayRobot, period_s: f64, time_s: f64) -> Option<[f64; 2]> {
    let last = robot.poses.len().checked_sub(1)?;
    if time_s > last as f64 * period_s + 1e-9 {
        return None;
    }
    pose_at(robot, period_s, time_s).map(|p| [p[0], p[1]])
}

/// Pose at a time, straight between frames (yaw the short way round); holds the first and last.
pub fn pose_at(robot: &ReplayRobot, period_s: f64, time_s: f64) -> Option<[f64; 3]> {
    let last = robot.poses.len().checked_sub(1)?;
    let place = if period_s > 0.0 {
        (time_s / period_s).clamp(0.0, last as f64)
    } else {
        0.0
    };
    let frame = place.floor() as usize;
    let a = robot.poses[frame];
    let b = robot.poses[(frame + 1).min(last)];
    let share = place - frame as f64;
    let turn = (b[2] - a[2] + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    Some([
        a[0] + (b[0] - a[0]) * share,
        a[1] + (b[1] - a[1]) * share,
        a[2] + turn * share,
    ])
}

/// The robot of this name in a recording.
pub fn robot<'a>(replay: &'a Replay, name: &str) -> Option<&'a ReplayRobot> {
    replay.robots.iter().find(|r| r.name == name)
}

pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Template;

    fn out_and_back() -> Vec<[f64; 2]> {
        path(&Template::RectangleOmni4.experiment(), 0).expect("waypoints have a path")
    }

    #[test]
    fn the_path_starts_at_the_robot_and_repeats_no_point() {
        assert_eq!(
            out_and_back(),
            [[-1.0, -0.5], [-1.0, 0.5], [1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5]]
        );
        assert_eq!(path(&Template::SwapCorners.experiment(), 0), None);
    }

    #[test]
    fn a_robot_on_the_path_has_no_error_even_where_the_ways_overlap() {
        let path = out_and_back();
        let mut walk = Vec::new();
        for leg in path.windows(2) {
            for step in 0..=100 {
                let s = f64::from(step) / 100.0;
                walk.push([
                    leg[0][0] + (leg[1][0] - leg[0][0]) * s,
                    leg[0][1] + (leg[1][1] - leg[0][1]) * s,
                ]);
            }
        }
        let errors = path_errors_m(&path, walk.into_iter());
        assert!(
            errors.iter().all(|e| *e < 1e-9),
            "{:?}",
            errors.iter().copied().fold(0.0, f64::max)
        );
    }

    #[test]
    fn leaving_out_a_leg_is_an_error() {
        // Straight back down after the first corner: the long leg out to x = 1 is missing.
        let walk = (0..=100)
            .map(|n| [-1.0, -0.5 + f64::from(n) * 0.01])
            .chain((0..=100).map(|n| [-1.0, 0.5 - f64::from(n) * 0.01]));
        let errors = path_errors_m(&out_and_back(), walk);
        assert!(errors[..=100].iter().all(|e| *e < 1e-9));
        assert!(
            (errors.last().copied().unwrap_or(0.0) - 1.0).abs() < 1e-9,
            "{:?}",
            errors.last()
        );
    }

    #[test]
    fn turning_short_of_the_waypoint_costs_nothing_but_overshoot_counts() {
        let path = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]];
        let short = (0..=95)
            .map(|n| [f64::from(n) * 0.01, 0.02])
            .chain((0..=95).rev().map(|n| [f64::from(n) * 0.01, 0.02]));
        assert!(path_errors_m(&path, short).iter().all(|e| (e - 0.02).abs() < 1e-9));
        let over = (0..=110).map(|n| [f64::from(n) * 0.01, 0.0]);
        let last = path_errors_m(&path, over).last().copied();
        assert!(last.is_some_and(|e| (e - 0.1).abs() < 1e-9), "{last:?}");
    }

    #[test]
    fn gap_is_taken_at_equal_times_while_both_last() {
        let robot = |poses: &[[f64; 3]]| ReplayRobot {
            name: "a".to_owned(),
            poses: poses.to_vec(),
            targets: Vec::new(),
        };
        let slow = robot(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        let fast = robot(&[[0.0, 0.0, 0.0], [0.5, 0.3, 0.0], [1.0, 0.4, 0.0], [9.0, 0.0, 0.0]]);
        let gap = gap_m((&fast, 0.5), (&slow, 1.0));
        assert_eq!(gap.len(), 3);
        assert!((gap[1][1] - 0.3).abs() < 1e-12 && (gap[2][1] - 0.4).abs() < 1e-12);
    }

    #[test]
    fn yaw_turns_the_short_way_between_frames() {
        let robot = ReplayRobot {
            name: "a".to_owned(),
            poses: vec![[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]],
            targets: Vec::new(),
        };
        let yaw = pose_at(&robot, 1.0, 0.5).expect("frames")[2];
        assert!((yaw.abs() - std::f64::consts::PI).abs() < 1e-9, "{yaw}");
    }
}
