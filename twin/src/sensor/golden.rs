//! A drive with every sensor and its known digest: the same bits in debug, release and WebAssembly.

use super::encoder::{EncoderReading, TickSettings};
use super::surroundings::{Circle, OrientedBox, Surroundings};
use super::{NoiseStreams, Readings, SensorSettings, SensorSuite};
use crate::command::WheelCommand;
use crate::digest::Digest;
use crate::free::FreeRobot;
use crate::golden::reference_robot;
use crate::pose::Pose;
use crate::robot::{Noise, ParameterError, Robot};
use crate::twist::BodyTwist;
use crate::world::Arena;

/// Digest of [`run`], the same on every platform. Changes only together with [`crate::VERSION`].
pub const DIGEST: &str = "b038474b45c38a0ab60fd7361cb2b4d7";
/// Physics steps of [`run`].
pub const STEPS: u64 = 2_400;

/// A car in an arena with a robot that passes by and a box, every sensor noisy; gives the digest of all readings.
pub fn run() -> Result<Digest, ParameterError> {
    let mut description = reference_robot("rwd");
    description.noise = Some(noise());
    let robot = Robot::new(description)?;
    let mut suite = SensorSuite::new(&robot, settings(&robot))?;
    let mut streams = NoiseStreams::new(0x5eed, 3);
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    let boxes = [OrientedBox {
        pose: pose(1.2, -0.6, 0.5),
        length_m: 0.4,
        width_m: 0.2,
    }];
    let mut bytes = Vec::new();
    for step in 0..STEPS {
        free.step(&command(&robot, step));
        let circles = [Circle {
            x_m: 1.0 - 0.0008 * step as f64,
            y_m: 0.9,
            radius_m: 0.2,
        }];
        let surroundings = Surroundings {
            arena: Some(Arena {
                width_m: 8.0,
                height_m: 6.0,
            }),
            circles: &circles,
            boxes: &boxes,
        };
        push(
            &mut bytes,
            &suite.sample(&free.state(), &surroundings, step, &mut streams),
        );
    }
    Ok(Digest::of_bytes(&bytes))
}

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn noise() -> Noise {
    Noise {
        pose_xy_m: Some(0.001),
        pose_yaw_rad: Some(0.003),
        wheel_rad_per_s: Some(0.05),
        current_a: Some(0.03),
        gyro_rad_per_s: Some(0.006),
        accel_m_per_s2: Some(0.05),
        bus_v: Some(0.03),
        steering_rad: Some(0.002),
    }
}

fn settings(robot: &Robot) -> SensorSettings {
    let mut settings = SensorSettings::of(robot);
    if let Some(encoder) = &mut settings.encoder {
        encoder.every_steps = 1;
        encoder.ticks = Some(TickSettings {
            encoder_ticks_per_rev: 2048,
            window_samples: 8,
        });
    }
    if let Some(magnetometer) = &mut settings.magnetometer {
        magnetometer.magnetic_north_rad = 1.4;
        magnetometer.noise_t = 3e-7;
    }
    if let Some(range) = &mut settings.range {
        (range.noise_m, range.noise_share) = (0.002, 0.01);
    }
    if let Some(tracker) = &mut settings.tracked_pose {
        tracker.exposure_steps = 2;
        tracker.latency_s = 0.012;
        tracker.latency_jitter_s = 0.02;
        tracker.drop_probability = 0.05;
    }
    settings
}

fn command(robot: &Robot, step: u64) -> WheelCommand {
    let phase = (step / 480 % 4) as f64;
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: 0.8 - 0.3 * phase,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.5 - 0.3 * phase,
    })
}

/// Every number of the readings in a fixed order, absent ones left out and marked.
fn push(bytes: &mut Vec<u8>, readings: &Readings) {
    let mut word = |word: u64| bytes.extend_from_slice(&word.to_le_bytes());
    let mut numbers = |values: Option<&[f64]>| {
        word(values.map_or(u64::MAX, |values| values.len() as u64));
        for value in values.unwrap_or_default() {
            word(value.to_bits());
        }
    };
    let encoder: Option<&EncoderReading> = readings.encoder.as_ref();
    let ticks = encoder
        .and_then(|encoder| encoder.ticks)
        .map(|ticks| ticks.map(|count| count as f64));
    numbers(ticks.as_ref().map(|ticks| ticks.as_slice()));
    numbers(encoder.map(|encoder| encoder.wheel_rad.as_slice()));
    numbers(encoder.map(|encoder| encoder.wheel_rad_per_s.as_slice()));
    numbers(readings.current_a.as_ref().map(|current_a| current_a.as_slice()));
    for single in [readings.bus_v, readings.steering_rad, readings.gyro_z_rad_per_s] {
        numbers(single.as_ref().map(core::slice::from_ref));
    }
    let force = readings.specific_force;
    let force = force.map(|force| [force.forward_m_per_s2, force.left_m_per_s2, force.up_m_per_s2]);
    numbers(force.as_ref().map(|force| force.as_slice()));
    let field = readings.magnetic_field;
    let field = field.map(|field| [field.forward_t, field.left_t, field.up_t]);
    numbers(field.as_ref().map(|field| field.as_slice()));
    for distance_m in readings.range_m.iter().flatten() {
        numbers(distance_m.as_ref().map(core::slice::from_ref));
    }
    for frame in &readings.tracked_poses {
        let Pose { x_m, y_m, yaw_rad } = frame.pose;
        numbers(Some(&[x_m, y_m, yaw_rad, frame.exposure_s, frame.arrival_s]));
    }
}
