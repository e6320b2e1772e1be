//! Shared by the tests: example scenarios and a seeded generator.
#![allow(dead_code, reason = "each test uses its own part")]

use control::scenario::Scenario;
use serde_json::{Value, json};

const LAB: &str = include_str!("../../../examples/lab/reference.json");
pub const EXPERIMENTS: [(&str, &str); 3] = [
    (
        "rectangle-omni4",
        include_str!("../../../examples/experiments/rectangle-omni4.json"),
    ),
    (
        "rectangle-diff2",
        include_str!("../../../examples/experiments/rectangle-diff2.json"),
    ),
    (
        "swap-corners",
        include_str!("../../../examples/experiments/swap-corners.json"),
    ),
];

/// Scenario of an experiment in the reference laboratory.
pub fn scenario_of(experiment: Value) -> Value {
    let lab: Value = serde_json::from_str(LAB).expect("laboratory");
    let all = lab["robots"].as_array().expect("robots");
    let named = |robot: &Value| {
        all.iter()
            .find(|known| known["description"]["name"] == robot["name"])
            .cloned()
    };
    let robots: Vec<Value> = experiment["robots"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(named)
        .collect();
    json!({ "experiment": experiment, "robots": robots, "arena": lab["arena"] })
}

/// A shipped example as a scenario document.
pub fn example(name: &str) -> Value {
    let (_, text) = EXPERIMENTS.iter().find(|(known, _)| *known == name).expect("example");
    scenario_of(serde_json::from_str(text).expect("experiment"))
}

pub fn parsed(document: &Value) -> Scenario {
    Scenario::from_json(&document.to_string()).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

/// A lab robot with a name of its own, made from one of the reference robots.
pub fn lab_robot(like: &str, name: &str) -> Value {
    let lab: Value = serde_json::from_str(LAB).expect("laboratory");
    let mut robot = lab["robots"]
        .as_array()
        .expect("robots")
        .iter()
        .find(|r| r["description"]["name"] == like)
        .expect("robot")
        .clone();
    robot["description"]["name"] = json!(name);
    robot
}

/// PCG-XSH-RR 64/32: seeds are constants, so every failure can be repeated.
pub struct Pcg(pub u64);

impl Pcg {
    pub fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (((old >> 18) ^ old) >> 27)
            .wrapping_as_u32()
            .rotate_right((old >> 59) as u32)
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.next()) / 4_294_967_296.0
    }
}

trait Low {
    fn wrapping_as_u32(self) -> u32;
}

impl Low for u64 {
    fn wrapping_as_u32(self) -> u32 {
        (self & 0xffff_ffff) as u32
    }
}
