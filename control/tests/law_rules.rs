//! What the laws refuse: wrong counts, targets of the wrong robot, things a chassis cannot drive, bad parameters.

mod common;

use common::{chassis_robot, example, team};
use control::law::LAWS;
use control::rehearsal::Rehearsal;
use control::scenario::{FieldProblem, Scenario};
use proptest::prelude::*;
use serde_json::{Value, json};

const ROOM: [f64; 2] = [8.0, 6.0];

fn problems(document: &Value) -> Vec<FieldProblem> {
    let found = Scenario::from_json(&document.to_string()).err().unwrap_or_default();
    for problem in &found {
        let texts = [&problem.field, &problem.message, &problem.limit, &problem.remedy];
        assert!(texts.iter().all(|text| !text.is_empty()), "{problem:?}");
    }
    found
}

fn fields(law: &str, parameters: Value, chassis: &str, n: usize, targets: Value) -> Vec<String> {
    let robots: Vec<(&str, [f64; 3])> = (0..n).map(|i| (chassis, [-2.0 + i as f64, 0.0, 0.0])).collect();
    let document = team(law, parameters, &robots, targets, 30.0, ROOM);
    problems(&document).into_iter().map(|problem| problem.field).collect()
}

fn at(robot: usize, x_m: f64, y_m: f64) -> Value {
    json!({"robot": format!("r{robot}"), "x_m": x_m, "y_m": y_m})
}

#[test]
fn wrong_counts_are_refused_by_field() {
    let none = || json!([]);
    let cases = [
        (
            fields(
                "formation",
                json!({"shape": 3}),
                "omni4",
                3,
                json!([at(0, 0.0, 0.0), at(1, 1.0, 0.0)]),
            ),
            "targets",
        ),
        (
            fields("formation", json!({"shape": 1}), "omni4", 3, json!([at(0, 0.0, 0.0)])),
            "targets",
        ),
        (
            fields("formation", json!({"spacing_m": 0.3}), "omni4", 3, none()),
            "control.parameters.spacing_m",
        ),
        (
            fields("formation", json!({"spacing_m": 3.0}), "omni4", 4, none()),
            "control.parameters.spacing_m",
        ),
        (fields("formation", json!({}), "omni4", 1, none()), "robots"),
        (fields("consensus", json!({}), "omni4", 1, none()), "robots"),
        (
            fields("consensus", json!({"leader": 4}), "omni4", 3, none()),
            "control.parameters.leader",
        ),
        (
            fields("consensus", json!({"leader": 1.5}), "omni4", 3, none()),
            "control.parameters.leader",
        ),
        (
            fields("consensus", json!({"leader": 2}), "omni4", 3, json!([at(0, 0.0, 0.0)])),
            "targets[0].robot",
        ),
        (
            fields("leader_follower", json!({}), "omni4", 1, json!([at(0, 0.0, 0.0)])),
            "robots",
        ),
        (
            fields("leader_follower", json!({}), "omni4", 2, json!([at(1, 0.0, 0.0)])),
            "targets[0].robot",
        ),
        (fields("leader_follower", json!({}), "omni4", 2, none()), "targets"),
        (
            fields(
                "leader_follower",
                json!({"distance_m": 0.4}),
                "omni4",
                2,
                json!([at(0, 0.0, 1.0)]),
            ),
            "control.parameters.distance_m",
        ),
        (
            fields(
                "goal_assignment",
                json!({}),
                "omni4",
                2,
                json!([{"x_m": 0.0, "y_m": 0.0}]),
            ),
            "targets",
        ),
        (
            fields("goal_assignment", json!({}), "omni4", 1, json!([at(0, 0.0, 0.0)])),
            "targets[0].robot",
        ),
        (
            fields(
                "goal_assignment",
                json!({}),
                "omni4",
                2,
                json!([{"x_m": 0.0, "y_m": 0.0}, {"x_m": 0.3, "y_m": 0.0}]),
            ),
            "targets[1]",
        ),
        (
            fields("coverage", json!({}), "omni4", 1, json!([at(0, 0.0, 0.0)])),
            "targets[0].robot",
        ),
        (
            fields("go_to_pose", json!({}), "omni4", 1, json!([at(0, 0.0, 0.0)])),
            "targets[0].yaw_rad",
        ),
        (
            fields(
                "path_following",
                json!({}),
                "omni4",
                1,
                json!([{"x_m": 0.0, "y_m": 0.0, "yaw_rad": 1.0}]),
            ),
            "targets[0].yaw_rad",
        ),
        (
            fields(
                "trajectory_tracking",
                json!({"interval_s": 1.0}),
                "omni4",
                1,
                json!([at(0, 3.0, 0.0)]),
            ),
            "control.parameters.interval_s",
        ),
        (
            fields("consensus", json!({"graph": 0.5}), "omni4", 2, none()),
            "control.parameters.graph",
        ),
        (
            fields("consensus", json!({"graph": "ring"}), "omni4", 2, none()),
            "control.parameters.graph",
        ),
        (
            fields("consensus", json!({"graph": 3}), "omni4", 2, none()),
            "control.parameters.graph",
        ),
    ];
    for (k, (found, field)) in cases.iter().enumerate() {
        assert!(
            !found.is_empty() && found.iter().all(|named| named == field),
            "case {k}: {found:?}"
        );
    }
}

