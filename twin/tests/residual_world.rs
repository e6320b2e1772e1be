//! Learned residuals in worlds and documents: bits, snapshots, refusals.

mod support;

use std::collections::BTreeMap;
use std::path::Path;

use support::drive::twist;
use support::{car, diff2, omni4, robot, wheels};
use twin::effect::Effect;
use twin::free::FreeRobot;
use twin::golden::{effect_digests, reference_residual, residual_digests};
use twin::model_document::ModelDocument;
use twin::pose::Pose;
use twin::residual::{Activation, Input, Layer, MAX_TICKS_AGO, ResidualDocument};
use twin::robot::{Robot, RobotDescription};
use twin::world::{Arena, World, WorldError};

const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};

fn with(description: &RobotDescription, residual: Option<&ResidualDocument>) -> Robot {
    Robot::with_model(description.clone(), &[], residual).unwrap_or_else(|problem| panic!("{problem}"))
}

fn world(robots: Vec<Robot>) -> World {
    let placed = robots.into_iter().enumerate().map(|(place, robot)| {
        let pose = Pose {
            x_m: -1.0 + 1.2 * place as f64,
            y_m: 0.1,
            yaw_rad: 0.4,
        };
        (robot, pose, 0.25)
    });
    World::new(ARENA, placed.collect()).expect("a world")
}

/// The numbers of every robot after each tick.
fn bits(mut world: World) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    for tick in 0..120 {
        let speed = if tick < 60 { 12.0 } else { -6.0 };
        world
            .step(&[wheels(&[-speed, speed, 0.8 * speed, speed])])
            .expect("a tick");
        all.push(world.snapshot().robots);
    }
    all
}

#[test]
fn no_residual_and_a_silent_one_change_no_bit() {
    let description = omni4();
    let plain = bits(world(vec![robot(description.clone())]));
    assert_eq!(bits(world(vec![with(&description, None)])), plain);
    let mut silent = reference_residual(&description);
    let mut loud = silent.clone();
    let last = silent.layers.last_mut().expect("layers");
    last.weights.fill(0.0);
    last.bias.fill(0.0);
    assert!(silent.is_neutral() && !loud.is_neutral());
    assert_eq!(bits(world(vec![with(&description, Some(&silent))])), plain);
    let changed = bits(world(vec![with(&description, Some(&loud))]));
    assert_ne!(
        changed, plain,
        "the same network with its output weights does change it"
    );
    loud.outputs.iter_mut().for_each(|output| output.scale = 0.0);
    assert!(loud.is_neutral());
    // The null residual is also the same world.
    let digest = |robot: Robot| world(vec![robot]).digest();
    assert_eq!(digest(with(&description, None)), digest(robot(description.clone())));
}

#[test]
fn outside_its_region_the_bits_are_those_of_the_nominal_twin() {
    let description = diff2();
    let mut residual = reference_residual(&description);
    residual.inputs[0].low = 50.0;
    residual.inputs[0].high = 51.0;
    residual.fade = 0.1;
    let start = Pose::default();
    let mut plain = FreeRobot::at_rest(&robot(description.clone()), start);
    let mut learned = FreeRobot::at_rest(&with(&description, Some(&residual)), start);
    for _ in 0..480 {
        plain.step(&wheels(&[10.0, 7.0]));
        learned.step(&wheels(&[10.0, 7.0]));
        assert_eq!(plain.state(), learned.state());
    }
    assert!(plain.state().pose.x_m > 0.2);
}

#[test]
fn a_restored_world_goes_on_as_if_nothing_had_been() {
    let lively = |description: RobotDescription, effects: &[Effect]| {
        let residual = reference_residual(&description);
        Robot::with_model(description, effects, Some(&residual)).expect("a robot")
    };
    let effects = [
        Effect::new("command_delay", &[("delay", 0.05)]),
        Effect::new("gear_backlash", &[("play", 0.05)]),
        Effect::new("payload", &[("mass", 2.0)]),
    ];
    let make = || {
        world(vec![
            lively(omni4(), &effects),
            lively(diff2(), &[]),
            lively(car("awd"), &[]),
        ])
    };
    let commands = |tick: u64| {
        let speed = 4.0 + (tick % 40) as f64 * 0.4;
        [
            wheels(&[-speed, -speed, speed, 0.5 * speed]),
            wheels(&[speed, -0.2 * speed]),
            robot(car("awd")).wheel_speeds(twist(0.05 * speed, 0.0, 0.3)),
        ]
    };
    let mut original = make();
    for tick in 0..37 {
        original.step(&commands(tick)).expect("a tick");
    }
    let snapshot = original.snapshot();
    let mut copy = make();
    copy.restore(&snapshot).expect("restored");
    for tick in 37..160 {
        original.step(&commands(tick)).expect("a tick");
        copy.step(&commands(tick)).expect("a tick");
        assert_eq!(original.digest(), copy.digest(), "tick {tick}");
        assert_eq!(original.snapshot(), copy.snapshot(), "tick {tick}");
    }
}

#[test]
fn a_snapshot_belongs_to_its_residual() {
    let description = omni4();
    let residual = reference_residual(&description);
    let snapshot = world(vec![with(&description, Some(&residual))]).snapshot();
    let mut other = residual.clone();
    other.layers[0].bias[0] += 1e-9;
    for stranger in [Some(&other), None] {
        let refused = world(vec![with(&description, stranger)]).restore(&snapshot);
        assert!(matches!(refused, Err(WorldError::Snapshot { .. })), "{refused:?}");
    }
    world(vec![with(&description, Some(&residual))])
        .restore(&snapshot)
        .expect("its own");
}

