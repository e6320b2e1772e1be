//! Laws on a kinematic stand-in: the robot does at once what the safe command says.

mod common;

use common::{Pcg, example, lab_robot, parsed};
use control::TICK_S;
use control::team::{RobotObservation, Team};
use serde_json::{Value, json};
use twin::pose::Pose;

/// Drives a scenario on the stand-in; ticks until done (or the limit) and the smallest gap between circles.
fn drive(document: &Value, most_ticks: u64) -> (Option<u64>, f64, Vec<Pose>) {
    let scenario = parsed(document);
    let mut team = Team::new(&scenario).expect("team");
    let start = |r: &control::scenario::ExperimentRobot| RobotObservation {
        pose: Pose {
            x_m: r.start.x_m,
            y_m: r.start.y_m,
            yaw_rad: r.start.yaw_rad,
        },
        pose_age_s: 0.0,
        twist: Default::default(),
        online: true,
    };
    let mut robots: Vec<RobotObservation> = scenario.experiment.robots.iter().map(start).collect();
    let radii: Vec<f64> = scenario.robots.iter().map(|r| r.bounding_radius_m).collect();
    let mut smallest = f64::INFINITY;
    for tick in 0..most_ticks {
        let twists: Vec<_> = team.tick(&robots).iter().map(|out| out.safe.twist()).collect();
        for (robot, twist) in robots.iter_mut().zip(twists) {
            let (s, c) = (libm::sin(robot.pose.yaw_rad), libm::cos(robot.pose.yaw_rad));
            robot.pose.x_m += (c * twist.forward_m_per_s - s * twist.left_m_per_s) * TICK_S;
            robot.pose.y_m += (s * twist.forward_m_per_s + c * twist.left_m_per_s) * TICK_S;
            robot.pose.yaw_rad += twist.yaw_rate_rad_per_s * TICK_S;
            robot.twist = twist;
        }
        for j in 0..robots.len() {
            for i in 0..j {
                smallest = smallest.min(robots[i].pose.distance_m(&robots[j].pose) - radii[i] - radii[j]);
            }
        }
        if team.is_done() {
            return (Some(tick), smallest, robots.iter().map(|r| r.pose).collect());
        }
    }
    (None, smallest, robots.iter().map(|r| r.pose).collect())
}

#[test]
fn examples_converge() {
    for (name, limit_s) in [("rectangle-omni4", 60), ("rectangle-diff2", 60), ("swap-corners", 30)] {
        let (done, _, _) = drive(&example(name), limit_s * 120);
        assert!(done.is_some(), "{name}");
    }
}

#[test]
fn every_chassis_reaches_a_goal_from_every_heading() {
    for (like, chassis) in [("omni-01", "omni4"), ("diff-01", "diff2")] {
        for step in 0..12 {
            let yaw_rad = -3.0 + 0.5 * f64::from(step);
            let document = json!({
                "experiment": {"format": "robopheus.experiment/1", "mode": "virtual", "arena": "reference", "floor": "lab-floor",
                    "robots": [{"name": "a", "chassis": chassis, "controller": "sam3x", "start": {"x_m": -1.0, "y_m": 0.5, "yaw_rad": yaw_rad}}],
                    "control": {"law": "go_to_point", "parameters": {}},
                    "targets": [{"x_m": 1.0, "y_m": -0.7, "yaw_rad": 1.0}], "duration_s": 30, "seed": 1, "model": null},
                "robots": [lab_robot(like, "a")],
                "arena": {"name": "reference", "width_m": 4.0, "height_m": 3.0, "floor": "lab-floor"}
            });
            let (done, _, poses) = drive(&document, 30 * 120);
            assert!(done.is_some(), "{chassis} from {yaw_rad}: {poses:?}");
            assert!(
                (poses[0].x_m - 1.0).abs() < 0.04 && (poses[0].y_m + 0.7).abs() < 0.04,
                "{chassis} from {yaw_rad}: {poses:?}"
            );
            assert!(
                twin::pose::wrapped_rad(poses[0].yaw_rad - 1.0).abs() < 0.06,
                "{chassis} from {yaw_rad}: {poses:?}"
            );
        }
    }
}

/// Robots on a circle change places with the one opposite, in a larger arena; none may stand still for good.
#[test]
fn antipodal_swaps_do_not_lock() {
    let mut random = Pcg(7);
    let (mut tried, mut solved) = (0, 0);
    for n in 2..=6_usize {
        for _ in 0..12 {
            let turn = random.between(0.0, core::f64::consts::TAU);
            let place = |i: usize, half: f64| {
                let angle = turn + (i as f64 / n as f64 + half) * core::f64::consts::TAU;
                (1.6 * libm::cos(angle), 1.6 * libm::sin(angle))
            };
            let mut robots = Vec::new();
            let mut targets = Vec::new();
            let mut lab = Vec::new();
            for i in 0..n {
                let name = format!("r{i}");
                let (like, chassis) = if random.between(0.0, 1.0) < 0.3 {
                    ("diff-01", "diff2")
                } else {
                    ("omni-01", "omni4")
                };
                let (x_m, y_m) = place(i, 0.0);
                robots.push(json!({"name": name, "chassis": chassis, "controller": "sam3x",
                    "start": {"x_m": x_m, "y_m": y_m, "yaw_rad": random.between(-3.0, 3.0)}}));
                let (x_m, y_m) = place(i, 0.5);
                targets.push(json!({"robot": name, "x_m": x_m, "y_m": y_m}));
                lab.push(lab_robot(like, &name));
            }
            let document = json!({
                "experiment": {"format": "robopheus.experiment/1", "mode": "virtual", "arena": "large", "floor": "lab-floor", "robots": robots,
                    "control": {"law": "go_to_point", "parameters": {}}, "targets": targets, "duration_s": 60, "seed": 1, "model": null},
                "robots": lab, "arena": {"name": "large", "width_m": 5.0, "height_m": 5.0, "floor": "lab-floor"}
            });
            let (done, gap_m, poses) = drive(&document, 60 * 120);
            assert!(gap_m > 0.0, "{n} robots, gap {gap_m}");
            tried += 1;
            solved += u32::from(done.is_some());
            if done.is_none() {
                println!("{n} robots locked: {poses:?}");
            }
        }
    }
    println!("{solved} of {tried} swaps solved");
    assert!(solved * 100 >= tried * 95, "{solved} of {tried}");
}
