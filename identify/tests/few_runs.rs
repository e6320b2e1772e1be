//! What the runs show and do not prove is suspected, and never confirmed.

mod plant;
mod threads;

use identify::channel::Channel;
use identify::diagnose::{Run, diagnose};
use identify::record::Record;
use identify::report::schema::NamedEffect;
use identify::report::{Report, Verdict};
use identify::select::{Role, roles};
use plant::{Change, healthy, input, robot, run, with_effect};
use threads::Threads;
use twin::effect::library::LIBRARY;

const SECONDS: usize = 20;
const LIMIT_M_PER_S2: f64 = 4.0;
const TRAINING_KG: f64 = 6.0;
const OTHERS_KG: f64 = 2.7;

/// Largest difference of the measured wheel speeds of two runs, rad/s.
fn difference(a: &Run, b: &Run) -> f64 {
    let wheels = a.bundle.telemetry.channels.iter();
    let wheels = wheels.filter(|(channel, _)| matches!(channel, Channel::WheelSpeed(_)));
    let pairs =
        wheels.flat_map(|(channel, series)| series.values.iter().zip(&b.bundle.telemetry.channels[channel].values));
    pairs.fold(0.0, |most, (a, b)| (a - b).abs().max(most))
}

fn found(references: Vec<Run>, runs: Vec<Run>) -> Report {
    let found = diagnose(&Threads(2), &input(references, runs)).unwrap_or_else(|error| panic!("{error}"));
    found.report
}

/// The only effect of a report, which is not proven.
fn suspected<'a>(report: &'a Report, name: &str) -> &'a NamedEffect {
    let [effect] = &report.effects[..] else {
        panic!("{}: {:?} {:?}", report.sentence, report.effects, report.remarks);
    };
    assert_eq!((effect.name.as_str(), effect.status.as_str()), (name, "ambiguous"));
    assert_eq!(report.verdict, Verdict::Partial, "{}", report.sentence);
    let plain = name.replace('_', " ");
    assert!(
        report.sentence.contains(&format!("{plain} would explain it")) && report.sentence.contains("do not prove it"),
        "{}",
        report.sentence
    );
    let named = report
        .effects
        .iter()
        .flat_map(|effect| effect.alternatives.iter().chain([&effect.name]));
    let mut listed: Vec<&str> = named.map(String::as_str).collect();
    listed.extend(report.absorbed.iter().map(|absorbed| absorbed.name.as_str()));
    listed.extend(report.rejected.iter().map(|rejected| rejected.name.as_str()));
    listed.extend(report.untestable.iter().map(|untestable| untestable.name.as_str()));
    listed.sort_unstable();
    let mut library: Vec<&str> = LIBRARY.iter().map(|entry| entry.name).collect();
    library.sort_unstable();
    assert_eq!(listed, library, "every name in exactly one list");
    let next = report.next_experiment.as_ref().expect("something can be done");
    assert!(next.why.contains(&plain), "{}", next.why);
    effect
}

fn assert_doubted(report: &Report, words: &str) {
    let is_told = |remark: &String| remark.contains(words) && remark.contains("not confirmed without new runs");
    assert!(report.remarks.iter().any(is_told), "{:?}", report.remarks);
}

/// Set-points change more slowly than they are told to, and one run of six is driven so harshly that it matters.
#[test]
fn a_limit_that_one_run_reaches_is_suspected() {
    let description = robot("diff2");
    let harsh = healthy(&description);
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
    let references = (0..4).map(|k| make(&format!("reference-{k}"), &harsh, 500 + k));
    let report = found(references.collect(), runs);
    let effect = suspected(&report, "acceleration_limit");
    let limit = effect.parameters[0].value.expect("a limit has a value");
    assert!((limit / LIMIT_M_PER_S2 - 1.0).abs() < 0.1, "{limit} m/s2");
    assert_doubted(&report, "acceleration_limit: only some runs show it");
    // The twin drives it with the limit and without: slow ramps and a slow grid never reach it.
    let next = report.next_experiment.as_ref().expect("something can be done");
    assert!(
        next.why.contains("would set the twin with it and the twin without"),
        "{}",
        next.why
    );
    let manoeuvre = next.experiment["manoeuvre"].as_str().expect("a manoeuvre");
    assert!(!["slow_ramps", "field_grid"].contains(&manoeuvre), "{manoeuvre}");
}

/// The runs kept for checking carry less than half of what the training runs carry: neither side's load explains the other's runs, and all of them carry
/// something.
#[test]
fn a_load_that_differs_between_the_sides_is_suspected() {
    let description = robot("diff2");
    let unloaded = healthy(&description);
    let make = |name: &str, change: &Change, seed: u64| run(name, &description, change, seed, SECONDS, false);
    let loaded = |load_kg: f64| with_effect(&unloaded, "payload", load_kg, &description);
    // Loads do not change what is commanded, and that decides what a run is for.
    let liveliness = |seed: u64| {
        let run = make("run", &unloaded, seed);
        Record::of(&run.path, &run.bundle).largest_command_rad_per_s
    };
    let roles = roles(&(600..606).map(liveliness).collect::<Vec<f64>>(), false);
    let runs = (600..).zip(&roles).map(|(seed, role)| {
        let load_kg = if *role == Role::Train { TRAINING_KG } else { OTHERS_KG };
        make(&format!("run-{seed}"), &loaded(load_kg), seed)
    });
    let references = (500..504).map(|seed| make(&format!("reference-{seed}"), &unloaded, seed));
    let report = found(references.collect(), runs.collect());
    let effect = suspected(&report, "payload");
    let load_kg = effect.parameters[0].value.expect("a load has a mass");
    assert!((OTHERS_KG..TRAINING_KG).contains(&load_kg), "{load_kg} kg");
    assert_doubted(
        &report,
        "payload: training and validation runs show it, but not at the sizes",
    );
}
