//! One short trace of every effect on every chassis that can have it, as the sensors report it, and one behind rotors that are told how they turn.

use std::collections::BTreeMap;

use super::{CHASSIS, GoldenError, reference_robot};
use crate::digest::Digest;
use crate::effect::Effect;
use crate::effect::library::LIBRARY;
use crate::pose::Pose;
use crate::replay::{CommandRow, ReplayRow, replay};
use crate::robot::{Robot, RobotDescription};
use crate::twist::BodyTwist;

/// Rows of every trace, at 120 Hz.
const ROWS: u32 = 180;

/// Digest by `<chassis>/<effect>`, `<chassis>/nominal` and `<chassis>/told_rotors` (with play in the gears); committed in `twin/golden/effects.json`.
pub fn effect_digests() -> Result<BTreeMap<String, String>, GoldenError> {
    let mut digests = BTreeMap::new();
    for chassis in CHASSIS {
        let description = reference_robot(chassis);
        digests.insert(format!("{chassis}/nominal"), digest(&description, &[])?);
        let play = [Effect::new("gear_backlash", &[("play", 0.05)])];
        let told = Robot::with_told_rotors(description.clone(), &play)?;
        digests.insert(format!("{chassis}/told_rotors"), trace(&told)?);
        for entry in LIBRARY {
            let effect = [Effect::sized(entry, &description, |(_, large)| large)];
            // What the chassis cannot have (a steering gear, an omni wheel) is refused.
            if Robot::with_effects(description.clone(), &effect).is_ok() {
                digests.insert(format!("{chassis}/{}", entry.name), digest(&description, &effect)?);
            }
        }
    }
    Ok(digests)
}

fn digest(description: &RobotDescription, effects: &[Effect]) -> Result<String, GoldenError> {
    trace(&Robot::with_effects(description.clone(), effects)?)
}

/// Digest of the common trace.
pub(super) fn trace(robot: &Robot) -> Result<String, GoldenError> {
    let mut command = robot.wheel_speeds(BodyTwist::default());
    let rows: Vec<CommandRow> = (0..ROWS)
        .map(|row| {
            let phase = f64::from(row / 30);
            let twist = BodyTwist {
                forward_m_per_s: 0.9 - 0.5 * phase + 0.004 * f64::from(row % 30),
                left_m_per_s: 0.15 * phase,
                yaw_rate_rad_per_s: 1.2 - 0.4 * phase,
            };
            command = robot.wheel_speeds_holding(twist, command.steering_rad);
            CommandRow {
                time_s: f64::from(row) / f64::from(crate::CONTROL_RATE_HZ),
                wheel_rad_per_s: command.wheel_rad_per_s.map(Some),
                steering_rad: Some(command.steering_rad),
                ..CommandRow::default()
            }
        })
        .collect();
    let start = Pose {
        x_m: 0.3,
        y_m: -0.2,
        yaw_rad: 0.4,
    };
    Ok(hash(&replay(robot, start, &rows)?).to_string())
}

/// Every number of every row.
fn hash(rows: &[ReplayRow]) -> Digest {
    let mut bytes = Vec::new();
    for row in rows {
        let s = &row.state;
        let body = [
            s.pose.x_m,
            s.pose.y_m,
            s.pose.yaw_rad,
            s.twist.forward_m_per_s,
            s.twist.left_m_per_s,
            s.twist.yaw_rate_rad_per_s,
            s.gyro_z_rad_per_s,
            s.accel_x_m_per_s2,
            s.accel_y_m_per_s2,
            s.bus_v,
            s.steering_rad,
        ];
        let wheels = [&s.wheel_rad_per_s, &s.wheel_rad, &s.current_a, &s.voltage_v];
        for number in body.iter().chain(wheels.into_iter().flatten()) {
            bytes.extend_from_slice(&number.to_bits().to_le_bytes());
        }
    }
    Digest::of_bytes(&bytes)
}
