//! What is to be run: experiment, the robots it names, and the arena. Same JSON documents as on the wire.

mod check;
mod json;
mod room;
mod targets;

pub use room::free_place;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use twin::model_document::ModelDocument;
use twin::robot::RobotDescription;
use twin::world::{Arena, Contents};

/// Format string of an experiment document.
pub const FORMAT: &str = "robopheus.experiment/1";
/// Largest accepted scenario text.
pub const MAX_TEXT_BYTES: usize = 4 * 1024 * 1024;
pub const MAX_ROBOTS: usize = 50;
pub const MAX_TARGETS: usize = 1000;
pub const MIN_DURATION_S: f64 = 0.1;
pub const MAX_DURATION_S: f64 = 600.0;
/// Smallest gap between two robots' bounding circles at the start.
pub const MIN_START_GAP_M: f64 = 0.01;

/// One field that cannot be accepted: what, why, what is allowed, what to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldProblem {
    /// Path of the field in the experiment, for example `robots[1].start.x_m`; robots of the laboratory and the
    /// arena stand under `laboratory.` and `arena.`.
    pub field: String,
    pub message: String,
    /// Allowed range or values, in words with units.
    pub limit: String,
    pub remedy: String,
}

/// An experiment together with everything needed to simulate or run it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    pub experiment: Experiment,
    /// The laboratory's robots that the experiment names, in the order of `experiment.robots`.
    pub robots: Vec<ScenarioRobot>,
    pub arena: ScenarioArena,
    /// Model versions that the twin simulates robots with, by robot; a robot without one is nominal. The laws and the
    /// safety filter always work with the laboratory's descriptions, as they do on the floor.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub models: BTreeMap<String, ModelDocument>,
}

/// `robopheus.experiment/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    pub format: String,
    pub mode: Mode,
    pub arena: String,
    pub floor: String,
    pub robots: Vec<ExperimentRobot>,
    pub control: Control,
    pub targets: Vec<Target>,
    pub duration_s: f64,
    pub seed: u64,
    pub model: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    Physical,
    Virtual,
    Interactive,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRobot {
    pub name: String,
    pub chassis: String,
    pub controller: String,
    pub start: Start,
}

/// Start pose in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Control {
    pub law: String,
    pub parameters: serde_json::Value,
    /// Correction of the commands by the robots' models, in the mode `interactive`; off when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interaction: Option<InteractionSetting>,
    /// Feedback alone: the law sees robots where they were measured, without delay compensation, and nothing is learnt of them.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub feedback_alone: bool,
}

/// How far ahead of the robots their models look; [`crate::interaction`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InteractionSetting {
    /// Within [`crate::interaction::HORIZONS_S`].
    pub horizon_s: f64,
}

/// A waypoint or a goal; `robot` may be left out when there is only one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    pub x_m: f64,
    pub y_m: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_rad: Option<f64>,
}

/// A robot of the laboratory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioRobot {
    /// Address on the robot link.
    pub number: u8,
    pub controller: String,
    /// Radius of the bounding circle around the body origin.
    pub bounding_radius_m: f64,
    pub description: RobotDescription,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioArena {
    pub name: String,
    pub width_m: f64,
    pub height_m: f64,
    pub floor: String,
    /// Obstacles, floor regions and tilt.
    #[serde(default, skip_serializing_if = "Contents::is_empty")]
    pub contents: Contents,
}

impl ScenarioArena {
    /// Its walls, as the twin has them.
    pub fn walls(&self) -> Arena {
        Arena {
            width_m: self.width_m,
            height_m: self.height_m,
        }
    }
}

impl Scenario {
    /// Reads and checks a scenario; every problem names its field.
    pub fn from_json(text: &str) -> Result<Scenario, Vec<FieldProblem>> {
        let scenario = Scenario::parse(text)?;
        let problems = scenario.check();
        if problems.is_empty() {
            Ok(scenario)
        } else {
            Err(problems)
        }
    }

    /// Reads a scenario without checking its rules; only its form is known to be right.
    pub fn parse(text: &str) -> Result<Scenario, Vec<FieldProblem>> {
        json::parse(text).map_err(|problem| vec![problem])
    }

    /// All rules of an experiment; empty when it may be simulated.
    pub fn check(&self) -> Vec<FieldProblem> {
        check::check(self)
    }

    /// Settings of the interaction where it is on: named in the experiment, whose mode is `interactive`.
    pub fn interaction(&self) -> Option<crate::interaction::Settings> {
        let asked = self.experiment.control.interaction;
        asked
            .filter(|_| self.experiment.mode == Mode::Interactive)
            .map(|asked| crate::interaction::Settings {
                horizon_s: asked.horizon_s,
                ..crate::interaction::Settings::default()
            })
    }

    /// Targets of the robot at `index`, in order.
    pub fn targets_of(&self, index: usize) -> impl Iterator<Item = &Target> {
        let name = self.experiment.robots.get(index).map(|robot| robot.name.as_str());
        let alone = self.experiment.robots.len() == 1;
        self.experiment
            .targets
            .iter()
            .filter(move |target| match &target.robot {
                Some(robot) => Some(robot.as_str()) == name,
                None => alone,
            })
    }
}
