//! Manoeuvres of ten seconds that every chassis can drive.

use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::pose::Pose;
use twin::replay::{CommandRow, ReplayRow, replay};
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

/// Those of the chassis table.
pub const SHOWN: [&str; 4] = ["straight", "circle", "slalom", "own"];
/// Those among which an effect is shown.
pub const FOR_EFFECTS: [&str; 6] = ["straight", "circle", "slalom", "own", "bursts", "slow"];
const RATE_HZ: f64 = 120.0;

pub fn title(name: &str) -> &'static str {
    match name {
        "straight" => "out and stop",
        "circle" => "circle",
        "slalom" => "slalom",
        "own" => "its own figure",
        "bursts" => "full speed, back and forth",
        _ => "slow reversals",
    }
}

fn twist(robot: &RobotDescription, name: &str, t: f64) -> (f64, f64, f64) {
    let sign = |on: bool| if on { 1.0 } else { -1.0 };
    match name {
        "straight" => (if t < 4.0 { 0.5 } else { 0.0 }, 0.0, 0.0),
        "circle" => (0.5, 0.0, 0.8),
        "slalom" => (0.5, 0.0, 1.4 * (1.5 * t).sin()),
        "bursts" => (1.8 * sign(((t * 1.5) as u32).is_multiple_of(2)), 0.0, 0.0),
        "slow" => (
            0.08 * (1.5 * t).sin(),
            0.0,
            if robot.steering.is_some() {
                0.05
            } else {
                0.1 * (2.0 * t).cos()
            },
        ),
        _ if robot.chassis == "omni4" && robot.wheels.iter().all(|wheel| wheel.driven) => {
            (0.4 * (0.8 * t).cos(), 0.4 * (0.8 * t).sin(), 0.3)
        }
        _ if robot.steering.is_some() => (0.5 * sign(t % 5.0 < 2.5), 0.0, 0.9),
        _ => (if t < 5.0 { 0.0 } else { 0.3 }, 0.0, if t < 5.0 { 1.0 } else { -0.4 }),
    }
}

/// Drives it from rest at the origin.
pub fn run(
    robot: &RobotDescription,
    effects: &[Effect],
    name: &str,
) -> Result<Vec<ReplayRow>, Box<dyn std::error::Error>> {
    let nominal = Robot::new(robot.clone())?;
    let mut command = WheelCommand::default();
    let rows: Vec<CommandRow> = (0..1200)
        .map(|tick| {
            let t = f64::from(tick) / RATE_HZ;
            let (forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s) = twist(robot, name, t);
            let twist = BodyTwist {
                forward_m_per_s,
                left_m_per_s,
                yaw_rate_rad_per_s,
            };
            command = nominal.wheel_speeds_holding(twist, command.steering_rad);
            CommandRow {
                time_s: t,
                wheel_rad_per_s: command.wheel_rad_per_s.map(Some),
                steering_rad: Some(command.steering_rad),
                ..CommandRow::default()
            }
        })
        .collect();
    let robot = Robot::with_effects(robot.clone(), effects)?;
    Ok(replay(&robot, Pose::default(), &rows)?)
}

/// Positions, thinned.
pub fn path(rows: &[ReplayRow]) -> Vec<(f64, f64)> {
    rows.iter()
        .step_by(6)
        .map(|row| (row.state.pose.x_m, row.state.pose.y_m))
        .collect()
}
