//! The team on a plant that is not its model: other wheels, mass and friction, dead time, measurement noise.

mod common;

use common::{Pcg, example, parsed};
use control::law::path_error_m;
use control::rehearsal::world;
use control::team::{RobotObservation, Team};

struct Report {
    done_s: Option<f64>,
    path_error_m: f64,
    separation_m: Option<f64>,
    wall_m: f64,
}

/// Commands act `dead_ticks` late; poses are `age_ticks` old and noisy.
fn drive(name: &str, dead_ticks: usize, age_ticks: usize, seed: u64) -> Report {
    let scenario = parsed(&example(name));
    let mut team = Team::new(&scenario).expect("team");
    let mut real = scenario.clone();
    for robot in &mut real.robots {
        robot.description.mass_kg *= 1.25;
        robot.description.yaw_inertia_kg_m2 *= 1.25;
        robot.description.floor_friction *= 0.5;
        for (k, wheel) in robot.description.wheels.iter_mut().enumerate() {
            wheel.radius_m = wheel.radius_m.map(|radius_m| radius_m * (0.97 + 0.015 * k as f64));
        }
    }
    let mut world = world(&real).expect("world");
    let n = scenario.experiment.robots.len();
    let mut random = Pcg(seed);
    let mut commands = vec![vec![Default::default(); n]; dead_ticks];
    let mut seen: Vec<Vec<RobotObservation>> = Vec::new();
    let mut report = Report {
        done_s: None,
        path_error_m: 0.0,
        separation_m: None,
        wall_m: f64::INFINITY,
    };
    for tick in 0..(scenario.experiment.duration_s * 120.0) as u64 {
        let observe = |i: usize, random: &mut Pcg| {
            let state = world.state(i);
            let mut pose = state.pose;
            pose.x_m += random.between(-0.003, 0.003);
            pose.y_m += random.between(-0.003, 0.003);
            pose.yaw_rad += random.between(-0.008, 0.008);
            let mut twist = state.twist;
            twist.forward_m_per_s += random.between(-0.05, 0.05);
            twist.left_m_per_s += random.between(-0.05, 0.05);
            RobotObservation {
                pose,
                pose_age_s: age_ticks as f64 / 120.0,
                twist,
                online: true,
            }
        };
        seen.push((0..n).map(|i| observe(i, &mut random)).collect());
        let old = seen.len().saturating_sub(1 + age_ticks);
        let outputs = team.tick(&seen[old]);
        commands.push(outputs.iter().map(|out| out.safe.wheel_command()).collect());
        world.step(&commands.remove(0)).expect("step");
        for (i, out) in outputs.iter().enumerate() {
            let pose = world.state(i).pose;
            let error_m = out
                .segment
                .map_or(0.0, |segment| path_error_m([pose.x_m, pose.y_m], segment));
            report.path_error_m = report.path_error_m.max(error_m);
        }
        let now_m = world.smallest_separation_m();
        report.separation_m = now_m.map(|m| report.separation_m.map_or(m, |old| old.min(m)));
        report.wall_m = report.wall_m.min(world.smallest_wall_distance_m());
        if team.is_done() {
            report.done_s = Some(tick as f64 / 120.0);
            break;
        }
    }
    report
}

#[test]
fn examples_finish_without_contact_on_another_plant() {
    for name in ["rectangle-omni4", "rectangle-diff2", "swap-corners"] {
        for seed in 0..3 {
            let report = drive(name, 4, 4, seed);
            println!(
                "{name}/{seed}: done {:?} s, path error {:.3} m, separation {:?} m, wall {:.3} m",
                report.done_s, report.path_error_m, report.separation_m, report.wall_m
            );
            assert!(report.done_s.is_some(), "{name}/{seed}");
            assert!(
                report.wall_m > 0.0 && report.separation_m.is_none_or(|m| m > 0.0),
                "{name}/{seed}"
            );
        }
    }
}
