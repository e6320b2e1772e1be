//! The twin's own data in place of the plant's.

use super::{Change, robot, run};
use emulator::noise::Noise;
use identify::channel::Channel;
use identify::diagnose::{Run, calibrated};
use identify::hypothesis::Hypothesis;
use identify::workers::Serial;
use twin::effect::Effect;
use twin::pose::Pose;
use twin::replay::{ReplayRow, replay};
use twin::robot::{Robot, RobotDescription};

/// What a robot of the twin makes of a run's set-points in place of what was measured, with the described noise.
pub fn of_the_twin(run: Run, description: RobotDescription, seed: u64) -> Run {
    of_the_twin_with(run, description, &[], seed)
}

/// The same of a robot with effects.
pub fn of_the_twin_with(mut run: Run, description: RobotDescription, effects: &[Effect], seed: u64) -> Run {
    let robot = Robot::with_effects(description, effects).unwrap_or_else(|error| panic!("{error}"));
    let mut noise = Noise::new(seed, 1234);
    let rows = run.bundle.command_rows();
    let first = Pose {
        x_m: 0.1,
        y_m: -0.2,
        yaw_rad: 0.4,
    };
    let out = replay(&robot, first, &rows).unwrap_or_else(|error| panic!("{error}"));
    let accelerations = accelerations(&out, robot.description().accelerometer_lag_s.unwrap_or(0.0));
    let sigma = run.bundle.run.robot.noise.clone().unwrap_or_default();
    for (channel, series) in &mut run.bundle.telemetry.channels {
        for (row, value) in series.rows.iter().zip(&mut series.values) {
            let state = &out[*row as usize].state;
            let (exact, deviation) = match *channel {
                Channel::WheelSpeed(k) => (state.wheel_rad_per_s[k], sigma.wheel_rad_per_s),
                Channel::WheelAngle(k) => (state.wheel_rad[k], None),
                Channel::Current(k) => (state.current_a[k], sigma.current_a),
                Channel::Steering => (state.steering_rad, sigma.steering_rad),
                Channel::Bus => (state.bus_v, sigma.bus_v),
                Channel::Gyro => (state.gyro_z_rad_per_s, sigma.gyro_rad_per_s),
                Channel::AccelX => (accelerations[*row as usize][0], sigma.accel_m_per_s2),
                Channel::AccelY => (accelerations[*row as usize][1], sigma.accel_m_per_s2),
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

/// Calibrated on four runs of a `chassis` of the twin that differs from its description by `own`.
pub fn calibration(chassis: &str, first_seed: u64, own: impl Fn(&mut RobotDescription)) -> Hypothesis {
    let description = robot(chassis);
    let mut changed = description.clone();
    own(&mut changed);
    let references: Vec<Run> = (0..4)
        .map(|k| {
            let driven = run(
                &format!("reference-{k}"),
                &description,
                &Change::none(),
                first_seed + k,
                20,
                true,
            );
            of_the_twin(driven, changed.clone(), k)
        })
        .collect();
    calibrated(&Serial, &references, None).unwrap_or_else(|error| panic!("{error}"))
}

/// Through a low-pass filter of first order.
fn accelerations(rows: &[ReplayRow], lag_s: f64) -> Vec<[f64; 2]> {
    let mut shown = [0.0; 2];
    let mut before_s = rows.first().map_or(0.0, |row| row.time_s);
    let mut all = Vec::with_capacity(rows.len());
    for row in rows {
        let share = if lag_s > 0.0 {
            1.0 - libm::exp(-(row.time_s - before_s) / lag_s)
        } else {
            1.0
        };
        before_s = row.time_s;
        for (shown, felt) in shown
            .iter_mut()
            .zip([row.state.accel_x_m_per_s2, row.state.accel_y_m_per_s2])
        {
            *shown += share * (felt - *shown);
        }
        all.push(shown);
    }
    all
}
