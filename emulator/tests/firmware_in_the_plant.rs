//! Firmware and plant together, through frames only.

mod bench;

use bench::{Bench, every_chassis, forward, reference, wheels};
use emulator::camera::{CameraSet, CameraSettings};
use emulator::faults::{FaultKind, FaultRequest, LostWay};
use emulator::hidden::Hidden;
use robot::frame::Command;

fn hidden() -> Hidden {
    Hidden::reference().unwrap()
}

fn fault(bench: &mut Bench, number: u8, kind: FaultKind) {
    bench.laboratory.set_fault(FaultRequest { number, kind }).unwrap();
}

#[test]
fn every_chassis_reaches_its_commanded_wheel_speeds() {
    let description = every_chassis();
    for (index, robot) in description.robots.iter().enumerate() {
        let mut bench = Bench::new(&description, hidden(), 1);
        bench.place(&[(robot.number, -1.0, 0.0, 0.0)]);
        let set_points = forward(&robot.description, 0.5);
        bench.drive_for(2.0, |_| wheels(set_points));
        let pose = bench.pose(index);
        let telemetry = bench.telemetry[index].unwrap();
        assert!(
            telemetry.status.running && telemetry.status.clock_known && !telemetry.status.latched,
            "{:?}",
            telemetry.status
        );
        let wheel_speeds: Vec<f64> = bench.laboratory.units()[index]
            .on_floor()
            .unwrap()
            .driven_wheels()
            .map(|wheel| wheel.speed_rad_per_s)
            .collect();
        for (speed, set_point) in wheel_speeds.iter().zip(set_points) {
            assert!(
                (speed - set_point).abs() < 0.4 + 0.03 * set_point.abs(),
                "{}: {speed} of {set_point}",
                robot.description.name
            );
        }
        assert!(
            (pose.x_m + 1.0 - 0.95).abs() < 0.15,
            "{}: {pose:?}",
            robot.description.name
        );
        assert!(
            (bench.speed_m_per_s(index) - 0.5).abs() < 0.05,
            "{}: {} m/s",
            robot.description.name,
            bench.speed_m_per_s(index)
        );
        assert!((18.0..26.0).contains(&telemetry.bus_v));
    }
}

#[test]
fn motors_do_not_chatter_in_the_backlash_of_their_gears() {
    let description = reference();
    for (index, robot) in description.robots.iter().enumerate() {
        let mut bench = Bench::new(&description, hidden(), 4);
        bench.place(&[(robot.number, -1.0, 0.0, 0.0)]);
        // Reversals open the play; the slow drive after them loads the gears so little that they could stay open.
        for speed_m_per_s in [0.4, -0.4, 0.4, 0.05] {
            bench.drive_for(1.0, |_| wheels(forward(&robot.description, speed_m_per_s)));
        }
        let set_points = forward(&robot.description, 0.05);
        let wheel_count = robot.description.wheels.iter().filter(|wheel| wheel.driven).count();
        let mut energy = vec![0.0; wheel_count];
        for _ in 0..120 {
            bench.drive_for(1.0 / 120.0, |_| wheels(set_points));
            let telemetry = bench.telemetry[index].unwrap();
            for (k, sum) in energy.iter_mut().enumerate() {
                *sum += (telemetry.wheel_rad_per_s[k] - set_points[k]).powi(2) / 120.0;
            }
        }
        for (k, sum) in energy.iter().enumerate() {
            let rms_rad_per_s = sum.sqrt();
            println!("{} wheel {k}: {rms_rad_per_s} rad/s", robot.description.name);
            assert!(
                rms_rad_per_s < 0.5,
                "{} wheel {k}: {rms_rad_per_s} rad/s off its set-point",
                robot.description.name
            );
        }
    }
}

