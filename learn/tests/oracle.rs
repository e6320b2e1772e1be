//! The twin with a residual that is known, learned from its own logs.

#[path = "support/logs.rs"]
#[allow(dead_code)]
mod logs;
#[path = "support/threads.rs"]
mod threads;

use identify::workers::Serial;
use learn::compare::differences;
use learn::inputs::{Sight, eyes};
use learn::linear::{AXES, Scales, Target, linearised};
use learn::rollout::{Predictor, driven};
use learn::session::{Outcome, Request, TRAINING, learn};
use learn::window::{Collection, Window};
use logs::{Log, description, runs, truth};
use threads::Threads;
use twin::model_document::ModelDocument;
use twin::residual::{Activation, Input, Layer, OUTPUTS, Output, Residual, ResidualDocument, SHIFTS};
use twin::robot::Robot;

/// Forward drag and a constant turning, for which the wheels slip.
const DRAG_PER_S: f64 = -2.0;
const TURN_RAD_PER_S2: f64 = 1.5;

fn learned(threads: bool) -> Outcome {
    let runs = runs(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2)), 5);
    let mut request = Request::new(&runs);
    request.sights = vec![Sight::Motion];
    let outcome = if threads {
        learn(&Threads, &request)
    } else {
        learn(&Serial, &request)
    };
    outcome.unwrap_or_else(|problem| panic!("{problem}"))
}

#[test]
fn a_known_force_is_found_and_the_prediction_is_several_times_better() {
    let outcome = learned(true);
    let report = &outcome.report;
    assert!(report.useful, "{}", report.table());
    let far = report.figure("position", 2.0).unwrap();
    let (with, black_box) = (far.residual.unwrap(), far.black_box.unwrap());
    assert!(with < far.physics / 3.0, "{}", report.table());
    assert!(with < black_box, "{}", report.table());
    // The force itself, at places that the logs hold.
    let document = outcome.model.residual.as_ref().unwrap();
    let residual = Residual::new(&description(), document).unwrap();
    for forward in [-0.4, 0.0, 0.4] {
        let inputs: Vec<f64> = document
            .inputs
            .iter()
            .map(|input| match input.name.as_str() {
                "forward_m_per_s" => forward,
                "wheel_rad_per_s" | "command_wheel_rad_per_s" => {
                    forward / description().wheels[0].radius_m.unwrap_or(1.0)
                }
                _ => 0.0,
            })
            .collect();
        let [along, _, turn] = residual.accelerations(&inputs);
        assert!((along - DRAG_PER_S * forward).abs() < 0.3, "{forward}: {along}");
        assert!((turn - TURN_RAD_PER_S2).abs() < 0.6, "{forward}: {turn}");
    }
    // The same bits on one thread.
    let again = learned(false);
    assert_eq!(again.model.id, outcome.model.id);
    assert_eq!(again.report.text(), report.text());
    // What is written can be read.
    let text = serde_json::to_string(&outcome.model).unwrap();
    assert_eq!(ModelDocument::parse(&text).unwrap(), outcome.model);
}

#[test]
fn a_twin_that_is_right_gets_no_residual() {
    let runs = runs(None, 4);
    let mut request = Request::new(&runs);
    request.sights = vec![Sight::Motion];
    let outcome = learn(&Threads, &request).unwrap_or_else(|problem| panic!("{problem}"));
    assert!(!outcome.report.useful, "{}", outcome.report.table());
    assert!(outcome.model.residual.is_none() && outcome.learner.is_none());
    assert!(
        outcome.report.verdict.contains("discarded"),
        "{}",
        outcome.report.verdict
    );
}

/// Wheels of a robot without motors that do a sixth less than they are told, and turn by themselves: what actuators do that no
/// description says. A force on the body fights the grip for it; set-points say it.
#[test]
fn what_wheels_do_besides_what_they_are_told_is_found() {
    let mut description = description();
    description.motor = None;
    let layer = Layer {
        weights: vec![-1.0 / 6.0, 0.0],
        bias: vec![0.0, 0.2],
        activation: Activation::Linear,
    };
    let output = |(name, _, limit): (&str, &str, f64)| Output {
        name: name.to_owned(),
        scale: 1.0,
        limit,
    };
    let truth = ResidualDocument::new(
        vec![Input::new("command_forward_m_per_s", -20.0, 20.0)],
        1.0,
        vec![layer],
        vec![output(SHIFTS[0]), output(SHIFTS[2])],
    );
    let robot = Robot::with_model(description.clone(), &[], Some(&truth)).unwrap();
    let runs: Vec<_> = (0..5)
        .map(|number| {
            let log = Log::usual(0.37 + 1.13 * f64::from(number));
            logs::read(&description, &logs::csv(&robot, &log), &format!("run-{number}"))
        })
        .collect();
    let mut request = Request::new(&runs);
    request.sights = vec![Sight::Motion];
    let outcome = learn(&Threads, &request).unwrap_or_else(|problem| panic!("{problem}"));
    let report = &outcome.report;
    assert_eq!(report.attempts.last().map(|attempt| attempt.sight), Some(Sight::Told));
    assert!(report.useful, "{}", report.table());
    assert_eq!(report.chosen, Some(1), "{}", report.table());
    let far = report.figure("position", 2.0).unwrap();
    let (with, black_box) = (far.residual.unwrap(), far.black_box.unwrap());
    println!("{}", report.table());
    assert!(with < far.physics / 5.0 && with < black_box, "{}", report.table());
    let names: Vec<&str> = outcome
        .model
        .residual
        .as_ref()
        .unwrap()
        .outputs
        .iter()
        .map(|output| output.name.as_str())
        .collect();
    assert_eq!(names, SHIFTS.map(|(name, ..)| name));
}

