//! Noise streams are normal, independent and repeatable; bounds are five standard errors of the statistic.

mod support;

use support::{car, omni4, robot};
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::{Noise, Robot};
use twin::sensor::encoder::TickSettings;
use twin::sensor::noise::Sensor;
use twin::sensor::surroundings::Circle;
use twin::sensor::{NoiseStream, NoiseStreams, Readings, SensorSettings, SensorSuite, Surroundings};
use twin::twist::BodyTwist;

const COUNT: usize = 100_000;

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

fn normals(seed: u64, robot: u32, sensor: Sensor) -> Vec<f64> {
    let mut stream = NoiseStream::new(seed, robot, sensor);
    (0..COUNT).map(|_| stream.normal()).collect()
}

#[test]
fn normal_numbers_have_the_moments_of_a_normal() {
    let count = COUNT as f64;
    for seed in [0, 1, u64::MAX] {
        let values = normals(seed, 0, Sensor::Gyro);
        // Moment, its expectation, its variance per number.
        for (power, want, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let moment = mean(values.iter().map(|x| (0..power).fold(1.0, |product, _| product * x)));
            let bound = 5.0 * f64::sqrt(variance / count);
            assert!((moment - want).abs() < bound, "seed {seed}: moment {power} is {moment}");
        }
        let beyond_two = mean(values.iter().map(|x| f64::from(u8::from(x.abs() > 2.0))));
        let share = 0.045_500_263_896;
        assert!(
            (beyond_two - share).abs() < 5.0 * f64::sqrt(share / count),
            "{beyond_two}"
        );
    }
}

#[test]
fn uniform_numbers_fill_the_unit_interval_evenly() {
    let mut stream = NoiseStream::new(3, 1, Sensor::Range);
    let mut bins = [0_u32; 50];
    for _ in 0..COUNT {
        let value = stream.uniform();
        assert!((0.0..1.0).contains(&value));
        bins[(value * 50.0) as usize] += 1;
    }
    let want = COUNT as f64 / 50.0;
    let chi2: f64 = bins
        .iter()
        .map(|bin| (f64::from(*bin) - want) * (f64::from(*bin) - want) / want)
        .sum();
    // 49 degrees of freedom: mean 49, variance 98.
    assert!((chi2 - 49.0).abs() < 5.0 * f64::sqrt(98.0), "{chi2}");
}

#[test]
fn streams_that_differ_in_seed_robot_or_sensor_are_independent() {
    let first = normals(1, 0, Sensor::Gyro);
    let others = [
        normals(2, 0, Sensor::Gyro),
        normals(1 << 32, 0, Sensor::Gyro),
        normals(1, 1, Sensor::Gyro),
        normals(1, 0, Sensor::Accelerometer),
    ];
    let bound = 5.0 / f64::sqrt(COUNT as f64);
    for other in &others {
        assert_ne!(&first, other);
        for (lag_a, lag_b) in [(0, 0), (0, 1), (1, 0)] {
            let pairs = first[lag_a..].iter().zip(&other[lag_b..]);
            let correlation = mean(pairs.map(|(a, b)| a * b));
            assert!(correlation.abs() < bound, "{correlation}");
        }
    }
    for lag in [1, 2, 7] {
        let correlation = mean(first.iter().zip(&first[lag..]).map(|(a, b)| a * b));
        assert!(correlation.abs() < bound, "lag {lag}: {correlation}");
    }
}

#[test]
fn a_stream_read_back_goes_on_with_the_same_bits() {
    let mut stream = NoiseStream::new(u64::MAX, 7, Sensor::TrackedPose);
    for _ in 0..1000 {
        stream.normal();
        stream.uniform();
    }
    let text = serde_json::to_string(&stream).unwrap_or_default();
    let Ok(mut read) = serde_json::from_str::<NoiseStream>(&text) else {
        panic!("{text}")
    };
    assert_eq!(read.position(), 2000);
    for _ in 0..1000 {
        assert_eq!(read.normal().to_bits(), stream.normal().to_bits());
    }
}