#[test]
fn a_robot_whose_link_is_cut_stops_within_the_promised_distance() {
    let description = reference();
    for (index, robot) in description.robots.iter().enumerate() {
        let mut bench = Bench::new(&description, hidden(), 2);
        bench.place(&[(robot.number, -1.5, 0.0, 0.0)]);
        bench.drive_for(2.0, |_| wheels(forward(&robot.description, 0.5)));
        let speed_m_per_s = bench.speed_m_per_s(index);
        let cut_x_m = bench.pose(index).x_m;
        bench.drive_for(1.0, |_| None);
        let distance_m = bench.pose(index).x_m - cut_x_m;
        // v (tau_link + 0.1 + tau_act) + v^2 / 2a: a control period has passed since the last command, and a PI speed loop
        // follows a ramp k_e / k_i late.
        let motor = robot.description.motor.as_ref().unwrap();
        let tau_act_s = motor.gear_ratio * motor.torque_constant_n_m_per_a / motor.speed_loop_ki_v_per_rad;
        let promised_m = speed_m_per_s * (1.0 / 120.0 + 0.1 + tau_act_s) + speed_m_per_s * speed_m_per_s / 4.0;
        println!(
            "{}: {distance_m} m of {promised_m} m at {speed_m_per_s} m/s",
            robot.description.name
        );
        assert!(bench.speed_m_per_s(index) < 0.01 && distance_m < promised_m && distance_m > speed_m_per_s * 0.1);
        assert!(bench.telemetry[index].unwrap().status.latched);
        bench.drive_for(0.5, |_| wheels([5.0; 4]));
        assert!(bench.speed_m_per_s(index) < 0.01, "latched");
        bench.drive_for(0.5, |_| {
            Some(Command {
                clear: true,
                ..wheels(forward(&robot.description, 0.3)).unwrap()
            })
        });
        assert!(bench.speed_m_per_s(index) > 0.1, "cleared");
    }
}

#[test]
fn motion_needs_frames_and_a_placed_robot_keeps_its_epoch() {
    let description = reference();
    let mut bench = Bench::new(&description, hidden(), 2);
    bench.place(&[(1, 0.0, 0.0, 0.0)]);
    bench.drive_for(0.5, |_| wheels([3.0; 4]));
    bench.place(&[(1, 0.5, 0.5, 1.0), (2, -0.5, -0.5, 0.0)]);
    assert_eq!(bench.laboratory.units()[0].firmware().epoch(), 1);
    let placed = bench.pose(0);
    assert!(
        (placed.x_m - 0.5).abs() < 1e-12 && (placed.y_m - 0.5).abs() < 1e-12 && placed.yaw_rad == 1.0,
        "{placed:?}"
    );
    bench.drive_for(1.0, |_| None);
    let rested = bench.pose(1);
    assert!((rested.x_m + 0.5).hypot(rested.y_m + 0.5) < 1e-3, "{rested:?}");
}

#[test]
fn faults_do_what_they_say() {
    let description = reference();
    let mut bench = Bench::new(&description, hidden(), 4);
    bench.place(&[
        (1, -1.0, 0.0, 0.0),
        (2, 1.0, 0.0, 0.0),
        (3, 0.0, 1.0, 0.0),
        (4, 0.0, -1.0, 0.0),
    ]);
    let spin = |_: usize| wheels([4.0; 4]);
    bench.drive_for(1.0, spin);
    fault(&mut bench, 1, FaultKind::Dead);
    fault(&mut bench, 2, FaultKind::StuckWheel { wheel: 2 });
    fault(&mut bench, 3, lost(1.0, LostWay::Both));
    fault(&mut bench, 4, FaultKind::TrackerLost);
    bench.drive_for(1.5, spin);
    assert!(bench.telemetry[0].is_none() && bench.speed_m_per_s(0) < 0.05, "dead");
    assert!(bench.telemetry[1].unwrap().wheel_rad_per_s[2].abs() < 0.5, "stuck");
    assert!(bench.telemetry[2].is_none(), "dropped");
    assert!(
        bench.laboratory.expose().iter().all(|pose| pose.number != 4),
        "tracker lost"
    );
    for number in 1..=4 {
        fault(&mut bench, number, FaultKind::None);
    }
    bench.drive_for(0.5, |_| {
        Some(Command {
            clear: true,
            ..Command::default()
        })
    });
    assert!(bench.telemetry.iter().all(Option::is_some));
    assert!(
        bench
            .laboratory
            .set_fault(FaultRequest {
                number: 99,
                kind: FaultKind::Dead
            })
            .is_err()
    );
    assert!(
        bench
            .laboratory
            .set_fault(FaultRequest {
                number: 1,
                kind: lost(1.5, LostWay::Both)
            })
            .is_err()
    );
}

