//! Robot-seconds per CPU-second of the twin: `cargo run --release -p twin --example speed`.
//!
//! Every robot drives on changing set-points with much of the time above half friction, apart from the others.
#![allow(
    clippy::disallowed_methods,
    reason = "a benchmark reads the clock; the library does not"
)]

use twin::command::WheelCommand;
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};
use twin::world::{Arena, World};

#[path = "../tests/support/mod.rs"]
mod support;

fn world(description: &RobotDescription, count: usize) -> World {
    let side = (count as f64).sqrt().ceil();
    let spacing = (990.0 / (side + 1.0)).min(40.0);
    let arena = Arena {
        width_m: (side + 1.0) * spacing,
        height_m: (side + 1.0) * spacing,
    };
    let place = |i: usize| Pose {
        x_m: ((i as f64 % side) - 0.5 * (side - 1.0)) * spacing,
        y_m: ((i as f64 / side).floor() - 0.5 * (side - 1.0)) * spacing,
        yaw_rad: i as f64,
    };
    let robots = (0..count)
        .map(|i| (Robot::new(description.clone()).expect("a good robot"), place(i), 0.25))
        .collect();
    World::new(arena, robots).expect("a good world")
}

fn commands(count: usize, tick: u64) -> Vec<WheelCommand> {
    let command = |i: usize| {
        let phase = (tick / 24 + i as u64) % 7;
        let mut command = WheelCommand {
            steering_rad: 0.1 * phase as f64 - 0.3,
            ..WheelCommand::default()
        };
        for (wheel, speed) in command.wheel_rad_per_s.iter_mut().enumerate() {
            *speed = 14.0 - 4.0 * phase as f64 + 3.0 * (wheel % 2) as f64;
        }
        command
    };
    (0..count).map(command).collect()
}

/// Time this thread was on a CPU, s.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux scheduler statistics");
    text.split(' ')
        .next()
        .and_then(|ns| ns.parse::<f64>().ok())
        .expect("a number")
        * 1e-9
}

fn main() {
    for description in [support::omni4(), support::diff2(), support::car("awd")] {
        for count in [1, 10, 100, 1000] {
            for digest in [true, false] {
                let mut world = world(&description, count);
                if !digest {
                    world = world.without_digest();
                }
                let ticks = (200_000 / count as u64).clamp(120, 24_000);
                let plan: Vec<Vec<WheelCommand>> = (0..168).map(|tick| commands(count, tick)).collect();
                let begun = cpu_s();
                for tick in 0..ticks {
                    world.step(&plan[(tick % 168) as usize]).expect("finite");
                }
                let rate = count as f64 * ticks as f64 / 120.0 / (cpu_s() - begun);
                println!(
                    "{:>6} N={count:<5} digest {:<3} {rate:>9.0} robot-seconds per CPU-second",
                    description.chassis,
                    if digest { "on" } else { "off" }
                );
            }
        }
    }
}
