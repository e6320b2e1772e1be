//! Negative controls: data in which there is nothing to name, or nothing that a name could be right for.

mod plant;
mod threads;

use emulator::noise::Noise;
use identify::channel::Channel;
use identify::diagnose::{Diagnosis, Run, diagnose};
use identify::report::{Report, Verdict};
use plant::replayed::of_the_twin;
use plant::{Change, input, robot, run, with_effect};
use threads::Threads;

const CHASSIS: &str = "diff2";
const SECONDS: usize = 20;
const REFERENCES: u64 = 4;
const RUNS: u64 = 6;

fn healthy() -> Change {
    plant::healthy(&robot(CHASSIS))
}

fn runs(name: &str, change: &Change, first_seed: u64, count: u64, reference: bool) -> Vec<Run> {
    let description = robot(CHASSIS);
    (0..count)
        .map(|k| {
            run(
                &format!("{name}-{k}"),
                &description,
                change,
                first_seed + k,
                SECONDS,
                reference,
            )
        })
        .collect()
}

fn found(references: Vec<Run>, runs: Vec<Run>) -> Diagnosis {
    let found = diagnose(&Threads(2), &input(references, runs)).unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<_> = found
        .report
        .effects
        .iter()
        .map(|effect| (effect.name.as_str(), effect.evidence.gain))
        .collect();
    println!("{:?} {names:?}", found.report.verdict);
    found
}

#[test]
fn another_day_is_no_discrepancy() {
    // Another seed, the battery half empty, windings 15 K warmer (5 % more resistance is 1 % less torque here), stiffer grease.
    let mut changed = healthy();
    changed.hidden.battery_charge = 0.45;
    changed.hidden.coulomb_scale *= 1.15;
    for scale in &mut changed.hidden.torque_constant_scale {
        *scale *= 0.99;
    }
    let report = found(
        runs("reference", &healthy(), 500, REFERENCES, true),
        runs("run", &changed, 700, RUNS, false),
    )
    .report;
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
    assert!(report.effects.is_empty());
}

#[test]
fn set_points_in_another_order_are_unexplained() {
    let report = of_shuffled_set_points();
    assert_eq!(report.verdict, Verdict::Unexplained);
    assert!(report.effects.is_empty());
    let tells_why = |remark: &String| remark.contains("explains most") && remark.contains("is not named: ");
    assert!(report.remarks.iter().any(tells_why), "{:?}", report.remarks);
}

fn of_shuffled_set_points() -> Report {
    let mut shuffled = runs("run", &healthy(), 600, RUNS, false);
    for (k, run) in shuffled.iter_mut().enumerate() {
        shuffle_set_points(run, k as u64);
    }
    found(runs("reference", &healthy(), 500, REFERENCES, true), shuffled).report
}

/// Pieces of 0.7 s of the set-points in another order, all wheels alike; everything measured stays.
fn shuffle_set_points(run: &mut Run, seed: u64) {
    let mut noise = Noise::new(seed, 4711);
    let telemetry = &mut run.bundle.telemetry;
    let commands: Vec<Channel> = telemetry
        .channels
        .keys()
        .copied()
        .filter(|channel| channel.is_command())
        .collect();
    let count = telemetry.channels[&commands[0]].values.len();
    let piece = 84; // 0.7 s of 120 a second
    let mut order: Vec<usize> = (0..count / piece).collect();
    for last in (1..order.len()).rev() {
        order.swap(last, (noise.uniform() * (last + 1) as f64) as usize);
    }
    for channel in commands {
        let series = telemetry.channels.get_mut(&channel).expect("a set-point");
        let before = series.values.clone();
        for (to, from) in order.iter().enumerate() {
            series.values[to * piece..(to + 1) * piece].copy_from_slice(&before[from * piece..(from + 1) * piece]);
        }
    }
}

#[test]
fn poses_of_another_robot_get_no_physical_name() {
    let mut swapped = runs("run", &healthy(), 600, RUNS, false);
    let others = runs("other", &healthy(), 800, RUNS, false);
    for (run, other) in swapped.iter_mut().zip(&others) {
        for channel in [Channel::PoseX, Channel::PoseY, Channel::PoseYaw] {
            let of_other = other.bundle.telemetry.channels[&channel].clone();
            run.bundle.telemetry.channels.insert(channel, of_other);
        }
    }
    let report = found(runs("reference", &healthy(), 500, REFERENCES, true), swapped).report;
    assert_ne!(report.verdict, Verdict::Confirmed);
    assert_ne!(report.verdict, Verdict::NoDiscrepancy, "the robots drove other ways");
    assert!(report.effects.is_empty(), "{:?}", report.effects);
}

#[test]
fn the_twins_own_data_are_no_discrepancy() {
    let own = |runs: Vec<Run>| {
        runs.into_iter()
            .zip(0..)
            .map(|(run, k)| of_the_twin(run, robot(CHASSIS), k))
            .collect()
    };
    let references = own(runs("reference", &Change::none(), 500, REFERENCES, true));
    let changed = own(runs("run", &Change::none(), 600, RUNS, false));
    let report = found(references, changed).report;
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
    assert!(report.effects.is_empty());
}

#[test]
fn the_same_runs_with_an_effect_do_get_a_name() {
    // The other side of the controls: what they find nothing in is not blind.
    let description = robot(CHASSIS);
    let changed = with_effect(&healthy(), "wheel_radius", 0.05, &description);
    let report = found(
        runs("reference", &healthy(), 500, REFERENCES, true),
        runs("run", &changed, 700, RUNS, false),
    )
    .report;
    assert!(
        report.effects.iter().any(|effect| effect.name == "wheel_radius"),
        "{:?}",
        report.effects
    );
}