fn lost(fraction: f64, way: LostWay) -> FaultKind {
    FaultKind::DropFrames { fraction, way }
}

#[test]
fn a_link_that_is_cut_one_way_leaves_the_other() {
    let description = reference();
    let mut bench = Bench::new(&description, hidden(), 4);
    bench.place(&[(1, -1.0, 0.0, 0.0), (2, 1.0, 0.0, 0.0)]);
    let spin = |_: usize| wheels([4.0; 4]);
    bench.drive_for(1.0, spin);
    let read = |text: &str| serde_json::from_str::<FaultRequest>(text).expect("a fault");
    for request in [
        read(r#"{"number": 1, "kind": "drop_frames", "fraction": 1.0, "way": "down"}"#),
        read(r#"{"number": 2, "kind": "drop_frames", "fraction": 1.0, "way": "up"}"#),
    ] {
        bench.laboratory.set_fault(request).expect("accepted");
    }
    bench.drive_for(1.5, spin);
    let wheel = |robot: usize| bench.laboratory.units()[robot].firmware().set_point().wheel_rad_per_s[0];
    assert!(
        bench.telemetry[0].is_some() && wheel(0).abs() < 0.1,
        "hears nothing, is heard"
    );
    assert!(
        bench.telemetry[1].is_none() && wheel(1).abs() > 1.0,
        "hears, is not heard"
    );
    let both = read(r#"{"number": 1, "kind": "drop_frames", "fraction": 0.5}"#);
    assert_eq!(both.kind, lost(0.5, LostWay::Both));
}

#[test]
fn a_frozen_tracker_repeats_and_a_low_battery_sags() {
    let description = reference();
    let mut bench = Bench::new(&description, hidden(), 4);
    bench.place(&[(1, -1.0, 0.0, 0.0)]);
    let seen = loop {
        if let Some(pose) = bench.laboratory.expose().first() {
            break *pose;
        }
    };
    let full_v = {
        bench.drive_for(0.2, |_| wheels([0.0; 4]));
        bench.telemetry[0].unwrap().bus_v
    };
    fault(&mut bench, 1, FaultKind::TrackerFrozen);
    fault(&mut bench, 1, FaultKind::LowBattery { charge: 0.02 });
    bench.drive_for(1.0, |_| wheels(forward(&description.robots[0].description, 0.5)));
    assert!(bench.laboratory.expose().iter().all(|pose| *pose == seen));
    assert!(bench.telemetry[0].unwrap().bus_v < full_v - 2.0);
}

#[test]
fn a_seed_repeats_exactly_and_runs_differ_from_one_another() {
    let description = reference();
    let run = |bench: &mut Bench| {
        bench.place(&[(1, -1.0, 0.0, 0.0), (5, 0.5, 0.5, 0.3)]);
        bench.drive_for(1.0, |index| {
            wheels(forward(&description.robots[index].description, 0.6))
        });
        bench.drive_for(0.3, |_| wheels([0.0; 4]));
        (bench.pose(0), bench.pose(4))
    };
    let (mut one, mut same, mut other) = (
        Bench::new(&description, hidden(), 8),
        Bench::new(&description, hidden(), 8),
        Bench::new(&description, hidden(), 9),
    );
    let first = run(&mut one);
    assert_eq!(first, run(&mut same));
    assert_ne!(first, run(&mut other));
    // The first run of a firmware starts later by a few frames, until the clocks are known.
    let (second, third) = (run(&mut one), run(&mut one));
    let gap_m = (second.0.x_m - third.0.x_m).hypot(second.0.y_m - third.0.y_m);
    println!("runs differ by {gap_m} m");
    assert!(gap_m > 1e-5 && gap_m < 0.03, "{gap_m}");
}

#[test]
fn the_hand_refuses_what_cannot_stand() {
    let mut bench = Bench::new(&reference(), hidden(), 1);
    let mut cameras = CameraSet::start(&[], &CameraSettings::default(), 60.0, 0).unwrap();
    let mut ask = |line: &str| {
        let reply = emulator::hand::answer(line.as_bytes(), &mut bench.laboratory, &mut cameras);
        String::from_utf8(reply).unwrap()
    };
    assert_eq!(
        ask(r#"{"place":[{"number":1,"x_m":0,"y_m":0,"yaw_rad":0}]}"#),
        r#"{"ok":true}"#
    );
    for (line, reason) in [
        (
            r#"{"place":[{"number":99,"x_m":0,"y_m":0,"yaw_rad":0}]}"#,
            "no robot 99",
        ),
        (r#"{"place":[{"number":1,"x_m":1.8,"y_m":0,"yaw_rad":0}]}"#, "floor"),
        (
            r#"{"place":[{"number":1,"x_m":0,"y_m":0,"yaw_rad":0},{"number":2,"x_m":0.4,"y_m":0,"yaw_rad":0}]}"#,
            "overlap",
        ),
        (
            r#"{"place":[{"number":1,"x_m":0,"y_m":0,"yaw_rad":0},{"number":1,"x_m":1,"y_m":0,"yaw_rad":0}]}"#,
            "twice",
        ),
        (r#"{"fault":{"number":1,"kind":"on_fire"}}"#, "not a request"),
        (r#"{"camera_fault":{"camera":0,"kind":"frozen"}}"#, "no camera 0"),
        (
            r#"{"hide":{"effect":"wheel_radius_one","robot":"diff-01","wheel":4,"relative":0.01}}"#,
            "diff-01 has no wheel 4; it has 4, from 0",
        ),
        (
            r#"{"hide":{"effect":"wheel_misalignment","robot":"diff-01","wheel":2,"toe_rad":0.01}}"#,
            "diff-01 has no direction or radius of its own at wheel 2, a caster",
        ),
        (
            r#"{"hide":{"effect":"weak_motor","robot":"diff-01","motor":2,"gain":0.8}}"#,
            "diff-01 has no motor 2; it has 2, from 0",
        ),
        (
            r#"{"hide":{"effect":"steering_scale","robot":"omni-01","scale":0.9}}"#,
            "omni-01 has no steered wheel",
        ),
        (
            r#"{"hide":{"effect":"roller_drag","robot":"rwd-01","per_wheel_n_s_per_m":1}}"#,
            "rwd-01 has no omni wheel",
        ),
        (
            r#"{"hide":{"effect":"steering_lag","robot":"rwd-01","time_constant_s":2}}"#,
            "time_constant_s 2 is outside 0..=1",
        ),
        ("{}", "neither"),
        ("nonsense", "not a request"),
    ] {
        let reply = ask(line);
        assert!(
            reply.contains(r#""ok":false"#) && reply.contains(reason),
            "{line}: {reply}"
        );
    }
    assert_eq!(
        ask(r#"{"fault":{"number":1,"kind":"stuck_wheel","wheel":0}}"#),
        r#"{"ok":true}"#
    );
    assert!(
        bench.laboratory.units()[0].on_floor().is_some(),
        "a refused request changes nothing"
    );
}

#[test]
fn every_robot_of_the_reference_laboratory_hides_something() {
    let (hidden, neutral) = (hidden(), emulator::hidden::HiddenRobot::default());
    for robot in &reference().robots {
        let name = &robot.description.name;
        let own = hidden
            .robots
            .get(name)
            .unwrap_or_else(|| panic!("{name} is not listed"));
        assert!(
            own.mass_scale != neutral.mass_scale || own.com_x_m != neutral.com_x_m,
            "{name}"
        );
        assert!(own.wheel_radius_scale.len() <= robot.description.wheels.len(), "{name}");
        assert_eq!(
            robot.description.steering.is_some(),
            own.steering_play_rad > 0.0,
            "{name}"
        );
    }
}
