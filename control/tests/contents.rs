//! Obstacles, regions and tilt of an arena in a scenario.

mod common;

use common::example;
use control::rehearsal::Rehearsal;
use control::safety::Geofence;
use control::scenario::Scenario;
use control::team::Team;
use serde_json::{Value, json};

fn with(contents: Value) -> Value {
    let mut document = example("rectangle-omni4");
    document["arena"]["contents"] = contents;
    document
}

fn fields(document: &Value) -> Vec<String> {
    let problems = Scenario::from_json(&document.to_string()).err().unwrap_or_default();
    problems.into_iter().map(|problem| problem.field).collect()
}

fn circle(radius_m: f64, x_m: f64, y_m: f64) -> Value {
    json!({"name": "pillar", "shape": {"circle": {"radius_m": radius_m}}, "pose": {"x_m": x_m, "y_m": y_m, "yaw_rad": 0.0}})
}

#[test]
fn contents_are_read_checked_and_written_back() {
    let document = with(json!({"tilt_x_rad": 0.3}));
    assert_eq!(fields(&document), ["arena.contents.tilt_x_rad"]);
    assert_eq!(
        fields(&with(json!({"fixed": [circle(-0.1, 0.0, 0.0)]}))),
        ["arena.contents.fixed[0].shape.circle.radius_m"]
    );
    assert_eq!(fields(&with(json!({"walls": []}))), ["arena.contents.walls"]);
    let plain = Scenario::from_json(&example("rectangle-omni4").to_string()).expect("example");
    let text = serde_json::to_string(&plain).expect("JSON");
    assert!(!text.contains("contents"), "an empty arena is written as before");
    let empty = Scenario::from_json(&with(json!({})).to_string()).expect("empty contents");
    assert_eq!(empty, plain);
}

#[test]
fn starts_and_targets_in_obstacles_are_refused() {
    let document = example("rectangle-omni4");
    let start = &document["experiment"]["robots"][0]["start"];
    let target = &document["experiment"]["targets"][1];
    let at = |place: &Value| [place["x_m"].as_f64().expect("x"), place["y_m"].as_f64().expect("y")];
    let [x_m, y_m] = at(target);
    let found = fields(&with(json!({"fixed": [circle(0.1, x_m + 0.2, y_m)]})));
    assert!(found.contains(&"targets[1]".to_owned()), "{found:?}");
    let [x_m, y_m] = at(start);
    for kind in ["fixed", "pushable"] {
        let mut obstacle = circle(0.1, x_m, y_m + 0.2);
        if kind == "pushable" {
            obstacle["mass_kg"] = json!(1.0);
            obstacle["floor_friction"] = json!(0.3);
        }
        let found = fields(&with(json!({kind: [obstacle]})));
        assert!(found.contains(&"robots[0].start".to_owned()), "{kind}: {found:?}");
    }
}

/// An obstacle half way along the longest side of the rectangle: nothing in the law goes round it.
fn in_the_way(kind: &str) -> Scenario {
    let document = example("rectangle-omni4");
    let targets = document["experiment"]["targets"].as_array().expect("targets");
    let at = |place: &Value| [place["x_m"].as_f64().expect("x"), place["y_m"].as_f64().expect("y")];
    let corners: Vec<[f64; 2]> = targets.iter().map(at).collect();
    let (from, to) = corners
        .windows(2)
        .map(|pair| (pair[0], pair[1]))
        .max_by(|a, b| {
            let length = |(p, q): &([f64; 2], [f64; 2])| (p[0] - q[0]).abs() + (p[1] - q[1]).abs();
            length(a).total_cmp(&length(b))
        })
        .expect("a path");
    let (x_m, y_m) = (0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1]));
    let mut obstacle = circle(0.05, x_m, y_m);
    if kind == "pushable" {
        obstacle["mass_kg"] = json!(0.5);
        obstacle["floor_friction"] = json!(0.3);
    }
    let scenario = with(json!({kind: [obstacle]}));
    Scenario::from_json(&scenario.to_string()).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

