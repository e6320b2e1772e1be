//! Hidden plants: the blind bench's healthy robot with one force that the effect library does not have, on a polished
//! floor, where a force on the body moves it although the motors hold their speed.

use blind::background::{background, robot};
use blind::change::Change;
use blind::drive::{RunStart, drive};
use blind::forces::Hill;
use blind::manoeuvre::{Style, plan};
use blind::telemetry::Texts;
use emulator::noise::Noise;
use emulator::plant::Pose;
use identify::diagnose::Run;
use twin::robot::{Robot, RobotDescription};

const POLISHED: f64 = 0.25;

/// References and changed runs of a plant.
pub struct Driven {
    pub references: Vec<Run>,
    pub runs: Vec<Run>,
}

fn hide(effect: &str, change: &mut Change, mass_kg: f64) {
    match effect {
        "air_drag" => change.forces.air_n_s2_per_m2 = 1.6 * mass_kg,
        "sideways_force" => change.forces.sideways_n_s_per_m = 1.0 * mass_kg,
        "force_hill" => {
            change.forces.hill = Some(Hill {
                force_n: 0.8 * mass_kg,
                at_m: [0.2, -0.1],
                width_m: 0.35,
            });
        }
        other => panic!("no hidden effect {other:?}"),
    }
}

/// Drives a plant; the same for ever.
///
/// - `effect`: `air_drag`, `sideways_force` or `force_hill`, of sizes that the blind bench has; or `none`.
pub fn driven(chassis: &str, effect: &str, seconds: u32, references: usize, runs: usize) -> Driven {
    let mut description = robot(chassis, false);
    description.floor_friction = POLISHED;
    let seed = 7000 + chassis.bytes().map(u64::from).sum::<u64>();
    let base = background(seed, &description);
    let mut changed = base.clone();
    if effect != "none" {
        hide(effect, &mut changed, description.mass_kg);
    }
    let made = |count: usize, change: &Change, reference: bool| -> Vec<Run> {
        (0..count)
            .map(|number| run(&description, change, seed, number, seconds, reference))
            .collect()
    };
    Driven {
        references: made(references, &base, true),
        runs: made(runs, &changed, false),
    }
}

fn run(
    description: &RobotDescription,
    change: &Change,
    seed: u64,
    number: usize,
    seconds: u32,
    reference: bool,
) -> Run {
    let seed = 1000 * seed + 2 * number as u64 + u64::from(reference);
    let mut noise = Noise::new(seed, 5);
    let pose = Pose {
        x_m: 0.6 * (noise.uniform() - 0.5),
        y_m: 0.4 * (noise.uniform() - 0.5),
        yaw_rad: std::f64::consts::TAU * (noise.uniform() - 0.5),
    };
    let robot = Robot::new(description.clone()).unwrap_or_else(|problem| panic!("{problem}"));
    let planned = plan(&robot, Style::Rich, pose, seconds, &mut noise);
    let start = RunStart { seed, pose, seconds };
    let words = serde_json::to_value(description).and_then(serde_json::from_value);
    let words = words.unwrap_or_else(|problem| panic!("{problem}"));
    let trace = drive(&words, change, &start, &mut |number, _| planned[number]);
    let trace = trace.unwrap_or_else(|problem| panic!("{problem}"));
    let texts = Texts::new(description, description, &trace, &change.sensing, seed, reference);
    let kind = if reference { "reference" } else { "run" };
    texts
        .and_then(|texts| texts.read(&format!("{kind}-{number}")))
        .unwrap_or_else(|problem| panic!("{problem}"))
}
