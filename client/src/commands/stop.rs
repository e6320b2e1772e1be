//! `robopheus stop`: the protective stop, from anywhere.
//!
//! The laboratory's own stop port and the service are tried side by side: each works without the other. The stop port
//! stops the robots within milliseconds and keeps them stopped; through the service, the runs that have robots are cancelled.

use crate::output::{Output, Unsuccessful};
use crate::settings::Settings;
use anyhow::Context;
use api::run::RunState;
use serde::Serialize;
use std::time::Duration;

/// An emergency waits for nobody.
const TIME_LIMIT: Duration = Duration::from_secs(3);

#[derive(clap::Args)]
pub struct Arguments {
    /// Stop port of the laboratory
    #[arg(long, env = "ROBOPHEUS_STOP", default_value = "http://127.0.0.1:8081")]
    lab: String,
}

#[derive(Serialize)]
struct Outcome {
    /// The laboratory's stop is pressed; `null` when its port did not answer.
    stopped: Option<bool>,
    /// Runs that the service was asked to stop; `null` when it did not answer.
    cancelled: Option<Vec<uuid::Uuid>>,
    problems: Vec<String>,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let press = tokio::time::timeout(TIME_LIMIT, press(&arguments.lab));
    let cancel = tokio::time::timeout(TIME_LIMIT, cancel(settings));
    let (pressed, cancelled) = tokio::join!(press, cancel);
    let pressed = pressed.unwrap_or_else(|_| Err(anyhow::anyhow!("no answer within {TIME_LIMIT:?}")));
    let cancelled = cancelled.unwrap_or_else(|_| Err(anyhow::anyhow!("no answer within {TIME_LIMIT:?}")));
    let mut problems = Vec::new();
    if let Err(error) = &pressed {
        problems.push(format!("stop port {}: {error:#}", arguments.lab));
    }
    if let Err(error) = &cancelled {
        problems.push(format!("service {}: {error:#}", settings.server));
    }
    let outcome = Outcome {
        stopped: pressed.ok(),
        cancelled: cancelled.ok(),
        problems,
    };
    output.result(&outcome, || words(&outcome))?;
    if outcome.stopped != Some(true) {
        let text = "the laboratory did not confirm the stop: use the hardware stop".to_owned();
        return Err(Unsuccessful(text).into());
    }
    Ok(())
}

fn words(outcome: &Outcome) -> String {
    let mut lines = Vec::new();
    if outcome.stopped == Some(true) {
        lines.push("stopped: robots stay still until the stop is cleared at the laboratory".to_owned());
    }
    if let Some(runs) = outcome.cancelled.as_deref().filter(|runs| !runs.is_empty()) {
        lines.push(format!("{} runs were asked to stop", runs.len()));
    }
    lines.extend(outcome.problems.iter().cloned());
    lines.join("\n")
}

async fn press(lab: &str) -> anyhow::Result<bool> {
    let http = reqwest::Client::builder().timeout(TIME_LIMIT).build()?;
    let url = format!("{}/stop", lab.trim_end_matches('/'));
    let reply = http.post(url).send().await?;
    let status = reply.status();
    let text = reply.text().await?;
    anyhow::ensure!(status.is_success(), "HTTP {status}: {text}");
    let state: serde_json::Value = serde_json::from_str(&text)?;
    state["stopped"].as_bool().context("the answer does not say `stopped`")
}

async fn cancel(settings: &Settings) -> anyhow::Result<Vec<uuid::Uuid>> {
    let client = settings.client()?;
    let runs = client.run_list().await?;
    let moving = |state| matches!(state, RunState::Preparing | RunState::Running);
    let mut asked = Vec::new();
    let mut refused = None;
    // One run that may not be cancelled keeps no other from it.
    for run in runs.into_iter().filter(|run| moving(run.state)) {
        match client.run_cancel(run.id).await {
            Ok(_) => asked.push(run.id),
            Err(error) => refused = Some(error),
        }
    }
    match refused {
        Some(error) if asked.is_empty() => Err(error.into()),
        _ => Ok(asked),
    }
}
