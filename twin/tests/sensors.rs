//! Sensors against closed forms, their signs, their limits, and the bits of all of them together.

mod support;

use core::f64::consts::{FRAC_PI_2, TAU};

use support::{car, diff2, omni4, robot, wheels};
use twin::free::{FreeRobot, RobotState};
use twin::pose::{Pose, wrapped_rad};
use twin::robot::{Noise, Robot, RobotDescription};
use twin::sensor::encoder::{EncoderSettings, TickSettings};
use twin::sensor::surroundings::Circle;
use twin::sensor::{NoiseStreams, Readings, SensorSettings, SensorSuite, Surroundings, golden};
use twin::twist::BodyTwist;
use twin::world::{Arena, World};

const OPEN_FLOOR: Surroundings<'static> = Surroundings {
    arena: None,
    circles: &[],
    boxes: &[],
};
const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn twist(forward_m_per_s: f64, yaw_rate_rad_per_s: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s,
    }
}

fn suite_with(robot: &Robot, change: impl Fn(&mut SensorSettings)) -> SensorSuite {
    let mut settings = SensorSettings::of(robot);
    change(&mut settings);
    match SensorSuite::new(robot, settings) {
        Ok(suite) => suite,
        Err(problem) => panic!("test sensors refused: {problem}"),
    }
}

fn suite(robot: &Robot) -> SensorSuite {
    suite_with(robot, |_| {})
}

fn standing(robot: &Robot, at: Pose) -> RobotState {
    FreeRobot::at_rest(robot, at).state()
}

/// All readings at step 0 of a robot with ideal sensors.
fn readings_of(robot: &Robot, state: &RobotState, surroundings: &Surroundings<'_>) -> Readings {
    suite(robot).sample(state, surroundings, 0, &mut NoiseStreams::new(1, 0))
}

/// State after driving with a body twist.
fn driven(description: RobotDescription, twist: BodyTwist, steps: u32) -> (Robot, RobotState) {
    let robot = robot(description);
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    let command = robot.wheel_speeds(twist);
    for _ in 0..steps {
        free.step(&command);
    }
    (robot, free.state())
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{got} against {want}");
}

// Neutral: without a noise entry a reading is the truth.

#[test]
fn without_noise_every_reading_is_the_truth() {
    for description in support::all() {
        let robot = robot(description);
        let mut suite = suite(&robot);
        let mut streams = NoiseStreams::new(7, 0);
        let untouched = streams.clone();
        let mut free = FreeRobot::at_rest(&robot, pose(0.3, -0.2, 3.0));
        let command = robot.wheel_speeds(twist(0.6, 0.9));
        for step in 0..600 {
            let state = free.state();
            let readings = suite.sample(&state, &OPEN_FLOOR, step, &mut streams);
            if step % 4 == 0 {
                check_truth(&robot, &state, &readings);
            } else {
                assert_eq!(readings, Readings::default(), "step {step}");
            }
            free.step(&command);
        }
        assert_eq!(streams, untouched, "nothing was drawn");
    }
}

fn check_truth(robot: &Robot, state: &RobotState, readings: &Readings) {
    let Some(encoder) = &readings.encoder else {
        panic!("no encoder sample")
    };
    assert_eq!(encoder.ticks, None);
    for (index, wheel) in robot.description().wheels.iter().enumerate() {
        let (angle, speed, current_a) = if wheel.driven {
            (
                state.wheel_rad[index],
                state.wheel_rad_per_s[index],
                state.current_a[index],
            )
        } else {
            (0.0, 0.0, 0.0)
        };
        assert_eq!(encoder.wheel_rad[index], angle);
        assert_eq!(encoder.wheel_rad_per_s[index], speed);
        assert_eq!(readings.current_a.map(|amperes| amperes[index]), Some(current_a));
    }
    let has_steering = robot.description().steering.is_some();
    assert_eq!(readings.bus_v, Some(state.bus_v));
    assert_eq!(readings.steering_rad, has_steering.then_some(state.steering_rad));
    assert_eq!(readings.gyro_z_rad_per_s, Some(state.twist.yaw_rate_rad_per_s));
    let force = readings
        .specific_force
        .map(|f| [f.forward_m_per_s2, f.left_m_per_s2, f.up_m_per_s2]);
    assert_eq!(
        force,
        Some([state.accel_x_m_per_s2, state.accel_y_m_per_s2, twin::GRAVITY_M_PER_S2])
    );
    let poses: Vec<Pose> = readings.tracked_poses.iter().map(|frame| frame.pose).collect();
    assert_eq!(poses, [state.pose]);
}

