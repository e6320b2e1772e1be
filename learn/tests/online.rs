//! Learning while driving: a plant whose difference from the model is known, poses as a camera gives them.

#[path = "support/logs.rs"]
#[allow(dead_code)]
mod logs;

use identify::random::Random;
use learn::online::law::{Law, Past};
use learn::online::span::Body;
use learn::online::{OnlineLearner, Prediction};
use logs::{description, truth};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::model_document::ModelDocument;
use twin::pose::{Pose, wrapped_rad};
use twin::residual::{Activation, Input, Layer, Output, ResidualDocument};
use twin::robot::Robot;

const DRAG_PER_S: f64 = -2.0;
const TURN_RAD_PER_S2: f64 = 1.5;
/// Physics steps from one pose to the next (60 Hz) and from one set-point to the next (2 Hz).
const POSE_STEPS: i64 = 8;
const COMMAND_STEPS: i64 = 240;
const STEPS_PER_S: i64 = 480;

/// The nominal robot as a document without an identifier: there is no version yet.
fn nominal() -> ModelDocument {
    let mut document = ModelDocument::new(None, description(), "hall", Vec::new(), serde_json::Value::Null);
    document.id.clear();
    document
}

fn plant(residual: Option<&ResidualDocument>) -> Robot {
    Robot::with_model(description(), &[], residual).expect("a robot")
}

fn varied(step: i64) -> WheelCommand {
    let phase = 0.37 + 0.7 * step as f64 / STEPS_PER_S as f64;
    let along = libm::sin(phase) + 0.6 * libm::sin(2.3 * phase + 0.4);
    let turn = 0.5 * libm::sin(1.7 * phase + 1.0);
    let mut command = WheelCommand::default();
    command.wheel_rad_per_s[0] = 9.0 * (along - turn);
    command.wheel_rad_per_s[1] = 9.0 * (along + turn);
    command
}

/// A plant, and a camera over it.
struct Drive {
    free: FreeRobot,
    command: WheelCommand,
    step: i64,
    random: Random,
    noise: f64,
}

impl Drive {
    fn new(plant: &Robot, noise: f64) -> Drive {
        Drive {
            free: FreeRobot::at_rest(plant, Pose::default()),
            command: WheelCommand::default(),
            step: 0,
            random: Random::new(3, 11),
            noise,
        }
    }

    /// Another plant goes on where this one is.
    fn change(&mut self, plant: &Robot) {
        self.free = FreeRobot::at_rest(plant, self.free.pose());
    }

    fn drive(
        &mut self,
        learner: &mut OnlineLearner,
        seconds: i64,
        commands: impl Fn(i64) -> WheelCommand,
        spoil: impl Fn(i64, Pose) -> Pose,
    ) -> Vec<Prediction> {
        let mut predictions = Vec::new();
        for _ in 0..seconds * STEPS_PER_S {
            if self.step % COMMAND_STEPS == 0 {
                self.command = commands(self.step);
                learner.command(self.step, self.command);
            }
            if self.step % POSE_STEPS == 0 {
                let pose = self.free.pose();
                let mut near = |value: f64, sigma: f64| value + self.noise * sigma * self.random.normal();
                let seen = Pose {
                    x_m: near(pose.x_m, 0.001),
                    y_m: near(pose.y_m, 0.001),
                    yaw_rad: wrapped_rad(near(pose.yaw_rad, 0.002)),
                };
                predictions.extend(learner.pose(self.step, spoil(self.step, seen)));
            }
            self.free.step(&self.command);
            self.step += 1;
        }
        predictions
    }
}

fn honest(_: i64, pose: Pose) -> Pose {
    pose
}

fn learned(seconds: i64) -> (OnlineLearner, Vec<Prediction>) {
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let mut drive = Drive::new(&plant(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2))), 1.0);
    let predictions = drive.drive(&mut learner, seconds, varied, honest);
    (learner, predictions)
}

fn rms(predictions: &[Prediction], error: impl Fn(&Prediction) -> f64) -> f64 {
    let squares: f64 = predictions.iter().map(error).map(|error| error * error).sum();
    (squares / predictions.len() as f64).sqrt()
}

