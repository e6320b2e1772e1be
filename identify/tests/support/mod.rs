//! Bundles that the tests make.
#![allow(dead_code)]

use identify::bundle::Bundle;
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::replay::{CommandRow, replay};
use twin::robot::{Robot, RobotDescription};

/// A `run.json` of the reference diff2.
pub fn run_json() -> String {
    run_json_of(&reference_robot("diff2"))
}

pub fn run_json_of(robot: &RobotDescription) -> String {
    let robot = serde_json::to_string(robot).unwrap_or_default();
    format!(
        "{{\"format\":\"robopheus.run/1\",\"robot\":{robot},\"floor\":\"hall\",\"label\":\"test\",\"started\":\"2026-01-01T00:00:00Z\",\"change_free_reference\":true}}"
    )
}

/// A run of `truth` for 20 s, recorded at 120 Hz without noise, whose `run.json` claims `described`.
pub fn recorded(truth: &RobotDescription, described: &RobotDescription) -> Bundle {
    let robot = match Robot::new(truth.clone()) {
        Ok(robot) => robot,
        Err(problem) => panic!("{problem}"),
    };
    let speeds = |tick: u32| {
        let phase = f64::from(tick / 180 % 4);
        (4.0 + 2.0 * phase, 9.0 - 2.0 * phase)
    };
    let mut rows = Vec::new();
    for tick in 0..2400 {
        let mut row = CommandRow {
            time_s: f64::from(tick) / 120.0,
            ..CommandRow::default()
        };
        (row.wheel_rad_per_s[0], row.wheel_rad_per_s[1]) = (Some(speeds(tick).0), Some(speeds(tick).1));
        rows.push(row);
    }
    let Ok(out) = replay(
        &robot,
        Pose {
            x_m: 0.3,
            y_m: -0.2,
            yaw_rad: 3.0,
        },
        &rows,
    ) else {
        panic!("no replay")
    };
    let mut csv = "time_s,command_wheel_0_rad_per_s,command_wheel_1_rad_per_s,wheel_0_rad_per_s,wheel_1_rad_per_s,current_0_a,current_1_a,pose_x_m,pose_y_m,pose_yaw_rad\n".to_owned();
    for (tick, row) in out.iter().enumerate() {
        let (left, right) = speeds(tick as u32);
        let s = &row.state;
        csv.push_str(&format!(
            "{:.6},{left},{right},{},{},{},{},{},{},{}\n",
            row.time_s,
            s.wheel_rad_per_s[0],
            s.wheel_rad_per_s[1],
            s.current_a[0],
            s.current_a[1],
            s.pose.x_m,
            s.pose.y_m,
            s.pose.yaw_rad
        ));
    }
    match Bundle::parse(&run_json_of(described), csv.as_bytes()) {
        Ok(bundle) => bundle,
        Err(error) => panic!("{error}"),
    }
}
