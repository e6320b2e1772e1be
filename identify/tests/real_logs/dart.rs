//! DART 1:10 car: Vicon at 100 Hz, on-board channels at 10 Hz and held.

use super::csv_table::Table;
use super::{Rows, folder};
use identify::diagnose::Run;

pub const ROBOT: &str = include_str!("dart.json");
pub const FREE: [&str; 4] = [
    "free__09_16_2024_10_01_01",
    "free__09_16_2024_10_02_28",
    "free__09_16_2024_10_12_05",
    "free__09_16_2024_10_27_02",
];
pub const STEERING: [&str; 3] = [
    "steerid__09_25_2024_09_53_24",
    "steerid__09_25_2024_09_56_00",
    "steerid__09_25_2024_10_02_32",
];
/// Steering angle at a command of 1, from slow driving, rad.
const STEERING_GAIN_RAD: f64 = 0.5;
/// Tracked point before the centre of the wheelbase, m.
const MARKER_M: f64 = 0.115 - 0.1735 / 2.0;
const RADIUS_M: f64 = 0.033;

/// A file cut into `parts` runs of the same length; what stands still at its start is left out.
pub fn runs(name: &str, parts: usize) -> Option<Vec<Run>> {
    runs_of(ROBOT, name, parts)
}

/// The car on a floor whose grip never ends: it rolls without slip.
pub fn slip_free() -> String {
    ROBOT.replace("\"floor_friction\": 1.0", "\"floor_friction\": 3.0")
}

/// The same with another description.
pub fn runs_of(robot: &str, name: &str, parts: usize) -> Option<Vec<Run>> {
    let table = Table::read(&folder("dart_car")?.join(format!("{name}.csv")));
    let column = |name: &str| table.column(name);
    let (t, x, y, yaw) = (column("t"), column("x"), column("y"), column("yaw"));
    let (steering, speed, gyro) = (column("steering"), column("v_enc"), column("gyro_z"));
    let (ax, ay) = (column("acc_x"), column("acc_y"));
    let stamp = column("t_sensor");
    let first = speed.iter().position(|v| *v > 0.2).unwrap_or(0).saturating_sub(50);
    let length = (t.len() - first) / parts;
    let names = [
        "command_steering_rad",
        "wheel_0_rad_per_s",
        "wheel_1_rad_per_s",
        "wheel_2_rad_per_s",
        "wheel_3_rad_per_s",
        "gyro_z_rad_per_s",
        "accel_x_m_per_s2",
        "accel_y_m_per_s2",
        "pose_x_m",
        "pose_y_m",
        "pose_yaw_rad",
    ];
    let part = |number: usize| {
        let mut rows = Rows::new(&names);
        for k in first + number * length..first + (number + 1) * length {
            let fresh = k == 0 || stamp[k] != stamp[k - 1];
            let sampled = |value: f64| Some(value).filter(|_| fresh);
            let (sin, cos) = libm::sincos(yaw[k]);
            rows.push(
                t[k],
                vec![
                    Some(STEERING_GAIN_RAD * steering[k]),
                    sampled(speed[k] / RADIUS_M),
                    sampled(speed[k] / RADIUS_M),
                    sampled(speed[k] / RADIUS_M),
                    sampled(speed[k] / RADIUS_M),
                    sampled(gyro[k]),
                    sampled(ax[k]),
                    sampled(ay[k]),
                    Some(x[k] - MARKER_M * cos),
                    Some(y[k] - MARKER_M * sin),
                    Some(yaw[k]),
                ],
            );
        }
        rows.bundle(&format!("{name}/{number}"), robot)
    };
    Some((0..parts).map(part).collect())
}
