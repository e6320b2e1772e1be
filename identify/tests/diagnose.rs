//! The whole workflow on runs of another plant: the emulator's body, with errors of its own in every number.

mod plant;
mod threads;

use identify::diagnose::{DiagnoseError, Diagnosis, Input, Run, diagnose};
use identify::report::Verdict;
use identify::workers::Serial;
use plant::{background, robot, run, with_effect};
use threads::Threads;

/// References and changed runs of a chassis, 14 s each.
fn input(chassis: &str, effect: &str, size: f64, counts: (usize, usize)) -> Input {
    let description = robot(chassis);
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    let base = background(5, description.wheels.len(), driven);
    let changed = with_effect(&base, effect, size, &description);
    let references =
        (0..counts.0).map(|k| run(&format!("reference-{k}"), &description, &base, 500 + k as u64, 14, true));
    let runs = (0..counts.1).map(|k| run(&format!("run-{k}"), &description, &changed, 600 + k as u64, 14, false));
    Input {
        references: references.collect(),
        runs: runs.collect(),
        locked: Vec::new(),
        model: None,
        seed: 1,
    }
}

fn found(input: &Input) -> Diagnosis {
    match diagnose(&Threads(2), input) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn nothing_changed_is_no_discrepancy() {
    let report = found(&input("diff2", "none", 0.0, (3, 6))).report;
    println!("{:?}", report.effects);
    assert_eq!(report.verdict, Verdict::NoDiscrepancy);
    assert!(report.effects.is_empty());
}

#[test]
fn a_delay_is_named_with_its_size_and_explains_the_gap() {
    let found = found(&input("diff2", "command_delay", 0.08, (3, 6)));
    let report = &found.report;
    let effect = &report.effects[0];
    println!("{:?} {:?} {:?}", report.verdict, effect, report.explained_fraction);
    assert_eq!(effect.name, "command_delay");
    // The plant's own 4 ms are in the references too.
    let value = effect.parameters[0].value.unwrap_or(0.0);
    assert!((value - 0.08).abs() < 0.008, "{value}");
    assert!(report.explained_fraction.is_some_and(|share| share > 0.8));
    assert!(found.model.effects.iter().any(|effect| effect.name == "command_delay"));
    // Every name of the library stands in exactly one list.
    let mut names: Vec<&str> = Vec::new();
    for effect in &report.effects {
        names.push(&effect.name);
        names.extend(effect.alternatives.iter().map(String::as_str));
    }
    names.extend(report.absorbed.iter().map(|other| other.name.as_str()));
    names.extend(report.rejected.iter().map(|other| other.name.as_str()));
    names.extend(report.untestable.iter().map(|other| other.name.as_str()));
    names.sort_unstable();
    let mut library: Vec<&str> = twin::effect::library::LIBRARY.iter().map(|entry| entry.name).collect();
    library.sort_unstable();
    assert_eq!(names, library);
}

#[test]
fn one_run_names_nothing_and_bytes_repeat_on_any_number_of_threads() {
    let input = input("diff2", "wheel_speed_saturation", 10.0, (2, 1));
    let report = found(&input).report;
    assert!(report.effects.is_empty());
    assert_eq!(report.verdict, Verdict::Unexplained);
    let tells_why = |remark: &String| remark.contains("explains most") && remark.contains("is not named: ");
    assert!(report.remarks.iter().any(tells_why), "{:?}", report.remarks);
    assert!(report.gap.is_empty());
    let Ok(again) = diagnose(&Serial, &input) else {
        panic!("no diagnosis")
    };
    assert_eq!(report.text(), again.report.text());
}

#[test]
fn runs_of_other_robots_are_refused() {
    let mut mixed = input("diff2", "none", 0.0, (0, 2));
    let description = robot("omni4");
    let change = background(5, 4, 4);
    mixed.references = vec![run("other", &description, &change, 1, 4, true)];
    assert!(matches!(
        diagnose(&Serial, &mixed),
        Err(DiagnoseError::OtherRobot { .. } | DiagnoseError::OtherChassis { .. })
    ));
    mixed.references = Vec::new();
    mixed.runs = Vec::<Run>::new();
    assert_eq!(diagnose(&Serial, &mixed).err(), Some(DiagnoseError::NoRuns));
}

/// A run that is learned from cannot check what was learned.
#[test]
fn a_recording_given_twice_is_refused() {
    let mut doubled = input("diff2", "none", 0.0, (0, 2));
    let mut again = doubled.runs[1].clone();
    again.path = "copy".to_owned();
    doubled.locked = vec![again];
    let error = diagnose(&Serial, &doubled).err();
    let words = error.as_ref().map_or_else(String::new, ToString::to_string);
    assert!(matches!(error, Some(DiagnoseError::Twice { .. })), "{words}");
    assert!(
        words.starts_with("copy and ") && words.contains("give every run once"),
        "{words}"
    );
}