#[test]
fn a_known_force_is_learned_within_a_minute_and_the_version_predicts_an_unseen_drive() {
    let (learner, predictions) = learned(60);
    let closing = learner.close();
    assert!(closing.is_better, "{closing:?} {:?}", learner.counts());
    assert!(closing.learnt_rms_m < 0.4 * closing.parent_rms_m, "{closing:?}");
    println!("{closing:?}");
    // Tenth of a second by tenth of a second.
    assert!((560..=600).contains(&predictions.len()), "{}", predictions.len());
    let version = learner.version(serde_json::json!({"run": "r"})).expect("a version");
    assert!(version.parent.is_none());
    let text = serde_json::to_string(&version).expect("JSON");
    let version = ModelDocument::parse(&text).expect("a model that everybody reads");
    // From rest, without noise, on set-points that were not in the run.
    let robots = [
        plant(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2))),
        plant(None),
        version.robot().expect("a robot"),
    ];
    let ends = robots.map(|robot| {
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        for step in 0..2 * STEPS_PER_S {
            free.step(&varied(5000 + step / COMMAND_STEPS * 531));
        }
        free.pose()
    });
    let [without_m, with_m] = [1, 2].map(|k: usize| ends[0].distance_m(&ends[k]));
    assert!(with_m < 0.5 * without_m, "{without_m} -> {with_m}");
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let [(one, predictions), (other, again)] = [learned(10), learned(10)];
    assert_eq!(predictions, again);
    let versions = [&one, &other].map(|learner| learner.version(serde_json::Value::Null).expect("a version").id);
    assert_eq!(versions[0], versions[1]);
}

#[test]
fn a_model_that_is_right_gets_no_version() {
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let mut drive = Drive::new(&plant(None), 1.0);
    drive.drive(&mut learner, 60, varied, honest);
    let closing = learner.close();
    assert!(!closing.is_better, "{closing:?}");
    assert!(closing.learnt_rms_m < 1.3 * closing.parent_rms_m, "{closing:?}");
    assert_eq!(learner.counts().discarded, 0);
}

#[test]
fn one_motion_for_minutes_leaves_everything_bounded() {
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let plant = plant(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2)));
    let mut drive = Drive::new(&plant, 1.0);
    let straight = |_| {
        let mut command = WheelCommand::default();
        command.wheel_rad_per_s[..2].fill(8.0);
        command
    };
    drive.drive(&mut learner, 180, straight, honest);
    assert_eq!(learner.counts().discarded, 0);
    let closing = learner.close();
    assert!(closing.learnt_rms_m < closing.parent_rms_m, "{closing:?}");
    // And it still learns when the robot begins to turn.
    let later = drive.drive(&mut learner, 60, varied, honest);
    let last = &later[later.len() / 2..];
    assert!(rms(last, |p| p.learnt_m) < 0.6 * rms(last, |p| p.parent_m));
}

#[test]
fn a_robot_at_rest_teaches_nothing() {
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let mut drive = Drive::new(&plant(None), 1.0);
    let predictions = drive.drive(&mut learner, 30, |_| WheelCommand::default(), honest);
    assert!(predictions.is_empty());
    assert!(learner.version(serde_json::Value::Null).is_none());
}

#[test]
fn poses_that_are_none_and_poses_that_jump_are_refused() {
    let spoiled = |step: i64, pose: Pose| match step / POSE_STEPS % 40 {
        17 => Pose { x_m: f64::NAN, ..pose },
        23 => Pose {
            yaw_rad: f64::INFINITY,
            ..pose
        },
        31 => Pose {
            y_m: pose.y_m + 1.5,
            ..pose
        },
        _ => pose,
    };
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let mut drive = Drive::new(&plant(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2))), 1.0);
    let predictions = drive.drive(&mut learner, 60, varied, spoiled);
    let mut broken = WheelCommand::default();
    broken.wheel_rad_per_s[0] = f64::NAN;
    learner.command(drive.step, broken);
    assert!(learner.counts().refused > 2 * 60 * 60 / 40, "{:?}", learner.counts());
    assert!(predictions.iter().all(|p| p.parent_m < 1.0 && p.learnt_m < 1.0));
    let closing = learner.close();
    assert!(closing.learnt_rms_m < 0.6 * closing.parent_rms_m, "{closing:?}");
}