fn windows() -> Vec<Window> {
    let run = logs::run(Some(&truth(DRAG_PER_S, 0.0)), &Log::usual(0.5), "run");
    let mut collection = Collection::new(TRAINING, 1000);
    collection.add(0, "run", &run.bundle, Default::default()).unwrap();
    collection.windows
}

#[test]
fn the_linear_loss_is_that_of_a_driven_twin() {
    let robot = Robot::new(description()).unwrap();
    let windows = windows();
    let plain: Vec<_> = windows
        .iter()
        .map(|w| differences(w, &robot.path(w).unwrap(), true).unwrap())
        .collect();
    let scales = Scales::of(plain.iter().map(Vec::as_slice));
    let eyes = eyes(robot.description(), Sight::Motion);
    let push = [-0.15, 0.0, 0.4, 0.0, 0.0, 0.0];
    for window in &windows[3..6] {
        let problem = linearised(&robot, window, (&eyes, &(0..OUTPUTS.len())), &scales, Target::Path).unwrap();
        let path = driven(&robot, window, &mut |_| Some(push)).unwrap();
        // Weights of the outliers are those of the linearisation: compare the differences through a loss of its own.
        let base = differences(
            window,
            &driven(&robot, window, &mut |_| Some([0.0; AXES])).unwrap(),
            true,
        )
        .unwrap();
        let pushed = differences(window, &path, true).unwrap();
        let change: Vec<f64> = push.iter().copied().cycle().take(AXES * problem.blocks).collect();
        let mut gradient = vec![0.0; change.len()];
        let predicted = problem.loss(&change, &mut gradient) - problem.energy;
        let counts = |class| base.iter().filter(|d| d.class == class).count() as f64;
        let weighted = |all: &[learn::compare::Difference]| -> f64 {
            let pairs = all.iter().zip(&base);
            pairs
                .map(|(d, base)| {
                    let scale = scales.0[d.class as usize];
                    let share = base.value.abs() / scale;
                    let robust = if share > 3.0 { 3.0 / share } else { 1.0 };
                    robust * d.value * d.value / (counts(d.class) * scale * scale)
                })
                .sum()
        };
        let found = weighted(&pushed) - weighted(&base);
        assert!(
            (found - predicted).abs() < 0.15 * found.abs() + 0.02,
            "{found} {predicted}"
        );
    }
}

#[test]
fn memory_is_bounded_and_every_second_window_goes() {
    let run = logs::run(None, &Log::usual(0.5), "run");
    let mut whole = Collection::new(TRAINING, 1000);
    whole.add(0, "run", &run.bundle, Default::default()).unwrap();
    let mut few = Collection::new(TRAINING, 8);
    few.add(0, "run", &run.bundle, Default::default()).unwrap();
    assert!(whole.windows.len() > 16 && whole.stride == 1);
    assert!(few.windows.len() <= 8 && few.stride > 1);
    assert_eq!(few.seen, whole.seen);
    let starts = |windows: &[Window]| -> Vec<f64> { windows.iter().map(|w| w.start_s).collect() };
    let thinned: Vec<f64> = starts(&whole.windows).into_iter().step_by(few.stride).collect();
    assert_eq!(starts(&few.windows), thinned);
}

#[test]
fn a_pause_of_the_telemetry_is_skipped() {
    let run = logs::run(None, &Log::usual(0.5), "run");
    let mut text = logs::csv(&Robot::new(description()).unwrap(), &Log::usual(0.5));
    let kept: Vec<&str> = text
        .lines()
        .filter(|line| {
            let time_s: f64 = line.split(',').next().unwrap().parse().unwrap_or(0.0);
            !(9.0..12.0).contains(&time_s)
        })
        .collect();
    text = kept.join("\n");
    let paused = logs::read(&description(), &text, "paused");
    let cut = |bundle| {
        let mut collection = Collection::new(TRAINING, 1000);
        collection.add(0, "run", bundle, Default::default()).unwrap();
        collection
    };
    let (whole, paused) = (cut(&run.bundle), cut(&paused.bundle));
    assert_eq!(whole.skipped, 0);
    assert!(paused.skipped >= 3);
    assert!(
        paused
            .windows
            .iter()
            .all(|w| w.start_s + w.end_s() < 9.51 || w.start_s > 11.9)
    );
}
