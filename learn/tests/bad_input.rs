//! Data that nothing can be learned from is refused by name.

#[path = "support/logs.rs"]
#[allow(dead_code)]
mod logs;

use identify::diagnose::Run;
use identify::workers::Serial;
use learn::problem::LearnError;
use learn::session::{Request, Shelf, learn};
use logs::{Log, csv, description, read, run, runs, truth};
use twin::model_document::ModelDocument;
use twin::robot::Robot;

fn refusal(runs: &dyn Shelf) -> LearnError {
    match learn(&Serial, &Request::new(runs)) {
        Err(error) => error,
        Ok(_) => panic!("was not refused"),
    }
}

fn short(seconds: f64) -> Vec<Run> {
    (0..3)
        .map(|number| {
            let log = Log {
                seconds,
                ..Log::usual(0.4 + number as f64)
            };
            run(None, &log, &format!("short-{number}"))
        })
        .collect()
}

#[test]
fn too_few_runs() {
    assert!(matches!(
        refusal(&Vec::new()),
        LearnError::TooFewRuns { found: 0, least: 3 }
    ));
    assert!(matches!(
        refusal(&runs(None, 2)),
        LearnError::TooFewRuns { found: 2, .. }
    ));
}

#[test]
fn runs_too_short_for_a_window() {
    let error = refusal(&short(1.0));
    assert!(
        matches!(
            error,
            LearnError::TooShort {
                role: "train",
                found: 0,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn a_robot_that_stands_still() {
    let still: Vec<Run> = (0..3)
        .map(|number| {
            let log = Log {
                speed_rad_per_s: 0.0,
                ..Log::usual(number as f64)
            };
            run(None, &log, "still")
        })
        .collect();
    assert_eq!(refusal(&still), LearnError::Constant);
}

#[test]
fn wheel_speeds_that_no_robot_has() {
    let robot = Robot::new(description()).unwrap();
    let log = Log::usual(0.3);
    let text = csv(&robot, &log);
    // The left wheel in degrees per hour.
    let wild: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            if line > 0 {
                let speed: f64 = cells[3].parse().unwrap();
                cells[3] = format!("{}", speed * 206_264.8 + 1e5);
            }
            cells.join(",")
        })
        .collect();
    let wild = read(&description(), &wild.join("\n"), "wild");
    let good = run(None, &log, "good");
    let error = refusal(&vec![wild.clone(), wild, good]);
    assert!(
        matches!(&error, LearnError::Absurd { path, quantity: "wheel_rad_per_s", .. } if path == "wild"),
        "{error}"
    );
}

#[test]
fn another_number_of_wheels() {
    let text: String = csv(&Robot::new(description()).unwrap(), &Log::usual(0.3));
    let mut tricycle = description();
    tricycle.wheels.truncate(3);
    tricycle.wheels[2].y_m = 0.0;
    let mut all = runs(None, 2);
    all.push(read(&tricycle, &text, "tricycle"));
    let error = refusal(&all);
    assert!(
        matches!(&error, LearnError::OtherRobot { path, found: 3, .. } if path == "tricycle"),
        "{error}"
    );
    all[2] = read(&twin::golden::reference_robot("omni4"), &text, "omni");
    let error = refusal(&all);
    assert!(
        matches!(&error, LearnError::OtherChassis { path, .. } if path == "omni"),
        "{error}"
    );
}

#[test]
fn a_run_without_poses() {
    let text = csv(&Robot::new(description()).unwrap(), &Log::usual(0.3));
    let blind: Vec<String> = text
        .lines()
        .map(|row| row.split(',').take(6).collect::<Vec<_>>().join(","))
        .collect();
    let mut all = runs(None, 2);
    all.push(read(&description(), &blind.join("\n"), "no-camera"));
    let error = refusal(&all);
    assert!(
        matches!(&error, LearnError::Channels { path, .. } if path == "no-camera"),
        "{error}"
    );
}

#[test]
fn a_model_that_carries_a_residual_already() {
    let model = ModelDocument::new(None, description(), "hall", Vec::new(), serde_json::Value::Null);
    let runs = runs(None, 3);
    let mut request = Request::new(&runs);
    request.model = Some(model.with_residual(truth(-0.1, 0.0)));
    assert_eq!(learn(&Serial, &request).unwrap_err(), LearnError::HasResidual);
}

#[test]
fn cancelling_ends_it() {
    struct Cancelled;
    impl identify::workers::Workers for Cancelled {
        fn run(&self, _: usize, _: &(dyn Fn(usize) + Sync)) {}
        fn is_cancelled(&self) -> bool {
            true
        }
    }
    let runs = runs(None, 3);
    let error = learn(&Cancelled, &Request::new(&runs)).unwrap_err();
    assert!(matches!(error, LearnError::Cancelled(_)), "{error}");
}
