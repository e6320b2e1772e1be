//! The laws in closed loop with the twin, on every chassis.

mod common;

use common::{CHASSIS, parsed, team};
use control::TICK_S;
use control::rehearsal::{Rehearsal, rehearse_json};
use control::verdict::Verdict;
use serde_json::{Value, json};

fn run(document: &Value) -> (Verdict, Vec<Vec<[f64; 3]>>) {
    let outcome = rehearse_json(&document.to_string()).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let poses = outcome.replay.robots.into_iter().map(|robot| robot.poses).collect();
    (outcome.verdict, poses)
}

fn turn(from_rad: f64, to_rad: f64) -> f64 {
    twin::pose::wrapped_rad(to_rad - from_rad)
}

/// 1 cm and 2 degrees, on every chassis, from 16 starts; the run ends when the robot has stood there for a second.
#[test]
fn go_to_pose_arrives_on_every_chassis_from_every_side() {
    for chassis in CHASSIS {
        let (mut worst_m, mut worst_rad, mut longest_s) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..16 {
            let around = f64::from(k) / 16.0 * core::f64::consts::TAU;
            let yaw_rad = turn(0.0, 2.4 * f64::from(k));
            let start = [0.3 + 1.1 * libm::cos(around), -0.1 + 0.9 * libm::sin(around), yaw_rad];
            let targets = json!([{"x_m": 0.2, "y_m": -0.1, "yaw_rad": 0.8}]);
            let (verdict, poses) = run(&team(
                "go_to_pose",
                json!({}),
                &[(chassis, start)],
                targets,
                120.0,
                [4.0, 3.0],
            ));
            let [x, y, yaw] = *poses[0].last().expect("poses");
            let off_m = libm::hypot(x - 0.2, y + 0.1);
            let off_rad = turn(yaw, 0.8).abs();
            let time_s = verdict.ticks as f64 * TICK_S;
            assert!(
                verdict.findings.is_empty(),
                "{chassis} {k} {start:?}: {:#?}",
                verdict.findings
            );
            assert!(
                off_m < 0.01 && off_rad < 2.0_f64.to_radians(),
                "{chassis} {k}: {off_m} m {off_rad} rad"
            );
            (worst_m, worst_rad) = (worst_m.max(off_m), worst_rad.max(off_rad));
            longest_s = longest_s.max(time_s);
        }
        println!(
            "{chassis}: {:.1} mm, {:.2} deg, {longest_s:.1} s",
            1e3 * worst_m,
            worst_rad.to_degrees()
        );
    }
}

/// A robot without a target stands on the straight way, another beside it, and a box beyond them; every chassis comes to its
/// place, as an omni-directional one and as a car of them must: round what stands.
#[test]
fn go_to_pose_goes_round_what_stands() {
    for chassis in CHASSIS {
        let robots = [
            (chassis, [-1.9, 0.0, 0.0]),
            ("omni4", [0.0, 0.05, 0.0]),
            ("diff2", [0.3, -0.75, 1.0]),
        ];
        let targets = json!([{"robot": "r0", "x_m": 1.9, "y_m": 0.1, "yaw_rad": 0.3}]);
        let mut document = team("go_to_pose", json!({}), &robots, targets, 90.0, [5.0, 4.0]);
        document["arena"]["contents"] = json!({"fixed": [{"name": "box", "shape": {"rectangle": {"length_m": 0.3, "width_m": 0.3}},
            "pose": {"x_m": 0.9, "y_m": 0.6, "yaw_rad": 0.4}}]});
        let (verdict, poses) = run(&document);
        let [x, y, yaw] = *poses[0].last().expect("poses");
        let (off_m, off_rad) = (libm::hypot(x - 1.9, y - 0.1), turn(yaw, 0.3).abs());
        println!("{chassis}: {:.1} s", verdict.ticks as f64 * TICK_S);
        assert!(verdict.findings.is_empty(), "{chassis}: {:#?}", verdict.findings);
        assert!(
            off_m < 0.01 && off_rad < 2.0_f64.to_radians(),
            "{chassis}: {off_m} m {off_rad} rad"
        );
        let [x, y, _] = *poses[1].last().expect("poses");
        assert!(libm::hypot(x, y - 0.05) < 0.05, "{chassis}: pushed aside to {x} {y}");
    }
}

