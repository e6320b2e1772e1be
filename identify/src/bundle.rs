//! Run bundles: `run.json` and telemetry of one robot, checked.

use serde::{Deserialize, Serialize};
use twin::MAX_WHEELS;
use twin::replay::CommandRow;
use twin::robot::{Robot, RobotDescription};

use crate::channel::Channel;
pub use crate::telemetry::{BundleError, Series, Telemetry};

/// `format` of `run.json`.
pub const RUN_FORMAT: &str = "robopheus.run/1";
/// A pause in the time stamps longer than this is listed, s.
pub const LONG_PAUSE_S: f64 = 0.5;

/// A robot that comes to rest by itself for longer than this after its last set-points is worth telling, s.
const LONG_END_S: f64 = 2.0;

/// What `time_s` means.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stamp {
    Sample,
    Arrival,
    #[default]
    Unknown,
}

/// `run.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    pub format: String,
    pub robot: RobotDescription,
    pub floor: String,
    pub label: String,
    pub started: String,
    pub change_free_reference: bool,
    #[serde(default)]
    pub stamp: Stamp,
    /// From sending a command to its effect.
    #[serde(default)]
    pub command_delay_s: f64,
    /// From exposure to `time_s` where poses carry arrival times.
    #[serde(default)]
    pub pose_latency_s: f64,
}

/// Something worth telling that does not stop the analysis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Remark {
    /// Column, or empty for the whole bundle.
    pub column: String,
    pub message: String,
}

/// One robot's run.
#[derive(Debug, Clone)]
pub struct Bundle {
    pub run: Run,
    pub robot: Robot,
    pub telemetry: Telemetry,
    /// Constant, empty and unknown channels, pauses.
    pub remarks: Vec<Remark>,
}

impl Bundle {
    /// The same with time stamps from the start of the run ([`Telemetry::from_start`]); remarks keep those of the file.
    pub fn from_start(self) -> Bundle {
        Bundle {
            telemetry: self.telemetry.from_start(),
            ..self
        }
    }

    /// Reads `run.json` text and telemetry as CSV bytes.
    ///
    /// - Errors: the first thing that cannot be meant, with line and column; see [`BundleError`].
    pub fn parse(run_json: &str, telemetry_csv: &[u8]) -> Result<Bundle, BundleError> {
        let run = parse_run(run_json)?;
        let robot = Robot::new(run.robot.clone()).map_err(|problem| BundleError::RunField {
            field: format!("robot.{}", problem.field),
            message: format!("{} (limit: {})", problem.message, problem.limit),
        })?;
        let telemetry = Telemetry::from_csv(telemetry_csv)?;
        check_wheels(&run.robot, &telemetry)?;
        check_angles(&telemetry)?;
        check_positions(&telemetry)?;
        let (telemetry, left_out_s) = telemetry.while_driven();
        let mut remarks = remarks(&run, &telemetry);
        if left_out_s > LONG_END_S {
            remarks.push(Remark {
                column: Channel::SequenceSent.name(),
                message: format!(
                    "the last {left_out_s:.1} s hold frames without set-points: the robot came to rest by itself, they are not compared"
                ),
            });
        }
        Ok(Bundle {
            run,
            robot,
            telemetry,
            remarks,
        })
    }

    /// True when every driven wheel has set-points, of its own or through the body's twist.
    pub fn commands_wheels(&self) -> bool {
        let has = |channel: Channel| self.telemetry.channels.contains_key(&channel);
        let mut driven = (0..self.run.robot.wheels.len()).filter(|k| self.run.robot.wheels[*k].driven);
        has(Channel::CommandForward) || driven.all(|k| has(Channel::CommandWheel(k)))
    }

