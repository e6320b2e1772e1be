//! What runs on the robots, in the plant: steering, cascade, estimate, battery.

mod bench;

use api::robot::MotorController;
use bench::{Bench, every_chassis, forward, reference, wheels};
use emulator::faults::{FaultKind, FaultRequest};
use emulator::hidden::{Hidden, HiddenMagnetometer};
use robot::battery::Level;
use robot::frame::{Command, Fix, Header, Health, Payload, decode, encode_fix};
use robot::key::Key;

fn cascade() -> MotorController {
    MotorController {
        kind: "cascade".to_owned(),
        sample_rate_hz: 1920,
        computation_delay_samples: 1,
        encoder_ticks_per_rev: Some(4096),
        speed_window_samples: Some(8),
        speed_kp_a_s_per_rad: Some(0.5),
        speed_ki_a_per_rad: Some(2.5),
        current_kp_v_per_a: Some(0.12),
        current_ki_v_per_a_s: Some(360.0),
        current_limit_a: None,
    }
}

/// Set-points and steering of a car whose body origin is to drive at `speed` with a bicycle angle.
fn arc(description: &api::robot::RobotDescription, speed_m_per_s: f64, steering_rad: f64) -> (Command, f64) {
    let rear_m = -0.13;
    let yaw_rate = speed_m_per_s * steering_rad.tan() / 0.26;
    let mut command = Command {
        enable: true,
        steering_rad,
        ..Command::default()
    };
    let driven = description.wheels.iter().filter(|wheel| wheel.driven);
    for (set_point, wheel) in command.wheel_rad_per_s.iter_mut().zip(driven) {
        // Around the turning centre every hub has its own speed.
        let (along, across) = (speed_m_per_s - yaw_rate * wheel.y_m, yaw_rate * (wheel.x_m - rear_m));
        *set_point = along.hypot(across) / wheel.radius_m.unwrap();
    }
    (command, yaw_rate)
}

#[test]
fn cars_drive_arcs_by_their_bicycle_angle_both_ways() {
    let description = every_chassis();
    for (index, robot) in description.robots.iter().enumerate().skip(3) {
        for (speed_m_per_s, steering_rad) in [(0.4f64, 0.3), (0.4, -0.3), (-0.4, 0.3)] {
            let (mut command, yaw_rate) = arc(&robot.description, speed_m_per_s.abs(), steering_rad);
            let backward = speed_m_per_s < 0.0;
            if backward {
                command.wheel_rad_per_s = command.wheel_rad_per_s.map(|speed| -speed);
            }
            let mut bench = Bench::new(&description, Hidden::neutral(), 3);
            bench.place(&[(robot.number, 0.0, 0.0, 0.0)]);
            bench.drive_for(1.5, |_| Some(command));
            let before = bench.pose(index);
            bench.drive_for(1.0, |_| Some(command));
            let turned = bench.pose(index).yaw_rad - before.yaw_rad;
            let by_hand = if backward { -yaw_rate } else { yaw_rate };
            println!(
                "{} {speed_m_per_s} m/s: {turned} rad of {by_hand}",
                robot.description.name
            );
            assert!(
                (turned / by_hand - 1.0).abs() < 0.1,
                "{}: {turned} {by_hand}",
                robot.description.name
            );
            let told = bench.telemetry[index].unwrap().steering_rad;
            assert!((told - steering_rad).abs() < 0.02, "{told}");
        }
    }
}

#[test]
fn every_chassis_runs_its_cascade() {
    let mut description = every_chassis();
    for robot in &mut description.robots {
        robot.description.motor.as_mut().unwrap().controller = Some(cascade());
    }
    for (index, robot) in description.robots.iter().enumerate() {
        let mut bench = Bench::new(&description, Hidden::reference().unwrap(), 1);
        bench.place(&[(robot.number, -1.0, 0.0, 0.0)]);
        let set_points = forward(&robot.description, 0.5);
        bench.drive_for(2.0, |_| wheels(set_points));
        let driven = robot.description.wheels.iter().filter(|wheel| wheel.driven).count();
        let (mut squares, mut most_a): (f64, f64) = (0.0, 0.0);
        for _ in 0..120 {
            bench.period(|_| wheels(set_points));
            let telemetry = bench.telemetry[index].unwrap();
            let wheels = telemetry
                .wheel_rad_per_s
                .iter()
                .zip(set_points)
                .zip(telemetry.current_a);
            for ((speed, set_point), current_a) in wheels.take(driven) {
                squares += (speed - set_point).powi(2) / (120 * driven) as f64;
                most_a = most_a.max(current_a.abs());
            }
        }
        let rms = squares.sqrt();
        println!(
            "{}: {rms} rad/s off {:?}, at most {most_a} A",
            robot.description.name, set_points[0]
        );
        assert!(
            rms < 0.5 && most_a < 9.0,
            "{}: {rms} rad/s, {most_a} A",
            robot.description.name
        );
        let moved_m = bench.pose(index).x_m + 1.0;
        assert!(
            (1.2..1.6).contains(&moved_m),
            "{}: {moved_m} m in 3 s",
            robot.description.name
        );
    }
}