/// Largest distance from the path (polyline; for car-like robots without the corners).
#[test]
fn path_following_stays_on_the_path_on_every_chassis() {
    for chassis in CHASSIS {
        let targets = json!([{"x_m": 0.6, "y_m": -0.8}, {"x_m": 1.3, "y_m": 0.6}, {"x_m": -1.2, "y_m": 0.9}]);
        let start = [-1.4, -0.7, 0.2];
        let (verdict, poses) = run(&team(
            "path_following",
            json!({}),
            &[(chassis, start)],
            targets,
            60.0,
            [4.0, 3.0],
        ));
        let [x, y, _] = *poses[0].last().expect("poses");
        let error_m = verdict.largest_path_error_m.expect("a path");
        println!(
            "{chassis}: {:.1} mm off the path, {:.1} s, ends {:.1} mm away",
            1e3 * error_m,
            verdict.ticks as f64 * TICK_S,
            1e3 * libm::hypot(x + 1.2, y - 0.9)
        );
        assert!(
            verdict.accepted && verdict.findings.is_empty(),
            "{chassis}: {:#?}",
            verdict.findings
        );
        assert!(error_m < 0.06, "{chassis}: {error_m}");
        assert!(libm::hypot(x + 1.2, y - 0.9) < 0.05, "{chassis}");
    }
}

/// RMS of the distance between robot and reference over the whole trajectory, in the nominal twin.
#[test]
fn trajectory_tracking_stays_close_on_every_chassis() {
    for chassis in CHASSIS {
        let targets = json!([{"x_m": 0.3, "y_m": -1.3}, {"x_m": 1.7, "y_m": -0.1}, {"x_m": 0.2, "y_m": 1.3}, {"x_m": -1.6, "y_m": 1.0}]);
        let document = team(
            "trajectory_tracking",
            json!({"interval_s": 6.0}),
            &[(chassis, [-1.4, -1.0, -0.3])],
            targets,
            30.0,
            [5.0, 4.0],
        );
        let mut rehearsal = Rehearsal::new(&parsed(&document)).expect("rehearsal");
        let (mut squares, mut count) = (0.0, 0.0);
        while rehearsal.step() {
            let frame = rehearsal.frame();
            if (2.0..=26.0).contains(&frame.time_s) {
                let robot = &frame.robots[0];
                let off_m = libm::hypot(robot.pose[0] - robot.target[0], robot.pose[1] - robot.target[1]);
                squares += off_m * off_m;
                count += 1.0;
            }
        }
        let verdict = rehearsal.finish().verdict;
        let rms_m: f64 = libm::sqrt(squares / count);
        println!("{chassis}: RMS {:.1} mm", 1e3 * rms_m);
        assert!(
            verdict.accepted && verdict.findings.is_empty(),
            "{chassis}: {:#?}",
            verdict.findings
        );
        // Four fixed wheels skid in every bend and turn less than they are told.
        let bound_m = if chassis == "diff4" { 0.04 } else { 0.015 };
        assert!(rms_m < bound_m, "{chassis}: {rms_m}");
    }
}

/// String stability: along the string the largest error of the spacing does not grow (5 % and 5 mm for the corner of the
/// leader), and at the end everyone stands in line.
#[test]
fn a_string_of_four_followers_is_stable() {
    for chassis in CHASSIS {
        let robots: Vec<(&str, [f64; 3])> = (0..5)
            .map(|i| (chassis, [3.0 - 0.8 * f64::from(i), -2.0, 0.0]))
            .collect();
        let targets = json!([{"robot": "r0", "x_m": 6.0, "y_m": -2.0}, {"robot": "r0", "x_m": 7.5, "y_m": 0.5}, {"robot": "r0", "x_m": 7.0, "y_m": 4.0}]);
        let document = team(
            "leader_follower",
            json!({"distance_m": 0.8, "speed_m_per_s": 0.35}),
            &robots,
            targets,
            90.0,
            [18.0, 12.0],
        );
        let (verdict, poses) = run(&document);
        let mut largest = [0.0_f64; 4];
        for (i, largest) in largest.iter_mut().enumerate() {
            for (a, b) in poses[i].iter().zip(&poses[i + 1]) {
                let error_m = (libm::hypot(a[0] - b[0], a[1] - b[1]) - 0.8).abs();
                *largest = largest.max(error_m);
            }
        }
        println!(
            "{chassis}: largest spacing errors {largest:.3?} m, {:.1} s",
            verdict.ticks as f64 * TICK_S
        );
        assert!(
            verdict.accepted && verdict.findings.is_empty(),
            "{chassis}: {:#?}",
            verdict.findings
        );
        for pair in largest.windows(2) {
            assert!(pair[1] <= 1.05 * pair[0] + 0.005, "{chassis}: {largest:?}");
        }
    }
}

