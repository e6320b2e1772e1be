//! Set-points that never arrive, hidden in the twin's own data: which were lost the twin throws by its own dice.

mod plant;
mod threads;

use identify::bundle::Bundle;
use identify::diagnose::{Input, Run, calibrated_floor, diagnose};
use identify::lost::{Lost, Seen, arrived, without};
use identify::report::Verdict;
use plant::replayed::{of_the_twin, of_the_twin_with};
use plant::{Change, robot, run};
use threads::Threads;
use twin::effect::Effect;
use twin::model_document::ModelDocument;

const CHASSIS: &str = "diff2";
const SECONDS: usize = 20;
const LOSS_RATE: f64 = 0.15;
/// 30 steps of the twin.
const BURST_S: f64 = 0.0625;

fn driven(name: &str, seed: u64, reference: bool) -> Run {
    run(name, &robot(CHASSIS), &Change::none(), seed, SECONDS, reference)
}

/// The twin's dice (splitmix64): whether set-points so long after a run's start are lost.
fn is_lost(after_s: f64) -> bool {
    let burst = (after_s / BURST_S + 1e-6) as u64;
    let mut z = (burst + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    ((z >> 11) as f64) < LOSS_RATE * 9_007_199_254_740_992.0
}

/// Set-points that changed in a run, and how many of them were lost.
fn told_and_gone(run: &Run) -> (u32, u32) {
    let first_s = run.bundle.telemetry.time_s[0];
    let mut held = twin::replay::HeldCommand::default();
    let mut last = held.command();
    let (mut told, mut gone) = (0, 0);
    for row in &run.bundle.command_rows() {
        held.apply(&run.bundle.robot, row);
        let now = held.command();
        let changes = now.wheel_rad_per_s.iter().zip(&last.wheel_rad_per_s);
        if changes.map(|(now, last)| (now - last).abs()).fold(0.0, f64::max) > 0.03 {
            told += 1;
            gone += u32::from(is_lost(row.time_s - first_s));
        }
        last = now;
    }
    (told, gone)
}

fn lossy() -> [Effect; 1] {
    [Effect::new(
        "command_hold",
        &[("loss_rate", LOSS_RATE), ("burst", BURST_S)],
    )]
}

/// Healthy references, and runs of which set-points are lost.
fn lossy_runs() -> (Vec<Run>, Vec<Run>) {
    let references = (0..4).map(|k| of_the_twin(driven(&format!("reference-{k}"), 500 + k, true), robot(CHASSIS), k));
    let runs = (0..6).map(|k| {
        let sent = driven(&format!("run-{k}"), 600 + k, false);
        of_the_twin_with(sent, robot(CHASSIS), &lossy(), 10 + k)
    });
    (references.collect(), runs.collect())
}

/// A model that loses about as many already: no news, and not twice.
#[test]
fn losses_that_the_model_has_are_no_name() {
    let (references, runs) = lossy_runs();
    let known = Effect::new("command_hold", &[("loss_rate", 0.1), ("burst", BURST_S)]);
    let model = ModelDocument::new(None, robot(CHASSIS), "lab", vec![known.clone()], serde_json::json!({}));
    let input = Input {
        references,
        runs,
        locked: Vec::new(),
        model: Some(model),
        seed: 1,
    };
    let found = diagnose(&Threads(2), &input).unwrap_or_else(|error| panic!("{error}"));
    let report = &found.report;
    assert_eq!(report.verdict, Verdict::NoDiscrepancy, "{:?}", report.remarks);
    assert!(report.effects.is_empty());
    assert!(report.absorbed.iter().any(|absorbed| absorbed.name == "command_hold"));
    let handed_on: Vec<&Effect> = found
        .model
        .effects
        .iter()
        .filter(|effect| effect.name == "command_hold")
        .collect();
    assert_eq!(handed_on, [&known]);
}

#[test]
fn lost_set_points_are_named_with_their_share_and_length() {
    let (references, runs) = lossy_runs();
    let changed: Vec<(u32, u32)> = runs.iter().map(told_and_gone).collect();
    let of = |part: fn(&(u32, u32)) -> u32| f64::from(changed.iter().map(part).sum::<u32>());
    let true_share = of(|run| run.1) / of(|run| run.0);
    let input = Input {
        references,
        runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let found = diagnose(&Threads(2), &input).unwrap_or_else(|error| panic!("{error}"));
    let report = &found.report;
    let names: Vec<&str> = report.effects.iter().map(|effect| effect.name.as_str()).collect();
    assert_eq!(names, ["command_hold"], "{:?} {:?}", report.verdict, report.remarks);
    assert_eq!(report.verdict, Verdict::Confirmed, "{:?}", report.remarks);
    let number = |name: &str| {
        let mut parameters = report.effects[0].parameters.iter();
        let parameter = parameters.find(|parameter| parameter.name == name);
        parameter.map(|parameter| [parameter.value, parameter.low, parameter.high].map(Option::unwrap_or_default))
    };
    let [share, low, high] = number("loss_rate").unwrap_or_default();
    assert!((share - true_share).abs() < 0.04, "{share} {true_share}");
    assert!(low < true_share && true_share < high, "{low} to {high}, {true_share}");
    let [burst_s, ..] = number("burst").unwrap_or_default();
    assert!((burst_s - BURST_S).abs() < 0.012, "{burst_s}");
    assert!(
        report.explained_fraction.is_some_and(|share| share > 0.6),
        "{:?}",
        report.explained_fraction
    );
    // The twin that the report hands on loses set-points as well.
    assert!(found.model.effects.iter().any(|effect| effect.name == "command_hold"));
}

#[test]
fn most_losses_of_a_run_are_found_where_they_were_and_none_in_a_run_without() {
    let references: Vec<Run> = (0..3)
        .map(|k| of_the_twin(driven(&format!("reference-{k}"), 500 + k, true), robot(CHASSIS), k))
        .collect();
    let floor = calibrated_floor(&Threads(2), &references, None).unwrap_or_else(|error| panic!("{error}"));
    let (model, noise) = (&floor.model, &floor.noise);
    let sent = driven("run", 600, false);
    let whole = of_the_twin(sent.clone(), robot(CHASSIS), 3);
    let found = arrived("run", &whole.bundle, model, noise).unwrap_or_else(|| panic!("no simulation"));
    assert_eq!(found.spans, []);
    assert!(found.seen.open_s > 1.0 && found.seen.lost_s == 0.0, "{:?}", found.seen);
    assert_eq!(found.bundle.command_rows(), whole.bundle.command_rows());
    let mut seen = Seen::default();
    let (mut near, mut spans) = (0, 0);
    let (mut told, mut gone) = (0, 0);
    for k in 0..4 {
        let sent = driven("run", 600 + k, false);
        let lossy = of_the_twin_with(sent, robot(CHASSIS), &lossy(), k);
        let found = arrived("run", &lossy.bundle, model, noise).unwrap_or_else(|| panic!("no simulation"));
        seen.open_s += found.seen.open_s;
        seen.lost_s += found.seen.lost_s;
        let first_s = lossy.bundle.telemetry.time_s[0];
        // In the middle of a span nothing arrived, and just outside something did.
        let is_near = |span: &&Lost| {
            let middle_s = 0.5 * (span.from_s + span.to_s);
            is_lost(middle_s - first_s) && !is_lost(span.to_s + 0.013 - first_s)
        };
        near += found.spans.iter().filter(is_near).count();
        spans += found.spans.len();
        let (of_run_told, of_run_gone) = told_and_gone(&lossy);
        told += of_run_told;
        gone += of_run_gone;
    }
    let share = seen.lost_s / seen.open_s;
    // The dice are the same in every run: of the set-points that changed these were lost.
    let true_share = f64::from(gone) / f64::from(told);
    println!("{near} of {spans}, {share} of {true_share}, {seen:?}");
    assert!((share - true_share).abs() < 0.04, "{share} {true_share}");
    assert!(4 * near >= 3 * spans && near >= 20, "{near} of {spans}");
}

/// The last set-point before a span holds; at its end the last one sent is in force.
#[test]
fn a_run_without_a_span_holds_what_was_sent_before() {
    let whole = driven("run", 600, false).bundle;
    let times = &whole.telemetry.time_s;
    let set_points = |bundle: &Bundle| -> Vec<_> {
        let mut held = twin::replay::HeldCommand::default();
        let told = |row: &_| {
            held.apply(&bundle.robot, row);
            held.command()
        };
        bundle.command_rows().iter().map(told).collect()
    };
    let sent = set_points(&whole);
    let first = (300..sent.len() - 60).find(|k| sent[*k] != sent[*k - 1] && sent[*k + 30] != sent[*k - 1]);
    let first = first.unwrap_or_else(|| panic!("nothing changes"));
    let last = first + 60;
    let span = |from: usize, to: usize| Lost {
        from_s: times[from] - 1e-4,
        to_s: times[to] - 1e-4,
    };
    // Two that touch are one.
    let rest = without(&whole, &[span(first, first + 20), span(first + 20, last)]);
    let acted = set_points(&rest);
    assert_eq!(sent.len(), acted.len());
    for (k, (sent_now, acted_now)) in sent.iter().zip(&acted).enumerate() {
        let expected = if (first..last).contains(&k) {
            &sent[first - 1]
        } else {
            sent_now
        };
        assert_eq!(acted_now, expected, "row {k}");
    }
}
