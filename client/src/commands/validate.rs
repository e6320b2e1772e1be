//! `robopheus validate`

use crate::output::{Output, Unsuccessful};
use crate::settings::Settings;
use anyhow::{Context, bail};
use api::arena::Arena;
use api::experiment::Experiment;
use api::lab::LabDescription;
use api::robot::LabRobot;
use api::verdict::{Replay, Verdict};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Experiment document (robopheus.experiment/1)
    experiment: PathBuf,
    /// Laboratory description; asked of the service when absent
    #[arg(long)]
    lab: Option<PathBuf>,
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
    let (robots, arena) = match &arguments.lab {
        Some(path) => laboratory_from_file(path)?,
        None => laboratory_from_service(settings, &arguments.experiment).await?,
    };
    let rehearsed = rehearse(&arguments.experiment, &robots, &arena)?;
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

/// Runs an experiment document in the twin.
///
/// - `robots`: all robots of the laboratory.
pub fn rehearse(path: &Path, robots: &[LabRobot], arena: &Arena) -> anyhow::Result<Rehearsed> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let experiment: Experiment = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
    let scenario = serde_json::json!({
        "experiment": experiment,
        "robots": robots_of(&experiment, robots),
        "arena": arena,
    });
    let outcome = match control::rehearsal::rehearse_json(&scenario.to_string()) {
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

/// The experiment's robots in its order; names the laboratory does not know are left for the checks to report.
fn robots_of(experiment: &Experiment, robots: &[LabRobot]) -> Vec<LabRobot> {
    let wanted = experiment.robots.iter();
    wanted
        .filter_map(|r| robots.iter().find(|known| known.description.name == r.name))
        .cloned()
        .collect()
}

fn laboratory_from_file(path: &Path) -> anyhow::Result<(Vec<LabRobot>, Arena)> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let lab: LabDescription = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
    Ok((lab.robots, lab.arena))
}

/// Robots and arena as the service has them, for the arena that the document names.
pub async fn laboratory_from_service(settings: &Settings, document: &Path) -> anyhow::Result<(Vec<LabRobot>, Arena)> {
    let text = std::fs::read_to_string(document).with_context(|| format!("cannot read {}", document.display()))?;
    let experiment: Experiment = serde_json::from_str(&text).with_context(|| format!("{}", document.display()))?;
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
    Ok((here.collect(), view.arena))
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