/// The filter knows what stands in the arena: the robot waits in front of it and says that it did not arrive.
#[test]
fn robots_stop_in_front_of_obstacles() {
    for kind in ["fixed", "pushable"] {
        let mut rehearsal = Rehearsal::new(&in_the_way(kind)).expect("set up");
        while rehearsal.step() {}
        assert_eq!(rehearsal.frame().robots[0].safety, Some("wall"), "{kind}");
        let verdict = rehearsal.finish().verdict;
        let codes: Vec<&str> = verdict.findings.iter().map(|finding| finding.code.as_str()).collect();
        assert_eq!(codes, ["target_not_reached"], "{kind}");
        assert!(verdict.accepted);
    }
}

/// A team that was not told of the obstacles drives into them.
#[test]
fn a_rehearsal_reports_what_the_robots_touch() {
    for (kind, code, accepted) in [
        ("fixed", "robot_hits_obstacle", false),
        ("pushable", "robot_pushes_obstacle", true),
    ] {
        let scenario = in_the_way(kind);
        let mut unaware = scenario.clone();
        unaware.arena.contents = Default::default();
        let team = Team::new(&unaware).expect("team");
        let mut rehearsal = Rehearsal::with_team(&scenario, team).expect("set up");
        while rehearsal.step() {}
        let verdict = rehearsal.finish().verdict;
        let count = verdict.findings.iter().filter(|finding| finding.code == code).count();
        assert_eq!((count, verdict.accepted), (1, accepted), "{:#?}", verdict.findings);
    }
}

#[test]
fn a_geofence_is_checked_and_holds_robots_starts_and_targets() {
    let fence = |corners: Value| with(json!({"geofence": corners}));
    assert_eq!(fields(&fence(json!([[0, 0], [1, 0]]))), ["arena.contents.geofence"]);
    let crossed = json!([[-1.9, -1.4], [1.9, 1.4], [1.9, -1.4], [-1.9, 1.4]]);
    assert_eq!(fields(&fence(crossed)), ["arena.contents.geofence[0]"]);
    // Wide enough for all places of the example, and then not.
    let wide = fence(json!([[-1.95, -1.45], [1.95, -1.45], [1.95, 1.45], [-1.95, 1.45]]));
    assert_eq!(fields(&wide), [""; 0]);
    let narrow = fields(&fence(json!([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])));
    assert!(
        narrow.contains(&"robots[0].start".to_owned()) && narrow.contains(&"targets[0]".to_owned()),
        "{narrow:?}"
    );
}

/// Four corners of the floor cut off: the way between two targets leads through what is forbidden.
#[test]
fn robots_stay_inside_a_geofence() {
    let mut document =
        with(json!({"geofence": [[-1.9, -1.4], [1.9, -1.4], [1.9, 0.0], [0.1, 0.0], [0.1, 1.4], [-1.9, 1.4]]}));
    document["experiment"]["control"] = json!({"law": "go_to_pose", "parameters": {}});
    document["experiment"]["robots"][0]["start"] = json!({"x_m": -0.6, "y_m": 1.0, "yaw_rad": 0.0});
    document["experiment"]["targets"] = json!([{"x_m": 1.4, "y_m": -0.6, "yaw_rad": 0.0}]);
    document["experiment"]["duration_s"] = json!(40.0);
    let scenario = Scenario::from_json(&document.to_string()).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let fence = Geofence::of(&scenario.arena.contents)
        .expect("a polygon")
        .expect("a fence");
    let radius_m = scenario.robots[0].bounding_radius_m;
    let mut rehearsal = Rehearsal::new(&scenario).expect("a rehearsal");
    while rehearsal.step() {}
    let outcome = rehearsal.finish();
    let poses = &outcome.replay.robots[0].poses;
    let least_m = poses
        .iter()
        .map(|pose| fence.depth_m([pose[0], pose[1]]))
        .fold(f64::INFINITY, f64::min);
    assert!(least_m > radius_m, "{least_m} m of {radius_m} m");
    let last = poses.last().expect("a pose");
    assert!(
        (last[0] - 1.4).abs() < 0.02 && (last[1] + 0.6).abs() < 0.02,
        "it gets there all the same: {last:?}"
    );
}
