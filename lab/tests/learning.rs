//! The learning side of a run whose robot is the twin with a force that the version of the run does not have.

mod fixture;

use api::experiment::Mode;
use api::lab::Assignment;
use fixture::START_US;
use fixture::twin_run::{assignment, run};
use lab::learning::{LearningRun, Lesson};
use lab::record::{End, Learning, Record};
use serde_json::{Value, json};
use twin::effect::Effect;
use twin::model_document::ModelDocument;
use twin::residual::{Activation, Input, Layer, Output, ResidualDocument};

const ROBOT: &str = "omni-01";

/// Polished floor; with a drag on the body when `hidden`.
fn version(assignment: &Assignment, hidden: bool) -> ModelDocument {
    let description = serde_json::to_value(&assignment.robots[0].description).expect("JSON");
    let description = serde_json::from_value(description).expect("a robot");
    let polished = Effect::new("floor_friction", &[("scale", 0.3)]);
    let floor = &assignment.experiment.floor;
    let document = ModelDocument::new(None, description, floor, vec![polished], Value::Null);
    if !hidden {
        return document;
    }
    let layer = Layer {
        weights: vec![-1.5, 0.0, 0.0, -1.5],
        bias: vec![0.2, 0.0],
        activation: Activation::Linear,
    };
    let output = |name: &str| Output {
        name: name.to_owned(),
        scale: 1.0,
        limit: 10.0,
    };
    document.with_residual(ResidualDocument::new(
        vec![
            Input::new("forward_m_per_s", -9.0, 9.0),
            Input::new("left_m_per_s", -9.0, 9.0),
        ],
        1.0,
        vec![layer],
        vec![
            output("acceleration_forward_m_per_s2"),
            output("acceleration_left_m_per_s2"),
        ],
    ))
}

/// Records of a run of the hidden plant; what they say of the robot's version is `told`.
fn records(mode: Mode, told: Option<&ModelDocument>) -> Vec<Record> {
    let mut assignment = assignment("rectangle-omni4.json", mode);
    let document = |version: &ModelDocument| serde_json::to_value(version).expect("JSON");
    let hidden = document(&version(&assignment, true));
    assignment.models.insert(ROBOT.to_owned(), hidden);
    let (mut records, _, _) = run(&assignment);
    assignment.models = told
        .map(|version| (ROBOT.to_owned(), document(version)))
        .into_iter()
        .collect();
    for record in &mut records {
        if let Record::Start(start) = record {
            start.assignment = assignment.clone();
        }
    }
    records.push(Record::End(Box::new(End {
        at_us: START_US + 60_000_000,
        state: api::run::RunState::Done,
        fault: None,
        records_dropped: 0,
    })));
    records
}

fn taught(records: &[Record]) -> (Vec<Learning>, Vec<Lesson>, Vec<String>) {
    let mut run = LearningRun::default();
    let (mut words, mut lessons, mut problems) = (Vec::new(), Vec::new(), Vec::new());
    for record in records {
        let heard = run.take(record);
        words.extend(heard.word);
        lessons.extend(heard.lessons);
        problems.extend(heard.problems);
    }
    (words, lessons, problems)
}

#[test]
fn a_force_that_the_version_lacks_is_learned_and_becomes_its_child() {
    let parent = version(&assignment("rectangle-omni4.json", Mode::Interactive), false);
    let records = records(Mode::Interactive, Some(&parent));
    let (words, lessons, problems) = taught(&records);
    assert_eq!(problems, Vec::<String>::new());
    let last = words.last().expect("words").robots[0];
    assert!(last.learnt_m < 0.5 * last.parent_m, "{last:?}");
    // Five words a second once the first prediction has ended, and two every second while the robot is driven at all.
    let seconds = records
        .iter()
        .filter(|record| matches!(record, Record::Tick(_)))
        .count() as f64
        / 120.0;
    assert!(
        words.len() as f64 > 4.5 * (seconds - 3.0),
        "{} words in {seconds} s",
        words.len()
    );
    let [lesson] = &lessons[..] else { panic!("{lessons:?}") };
    assert!(lesson.closing.is_better, "{lesson:?}");
    let learned = lesson.version.as_ref().expect("a version");
    let document = ModelDocument::parse(&learned.document.to_string()).expect("a model");
    assert_eq!(document.parent, Some(parent.id));
    assert_eq!((learned.robot.as_str(), document.robot.name.as_str()), (ROBOT, ROBOT));
    assert_eq!(document.provenance["learned_online"]["run"], json!(lesson.run_id));
    assert_eq!(
        document.provenance["data"][0]["sha256"].as_str().map(str::len),
        Some(64)
    );
    // The same records give the same document.
    let (_, again, _) = taught(&records);
    assert_eq!(again[0].version, lesson.version);
}

#[test]
fn a_version_that_is_right_gets_no_child() {
    let right = version(&assignment("rectangle-omni4.json", Mode::Interactive), true);
    let (words, lessons, _) = taught(&records(Mode::Interactive, Some(&right)));
    assert!(
        words
            .iter()
            .flat_map(|word| &word.robots)
            .all(|gap| gap.parent_m < 0.001)
    );
    assert!(lessons.len() == 1 && lessons[0].version.is_none(), "{lessons:?}");
}

#[test]
fn virtual_runs_teach_nothing() {
    let (words, lessons, problems) = taught(&records(Mode::Virtual, None));
    assert!(words.is_empty() && lessons.is_empty() && problems.is_empty());
}

#[test]
fn a_server_that_comes_late_learns_the_rest() {
    let parent = version(&assignment("rectangle-omni4.json", Mode::Interactive), false);
    let records = records(Mode::Interactive, Some(&parent));
    // The hub tells the beginning, then what happens from a quarter on.
    let late = [&records[..2], &records[records.len() / 4..]].concat();
    let (words, lessons, _) = taught(&late);
    assert!(!words.is_empty());
    assert!(
        lessons[0].closing.learnt_rms_m < 0.7 * lessons[0].closing.parent_rms_m,
        "{lessons:?}"
    );
}

#[test]
fn a_run_with_lost_records_gives_no_version() {
    let parent = version(&assignment("rectangle-omni4.json", Mode::Interactive), false);
    let mut run = LearningRun::default();
    let mut lessons = Vec::new();
    for (place, record) in records(Mode::Interactive, Some(&parent)).iter().enumerate() {
        if place == 500 {
            run.lost();
        }
        lessons.extend(run.take(record).lessons);
    }
    assert!(
        lessons[0].closing.is_better && lessons[0].version.is_none(),
        "{lessons:?}"
    );
}