#[test]
fn what_a_car_like_robot_cannot_drive_is_refused_and_others_may() {
    let sharp = json!([at(0, 0.0, 0.0), at(0, -0.4, 0.6)]);
    let back = json!([at(0, 0.0, 0.0), at(0, -1.0, 0.1)]);
    let behind = json!([at(0, -3.0, 0.0)]);
    let hook = json!([at(0, -1.0, 0.0), at(0, -1.1, 0.5), at(0, -1.9, 0.4)]);
    for (law, targets, field) in [
        ("path_following", &sharp, "targets"),
        ("path_following", &behind, "robots[0].start.yaw_rad"),
        ("trajectory_tracking", &hook, "targets"),
        ("trajectory_tracking", &behind, "robots[0].start.yaw_rad"),
    ] {
        let found = fields(law, json!({}), "rwd", 1, targets.clone());
        assert!(found.contains(&field.to_owned()), "{law} {targets}: {found:?}");
        assert_eq!(
            fields(law, json!({}), "diff2", 1, targets.clone()),
            [""; 0],
            "{law} {targets}"
        );
    }
    // It changes gear there.
    assert_eq!(fields("path_following", json!({}), "rwd", 1, back), [""; 0]);
}

/// Nothing holds a robot on two omni wheels across their axis, so no law may have it.
#[test]
fn the_two_wheel_mode_is_refused_with_its_reason() {
    let mut document = team(
        "go_to_point",
        json!({}),
        &[("omni4", [0.0, 0.0, 0.0])],
        json!([at(0, 1.0, 0.0)]),
        30.0,
        ROOM,
    );
    assert!(problems(&document).is_empty());
    document["robots"][0] = chassis_robot("omni4-two-wheel", "r0");
    let found = problems(&document);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].field, "robots[0].chassis");
    assert!(
        found[0].message.contains("slides") && found[0].remedy.contains("four wheels"),
        "{found:?}"
    );
}

/// A value for a parameter: in and out of ranges, choices, other types.
fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        (-100.0..100.0_f64).prop_map(|number| json!(number)),
        (-3..60_i64).prop_map(|number| json!(number)),
        Just(json!(0)),
        Just(json!(1e308)),
        Just(json!(-0.0)),
        Just(json!("fast")),
        Just(json!(null)),
        Just(json!([1, 2])),
        Just(json!(true)),
    ]
}

fn key() -> impl Strategy<Value = String> {
    let keys: Vec<String> = LAWS
        .iter()
        .flat_map(|law| law.parameters.iter().map(|parameter| parameter.key.to_owned()))
        .chain(["speed".to_owned(), String::new()])
        .collect();
    prop::sample::select(keys)
}

