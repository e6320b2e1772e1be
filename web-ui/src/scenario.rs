//! The text that the twin computes from: experiment, robots of the laboratory, arena.

use crate::state::Lab;
use api::arena::Arena;
use api::experiment::Experiment;
use api::problem::FieldProblem;
use api::robot::LabRobot;
use serde::Serialize;

#[derive(Serialize)]
struct Scenario<'a> {
    experiment: &'a Experiment,
    /// In the order of `experiment.robots`.
    robots: Vec<&'a LabRobot>,
    arena: &'a Arena,
}

/// `{"experiment", "robots", "arena"}` as the twin reads it, or the names the laboratory does not know.
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
        })
        .expect("a scenario has string keys")),
        _ => Err(problems),
    }
}
