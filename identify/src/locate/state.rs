//! What a robot was told to do, and where and when, at every residual.

use crate::record::Record;
use twin::robot::Robot;

/// A change of set-points is that since so long before, s.
const CHANGE_S: f64 = 0.3;

/// A state variable that residuals are sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    Forward,
    Left,
    YawRate,
    Command,
    CommandChange,
    Elapsed,
    Heading,
}

/// All variables with their words and units.
pub const VARIABLES: [(Variable, &str, &str); 7] = [
    (Variable::Forward, "commanded forward speed", "m/s"),
    (Variable::Left, "commanded left speed", "m/s"),
    (Variable::YawRate, "commanded yaw rate", "rad/s"),
    (Variable::Command, "largest wheel set-point", "rad/s"),
    (Variable::CommandChange, "set-point change in 0.3 s", "rad/s"),
    (Variable::Elapsed, "time since the start", "s"),
    (Variable::Heading, "heading", "rad"),
];

/// State variables at every place of a record, in the order of its residuals.
pub fn states(robot: &Robot, record: &Record) -> Vec<[f64; VARIABLES.len()]> {
    let tracks: Vec<Vec<(f64, [f64; 5])>> = record
        .windows
        .iter()
        .map(|window| {
            let mut held = window.drive.held;
            let mut history: Vec<(f64, f64)> = Vec::new();
            let rows = window.drive.rows.iter();
            rows.map(|row| {
                held.apply(robot, row);
                let command = held.command();
                let twist = robot.twist_of_wheels(&command);
                let largest = command.wheel_rad_per_s.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
                let sum: f64 = command.wheel_rad_per_s.iter().sum();
                history.push((row.time_s, sum));
                let old = history.partition_point(|(t, _)| *t < row.time_s - CHANGE_S);
                let change = (sum - history[old.min(history.len() - 1)].1).abs();
                let state = [
                    twist.forward_m_per_s,
                    twist.left_m_per_s,
                    twist.yaw_rate_rad_per_s,
                    largest,
                    change,
                ];
                (row.time_s, state)
            })
            .collect()
        })
        .collect();
    let places = record.places().into_iter().map(|place| {
        let window = &record.windows[place.window];
        let track = &tracks[place.window];
        let at = track.partition_point(|(t, _)| *t < place.time_s).min(track.len() - 1);
        let [u, v, r, command, change] = track[at].1;
        [
            u,
            v,
            r,
            command,
            change,
            window.elapsed_s + place.time_s - window.start_s,
            twin::pose::wrapped_rad(window.start.pose.yaw_rad),
        ]
    });
    places.collect()
}