// Noise in the readings.

fn noisy_car() -> Robot {
    let mut description = car("rwd");
    description.noise = Some(Noise {
        pose_xy_m: Some(0.001),
        pose_yaw_rad: Some(0.003),
        wheel_rad_per_s: Some(0.05),
        current_a: Some(0.03),
        gyro_rad_per_s: Some(0.006),
        accel_m_per_s2: Some(0.05),
        bus_v: Some(0.03),
        steering_rad: Some(0.002),
    });
    robot(description)
}

fn suite(robot: &Robot, change: impl Fn(&mut SensorSettings)) -> SensorSuite {
    let mut settings = SensorSettings::of(robot);
    change(&mut settings);
    match SensorSuite::new(robot, settings) {
        Ok(suite) => suite,
        Err(problem) => panic!("test sensors refused: {problem}"),
    }
}

/// A circle 1 m ahead of the ring of the robot's range sensors.
fn something_ahead(robot: &Robot) -> [Circle; 1] {
    [Circle {
        x_m: robot.bounding_radius_m() + 1.5,
        y_m: 0.0,
        radius_m: 0.5,
    }]
}

/// Every number of a reading of a robot at rest, with its truth and its standard deviation.
fn channels(readings: &Readings) -> Option<[(&'static str, f64, f64, f64); 15]> {
    let encoder = readings.encoder?;
    let current_a = readings.current_a?;
    let force = readings.specific_force?;
    let field = readings.magnetic_field?;
    let frame = readings.tracked_poses.first()?;
    Some([
        ("wheel 2", encoder.wheel_rad_per_s[2], 0.0, 0.05),
        ("wheel 3", encoder.wheel_rad_per_s[3], 0.0, 0.05),
        ("current 2", current_a[2], 0.0, 0.03),
        ("current 3", current_a[3], 0.0, 0.03),
        ("bus", readings.bus_v?, 24.0, 0.03),
        ("steering", readings.steering_rad?, 0.0, 0.002),
        ("gyro", readings.gyro_z_rad_per_s?, 0.0, 0.006),
        ("forward", force.forward_m_per_s2, 0.0, 0.05),
        ("left", force.left_m_per_s2, 0.0, 0.05),
        ("up", force.up_m_per_s2, 9.81, 0.05),
        ("field", field.left_t, 0.0, 1e-6),
        ("range", readings.range_m?[3]?, 1.0, 0.01 + 0.02),
        ("x", frame.pose.x_m, 0.0, 0.001),
        ("y", frame.pose.y_m, 0.0, 0.001),
        ("yaw", frame.pose.yaw_rad, 0.0, 0.003),
    ])
}

#[test]
fn every_channel_has_its_own_standard_deviation_and_no_common_noise() {
    let robot = noisy_car();
    let mut suite = suite(&robot, |settings| {
        if let Some(magnetometer) = &mut settings.magnetometer {
            magnetometer.noise_t = 1e-6;
        }
        if let Some(range) = &mut settings.range {
            (range.every_steps, range.noise_m, range.noise_share) = (4, 0.01, 0.02);
        }
    });
    let ahead = something_ahead(&robot);
    let surroundings = Surroundings {
        circles: &ahead,
        ..Surroundings::default()
    };
    let state = FreeRobot::at_rest(&robot, Pose::default()).state();
    let mut streams = NoiseStreams::new(11, 2);
    let count = 20_000_usize;
    let mut errors: [Vec<f64>; 15] = Default::default();
    let mut names = [""; 15];
    for sample in 0..count as u64 {
        let readings = suite.sample(&state, &surroundings, 4 * sample, &mut streams);
        let Some(channels) = channels(&readings) else {
            panic!("a channel is missing in {readings:?}")
        };
        for (index, (name, value, truth, deviation)) in channels.into_iter().enumerate() {
            names[index] = name;
            errors[index].push((value - truth) / deviation);
        }
        let encoder = readings.encoder.map(|e| (e.wheel_rad, e.wheel_rad_per_s[0]));
        assert_eq!(
            encoder,
            Some(([0.0; 6], 0.0)),
            "angles and passive wheels are without noise"
        );
    }
    let one = f64::sqrt(1.0 / count as f64);
    for (index, name) in names.iter().enumerate() {
        let average = mean(errors[index].iter().copied());
        let variance = mean(errors[index].iter().map(|error| error * error));
        assert!(average.abs() < 5.0 * one, "{name}: mean {average}");
        assert!(
            (variance - 1.0).abs() < 5.0 * f64::sqrt(2.0) * one,
            "{name}: variance {variance}"
        );
        for other in 0..index {
            let correlation = mean(errors[index].iter().zip(&errors[other]).map(|(a, b)| a * b));
            assert!(
                correlation.abs() < 5.0 * one,
                "{name} and {}: {correlation}",
                names[other]
            );
        }
    }
}

#[test]
fn what_one_range_sensor_sees_does_not_change_the_noise_of_the_others() {
    let robot = robot(omni4());
    let state = FreeRobot::at_rest(&robot, Pose::default()).state();
    let left = Circle {
        x_m: 0.0,
        y_m: 1.0,
        radius_m: 0.2,
    };
    let [ahead] = something_ahead(&robot);
    let seen = |circles: &[Circle]| {
        let mut suite = suite(&robot, |settings| {
            if let Some(range) = &mut settings.range {
                range.noise_m = 0.01;
            }
        });
        let surroundings = Surroundings {
            circles,
            ..Surroundings::default()
        };
        suite
            .sample(&state, &surroundings, 0, &mut NoiseStreams::new(5, 0))
            .range_m
            .unwrap_or_default()
    };
    let (alone, both) = (seen(&[left]), seen(&[ahead, left]));
    assert_eq!(alone[3], None);
    assert!(both[3].is_some() && alone[6].is_some());
    assert_eq!(alone[6], both[6]);
}

// Saved and restored.

#[test]
fn sensors_restored_from_memory_and_streams_continue_identically() {
    let robot = noisy_car();
    let make = || {
        suite(&robot, |settings| {
            if let Some(encoder) = &mut settings.encoder {
                encoder.every_steps = 1;
                encoder.ticks = Some(TickSettings {
                    encoder_ticks_per_rev: 2048,
                    window_samples: 8,
                });
            }
            if let Some(tracker) = &mut settings.tracked_pose {
                (tracker.exposure_steps, tracker.latency_s, tracker.latency_jitter_s) = (3, 0.02, 0.03);
                tracker.drop_probability = 0.1;
            }
        })
    };
    let command = robot.wheel_speeds(BodyTwist {
        forward_m_per_s: 0.6,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.7,
    });
    let (mut free, mut suite, mut streams) = (
        FreeRobot::at_rest(&robot, Pose::default()),
        make(),
        NoiseStreams::new(9, 4),
    );
    let mut saved: Option<(SensorSuite, NoiseStreams)> = None;
    for step in 0..960 {
        free.step(&command);
        // In the middle of an exposure, with frames on their way.
        if step == 402 {
            let memory = serde_json::to_string(suite.memory()).unwrap_or_default();
            let text = serde_json::to_string(&streams).unwrap_or_default();
            let mut restored = make();
            let (Ok(memory), Ok(read)) = (serde_json::from_str(&memory), serde_json::from_str(&text)) else {
                panic!("{memory} {text}")
            };
            restored.restore(memory);
            saved = Some((restored, read));
        }
        let state = free.state();
        let readings = suite.sample(&state, &Surroundings::default(), step, &mut streams);
        if let Some((restored, read)) = &mut saved {
            assert_eq!(
                restored.sample(&state, &Surroundings::default(), step, read),
                readings,
                "step {step}"
            );
        }
    }
    assert_eq!(saved.map(|(_, read)| read), Some(streams));
}
