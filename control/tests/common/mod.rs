//! Shared by the tests: example scenarios and a seeded generator.
#![allow(dead_code, reason = "each test uses its own part")]

use control::scenario::Scenario;
use serde_json::{Value, json};

const LAB: &str = include_str!("../../../examples/lab/reference.json");
pub const EXPERIMENTS: [(&str, &str); 12] = [
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
    (
        "pose-parking",
        include_str!("../../../examples/experiments/pose-parking.json"),
    ),
    (
        "path-zigzag",
        include_str!("../../../examples/experiments/path-zigzag.json"),
    ),
    (
        "paper-path",
        include_str!("../../../examples/experiments/paper-path.json"),
    ),
    (
        "trajectory-loops",
        include_str!("../../../examples/experiments/trajectory-loops.json"),
    ),
    (
        "consensus-row",
        include_str!("../../../examples/experiments/consensus-row.json"),
    ),
    (
        "leader-column",
        include_str!("../../../examples/experiments/leader-column.json"),
    ),
    (
        "formation-circle",
        include_str!("../../../examples/experiments/formation-circle.json"),
    ),
    (
        "coverage-six",
        include_str!("../../../examples/experiments/coverage-six.json"),
    ),
    (
        "goals-shared",
        include_str!("../../../examples/experiments/goals-shared.json"),
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

/// A robot of `examples/robots` on the sam3x, with a name of its own.
pub fn chassis_robot(chassis: &str, name: &str) -> Value {
    let path = format!("{}/../examples/robots/{chassis}-sam3x.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let document: Value = serde_json::from_str(&text).expect("robot");
    let mut description = document["robot"].clone();
    description["name"] = json!(name);
    json!({"number": 1, "controller": "sam3x", "bounding_radius_m": 0.25, "description": description})
}

/// The six chassis.
pub const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];

/// A scenario with robots `r0`, `r1`, ... given as chassis and start `[x_m, y_m, yaw_rad]`.
pub fn team(
    law: &str,
    parameters: Value,
    robots: &[(&str, [f64; 3])],
    targets: Value,
    duration_s: f64,
    [width_m, height_m]: [f64; 2],
) -> Value {
    let mut listed = Vec::new();
    let mut lab = Vec::new();
    for (i, (chassis, [x_m, y_m, yaw_rad])) in robots.iter().enumerate() {
        let name = format!("r{i}");
        listed.push(json!({"name": name, "chassis": chassis, "controller": "sam3x",
            "start": {"x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad}}));
        lab.push(chassis_robot(chassis, &name));
    }
    json!({
        "experiment": {"format": "robopheus.experiment/1", "mode": "virtual", "arena": "room", "floor": "lab-floor", "robots": listed,
            "control": {"law": law, "parameters": parameters}, "targets": targets, "duration_s": duration_s, "seed": 1, "model": null},
        "robots": lab, "arena": {"name": "room", "width_m": width_m, "height_m": height_m, "floor": "lab-floor"}
    })
}

/// Robots that do at once what the law asks: single integrators that may move in every direction, without filter.
pub struct Ideal {
    law: Box<dyn control::law::Law>,
    arena_m: [f64; 2],
    parameters: control::law::Parameters,
    pub bodies: Vec<control::law::Body>,
    targets: Vec<Vec<control::law::Goal>>,
    pub robots: Vec<control::law::RobotObservation>,
    pub demands: Vec<control::law::Demand>,
    pub tick: u64,
}

impl Ideal {
    pub fn new(document: &Value) -> Ideal {
        let scenario = parsed(document);
        let robots = control::team::robots(&scenario).expect("robots");
        let seen = |r: &control::scenario::ExperimentRobot| control::law::RobotObservation {
            pose: twin::pose::Pose {
                x_m: r.start.x_m,
                y_m: r.start.y_m,
                yaw_rad: r.start.yaw_rad,
            },
            pose_age_s: 0.0,
            twist: Default::default(),
            online: true,
        };
        Ideal {
            law: control::law::build(&scenario).expect("law"),
            arena_m: [scenario.arena.width_m, scenario.arena.height_m],
            parameters: control::law::Parameters::of(&scenario.experiment.control),
            bodies: control::law::bodies(&scenario, &robots),
            targets: control::law::goals(&scenario),
            robots: scenario.experiment.robots.iter().map(seen).collect(),
            demands: vec![Default::default(); robots.len()],
            tick: 0,
        }
    }

    pub fn place(&self, i: usize) -> [f64; 2] {
        [self.robots[i].pose.x_m, self.robots[i].pose.y_m]
    }

    pub fn step(&mut self) {
        self.demands.fill(Default::default());
        let observation = control::law::Observation {
            arena_m: self.arena_m,
            tick: self.tick,
            robots: &self.robots,
            bodies: &self.bodies,
            targets: &self.targets,
            parameters: &self.parameters,
        };
        self.law.step(&observation, &mut self.demands);
        for (robot, demand) in self.robots.iter_mut().zip(&self.demands) {
            let (s, c) = (libm::sin(robot.pose.yaw_rad), libm::cos(robot.pose.yaw_rad));
            let twist = demand.twist;
            robot.pose.x_m += (c * twist.forward_m_per_s - s * twist.left_m_per_s) * control::TICK_S;
            robot.pose.y_m += (s * twist.forward_m_per_s + c * twist.left_m_per_s) * control::TICK_S;
            robot.pose.yaw_rad += twist.yaw_rate_rad_per_s * control::TICK_S;
            robot.twist = twist;
        }
        self.tick += 1;
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
