//! Every rule of an experiment refuses with the field it is about.

mod common;

use common::{example, scenario_of};
use control::scenario::{FieldProblem, Scenario};
use serde_json::{Value, json};

fn problems(document: &Value) -> Vec<FieldProblem> {
    Scenario::from_json(&document.to_string()).err().unwrap_or_default()
}

fn fields(document: &Value) -> Vec<String> {
    problems(document).into_iter().map(|problem| problem.field).collect()
}

/// A change to the experiment (JSON pointer, new value) and the field that must be named.
fn refused(base: &str, pointer: &str, value: Value, field: &str) {
    let mut document = example(base);
    *document["experiment"]
        .pointer_mut(pointer)
        .unwrap_or_else(|| panic!("{pointer}")) = value.clone();
    let found = problems(&document);
    let problem = found
        .iter()
        .find(|p| p.field == field)
        .unwrap_or_else(|| panic!("{pointer} = {value}: no {field} in {found:#?}"));
    assert!(
        !problem.message.is_empty() && !problem.limit.is_empty() && !problem.remedy.is_empty(),
        "{problem:?}"
    );
}

#[test]
fn a_controller_that_cannot_drive_the_chassis_is_refused_with_the_budget() {
    let mut document = example("rectangle-omni4");
    document["experiment"]["robots"][0]["controller"] = json!("mega2560");
    document["robots"][0]["controller"] = json!("mega2560");
    let found = problems(&document);
    let problem = &found[0];
    assert_eq!(problem.field, "laboratory.robots[0].controller", "{found:#?}");
    assert!(problem.message.contains("cycles"), "{problem:?}");
    assert!(
        problem.limit.contains("mega2560") && problem.remedy.contains("sam3x"),
        "{problem:?}"
    );
}

#[test]
fn a_horizon_outside_of_its_range_is_refused_and_without_one_nothing_is_corrected() {
    let with = |mode: &str, interaction: Value| {
        let mut document = example("rectangle-omni4");
        document["experiment"]["mode"] = json!(mode);
        document["experiment"]["control"]["interaction"] = interaction;
        document
    };
    for horizon_s in [0.0, 0.09, 0.51, -1.0, 1e300] {
        let found = fields(&with("interactive", json!({"horizon_s": horizon_s})));
        assert_eq!(found, ["control.interaction.horizon_s"], "{horizon_s}");
    }
    assert_eq!(
        fields(&with("interactive", json!({"horizon": 0.3}))),
        ["control.interaction.horizon"]
    );
    for (mode, interaction, robots) in [
        ("interactive", json!({"horizon_s": 0.3}), 1),
        ("interactive", Value::Null, 0),
        ("physical", json!({"horizon_s": 0.3}), 0),
    ] {
        let scenario = Scenario::from_json(&with(mode, interaction).to_string()).expect("a scenario");
        let team = control::team::Team::new(&scenario).expect("a team");
        assert_eq!(team.interactions().len(), robots, "{mode}");
    }
}

#[test]
fn each_rule_names_its_field() {
    let one = "rectangle-omni4";
    let four = "swap-corners";
    refused(one, "/format", json!("robopheus.experiment/2"), "format");
    refused(one, "/mode", json!("dream"), "mode");
    refused(one, "/arena", json!("moon"), "arena");
    refused(one, "/floor", json!("ice"), "floor");
    for duration_s in [0.0, 0.09, 600.1, -1.0, 1e300] {
        refused(one, "/duration_s", json!(duration_s), "duration_s");
    }
    refused(one, "/seed", json!(-1), "seed");
    refused(one, "/robots", json!([]), "robots");
    refused(one, "/robots/0/name", json!("omni-99"), "robots[0].name");
    refused(one, "/robots/0/name", json!(""), "robots[0].name");
    refused(one, "/robots/0/chassis", json!("tank"), "robots[0].chassis");
    refused(one, "/robots/0/chassis", json!("diff2"), "robots[0].chassis");
    refused(one, "/robots/0/controller", json!("tx2"), "robots[0].controller");
    refused(one, "/robots/0/controller", json!("abacus"), "robots[0].controller");
    refused(one, "/robots/0/start/x_m", json!(1.76), "robots[0].start.x_m");
    refused(one, "/robots/0/start/y_m", json!(-1.26), "robots[0].start.y_m");
    refused(four, "/robots/1/name", json!("omni-01"), "robots[1].name");
    refused(
        four,
        "/robots/1/start",
        json!({"x_m": -0.8, "y_m": -0.8, "yaw_rad": 0.0}),
        "robots[1].start",
    );
    refused(one, "/targets", json!([]), "targets");
    refused(one, "/targets/1/x_m", json!(2.0), "targets[1].x_m");
    refused(one, "/targets/1/y_m", json!(-1.3), "targets[1].y_m");
    refused(four, "/targets/2/robot", json!("nobody"), "targets[2].robot");
    refused(four, "/targets/2", json!({"x_m": 0.0, "y_m": 0.0}), "targets[2].robot");
    refused(four, "/targets/2/robot", json!("omni-01"), "targets[2].robot");
    refused(
        four,
        "/targets/1",
        json!({"robot": "omni-02", "x_m": 1.0, "y_m": 0.7}),
        "targets",
    );
    refused(
        one,
        "/targets",
        json!(vec![json!({"x_m": 0.0, "y_m": 0.0}); 1001]),
        "targets",
    );
    refused(one, "/control/law", json!("push"), "control.law");
    refused(one, "/control/law", json!("magic"), "control.law");
    refused(
        one,
        "/control/parameters",
        json!({"speed": 1.0}),
        "control.parameters.speed",
    );
    refused(
        one,
        "/control/parameters",
        json!({"speed_m_per_s": 3.0}),
        "control.parameters.speed_m_per_s",
    );
    refused(
        one,
        "/control/parameters",
        json!({"speed_m_per_s": "fast"}),
        "control.parameters.speed_m_per_s",
    );
    refused(one, "/control/parameters", json!([]), "control.parameters");
    refused(one, "/model", json!(""), "model");
}

