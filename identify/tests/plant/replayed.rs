//! The twin's own data in place of the plant's.

use emulator::noise::Noise;
use identify::channel::Channel;
use identify::diagnose::Run;
use twin::pose::Pose;
use twin::replay::replay;
use twin::robot::{Robot, RobotDescription};

/// What a robot of the twin makes of a run's set-points in place of what was measured, with the described noise.
pub fn of_the_twin(mut run: Run, description: RobotDescription, seed: u64) -> Run {
    let robot = Robot::new(description).unwrap_or_else(|error| panic!("{error}"));
    let mut noise = Noise::new(seed, 1234);
    let rows = run.bundle.command_rows();
    let first = Pose {
        x_m: 0.1,
        y_m: -0.2,
        yaw_rad: 0.4,
    };
    let out = replay(&robot, first, &rows).unwrap_or_else(|error| panic!("{error}"));
    let sigma = run.bundle.run.robot.noise.clone().unwrap_or_default();
    for (channel, series) in &mut run.bundle.telemetry.channels {
        for (row, value) in series.rows.iter().zip(&mut series.values) {
            let state = &out[*row as usize].state;
            let (exact, deviation) = match *channel {
                Channel::WheelSpeed(k) => (state.wheel_rad_per_s[k], sigma.wheel_rad_per_s),
                Channel::WheelAngle(k) => (state.wheel_rad[k], None),
                Channel::Current(k) => (state.current_a[k], sigma.current_a),
                Channel::Bus => (state.bus_v, sigma.bus_v),
                Channel::Gyro => (state.gyro_z_rad_per_s, sigma.gyro_rad_per_s),
                Channel::AccelX => (state.accel_x_m_per_s2, sigma.accel_m_per_s2),
                Channel::AccelY => (state.accel_y_m_per_s2, sigma.accel_m_per_s2),
                Channel::PoseX => (state.pose.x_m, sigma.pose_xy_m),
                Channel::PoseY => (state.pose.y_m, sigma.pose_xy_m),
                Channel::PoseYaw => (state.pose.yaw_rad, sigma.pose_yaw_rad),
                _ => continue,
            };
            *value = exact + deviation.unwrap_or(0.0) * noise.normal();
            if *channel == Channel::PoseYaw {
                *value = twin::pose::wrapped_rad(*value);
            }
        }
    }
    run
}
