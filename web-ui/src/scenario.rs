//! The text that the twin computes from: experiment, robots of the laboratory, arena.

use crate::state::Lab;
use api::arena::Arena;
use api::experiment::Experiment;
use api::model::ModelView;
use api::problem::FieldProblem;
use api::robot::LabRobot;
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Serialize)]
struct Scenario<'a> {
    experiment: &'a Experiment,
    /// In the order of `experiment.robots`.
    robots: Vec<&'a LabRobot>,
    arena: &'a Arena,
    /// Documents of the robots that are not nominal.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    models: BTreeMap<&'a str, &'a serde_json::Value>,
}

/// The models that the service will rehearse with, too: those in use on the experiment's floor.
pub fn models_of<'a>(experiment: &Experiment, lab: &'a Lab) -> BTreeMap<&'a str, &'a ModelView> {
    let takes_part = |model: &&ModelView| experiment.robots.iter().any(|robot| robot.name == model.robot);
    lab.models
        .iter()
        .flatten()
        .filter(|model| model.floor == experiment.floor && experiment.model.is_none())
        .filter(takes_part)
        .map(|model| (model.robot.as_str(), model))
        .collect()
}

/// `{"experiment", "robots", "arena", "models"}` as the twin reads it, or the names the laboratory does not know.
pub fn scenario_json(experiment: &Experiment, lab: &Lab) -> Result<String, Vec<FieldProblem>> {
    let mut problems = Vec::new();
    let mut robots = Vec::new();
    for (index, robot) in experiment.robots.iter().enumerate() {
        match lab.robot(&robot.name) {
            Some(known) => robots.push(known),
            None => problems.push(FieldProblem {
                field: format!("robots[{index}].name"),
                message: format!("the laboratory has no robot named {}", robot.name),
                limit: "a robot of the Robots page".to_owned(),
                remedy: "choose another template or wait until the robot is back".to_owned(),
            }),
        }
    }
    let arena = lab.arena(&experiment.arena);
    if arena.is_none() {
        problems.push(FieldProblem {
            field: "arena".to_owned(),
            message: format!("no arena is named {}", experiment.arena),
            limit: "an arena of the laboratory".to_owned(),
            remedy: "choose another template".to_owned(),
        });
    }
    match (arena, problems.is_empty()) {
        (Some(arena), true) => Ok(serde_json::to_string(&Scenario {
            experiment,
            robots,
            arena,
            models: models_of(experiment, lab)
                .into_iter()
                .map(|(robot, model)| (robot, &model.document))
                .collect(),
        })
        .expect("a scenario has string keys")),
        _ => Err(problems),
    }
}