#[test]
fn what_turns_out_wrong_is_thrown_away_and_learned_anew() {
    let mut learner = OnlineLearner::new(nominal()).expect("a learner");
    let mut drive = Drive::new(&plant(Some(&truth(DRAG_PER_S, 3.0))), 1.0);
    drive.drive(&mut learner, 60, varied, honest);
    let before = learner.counts().discarded;
    assert!(learner.close().is_better, "{:?}", learner.close());
    // From one moment to the next the robot turns the other way: what was learned is worse than nothing.
    drive.change(&plant(Some(&truth(DRAG_PER_S, -3.0))));
    let after = drive.drive(&mut learner, 60, varied, honest);
    let last = &after[after.len() / 2..];
    let worst = after
        .windows(20)
        .map(|part| rms(part, |p| p.learnt_m) / rms(part, |p| p.parent_m));
    assert!(worst.fold(0.0, f64::max) > 1.2, "the change is felt");
    assert!(learner.counts().discarded > before, "{:?}", learner.counts());
    assert!(rms(last, |p| p.learnt_m) < 0.7 * rms(last, |p| p.parent_m));
}

/// A parent with hidden units: x -> tanh -> linear.
fn with_hidden() -> ModelDocument {
    let inputs = vec![
        Input::new("forward_m_per_s", -1.0, 1.0).normalised(0.1, 0.4),
        Input::new("command_wheel_rad_per_s", -20.0, 20.0)
            .at(1)
            .ago(4)
            .normalised(0.0, 8.0),
    ];
    let hidden = Layer {
        weights: vec![0.8, -0.3, 0.1, 0.5, -0.2, 0.7],
        bias: vec![0.0, 0.1, -0.1],
        activation: Activation::Tanh,
    };
    let last = Layer {
        weights: vec![-0.6, 0.2, 0.4, 0.3, 0.1, -0.5],
        bias: vec![0.05, -0.02],
        activation: Activation::Linear,
    };
    let output = |name: &str, scale: f64, limit: f64| Output {
        name: name.to_owned(),
        scale,
        limit,
    };
    let outputs = vec![
        output("acceleration_yaw_rad_per_s2", 4.0, 3.0),
        output("acceleration_forward_m_per_s2", 1.5, 2.0),
    ];
    nominal().with_residual(ResidualDocument::new(inputs, 0.25, vec![hidden, last], outputs))
}

#[test]
fn a_law_pushes_as_the_twin_evaluates_its_document() {
    let document = with_hidden();
    let residual = document.residual.as_ref().expect("a residual");
    let (law, weights) = Law::new(residual).expect("a law");
    assert_eq!(law.last_layer(&weights), residual.layers[1]);
    let bare = plant(None);
    let body = Body {
        robot: &bare,
        law: &law,
    };
    let (mut pushed, mut past) = (FreeRobot::at_rest(&bare, Pose::default()), Past::default());
    let mut evaluated = FreeRobot::at_rest(&document.robot().expect("a robot"), Pose::default());
    for step in 0..10 * STEPS_PER_S {
        let command = varied(step / COMMAND_STEPS * COMMAND_STEPS);
        body.step(&mut pushed, &command, &weights, &mut past);
        evaluated.step(&command);
        let apart_m = pushed.pose().distance_m(&evaluated.pose());
        assert!(apart_m < 1e-6, "step {step}: {apart_m}");
    }
    assert!(evaluated.pose().distance_m(&Pose::default()) > 0.05);
}

#[test]
fn a_parent_with_hidden_units_keeps_them_and_gets_another_last_layer() {
    let parent = with_hidden();
    let mut learner = OnlineLearner::new(parent.clone()).expect("a learner");
    let mut drive = Drive::new(&plant(Some(&truth(DRAG_PER_S, TURN_RAD_PER_S2))), 1.0);
    let predictions = drive.drive(&mut learner, 60, varied, honest);
    let first = &predictions[0];
    assert_eq!(first.parent_m, first.learnt_m);
    let closing = learner.close();
    assert!(
        closing.is_better && closing.learnt_rms_m < 0.6 * closing.parent_rms_m,
        "{closing:?}"
    );
    let version = learner.version(serde_json::Value::Null).expect("a version");
    assert_eq!(version.parent.as_ref(), Some(&parent.id));
    let [before, after] = [&parent, &version].map(|document| document.residual.clone().expect("a residual"));
    assert_eq!(before.inputs, after.inputs);
    assert_eq!(before.layers[0], after.layers[0]);
    assert_ne!(before.layers[1], after.layers[1]);
    let mut squashed = parent;
    squashed.residual.as_mut().expect("a residual").layers[1].activation = Activation::Tanh;
    assert!(OnlineLearner::new(squashed).is_err());
}
