//! References that were driven smoothly, runs with steps: what harsh moments show of a robot is no change of it.

mod plant;
mod threads;

use identify::diagnose::{Input, Run, diagnose};
use identify::report::{Report, Verdict};
use plant::{Change, robot, run, with_effect};
use threads::Threads;

const SECONDS: usize = 20;
const REFERENCES: u64 = 4;
const RUNS: u64 = 6;

fn healthy(chassis: &str) -> Change {
    plant::healthy(&robot(chassis))
}

/// The same on a floor of a little less friction.
fn slippery(chassis: &str) -> Change {
    let mut change = healthy(chassis);
    change.floor.friction_scale *= 0.85;
    change
}

fn runs(chassis: &str, name: &str, change: &Change, first_seed: u64, count: u64) -> Vec<Run> {
    let description = robot(chassis);
    let of = |k| {
        let path = format!("{name}-{k}");
        run(
            &path,
            &description,
            change,
            first_seed + k,
            SECONDS,
            name == "reference",
        )
    };
    (0..count).map(of).collect()
}

fn found(chassis: &str, smooth_references: bool, before: &Change, change: &Change) -> Report {
    let references = Change {
        is_smooth: smooth_references,
        ..before.clone()
    };
    let input = Input {
        references: runs(chassis, "reference", &references, 500, REFERENCES),
        runs: runs(chassis, "run", change, 600, RUNS),
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let found = diagnose(&Threads(2), &input).unwrap_or_else(|error| panic!("{error}"));
    let report = found.report;
    let names: Vec<&str> = report.effects.iter().map(|effect| effect.name.as_str()).collect();
    println!("{chassis}: {:?} {names:?}", report.verdict);
    report
}

fn tells_that_runs_are_driven_harder(report: &Report) -> bool {
    let mut remarks = report.remarks.iter();
    remarks.any(|remark| remark.contains("driven harder than the references"))
}

#[test]
fn steps_that_references_did_not_have_are_no_discrepancy() {
    // Treads and a floor that are not as described, as they were before: smooth references do not show it.
    let report = found("diff2", true, &slippery("diff2"), &slippery("diff2"));
    assert!(tells_that_runs_are_driven_harder(&report));
    assert!(report.effects.is_empty());
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
}

#[test]
fn an_effect_is_named_beside_them() {
    let before = slippery("diff2");
    let changed = with_effect(&before, "wheel_radius", 0.03, &robot("diff2"));
    let report = found("diff2", true, &before, &changed);
    assert!(tells_that_runs_are_driven_harder(&report));
    assert_eq!(report.verdict, Verdict::Confirmed);
    assert_eq!(report.effects.len(), 1);
    assert_eq!(report.effects[0].name, "wheel_radius");
    let relative = &report.effects[0].parameters[0];
    let is_inside = relative
        .low
        .zip(relative.high)
        .is_some_and(|(low, high)| low < 0.03 && 0.03 < high);
    assert!(is_inside, "{relative:?}");
}

#[test]
fn references_driven_alike_are_enough() {
    let report = found("diff2", false, &healthy("diff2"), &healthy("diff2"));
    assert!(!tells_that_runs_are_driven_harder(&report));
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
}
