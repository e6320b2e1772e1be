//! What a diagnosis says of runs that lack something: fewer verdicts, and which.

mod support;

use identify::bundle::Bundle;
use identify::diagnose::{Diagnosis, Input, Run, diagnose};
use identify::record::{Record, WINDOW_S};
use identify::report::Verdict;
use identify::workers::Serial;
use support::{recorded, run_json};
use twin::golden::reference_robot;

/// A run of the reference robot with some of its columns and rows.
fn run(path: &str, keep: impl Fn(&str) -> bool, rows: impl Fn(f64) -> Option<f64>) -> Run {
    let robot = reference_robot("diff2");
    let whole = recorded(&robot, &robot);
    let columns: Vec<_> = whole
        .telemetry
        .channels
        .iter()
        .filter(|(c, _)| keep(&c.name()))
        .collect();
    let mut csv = "time_s".to_owned();
    columns
        .iter()
        .for_each(|(channel, _)| csv += &format!(",{}", channel.name()));
    for (row, time_s) in whole.telemetry.time_s.iter().enumerate() {
        let Some(time_s) = rows(*time_s) else { continue };
        csv += &format!("\n{time_s:.6}");
        columns
            .iter()
            .for_each(|(_, series)| csv += &format!(",{}", series.values[row]));
    }
    match Bundle::parse(&run_json(), csv.as_bytes()) {
        Ok(bundle) => Run {
            path: path.to_owned(),
            sha256: String::new(),
            bundle,
        },
        Err(error) => panic!("{error}"),
    }
}

fn found(runs: Vec<Run>) -> Diagnosis {
    let input = Input {
        references: Vec::new(),
        runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    match diagnose(&Serial, &input) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn without_set_points_of_the_wheels_the_actuators_are_untestable() {
    let keep = |name: &str| !name.starts_with("command") && !name.starts_with("current");
    let report = found(vec![run("a", keep, Some), run("b", keep, Some)]).report;
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
    for name in [
        "command_delay",
        "command_dead_band",
        "coulomb_friction",
        "weak_motor",
        "body_speed_saturation",
    ] {
        assert!(report.untestable.iter().any(|other| other.name == name), "{name}");
    }
    // What happens between wheels and floor can be told.
    let rejected: Vec<&str> = report.rejected.iter().map(|other| other.name.as_str()).collect();
    assert!(rejected.contains(&"floor_friction"), "{rejected:?}");
    assert!(
        report.remarks.iter().any(|line| line.contains("no set-points")),
        "{:?}",
        report.remarks
    );
}

#[test]
fn no_window_reaches_over_a_pause_or_a_break_of_the_tracker() {
    let all = |_: &str| true;
    let pause = run("pause", all, |t| (!(7.0..9.5).contains(&t)).then_some(t));
    let record = Record::of("pause", &pause.bundle);
    assert!(
        record
            .windows
            .iter()
            .all(|window| window.to_s <= 7.01 || window.start_s >= 9.49)
    );
    // Both sides are used.
    assert!(record.windows.iter().any(|w| w.to_s <= 7.01) && record.windows.iter().any(|w| w.start_s >= 9.49));
    assert!(
        pause
            .bundle
            .remarks
            .iter()
            .any(|remark| remark.message.contains("no rows between"))
    );
    let mut broken = run("broken", all, Some);
    if let Some(x) = broken
        .bundle
        .telemetry
        .channels
        .get_mut(&identify::channel::Channel::PoseX)
    {
        x.values.iter_mut().skip(1200).for_each(|value| *value += 4.0);
    }
    let record = Record::of("broken", &broken.bundle);
    assert!(
        record
            .windows
            .iter()
            .all(|window| window.to_s <= 10.01 || window.start_s >= 9.99)
    );
    let full = Record::of("full", &run("full", all, Some).bundle);
    assert!(
        full.windows
            .iter()
            .any(|window| window.start_s < 9.9 && window.to_s > 10.1 && WINDOW_S > 1.0)
    );
}

#[test]
fn poses_ten_times_a_second_are_enough() {
    let keep = |_: &str| true;
    let slow = run("slow", keep, |t| {
        ((t * 120.0).round() as u32).is_multiple_of(12).then_some(t)
    });
    let record = Record::of("slow", &slow.bundle);
    assert!(
        record.windows.len() >= 8 && record.skipped == 0,
        "{} {}",
        record.windows.len(),
        record.skipped
    );
}

#[test]
fn a_dead_sensor_is_told_and_not_compared() {
    let mut dead = run("dead", |_| true, Some);
    if let Some(series) = dead
        .bundle
        .telemetry
        .channels
        .get_mut(&identify::channel::Channel::Current(0))
    {
        series.values.iter_mut().for_each(|value| *value = 0.25);
    }
    let record = Record::of("dead", &dead.bundle);
    let quantities = record.quantities();
    assert!(!quantities.contains(&identify::record::Quantity::Current(0)));
    assert!(quantities.contains(&identify::record::Quantity::Current(1)));
}
