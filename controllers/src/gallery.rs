//! Examples: programs to start from, and what each does in the twin, for the comparison of builds.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use crate::experiment::rehearse_json;
use crate::source::Source;
use crate::variety;

/// One program of the gallery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Example {
    pub name: &'static str,
    /// In one sentence.
    pub title: &'static str,
    pub script: &'static str,
}

/// Scripts, in the order in which they are shown.
pub const SCRIPTS: [Example; 6] = [
    Example {
        name: "go_to_point",
        title: "Go to point: every robot drives to its first target",
        script: include_str!("../gallery/go_to_point.rhai"),
    },
    Example {
        name: "consensus",
        title: "Consensus: the robots agree on a row",
        script: include_str!("../gallery/consensus.rhai"),
    },
    Example {
        name: "leader_follower",
        title: "Leader and followers: a column on a circle",
        script: include_str!("../gallery/leader_follower.rhai"),
    },
    Example {
        name: "formation",
        title: "Formation: a circle around the team's middle",
        script: include_str!("../gallery/formation.rhai"),
    },
    Example {
        name: "coverage",
        title: "Coverage: robots spread over the arena",
        script: include_str!("../gallery/coverage.rhai"),
    },
    Example {
        name: "obstacle_avoidance",
        title: "Obstacle avoidance with range sensors",
        script: include_str!("../gallery/obstacle_avoidance.rhai"),
    },
];

/// A network of six weights that goes to a point, with its manifest; `examples/policies/go_to_point.py` makes the like.
pub const POLICY: &[u8] = include_bytes!("../gallery/go_to_point.onnx");

/// `go_to_point.wat`, assembled.
pub const MODULE: &[u8] = include_bytes!("../gallery/go_to_point.wasm");

/// Scenario of three robots, one that moves in all directions, one that turns on the spot and one that is steered, driven by a
/// program of one's own.
pub fn scenario_json(source: &Source, duration_s: f64) -> String {
    let all = control::gallery::digest_scenarios();
    let text = all
        .into_iter()
        .find(|(name, _)| name == "three-kinds")
        .map(|(_, text)| text);
    let mut scenario: Value = text
        .and_then(|text| serde_json::from_str(&text).ok())
        .unwrap_or_default();
    let program = match source {
        Source::Script(text) | Source::Module(text) | Source::Policy(text) => text,
    };
    let name = |robot: usize| scenario["experiment"]["robots"][robot]["name"].clone();
    let targets: Vec<Value> = [[0.6, 0.9], [-1.2, -0.7], [1.3, -0.6]]
        .iter()
        .enumerate()
        .map(|(robot, [x_m, y_m])| json!({"robot": name(robot), "x_m": x_m, "y_m": y_m}))
        .collect();
    scenario["experiment"]["targets"] = json!(targets);
    scenario["experiment"]["duration_s"] = json!(duration_s);
    scenario["experiment"]["control"] = json!({"law": control::law::OWN, "parameters": {source.key(): program}});
    scenario.to_string()
}

/// The varied programs by name.
pub fn varied() -> impl Iterator<Item = (String, Source)> {
    let script = |number| (format!("script {number:03}"), Source::Script(variety::script(number)));
    let module = |number| (format!("module {number:03}"), Source::module(&variety::module(number)));
    (0..variety::COUNT).map(script).chain((0..variety::COUNT).map(module))
}

/// Trace digests of the gallery's programs, of the varied ones and of programs that run into their limits, by name; empty where there is none.
pub fn digests() -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    let sources = SCRIPTS
        .iter()
        .map(|example| {
            (
                format!("script {}", example.name),
                Source::Script(example.script.into()),
            )
        })
        .chain([("module go_to_point".to_owned(), Source::module(MODULE))])
        .chain([("policy go_to_point".to_owned(), Source::policy(POLICY))]);
    for (name, source) in sources {
        let outcome = rehearse_json(&scenario_json(&source, 8.0));
        all.insert(name, outcome.map_or(String::new(), |outcome| outcome.verdict.digest));
    }
    for (name, source) in varied() {
        let outcome = rehearse_json(&scenario_json(&source, variety::DURATION_S));
        all.insert(name, outcome.map_or(String::new(), |outcome| outcome.verdict.digest));
    }
    for (name, script) in BOUNDS {
        let outcome = rehearse_json(&scenario_json(&Source::Script(script.into()), 2.0));
        // Where it was stopped is as much part of the result as how far the robots came.
        let told = outcome.map_or(String::new(), |outcome| {
            format!("{} {}", outcome.verdict.digest, outcome.verdict.sentence)
        });
        all.insert(format!("bound {name}"), told);
    }
    all
}

/// Scripts whose use grows from tick to tick until a limit stops them.
const BOUNDS: [(&str, &str); 3] = [
    (
        "operations",
        "fn step(now) { for r in 0..3 { twist(r, 0.2, 0, 0.1); } let n = 0; while n < 70 * now.tick { n += 1; } }",
    ),
    (
        "depth",
        "fn deep(n) { if n > 0 { deep(n - 1) + 1 } else { 0 } } fn step(now) { for r in 0..3 { twist(r, 0.2, 0, 0.1); } deep(now.tick); }",
    ),
    (
        "array",
        "fn start(now) { this.all = []; } fn step(now) { for r in 0..3 { twist(r, 0.2, 0, 0.1); } for k in 0..100 { this.all.push(sin(k)); } }",
    ),
];
