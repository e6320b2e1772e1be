//! Logs of the twin itself with a residual that is known: an oracle for what can be learned.

use std::fmt::Write;

use identify::bundle::Bundle;
use identify::diagnose::Run;
use twin::golden::reference_robot;
use twin::pose::{Pose, wrapped_rad};
use twin::replay::{CommandRow, replay};
use twin::residual::{Activation, Input, Layer, Output, ResidualDocument};
use twin::robot::{Robot, RobotDescription};

/// A log that is made.
#[derive(Clone)]
pub struct Log {
    pub seconds: f64,
    /// Changes the pattern of driving.
    pub pattern: f64,
    /// Of the set-points; 0 stands still.
    pub speed_rad_per_s: f64,
    /// Standard deviations of position and wheel speed.
    pub noise: f64,
}

impl Log {
    pub fn usual(pattern: f64) -> Log {
        Log {
            seconds: 24.0,
            pattern,
            speed_rad_per_s: 9.0,
            noise: 1.0,
        }
    }
}

/// The chassis of all logs, on a floor where a force on the body moves it.
pub fn description() -> RobotDescription {
    let mut description = reference_robot("diff2");
    description.floor_friction = 0.3;
    description
}

/// Forward acceleration `forward u` and yaw acceleration `turn`, everywhere: the true residual.
pub fn truth(forward_per_s: f64, turn_rad_per_s2: f64) -> ResidualDocument {
    let layer = Layer {
        weights: vec![forward_per_s, 0.0],
        bias: vec![0.0, turn_rad_per_s2],
        activation: Activation::Linear,
    };
    let output = |name: &str, limit: f64| Output {
        name: name.to_owned(),
        scale: 1.0,
        limit,
    };
    ResidualDocument::new(
        vec![Input::new("forward_m_per_s", -20.0, 20.0)],
        1.0,
        vec![layer],
        vec![
            output("acceleration_forward_m_per_s2", 10.0),
            output("acceleration_yaw_rad_per_s2", 100.0),
        ],
    )
}

/// The telemetry of a robot as CSV.
pub fn csv(robot: &Robot, log: &Log) -> String {
    let count = (log.seconds * 120.0) as usize;
    let rows: Vec<CommandRow> = (0..count)
        .map(|k| {
            let time_s = k as f64 / 120.0;
            let mut row = CommandRow {
                time_s,
                ..CommandRow::default()
            };
            if k % 60 == 0 {
                let phase = log.pattern + 0.7 * time_s;
                let along = libm::sin(phase) + 0.6 * libm::sin(2.3 * phase + log.pattern);
                let turn = 0.5 * libm::sin(1.7 * phase + 1.0);
                row.wheel_rad_per_s[0] = Some(log.speed_rad_per_s * (along - turn));
                row.wheel_rad_per_s[1] = Some(log.speed_rad_per_s * (along + turn));
            }
            row
        })
        .collect();
    let states = replay(robot, Pose::default(), &rows).unwrap_or_else(|problem| panic!("{problem}"));
    let mut random = identify::random::Random::new(5, (1000.0 * log.pattern) as u64);
    let mut text =
        "time_s,command_wheel_0_rad_per_s,command_wheel_1_rad_per_s,wheel_0_rad_per_s,wheel_1_rad_per_s,gyro_z_rad_per_s,pose_x_m,pose_y_m,pose_yaw_rad\n"
            .to_owned();
    for (row, state) in rows.iter().zip(states) {
        let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
        let mut near = |value: f64, sigma: f64| value + log.noise * sigma * random.normal();
        let state = state.state;
        let _ = writeln!(
            text,
            "{:.6},{},{},{:.5},{:.5},{:.5},{:.6},{:.6},{:.6}",
            row.time_s,
            cell(row.wheel_rad_per_s[0]),
            cell(row.wheel_rad_per_s[1]),
            near(state.wheel_rad_per_s[0], 0.02),
            near(state.wheel_rad_per_s[1], 0.02),
            near(state.gyro_z_rad_per_s, 0.003),
            near(state.pose.x_m, 0.0005),
            near(state.pose.y_m, 0.0005),
            wrapped_rad(near(state.pose.yaw_rad, 0.001)),
        );
    }
    text
}

/// A run of a robot; its bundle says nothing of the residual.
pub fn run(residual: Option<&ResidualDocument>, log: &Log, path: &str) -> Run {
    let robot = Robot::with_model(description(), &[], residual).unwrap_or_else(|problem| panic!("{problem}"));
    read(&description(), &csv(&robot, log), path)
}

/// Through the public reader.
pub fn read(description: &RobotDescription, csv: &str, path: &str) -> Run {
    let robot = serde_json::to_string(description).unwrap_or_else(|problem| panic!("{problem}"));
    let json = format!(
        "{{\"format\":\"robopheus.run/1\",\"robot\":{robot},\"floor\":\"hall\",\"label\":\"\",\"started\":\"\",\"change_free_reference\":false}}"
    );
    Run {
        path: path.to_owned(),
        sha256: format!("{:064}", csv.len()),
        bundle: Bundle::parse(&json, csv.as_bytes()).unwrap_or_else(|problem| panic!("{problem}")),
    }
}

/// Runs that differ in how they were driven.
pub fn runs(residual: Option<&ResidualDocument>, count: usize) -> Vec<Run> {
    (0..count)
        .map(|number| {
            run(
                residual,
                &Log::usual(0.37 + 1.13 * number as f64),
                &format!("run-{number}"),
            )
        })
        .collect()
}