// Encoder.

fn ticks(encoder_ticks_per_rev: u32, window_samples: u32) -> Option<EncoderSettings> {
    Some(EncoderSettings {
        every_steps: 1,
        ticks: Some(TickSettings {
            encoder_ticks_per_rev,
            window_samples,
        }),
        noise_rad_per_s: 0.0,
    })
}

#[test]
fn encoders_count_up_along_the_rolling_direction_and_down_against_it() {
    for (speed, sign) in [(6.0, 1), (-6.0, -1)] {
        let robot = robot(diff2());
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        let mut suite = suite_with(&robot, |s| s.encoder = ticks(1000, 4));
        let mut streams = NoiseStreams::new(1, 0);
        for step in 0..480 {
            free.step(&wheels(&[speed, 0.5 * speed]));
            let state = free.state();
            let Some(reading) = suite.sample(&state, &OPEN_FLOOR, step, &mut streams).encoder else {
                panic!("no sample")
            };
            for wheel in 0..2 {
                let quantum = TAU / 1000.0;
                let below = state.wheel_rad[wheel] - reading.wheel_rad[wheel];
                assert!((-1e-12..quantum + 1e-12).contains(&below), "{below}");
            }
            if step > 400 {
                let ticks = reading.ticks.unwrap_or_default();
                assert!(ticks[0] * sign > ticks[1] * sign && ticks[1] * sign > 0, "{ticks:?}");
                // Resolution of the speed: one tick in the window of four samples.
                close(
                    reading.wheel_rad_per_s[0],
                    state.wheel_rad_per_s[0],
                    TAU / 1000.0 * 120.0 + 1e-3,
                );
                assert!(reading.wheel_rad_per_s[0] * f64::from(sign as i32) > 5.0);
            }
        }
    }
}

#[test]
fn ticks_are_the_floor_of_the_angle_on_both_sides_of_zero() {
    let settings = TickSettings {
        encoder_ticks_per_rev: 100,
        window_samples: 1,
    };
    let quantum = TAU / 100.0;
    for (turns, want) in [(0.0, 0), (0.5, 0), (1.5, 1), (-0.5, -1), (-1.5, -2), (12_345.5, 12_345)] {
        assert_eq!(settings.ticks(turns * quantum), want, "{turns}");
    }
}

#[test]
fn a_constant_speed_of_whole_ticks_is_read_exactly_whatever_the_window() {
    let robot = robot(diff2());
    for window in [1, 3, 64] {
        let mut suite = suite_with(&robot, |s| s.encoder = ticks(480, window));
        let mut streams = NoiseStreams::new(1, 0);
        let mut state = standing(&robot, Pose::default());
        for step in 0..200_u64 {
            // Two ticks a sample, in the middle of the tick.
            state.wheel_rad[0] = (2.0 * step as f64 + 0.5) * TAU / 480.0;
            let reading = suite.sample(&state, &OPEN_FLOOR, step, &mut streams).encoder;
            let speed = reading.map(|reading| reading.wheel_rad_per_s[0]).unwrap_or(f64::NAN);
            let want = if step == 0 { 0.0 } else { 2.0 * TAU };
            close(speed, want, 1e-12);
        }
    }
}

#[test]
fn a_longer_window_makes_the_speed_finer_and_later() {
    let robot = robot(diff2());
    let steps_to_see = |window: u32| {
        let mut suite = suite_with(&robot, |s| s.encoder = ticks(480, window));
        let mut streams = NoiseStreams::new(1, 0);
        let mut state = standing(&robot, Pose::default());
        state.wheel_rad[0] = 0.5 * TAU / 480.0;
        let mut sample = |state: &RobotState, step: u64| {
            let reading = suite.sample(state, &OPEN_FLOOR, step, &mut streams).encoder;
            reading.map_or(0.0, |reading| reading.wheel_rad_per_s[0])
        };
        for step in 0..100 {
            sample(&state, step);
        }
        (100..300_u64).find(|step| {
            state.wheel_rad[0] += TAU / 480.0;
            sample(&state, *step) > 0.99 * TAU
        })
    };
    assert_eq!(steps_to_see(1), Some(100));
    assert_eq!(steps_to_see(16), Some(115));
}

// Current, voltage, steering.

#[test]
fn current_is_positive_when_it_drives_forward() {
    for sign in [1.0, -1.0] {
        let (robot, state) = driven(diff2(), twist(sign, 0.0), 20);
        let readings = readings_of(&robot, &state, &OPEN_FLOOR);
        let current_a = readings.current_a.unwrap_or_default();
        assert!(current_a[0] * sign > 0.5 && current_a[1] * sign > 0.5, "{current_a:?}");
        assert_eq!(current_a[2], 0.0, "casters carry no motor");
        assert_eq!(readings.bus_v, Some(24.0));
    }
}