#[test]
fn controllers_that_cannot_be_run_are_refused_with_field_and_limit() {
    type Spoil = fn(&mut MotorController);
    let cases: [(Spoil, &str); 5] = [
        (|c| c.sample_rate_hz = 500, "sample_rate_hz"),
        (|c| c.sample_rate_hz = 9600, "7680"),
        (|c| c.computation_delay_samples = 9, "computation_delay_samples"),
        (|c| c.current_kp_v_per_a = None, "current_kp_v_per_a"),
        (|c| c.kind = "fuzzy".to_owned(), "cascade"),
    ];
    for (spoil, word) in cases {
        let mut description = reference();
        let mut controller = cascade();
        spoil(&mut controller);
        description.robots[0].description.motor.as_mut().unwrap().controller = Some(controller);
        let refused = emulator::Laboratory::new(&description, Hidden::neutral(), &bench::keys(), 1).unwrap_err();
        assert!(refused.to_string().contains(word), "{word}: {refused}");
    }
}

fn health(bench: &mut Bench, index: usize, now_us: i64) -> Health {
    let mut out = [0; 160];
    let unit = bench.laboratory.unit_mut(index).unwrap();
    let length = unit.health_report(now_us, &mut out);
    let key = Key::from_hex(bench::KEY_HEX).unwrap();
    let Payload::Health(health) = decode(&out[..length], &key).unwrap().payload else {
        panic!("not health")
    };
    health
}

#[test]
fn a_robot_knows_where_it_is_with_fixes_and_for_a_while_without() {
    let description = reference();
    let mut hidden = Hidden::reference().unwrap();
    hidden.robots.entry("omni-01".to_owned()).or_default().magnetometer = Some(HiddenMagnetometer {
        north_rad: 0.4,
        field_t: 2e-5,
        noise_t: 4e-7,
        offset_t: [3e-7, -2e-7],
    });
    let key = Key::from_hex(bench::KEY_HEX).unwrap();
    let mut bench = Bench::new(&description, hidden, 6);
    bench.place(&[(1, -0.5, 0.2, 0.7)]);
    let mut worst_m: f64 = 0.0;
    for period in 0..1200u32 {
        let fixed = period < 720;
        let turning = if period < 120 { [0.0; 4] } else { [7.0, 2.0, -3.0, 2.0] };
        // The bench sends a command a period under an odd sequence of its own; fixes go in between.
        bench.period(|_| wheels(turning));
        let (sequence, echo_ms, now_us) = bench.between();
        if fixed {
            let pose = bench.pose(0);
            let header = Header {
                robot: 1,
                epoch: 1,
                sequence,
                tick: period,
                clock_ms: (now_us / 1000) as u32,
                echo_ms,
            };
            let fix = Fix {
                x_m: pose.x_m,
                y_m: pose.y_m,
                yaw_rad: pose.yaw_rad - std::f64::consts::TAU * (pose.yaw_rad / std::f64::consts::TAU).round(),
                exposure_ms: (now_us / 1000) as u32,
                position_sd_m: 0.001,
                yaw_sd_rad: 0.003,
            };
            let mut out = [0; 96];
            let length = encode_fix(&header, &fix, &key, &mut out);
            bench
                .laboratory
                .unit_mut(0)
                .unwrap()
                .receive(&out[..length], now_us + 1000);
        }
        if period == 719 || period == 1199 {
            let told = health(&mut bench, 0, now_us);
            let pose = bench.pose(0);
            let gap_m = (told.x_m - pose.x_m).hypot(told.y_m - pose.y_m);
            worst_m = worst_m.max(gap_m);
            println!(
                "period {period}: {gap_m} m off, said {} m; bias {}",
                told.position_sd_m, told.gyro_bias_rad_per_s
            );
            assert!(
                told.anchored && gap_m < 3.0 * told.position_sd_m + 5e-3,
                "{told:?} {pose:?}"
            );
            if period == 719 {
                assert!(told.bounded && gap_m < 0.01, "{told:?} {pose:?}");
                // Hidden bias of omni-01: 0.004.
                assert!((told.gyro_bias_rad_per_s - 0.004).abs() < 1e-3, "{told:?}");
            }
        }
    }
    assert!(worst_m < 0.15, "{worst_m} m after 4 s without a fix");
    bench.place(&[(1, 0.5, 0.0, 0.0)]);
    bench.drive_for(0.1, |_| wheels([0.0; 4]));
    let (_, _, now_us) = bench.between();
    assert!(!health(&mut bench, 0, now_us).anchored, "it was lifted");
}

