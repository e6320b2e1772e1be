//! A laboratory and an experiment for a drill.

use anyhow::{Context, Result, anyhow};
use api::lab::LabDescription;
use api::robot::LabRobot;
use control::scenario::Scenario;
use serde_json::{Value, json};

/// One robot of a drill and where it starts and goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneRobot {
    pub start: [f64; 3],
    pub goal: [f64; 2],
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Scene {
    pub laboratory: LabDescription,
    experiment: Value,
}

impl Scene {
    /// Robots of one chassis in the reference arena that drive to their goals.
    ///
    /// - `chassis`: `omni4`, `diff2`, `diff4`, `fwd`, `rwd` or `awd`.
    pub fn new(chassis: &str, robots: &[SceneRobot], duration_s: f64) -> Result<Self> {
        Self::mixed(&vec![chassis; robots.len()], robots, duration_s)
    }

    /// As [`Self::new`] with a chassis for each robot.
    pub fn mixed(chassis: &[&str], robots: &[SceneRobot], duration_s: f64) -> Result<Self> {
        let mut laboratory: LabDescription = serde_json::from_str(include_str!("../../examples/lab/reference.json"))?;
        let numbered = chassis.iter().zip(1..=robots.len() as u8);
        laboratory.robots = numbered
            .map(|(chassis, number)| {
                let mut robot = template(chassis)?;
                robot.number = number;
                robot.description.name = format!("{chassis}-{number:02}");
                Ok(robot)
            })
            .collect::<Result<_>>()?;
        let places = robots.iter().zip(&laboratory.robots);
        let starts: Vec<Value> = places
            .map(|(robot, lab_robot)| {
                let [x_m, y_m, yaw_rad] = robot.start;
                json!({
                    "name": lab_robot.description.name, "chassis": lab_robot.description.chassis, "controller": lab_robot.controller,
                    "start": {"x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad},
                })
            })
            .collect();
        let goals = robots.iter().zip(&laboratory.robots);
        let targets: Vec<Value> = goals
            .map(|(robot, lab_robot)| {
                let [x_m, y_m] = robot.goal;
                json!({"robot": lab_robot.description.name, "x_m": x_m, "y_m": y_m})
            })
            .collect();
        let experiment = json!({
            "format": "robopheus.experiment/1", "mode": "physical", "arena": laboratory.arena.name,
            "floor": laboratory.arena.floor, "robots": starts, "control": {"law": "go_to_point", "parameters": {}},
            "targets": targets, "duration_s": duration_s, "seed": 1, "model": null,
        });
        Ok(Self { laboratory, experiment })
    }

    /// An experiment document in a laboratory.
    pub fn of(laboratory: LabDescription, experiment: Value) -> Self {
        Self { laboratory, experiment }
    }

    /// The document.
    pub fn experiment(&self) -> &Value {
        &self.experiment
    }

    /// To change the document before the drill.
    pub fn experiment_mut(&mut self) -> &mut Value {
        &mut self.experiment
    }

    /// Robots of the experiment, in its order.
    pub fn robots(&self) -> Result<Vec<&LabRobot>> {
        let wanted = self.experiment["robots"]
            .as_array()
            .context("the experiment has no robots")?;
        let find = |robot: &Value| {
            let of_name = |lab_robot: &&LabRobot| robot["name"] == lab_robot.description.name.as_str();
            self.laboratory
                .robots
                .iter()
                .find(of_name)
                .with_context(|| format!("no robot {}", robot["name"]))
        };
        wanted.iter().map(find).collect()
    }

    /// As the control library sees it.
    pub fn scenario(&self) -> Result<Scenario> {
        let document = json!({
            "experiment": self.experiment, "robots": self.robots()?, "arena": self.laboratory.arena,
        });
        Scenario::from_json(&document.to_string()).map_err(|problems| anyhow!("{problems:?}"))
    }
}

/// Circle that every chassis of the examples fits into.
const BOUNDING_RADIUS_M: f64 = 0.25;

/// The robot document of a chassis with its usual controller.
fn template(chassis: &str) -> Result<LabRobot> {
    let path = format!("{}/../examples/robots/{chassis}-sam3x.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {path}"))?;
    let document: Value = serde_json::from_str(&text)?;
    let description = serde_json::from_value(document["robot"].clone()).with_context(|| format!("{path}: robot"))?;
    Ok(LabRobot {
        number: 1,
        controller: "sam3x".to_owned(),
        bounding_radius_m: BOUNDING_RADIUS_M,
        description,
    })
}
