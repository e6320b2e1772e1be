//! What only one run shows is suspected, and never confirmed.

mod plant;
mod threads;

use identify::channel::Channel;
use identify::diagnose::{Input, Run, diagnose};
use identify::report::Verdict;
use plant::{Change, background, robot, run, with_effect};
use threads::Threads;

const SECONDS: usize = 20;
const LIMIT_M_PER_S2: f64 = 4.0;

/// Largest difference of the measured wheel speeds of two runs, rad/s.
fn difference(a: &Run, b: &Run) -> f64 {
    let wheels = a.bundle.telemetry.channels.iter();
    let wheels = wheels.filter(|(channel, _)| matches!(channel, Channel::WheelSpeed(_)));
    let pairs =
        wheels.flat_map(|(channel, series)| series.values.iter().zip(&b.bundle.telemetry.channels[channel].values));
    pairs.fold(0.0, |most, (a, b)| (a - b).abs().max(most))
}

/// Set-points change more slowly than they are told to, and one run of six is driven so harshly that it matters.
#[test]
fn a_limit_that_one_run_reaches_is_suspected() {
    let description = robot("diff2");
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    let harsh = background(5, description.wheels.len(), driven);
    let smooth = Change {
        is_smooth: true,
        ..harsh.clone()
    };
    let make = |name: &str, change: &Change, seed: u64| run(name, &description, change, seed, SECONDS, false);
    let limited = |change: &Change| with_effect(change, "acceleration_limit", LIMIT_M_PER_S2, &description);
    let runs: Vec<Run> = (0..6)
        .map(|k| {
            let own = if k == 0 { &harsh } else { &smooth };
            let (without, with) = (
                make("run", own, 600 + k),
                make(&format!("run-{k}"), &limited(own), 600 + k),
            );
            assert_eq!(
                difference(&without, &with) > 1.0,
                k == 0,
                "run {k}: {} rad/s",
                difference(&without, &with)
            );
            with
        })
        .collect();
    let input = Input {
        references: (0..4)
            .map(|k| make(&format!("reference-{k}"), &harsh, 500 + k))
            .collect(),
        runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let found = diagnose(&Threads(2), &input).unwrap_or_else(|error| panic!("{error}"));
    let report = found.report;
    assert_eq!(
        report.verdict,
        Verdict::Partial,
        "{}: {:?}",
        report.sentence,
        report.remarks
    );
    let [effect] = &report.effects[..] else {
        panic!("{:?}", report.effects);
    };
    assert_eq!(
        (effect.name.as_str(), effect.status.as_str()),
        ("acceleration_limit", "ambiguous")
    );
    let limit = effect.parameters[0].value.expect("a limit has a value");
    assert!((limit / LIMIT_M_PER_S2 - 1.0).abs() < 0.1, "{limit} m/s2");
    assert!(
        report.sentence.contains("acceleration limit would explain it") && report.sentence.contains("do not prove it"),
        "{}",
        report.sentence
    );
    let next = report.next_experiment.expect("something can be done");
    assert!(next.why.contains("acceleration limit"), "{}", next.why);
    let doubt = report
        .remarks
        .iter()
        .find(|remark| remark.contains("not confirmed without new runs"));
    assert!(
        doubt.is_some_and(|remark| remark.contains("acceleration_limit: only some runs show it")),
        "{:?}",
        report.remarks
    );
}
