//! `robopheus validate`

use crate::output::{Output, Unsuccessful};
use crate::program::experiment;
use crate::settings::Settings;
use anyhow::{Context, bail};
use api::arena::Arena;
use api::diagnosis::NOMINAL;
use api::experiment::Experiment;
use api::lab::LabDescription;
use api::model::ModelView;
use api::robot::LabRobot;
use api::verdict::{Replay, Verdict};
use control::rehearsal::{Outcome, Rehearsal};
use control::scenario::{FieldProblem, Scenario};
use sandbox::pipe::PipeProgram;
use sandbox::start::REHEARSAL_PATIENCE;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Experiment document (robopheus.experiment/1)
    experiment: PathBuf,
    /// Laboratory description; asked of the service when absent
    #[arg(long)]
    lab: Option<PathBuf>,
    /// Program that takes the place of the experiment's law: it is asked over its standard input and output
    /// (docs/controllers.md), and started by the shell
    #[arg(long, conflicts_with = "program")]
    controller: Option<String>,
    /// Own controller that takes the place of the experiment's law: a script, a WebAssembly module or a policy (.onnx)
    #[arg(long)]
    program: Option<PathBuf>,
    /// Write the twin's replay here
    #[arg(long)]
    replay: Option<PathBuf>,
}

/// What the twin on this machine says.
pub struct Rehearsed {
    pub experiment: Experiment,
    pub verdict: Verdict,
    pub replay: Replay,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let experiment = experiment(&arguments.experiment, arguments.program.as_deref())?;
    let laboratory = match &arguments.lab {
        Some(path) => laboratory_from_file(path)?,
        None => laboratory_from_service(settings, &experiment).await?,
    };
    let rehearsed = rehearse(
        &arguments.experiment,
        experiment,
        &laboratory,
        arguments.controller.as_deref(),
    )?;
    if let Some(path) = &arguments.replay {
        std::fs::write(path, serde_json::to_vec(&rehearsed.replay)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    output.result(&rehearsed.verdict, || verdict_text(&rehearsed.verdict))?;
    match rehearsed.verdict.accepted {
        true => Ok(()),
        false => Err(Unsuccessful("the twin rejects this experiment".into()).into()),
    }
}

/// What an experiment is rehearsed with.
pub struct Laboratory {
    pub robots: Vec<LabRobot>,
    pub arena: Arena,
    /// Models that robots use now.
    pub models: Vec<ModelView>,
}

/// Runs an experiment in the twin, as the service will.
///
/// - `path`: of its document, for messages.
pub fn rehearse(
    path: &Path,
    experiment: Experiment,
    laboratory: &Laboratory,
    controller: Option<&str>,
) -> anyhow::Result<Rehearsed> {
    let scenario = serde_json::json!({
        "experiment": experiment,
        "robots": robots_of(&experiment, &laboratory.robots),
        "arena": laboratory.arena,
        "models": models_of(&experiment, &laboratory.models),
    });
    let outcome = match rehearsed(&scenario.to_string(), controller) {
        Ok(outcome) => outcome,
        Err(problems) => {
            let lines: Vec<_> = problems
                .iter()
                .map(|p| format!("  {}: {}; allowed: {}; {}", p.field, p.message, p.limit, p.remedy))
                .collect();
            bail!("{} breaks {} rules:\n{}", path.display(), lines.len(), lines.join("\n"));
        }
    };
    let verdict = serde_json::from_value(serde_json::to_value(&outcome.verdict)?)?;
    let replay = serde_json::from_value(serde_json::to_value(&outcome.replay)?)?;
    Ok(Rehearsed {
        experiment,
        verdict,
        replay,
    })
}

/// The twin by the experiment's law, or by a program behind a pipe. What an experiment brings along runs in this process: it is
/// the user's own.
fn rehearsed(scenario_json: &str, controller: Option<&str>) -> Result<Outcome, Vec<FieldProblem>> {
    let Some(controller) = controller else {
        return controllers::experiment::rehearse_json(scenario_json);
    };
    let scenario = Scenario::from_json(scenario_json)?;
    let setup = controllers::experiment::setup(&scenario)?;
    let mut command = std::process::Command::new("sh");
    command.args(["-c", controller]);
    let program = PipeProgram::start(command, None, &setup, REHEARSAL_PATIENCE).map_err(|fault| {
        vec![FieldProblem {
            field: "--controller".into(),
            message: fault.to_string(),
            limit: "a program that answers line for line".into(),
            remedy: "look at what it writes to its standard error".into(),
        }]
    })?;
    let team = controllers::experiment::team_of(&scenario, Box::new(program))?;
    let mut rehearsal = Rehearsal::with_team(&scenario, team)?;
    while rehearsal.step() {}
    Ok(rehearsal.finish())
}

/// The experiment's robots in its order; names the laboratory does not know are left for the checks to report.
fn robots_of(experiment: &Experiment, robots: &[LabRobot]) -> Vec<LabRobot> {
    let wanted = experiment.robots.iter();
    wanted
        .filter_map(|r| robots.iter().find(|known| known.description.name == r.name))
        .cloned()
        .collect()
}

/// The models that are current on the experiment's floor, by robot; none when it asks for the nominal twin.
fn models_of<'a>(experiment: &Experiment, models: &'a [ModelView]) -> BTreeMap<&'a str, &'a serde_json::Value> {
    let wanted = |model: &&ModelView| {
        let takes_part = experiment.robots.iter().any(|robot| robot.name == model.robot);
        takes_part && model.floor == experiment.floor && experiment.model.as_deref() != Some(NOMINAL)
    };
    models
        .iter()
        .filter(wanted)
        .map(|model| (model.robot.as_str(), &model.document))
        .collect()
}

fn laboratory_from_file(path: &Path) -> anyhow::Result<Laboratory> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let lab: LabDescription = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
    Ok(Laboratory {
        robots: lab.robots,
        arena: lab.arena,
        models: Vec::new(),
    })
}