fn target(robots: usize) -> impl Strategy<Value = Value> {
    let owner = prop_oneof![Just(None), (0..robots + 1).prop_map(|robot| Some(format!("r{robot}")))];
    (owner, -4.0..4.0_f64, -3.0..3.0_f64, prop::option::of(-10.0..10.0_f64)).prop_map(|(owner, x_m, y_m, yaw_rad)| {
        let mut target = json!({"x_m": x_m, "y_m": y_m});
        if let Some(owner) = owner {
            target["robot"] = json!(owner);
        }
        if let Some(yaw_rad) = yaw_rad {
            target["yaw_rad"] = json!(yaw_rad);
        }
        target
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any parameters and targets: refused with field, limit and remedy, or rehearsed for a second. Never a panic.
    #[test]
    fn bad_parameters_and_targets_never_panic(
        law in 0..LAWS.len(),
        parameters in prop::collection::btree_map(key(), value(), 0..4),
        chassis in prop::sample::select(common::CHASSIS.to_vec()),
        robots in 1..4_usize,
        targets in prop::collection::vec(target(3), 0..5),
    ) {
        let starts: Vec<(&str, [f64; 3])> = (0..robots).map(|i| (chassis, [-2.0 + i as f64, 0.0, 0.3])).collect();
        let document = team(LAWS[law].name, json!(parameters), &starts, json!(targets), 1.0, ROOM);
        if problems(&document).is_empty() {
            let scenario = Scenario::from_json(&document.to_string()).expect("checked");
            let mut rehearsal = Rehearsal::new(&scenario).expect("a checked scenario runs");
            while rehearsal.step() {}
            let verdict = rehearsal.finish().verdict;
            prop_assert!(verdict.accepted, "{:#?}", verdict.findings);
        }
    }

    /// A single parameter out of range names itself, its range and what to do.
    #[test]
    fn a_parameter_out_of_range_names_itself(law in 0..LAWS.len(), which in 0..16_usize, above in any::<bool>(), by in 0.01..50.0_f64) {
        let spec = &LAWS[law];
        let parameter = &spec.parameters[which % spec.parameters.len()];
        let bad = if above { parameter.max + by } else { parameter.min - by };
        let document = team(spec.name, json!({parameter.key: bad}), &[("omni4", [0.0, 0.0, 0.0])], json!([]), 1.0, ROOM);
        let field = format!("control.parameters.{}", parameter.key);
        let found = problems(&document);
        let problem = found.iter().find(|problem| problem.field == field);
        prop_assert!(problem.is_some_and(|problem| problem.limit == parameter.limit()), "{found:?}");
    }
}

/// Robots that are not seen, or whose numbers are not finite, stop; the others go on and nothing panics.
#[test]
fn laws_are_total_on_broken_observations() {
    for (name, _) in common::EXPERIMENTS {
        let scenario = common::parsed(&example(name));
        let mut team = control::team::Team::new(&scenario).expect("team");
        let n = scenario.experiment.robots.len();
        let seen = |i: usize, broken: bool| {
            let start = scenario.experiment.robots[i].start;
            control::law::RobotObservation {
                pose: twin::pose::Pose {
                    x_m: if broken { f64::NAN } else { start.x_m },
                    y_m: start.y_m,
                    yaw_rad: start.yaw_rad,
                },
                pose_age_s: if broken { f64::NAN } else { 0.0 },
                twist: twin::twist::BodyTwist {
                    forward_m_per_s: if broken { f64::INFINITY } else { 0.0 },
                    ..Default::default()
                },
                online: !broken,
            }
        };
        for tick in 0..240 {
            let broken = |i: usize| tick > 60 && (i + tick / 60).is_multiple_of(2);
            let robots: Vec<_> = (0..n).map(|i| seen(i, broken(i))).collect();
            for (i, out) in team.tick(&robots).iter().enumerate() {
                let command = out.safe.wheel_command();
                assert!(command.non_finite_field().is_none(), "{name} {i}");
                assert!(!broken(i) || out.safe.twist() == Default::default(), "{name} {i}");
                assert!(out.target[0].is_finite() && out.target[1].is_finite(), "{name} {i}");
            }
        }
    }
}