#[test]
fn steering_is_positive_to_the_left() {
    for sign in [1.0, -1.0] {
        let (robot, state) = driven(car("rwd"), twist(0.5, 0.5 * sign), 480);
        let steering = readings_of(&robot, &state, &OPEN_FLOOR).steering_rad;
        assert!(steering.unwrap_or(0.0) * sign > 0.1, "{steering:?}");
    }
}

// Gyro, accelerometer, magnetometer.

#[test]
fn gyro_is_positive_when_yaw_grows() {
    for sign in [1.0, -1.0] {
        let (robot, state) = driven(omni4(), twist(0.0, 0.8 * sign), 480);
        assert!(state.pose.yaw_rad * sign > 0.3);
        let gyro = readings_of(&robot, &state, &OPEN_FLOOR).gyro_z_rad_per_s;
        close(gyro.unwrap_or(0.0), 0.8 * sign, 0.05);
    }
}

#[test]
fn accelerometer_shows_gravity_upward_at_rest_and_the_push_forward_when_starting() {
    let robot = robot(diff2());
    let force = readings_of(&robot, &standing(&robot, Pose::default()), &OPEN_FLOOR).specific_force;
    assert_eq!(
        force.map(|f| [f.forward_m_per_s2, f.left_m_per_s2, f.up_m_per_s2]),
        Some([0.0, 0.0, 9.81])
    );
    for sign in [1.0, -1.0] {
        let (robot, state) = driven(diff2(), twist(sign, 0.0), 20);
        let force = readings_of(&robot, &state, &OPEN_FLOOR).specific_force;
        assert!(force.is_some_and(|f| f.forward_m_per_s2 * sign > 0.5), "{force:?}");
    }
}

/// Speed and radius come from the path alone: three points of it and the time between them.
#[test]
fn accelerometer_in_a_steady_circle_is_speed_squared_over_radius() {
    for sign in [1.0, -1.0] {
        let robot = robot(diff2());
        let command = robot.wheel_speeds(twist(0.7, 0.9 * sign));
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        let mut points = Vec::new();
        for step in 0..4320 {
            if step % 480 == 0 && step >= 2880 {
                points.push(free.state().pose);
            }
            free.step(&command);
        }
        let [a, b, c] = [points[0], points[1], points[2]];
        let area2 = (b.x_m - a.x_m) * (c.y_m - a.y_m) - (c.x_m - a.x_m) * (b.y_m - a.y_m);
        let radius_m = a.distance_m(&b) * b.distance_m(&c) * c.distance_m(&a) / (2.0 * area2.abs());
        let speed_m_per_s = radius_m * wrapped_rad(b.yaw_rad - a.yaw_rad).abs();
        let want = speed_m_per_s * speed_m_per_s / radius_m;
        assert!(area2 * sign > 0.0 && want > 0.5, "{want}");
        let force = readings_of(&robot, &free.state(), &OPEN_FLOOR).specific_force;
        let Some(force) = force else { panic!("no sample") };
        assert!(
            force.left_m_per_s2 * sign > 0.0,
            "toward the centre, left in a left-hand bend"
        );
        let size = (force.forward_m_per_s2 * force.forward_m_per_s2 + force.left_m_per_s2 * force.left_m_per_s2).sqrt();
        close(size, want, 1e-6 * want);
    }
}

#[test]
fn magnetometer_turns_against_the_yaw() {
    let robot = robot(omni4());
    let (north_rad, dip_rad) = (0.4, 1.0);
    let mut suite = suite_with(&robot, |s| {
        if let Some(magnetometer) = &mut s.magnetometer {
            magnetometer.magnetic_north_rad = north_rad;
            magnetometer.inclination_rad = dip_rad;
        }
    });
    let Some(settings) = suite.settings().magnetometer.clone() else {
        panic!("no magnetometer")
    };
    for index in -12..=12 {
        let yaw_rad = 0.25 * f64::from(index);
        let state = standing(&robot, pose(0.0, 0.0, yaw_rad));
        let field = suite
            .sample(&state, &OPEN_FLOOR, 0, &mut NoiseStreams::new(1, 0))
            .magnetic_field;
        let Some(field) = field else { panic!("no sample") };
        close(
            libm::atan2(field.left_t, field.forward_t),
            wrapped_rad(north_rad - yaw_rad),
            1e-15,
        );
        close(settings.yaw_rad(&field), yaw_rad, 1e-15);
        close(field.up_t, -5.0e-5 * libm::sin(dip_rad), 1e-20);
        let squares = field.forward_t * field.forward_t + field.left_t * field.left_t + field.up_t * field.up_t;
        close(squares.sqrt(), 5.0e-5, 1e-19);
    }
    let facing_east = standing(&robot, pose(0.0, 0.0, north_rad - FRAC_PI_2));
    let field = suite
        .sample(&facing_east, &OPEN_FLOOR, 0, &mut NoiseStreams::new(1, 0))
        .magnetic_field;
    assert!(
        field.is_some_and(|f| f.left_t > 2.0e-5),
        "north is to the left of a robot that faces east"
    );
}