/// Robots and arena as the service has them, for the arena that the experiment names.
pub async fn laboratory_from_service(settings: &Settings, experiment: &Experiment) -> anyhow::Result<Laboratory> {
    let client = settings.client()?;
    let arenas = client.arena_list().await?;
    let known: Vec<_> = arenas.iter().map(|view| view.arena.name.clone()).collect();
    let Some(view) = arenas.into_iter().find(|view| view.arena.name == experiment.arena) else {
        bail!(
            "arena: {:?} is unknown; the service has: {}",
            experiment.arena,
            known.join(", ")
        );
    };
    let robots = client.robot_list().await?;
    let here = robots
        .into_iter()
        .filter(|robot| robot.arena == experiment.arena)
        .map(|view| view.robot);
    let mut models = client.models_current().await?;
    if let Some(named) = experiment.model.as_deref().filter(|model| *model != NOMINAL) {
        let mut all = client.model_list(None, None).await?.into_iter();
        // One that does not exist is refused by the service, which lists those that do.
        if let Some(model) = all.find(|model| model.version == named || model.id.to_string() == named) {
            models.retain(|other| other.robot != model.robot);
            models.push(model);
        }
    }
    Ok(Laboratory {
        robots: here.collect(),
        arena: view.arena,
        models,
    })
}

pub fn verdict_text(verdict: &Verdict) -> String {
    let mut text = verdict.sentence.clone();
    for finding in &verdict.findings {
        text.push_str(&format!(
            "\n  {:7} at {:.2} s  {}",
            finding.severity, finding.at_s, finding.message
        ));
    }
    text.push_str(&format!(
        "\n  {} ticks, digest {} ({}); closest to a wall {:.3} m",
        verdict.ticks, verdict.digest, verdict.twin_version, verdict.smallest_wall_distance_m
    ));
    if let Some(separation_m) = verdict.smallest_separation_m {
        text.push_str(&format!(", between robots {separation_m:.3} m"));
    }
    text
}