#[test]
fn too_many_robots_are_refused() {
    let mut document = example("rectangle-omni4");
    let robot = document["experiment"]["robots"][0].clone();
    document["experiment"]["robots"] = json!(vec![robot; 51]);
    assert!(fields(&document).contains(&"robots".to_owned()));
}

#[test]
fn the_form_is_checked_with_the_path_of_the_field() {
    let mut unknown = example("rectangle-omni4");
    unknown["experiment"]["robots"][0]["start"]["z_m"] = json!(1.0);
    assert_eq!(fields(&unknown), ["robots[0].start.z_m"]);
    let mut missing = example("rectangle-omni4");
    missing["experiment"]["targets"][2]
        .as_object_mut()
        .expect("target")
        .remove("y_m");
    assert_eq!(fields(&missing), ["targets[2].y_m"]);
    let mut wrong = example("rectangle-omni4");
    wrong["experiment"]["robots"][0]["start"]["y_m"] = json!("left");
    assert_eq!(fields(&wrong), ["robots[0].start.y_m"]);
    let mut lab = example("rectangle-omni4");
    lab["robots"][0]["description"]["wheels"][1]["radius_m"] = json!("big");
    assert_eq!(fields(&lab), ["laboratory.robots[0].description.wheels[1].radius_m"]);
}

#[test]
fn broken_text_is_refused_with_line_and_column() {
    let text = serde_json::to_string_pretty(&example("rectangle-omni4")).expect("text");
    let broken = text.replacen("\"duration_s\": 60", "\"duration_s\": sixty", 1);
    assert_ne!(text, broken);
    let problem = &Scenario::from_json(&broken).expect_err("broken")[0];
    assert_eq!(problem.field, "duration_s");
    assert!(
        problem.message.contains("line") && problem.message.contains("column"),
        "{problem:?}"
    );
    for cut in (0..text.len()).step_by(97) {
        assert_eq!(Scenario::from_json(&text[..cut]).expect_err("cut off").len(), 1);
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_in_scenarios_made_by_programs() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut scenario = common::parsed(&example("rectangle-omni4"));
        scenario.experiment.robots[0].start.x_m = bad;
        scenario.experiment.robots[0].start.yaw_rad = bad;
        scenario.experiment.targets[0].y_m = bad;
        scenario.experiment.duration_s = bad;
        let fields: Vec<String> = scenario.check().into_iter().map(|p| p.field).collect();
        for field in [
            "robots[0].start.x_m",
            "robots[0].start.yaw_rad",
            "targets[0].y_m",
            "duration_s",
        ] {
            assert!(fields.iter().any(|f| f == field), "{field} in {fields:?}");
        }
    }
}

#[test]
fn a_head_on_experiment_that_starts_overlapping_or_aims_into_the_wall_is_refused_by_field() {
    let experiment = json!({"format": "robopheus.experiment/1", "mode": "physical", "arena": "reference", "floor": "lab-floor",
        "robots": [
            {"name": "omni-01", "chassis": "omni4", "controller": "sam3x", "start": {"x_m": -0.2, "y_m": 0.0, "yaw_rad": 0.0}},
            {"name": "omni-02", "chassis": "omni4", "controller": "sam3x", "start": {"x_m": 0.2, "y_m": 0.0, "yaw_rad": 3.0}}],
        "control": {"law": "go_to_point", "parameters": {}},
        "targets": [{"robot": "omni-01", "x_m": 1.9, "y_m": 0.0}, {"robot": "omni-02", "x_m": -1.0, "y_m": 0.0}],
        "duration_s": 20, "seed": 1, "model": null});
    assert_eq!(fields(&scenario_of(experiment)), ["robots[1].start", "targets[0].x_m"]);
}

/// Half a second of commands.
const TOLD_TICKS: u32 = 60;

#[test]
fn feedback_alone_has_no_answers_learns_nothing_and_stands_beside_no_interaction() {
    let mut document = example("path-zigzag");
    document["experiment"]["control"]["feedback_alone"] = json!(true);
    let scenario = Scenario::from_json(&document.to_string()).expect("a scenario");
    let turned = |scenario: &Scenario| {
        let mut team = control::team::Team::new(scenario).expect("a team").learning();
        team.look_ahead_as_described();
        let start = scenario.experiment.robots[0].start;
        let seen = control::team::RobotObservation {
            pose: twin::pose::Pose {
                x_m: start.x_m,
                y_m: start.y_m,
                yaw_rad: start.yaw_rad,
            },
            pose_age_s: 0.05,
            twist: twin::twist::BodyTwist {
                forward_m_per_s: 0.3,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: 0.0,
            },
            online: true,
        };
        // What is ahead of a robot is what it was told, so it must have been told something.
        for _ in 0..TOLD_TICKS {
            team.tick(&vec![seen; scenario.experiment.robots.len()]);
        }
        let [x_m, y_m] = [team.seen()[0].pose.x_m - start.x_m, team.seen()[0].pose.y_m - start.y_m];
        x_m.abs() + y_m.abs()
    };
    assert!(turned(&scenario) == 0.0, "the law sees what was measured");
    let mut usual = scenario.clone();
    usual.experiment.control.feedback_alone = false;
    assert!(turned(&usual) > 1e-6, "the law sees where the robot will be");
    document["experiment"]["mode"] = json!("interactive");
    document["experiment"]["control"]["interaction"] = json!({"horizon_s": 0.3});
    assert_eq!(fields(&document), ["control.feedback_alone"]);
}