#[test]
fn a_battery_runs_down_level_by_level_and_stops_the_robot() {
    let description = reference();
    let mut bench = Bench::new(&description, Hidden::reference().unwrap(), 2);
    bench.place(&[(1, 0.0, 0.0, 0.0)]);
    bench.drive_for(1.0, |_| wheels([3.0; 4]));
    let drain = FaultRequest {
        number: 1,
        kind: FaultKind::DrainBattery { charge_per_s: 0.05 },
    };
    bench.laboratory.set_fault(drain).unwrap();
    let mut seen = vec![Level::Good];
    for _ in 0..120 * 25 {
        bench.period(|_| wheels([3.0; 4]));
        let level = bench.laboratory.units()[0].firmware().findings().battery;
        if seen.last() != Some(&level) {
            println!(
                "{level:?} at {} V",
                bench.laboratory.units()[0].firmware().battery().rest_v()
            );
            seen.push(level);
        }
    }
    assert_eq!(seen, [Level::Good, Level::Low, Level::Critical, Level::Empty]);
    let telemetry = bench.telemetry[0].unwrap();
    assert!(telemetry.status.latched && telemetry.status.stopped);
    assert!(
        telemetry.wheel_rad_per_s.iter().all(|speed| speed.abs() < 0.3),
        "{telemetry:?}"
    );
}

#[test]
fn a_wheel_that_is_stuck_stops_the_robot_and_says_so() {
    let description = reference();
    let mut bench = Bench::new(&description, Hidden::neutral(), 2);
    bench.place(&[(1, 0.0, 0.0, 0.0)]);
    bench.drive_for(1.0, |_| wheels([5.0; 4]));
    let stuck = FaultRequest {
        number: 1,
        kind: FaultKind::StuckWheel { wheel: 1 },
    };
    bench.laboratory.set_fault(stuck).unwrap();
    bench.drive_for(6.0, |_| wheels([5.0; 4]));
    assert!(bench.telemetry[0].unwrap().status.stopped);
    assert!(bench.speed_m_per_s(0) < 0.02, "{}", bench.speed_m_per_s(0));
}

#[test]
fn swapped_identities_show_in_the_tracker_and_end_together() {
    let description = reference();
    let mut bench = Bench::new(&description, Hidden::neutral(), 2);
    bench.place(&[(1, -1.0, 0.0, 0.0), (2, 1.0, 0.0, 0.0)]);
    let swap = FaultRequest {
        number: 1,
        kind: FaultKind::SwapIdentity { with: 2 },
    };
    bench.laboratory.set_fault(swap).unwrap();
    let of_one = |bench: &mut Bench| loop {
        if let Some(pose) = bench.laboratory.expose().iter().find(|pose| pose.number == 1) {
            break pose.x_m;
        }
    };
    assert!(of_one(&mut bench) > 0.9);
    let end = FaultRequest {
        number: 2,
        kind: FaultKind::None,
    };
    bench.laboratory.set_fault(end).unwrap();
    assert!(of_one(&mut bench) < -0.9);
    let nobody = FaultRequest {
        number: 1,
        kind: FaultKind::SwapIdentity { with: 99 },
    };
    assert!(bench.laboratory.set_fault(nobody).is_err());
}