#[test]
fn a_residual_comes_back_from_its_document() {
    let residual = reference_residual(&omni4());
    let document = ModelDocument::new(None, omni4(), "lab-floor", Vec::new(), serde_json::Value::Null);
    let learned = document.clone().with_residual(residual.clone());
    assert_ne!(learned.id, document.id);
    let read = ModelDocument::parse(&serde_json::to_string_pretty(&learned).expect("JSON")).expect("a model");
    assert_eq!(read, learned);
    let back = read.robot().expect("a robot");
    assert_eq!(back.residual().expect("a residual").document(), &residual);
}

/// Changes one thing of a good residual.
type Change = fn(&mut ResidualDocument);

#[test]
fn a_residual_says_what_is_wrong_with_it() {
    let cases: [(Change, &str); 27] = [
        (|d| d.format = "robopheus.residual/2".to_owned(), "format"),
        (|d| d.inputs.clear(), "inputs"),
        (|d| d.inputs = vec![d.inputs[0].clone(); 65], "inputs"),
        (|d| d.inputs[1].name = "mood".to_owned(), "inputs[1].name"),
        (|d| d.inputs[1] = d.inputs[0].clone(), "inputs[1].name"),
        (|d| d.inputs[1].name = "steering_rad".to_owned(), "inputs[1].name"),
        (|d| d.inputs[1].wheel = Some(0), "inputs[1].wheel"),
        (|d| d.inputs[0].wheel = None, "inputs[0].wheel"),
        (|d| d.inputs[0].wheel = Some(9), "inputs[0].wheel"),
        (|d| d.inputs[0].wheel = Some(2), "inputs[0].wheel"),
        (
            |d| d.inputs[0] = Input::new("current_a", -1.0, 1.0).at(2),
            "inputs[0].wheel",
        ),
        (|d| d.inputs[1].ticks_ago = MAX_TICKS_AGO + 1, "inputs[1].ticks_ago"),
        (|d| d.inputs[1].mean = f64::NAN, "inputs[1].mean"),
        (|d| d.inputs[1].scale = 0.0, "inputs[1].scale"),
        (|d| d.inputs[1].low = f64::NEG_INFINITY, "inputs[1].low"),
        (|d| d.inputs[1].high = d.inputs[1].low, "inputs[1].high"),
        (|d| d.inputs[1].scale = 1e-6, "inputs[1].low"),
        (|d| d.fade = 0.0, "fade"),
        (|d| d.layers = vec![d.layers[0].clone(); 5], "layers"),
        (|d| d.layers[0].bias.clear(), "layers[0].bias"),
        (|d| d.layers[0].weights.push(1.0), "layers[0].weights"),
        (|d| d.layers[0].weights[3] = f64::INFINITY, "layers[0].weights[3]"),
        (|d| d.layers[0].bias[1] = 1e7, "layers[0].bias[1]"),
        (|d| d.outputs.truncate(1), "outputs"),
        (|d| d.outputs[1].name = d.outputs[0].name.clone(), "outputs[1].name"),
        (|d| d.outputs[0].limit = 10.1, "outputs[0].limit"),
        (|d| d.outputs[0].scale = f64::NAN, "outputs[0].scale"),
    ];
    let good = || {
        let layer = Layer {
            weights: vec![0.1, 0.2, 0.3, 0.4],
            bias: vec![0.0, 0.1],
            activation: Activation::Tanh,
        };
        let inputs = vec![
            Input::new("wheel_rad_per_s", -10.0, 10.0).at(1),
            Input::new("left_m_per_s", -1.0, 1.0),
        ];
        let outputs = reference_residual(&diff2()).outputs[..2].to_vec();
        ResidualDocument::new(inputs, 0.25, vec![layer], outputs)
    };
    with(&diff2(), Some(&good()));
    for (change, field) in cases {
        let mut bad = good();
        change(&mut bad);
        let problem = Robot::with_model(diff2(), &[], Some(&bad)).expect_err(field);
        assert_eq!(problem.field, format!("residual.{field}"), "{problem}");
        assert!(!problem.limit.is_empty() && !problem.remedy.is_empty(), "{problem}");
    }
    // Unknown fields and activations are no documents at all.
    let text = serde_json::to_string(&good()).expect("JSON");
    for (from, to) in [("\"fade\"", "\"haze\""), ("\"tanh\"", "\"relu\"")] {
        assert!(serde_json::from_str::<ResidualDocument>(&text.replace(from, to)).is_err());
    }
}

/// `UPDATE_GOLDEN=1` writes the file anew.
#[test]
fn a_residual_on_every_chassis_gives_its_committed_digest() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/residual.json");
    let now = residual_digests().expect("traces");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let text = serde_json::to_string_pretty(&now).expect("JSON");
        std::fs::write(&path, text + "\n").expect("written");
    }
    let text = std::fs::read_to_string(&path).expect("golden/residual.json");
    let committed: BTreeMap<String, String> = serde_json::from_str(&text).expect("JSON");
    assert_eq!(
        now, committed,
        "if these bits were meant to change, change twin::VERSION and run with UPDATE_GOLDEN=1"
    );
    let nominal = effect_digests().expect("traces");
    for (name, digest) in &now {
        let plain = &nominal[&name.replace("/residual", "/nominal")];
        assert_ne!(digest, plain, "{name} changes nothing");
    }
}