/// Law, parameters, targets (for one robot or for the team) in a 9 by 8 m room.
fn every_law() -> Vec<(&'static str, Value, Value)> {
    let goals = [[1.5, 2.0], [-1.0, 2.4], [2.2, -0.6]];
    let of_robots = |yaw: bool| -> Value {
        (0..3)
            .map(|i| {
                let mut target = json!({"robot": format!("r{i}"), "x_m": goals[i][0], "y_m": goals[i][1]});
                if yaw {
                    target["yaw_rad"] = json!(1.0);
                }
                target
            })
            .collect()
    };
    let of_team: Value = goals.iter().map(|[x, y]| json!({"x_m": x, "y_m": y})).collect();
    let given = json!([{"robot": "r0", "x_m": 0.0, "y_m": 1.0}, {"robot": "r1", "x_m": -1.0, "y_m": 0.0}, {"robot": "r2", "x_m": 1.0, "y_m": 0.0}]);
    vec![
        ("waypoints", json!({}), of_robots(false)),
        ("go_to_point", json!({}), of_robots(false)),
        ("go_to_pose", json!({}), of_robots(true)),
        ("path_following", json!({}), of_robots(false)),
        ("trajectory_tracking", json!({"interval_s": 20.0}), of_robots(false)),
        ("consensus", json!({}), json!([])),
        ("consensus", json!({"value": 2}), json!([])),
        (
            "consensus",
            json!({"graph": 2, "leader": 1}),
            json!([{"robot": "r0", "x_m": 1.0, "y_m": 0.5}]),
        ),
        (
            "leader_follower",
            json!({"distance_m": 0.9}),
            json!([{"robot": "r0", "x_m": 1.5, "y_m": 2.0}]),
        ),
        ("formation", json!({}), json!([])),
        ("formation", json!({"shape": 1, "rotation": 1}), json!([])),
        ("formation", json!({"shape": 2, "graph": 2}), json!([])),
        ("formation", json!({"shape": 3}), given),
        ("coverage", json!({}), json!([])),
        ("coverage", json!({}), of_team.clone()),
        ("goal_assignment", json!({}), of_team),
    ]
}

/// Nothing touches, on every chassis, and every robot comes to where the law wants it.
#[test]
fn every_law_on_every_chassis_is_safe_and_finishes() {
    let mut unfinished = Vec::new();
    for chassis in CHASSIS {
        for (law, parameters, targets) in every_law() {
            let robots = [
                (chassis, [-1.5, -1.0, 0.6]),
                (chassis, [-2.3, -2.0, 1.2]),
                (chassis, [-0.5, -2.2, 0.3]),
            ];
            let (verdict, _) = run(&team(law, parameters.clone(), &robots, targets, 90.0, [9.0, 8.0]));
            let names: Vec<String> = verdict
                .findings
                .iter()
                .map(|f| format!("{} {}", f.code, f.message))
                .collect();
            println!(
                "{chassis} {law} {parameters}: {:.1} s, {:?} m apart {names:?}",
                verdict.ticks as f64 * TICK_S,
                verdict.smallest_separation_m
            );
            assert!(
                verdict.accepted,
                "{chassis} {law} {parameters}: {:#?}",
                verdict.findings
            );
            assert!(verdict.smallest_separation_m.expect("robots") > 0.0 && verdict.smallest_wall_distance_m > 0.0);
            if !verdict.findings.is_empty() {
                unfinished.push(format!("{chassis} {law} {parameters} {names:?}"));
            }
        }
    }
    assert!(unfinished.is_empty(), "{unfinished:#?}");
}