    /// The command columns, one row per time stamp.
    pub fn command_rows(&self) -> Vec<CommandRow> {
        let mut rows: Vec<CommandRow> = self
            .telemetry
            .time_s
            .iter()
            .map(|time_s| CommandRow {
                time_s: *time_s,
                ..CommandRow::default()
            })
            .collect();
        for (channel, series) in self
            .telemetry
            .channels
            .iter()
            .filter(|(channel, _)| channel.is_command())
        {
            for (row, value) in series.rows.iter().zip(&series.values) {
                let row = &mut rows[*row as usize];
                let slot = match channel {
                    Channel::CommandWheel(wheel) => &mut row.wheel_rad_per_s[*wheel],
                    Channel::CommandForward => &mut row.forward_m_per_s,
                    Channel::CommandLeft => &mut row.left_m_per_s,
                    Channel::CommandYawRate => &mut row.yaw_rate_rad_per_s,
                    _ => &mut row.steering_rad,
                };
                *slot = Some(*value);
            }
        }
        rows
    }
}

fn parse_run(text: &str) -> Result<Run, BundleError> {
    let run: Run = serde_json::from_str(text).map_err(|error| BundleError::RunText {
        line: error.line(),
        column: error.column(),
        message: error.to_string(),
    })?;
    let wrong = |field: &str, message: String| {
        Err(BundleError::RunField {
            field: field.to_owned(),
            message,
        })
    };
    if run.format != RUN_FORMAT {
        return wrong("format", format!("{:?}; this reads {RUN_FORMAT:?}", run.format));
    }
    for (field, value) in [
        ("command_delay_s", run.command_delay_s),
        ("pose_latency_s", run.pose_latency_s),
    ] {
        if !(0.0..=2.0).contains(&value) {
            return wrong(field, format!("{value} s; 0 to 2 s are possible"));
        }
    }
    Ok(run)
}

fn check_wheels(robot: &RobotDescription, telemetry: &Telemetry) -> Result<(), BundleError> {
    let present = telemetry.channels.keys().chain(&telemetry.empty);
    for channel in present {
        let Some(wheel) = channel.wheel() else { continue };
        let wrong = |message: String| {
            Err(BundleError::Column {
                column: channel.name(),
                message,
            })
        };
        let Some(described) = robot.wheels.get(wheel) else {
            return wrong(format!("the robot has {} wheels, numbered from 0", robot.wheels.len()));
        };
        if channel.is_command() && !described.driven {
            return wrong(format!("wheel {wheel} is not driven and cannot be commanded"));
        }
    }
    Ok(())
}

/// Refuses angles that can only be degrees.
fn check_angles(telemetry: &Telemetry) -> Result<(), BundleError> {
    for (channel, series) in &telemetry.channels {
        let Some(limit_rad) = channel.angle_limit_rad() else {
            continue;
        };
        let Some(index) = series.values.iter().position(|value| value.abs() > limit_rad) else {
            continue;
        };
        let (value, line) = (series.values[index], u64::from(series.rows[index]) + 2);
        let message = format!(
            "{value} is beyond +-{limit_rad:.3} rad: is it in degrees{}?",
            if *channel == Channel::PoseYaw {
                " or not wrapped"
            } else {
                ""
            }
        );
        return Err(BundleError::Cell {
            line,
            column: channel.name(),
            message,
        });
    }
    check_turning(telemetry)
}

/// Steps of the yaw from here on are a tracker's errors, rad.
const FLIP_RAD: f64 = 2.0;