// Together.

#[test]
fn a_robot_without_motor_or_steering_has_no_sensors_for_them() {
    let mut description = omni4();
    description.motor = None;
    let robot = robot(description);
    let settings = SensorSettings::of(&robot);
    assert!(settings.current.is_none() && settings.bus_voltage.is_none() && settings.steering.is_none());
    let nothing = match SensorSuite::new(&robot, SensorSettings::default()) {
        Ok(mut suite) => suite.sample(
            &standing(&robot, Pose::default()),
            &OPEN_FLOOR,
            0,
            &mut NoiseStreams::new(1, 0),
        ),
        Err(problem) => panic!("{problem}"),
    };
    assert_eq!(nothing, Readings::default());
}

#[test]
fn robots_in_a_world_see_each_other() {
    let make = || robot(omni4());
    let robots = vec![
        (make(), pose(-1.0, 0.0, 0.0), 0.25),
        (make(), pose(0.5, 0.0, 0.0), 0.25),
    ];
    let Ok(mut world) = World::new(ARENA, robots) else {
        panic!("no world")
    };
    let forward = make().wheel_speeds(twist(0.4, 0.0));
    let robot = make();
    let mut suite = suite(&robot);
    let mut streams = NoiseStreams::new(1, 0);
    for tick in 0..120_u64 {
        let other = world.state(1).pose;
        let circles = [Circle {
            x_m: other.x_m,
            y_m: other.y_m,
            radius_m: 0.25,
        }];
        let surroundings = Surroundings {
            arena: Some(world.arena()),
            circles: &circles,
            boxes: &[],
        };
        let state = world.state(0);
        let readings = suite.sample(&state, &surroundings, tick * u64::from(twin::SUBSTEPS), &mut streams);
        assert_eq!(readings.range_m.is_some(), tick % 6 == 0, "20 Hz");
        if let Some(range_m) = readings.range_m {
            let gap_m = state.pose.distance_m(&other) - 0.25 - robot.bounding_radius_m();
            close(range_m[3].unwrap_or(f64::NAN), gap_m, 1e-6);
        }
        assert!(world.step(&[forward, wheels(&[0.0; 4])]).is_ok());
    }
}

#[test]
fn the_bits_of_all_sensors_are_those_committed() {
    match golden::run() {
        Ok(digest) => assert_eq!(
            digest.to_string(),
            golden::DIGEST,
            "if that is meant, change twin::VERSION and the digest"
        ),
        Err(problem) => panic!("{problem}"),
    }
}

#[test]
fn noise_of_a_description_is_the_noise_of_its_sensors() {
    let mut description = car("awd");
    description.noise = Some(Noise {
        pose_xy_m: Some(0.001),
        pose_yaw_rad: Some(0.002),
        wheel_rad_per_s: Some(0.003),
        current_a: Some(0.004),
        gyro_rad_per_s: Some(0.005),
        accel_m_per_s2: Some(0.006),
        bus_v: Some(0.007),
        steering_rad: Some(0.008),
    });
    let settings = SensorSettings::of(&robot(description));
    let tracker = settings.tracked_pose.as_ref().map(|s| (s.noise_xy_m, s.noise_yaw_rad));
    assert_eq!(tracker, Some((0.001, 0.002)));
    assert_eq!(settings.encoder.map(|s| s.noise_rad_per_s), Some(0.003));
    assert_eq!(settings.current.map(|s| s.noise_a), Some(0.004));
    assert_eq!(settings.gyro.map(|s| s.noise_rad_per_s), Some(0.005));
    assert_eq!(settings.accelerometer.map(|s| s.noise_m_per_s2), Some(0.006));
    assert_eq!(settings.bus_voltage.map(|s| s.noise_v), Some(0.007));
    assert_eq!(settings.steering.map(|s| s.noise_rad), Some(0.008));
}