/// Heading change per second from poses and from the gyro must agree in order of magnitude.
///
/// A yaw written in degrees stays within +-pi while the robot hardly turns, and a gyro in deg/s has no limit; their ratio
/// shows both.
fn check_turning(telemetry: &Telemetry) -> Result<(), BundleError> {
    let (Some(yaw), Some(gyro)) = (telemetry.series(Channel::PoseYaw), telemetry.series(Channel::Gyro)) else {
        return Ok(());
    };
    let turned: f64 = yaw
        .values
        .windows(2)
        .map(|pair| twin::pose::wrapped_rad(pair[1] - pair[0]))
        // Half a turn there and back of a flipped tag adds up to a whole one.
        .filter(|step| step.abs() < FLIP_RAD)
        .sum();
    let time_of = |row: u32| telemetry.time_s[row as usize];
    let mut integrated = 0.0;
    for sample in 1..gyro.rows.len() {
        integrated += 0.5
            * (gyro.values[sample] + gyro.values[sample - 1])
            * (time_of(gyro.rows[sample]) - time_of(gyro.rows[sample - 1]));
    }
    // Enough turning to compare, net of noise and drift.
    if turned.abs() < 1.0 || integrated.abs() < 1.0 {
        return Ok(());
    }
    let ratio = (integrated / turned).abs();
    let degrees = 180.0 / core::f64::consts::PI;
    if ratio > 0.5 * degrees && ratio < 2.0 * degrees {
        let message = format!("turns {ratio:.0} times as much as the poses: is it in degrees per second?");
        return Err(BundleError::Column {
            column: Channel::Gyro.name(),
            message,
        });
    }
    if 1.0 / ratio > 0.5 * degrees && 1.0 / ratio < 2.0 * degrees {
        let message = format!("turns {:.0} times as much as the gyro: is it in degrees?", 1.0 / ratio);
        return Err(BundleError::Column {
            column: Channel::PoseYaw.name(),
            message,
        });
    }
    Ok(())
}

/// Median speed between poses that no robot of a laboratory has, m/s.
const IMPOSSIBLE_M_PER_S: f64 = 50.0;

/// Refuses positions that can only be in another unit.
fn check_positions(telemetry: &Telemetry) -> Result<(), BundleError> {
    for channel in [Channel::PoseX, Channel::PoseY] {
        let Some(series) = telemetry.series(channel) else {
            continue;
        };
        let time_of = |sample: usize| telemetry.time_s[series.rows[sample] as usize];
        let mut speeds: Vec<f64> = (1..series.values.len())
            .map(|k| (series.values[k] - series.values[k - 1]).abs() / (time_of(k) - time_of(k - 1)))
            .filter(|speed| *speed > 0.0)
            .collect();
        speeds.sort_by(f64::total_cmp);
        let median = speeds.get(speeds.len() / 2).copied().unwrap_or(0.0);
        if median > IMPOSSIBLE_M_PER_S {
            return Err(BundleError::Column {
                column: channel.name(),
                message: format!(
                    "moves at {median:.0} m/s half of the time; up to {IMPOSSIBLE_M_PER_S:.0} m/s are possible: is it in millimetres?"
                ),
            });
        }
    }
    Ok(())
}

fn remarks(run: &Run, telemetry: &Telemetry) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let mut remark = |column: String, message: String| remarks.push(Remark { column, message });
    for channel in &telemetry.empty {
        remark(channel.name(), "no sample in any row".to_owned());
    }
    for name in &telemetry.unknown {
        remark(name.clone(), "not a column of the format; not read".to_owned());
    }
    for (channel, series) in &telemetry.channels {
        let moving = !matches!(channel, Channel::CameraId) && !channel.is_command();
        if moving && series.is_constant() {
            remark(
                channel.name(),
                format!(
                    "constant at {} in all {} samples",
                    series.values[0],
                    series.values.len()
                ),
            );
        }
    }
    let commanded = |wheel: usize| telemetry.channels.contains_key(&Channel::CommandWheel(wheel));
    let by_twist = telemetry.channels.contains_key(&Channel::CommandForward);
    for (wheel, described) in run.robot.wheels.iter().enumerate().take(MAX_WHEELS) {
        if described.driven && !commanded(wheel) && !by_twist {
            remark(
                Channel::CommandWheel(wheel).name(),
                "absent although the wheel is driven; a replay takes 0, a diagnosis compares rolling alone".to_owned(),
            );
        }
    }
    for pair in telemetry.time_s.windows(2) {
        if pair[1] - pair[0] > LONG_PAUSE_S {
            remark(
                "time_s".to_owned(),
                format!("no rows between {} s and {} s", pair[0], pair[1]),
            );
        }
    }
    remarks
}
