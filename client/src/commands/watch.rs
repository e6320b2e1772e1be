//! `robopheus watch`

use crate::output::{Output, Unsuccessful};
use crate::settings::Settings;
use api::run::{RunState, RunView};
use client::{Client, ClientError};
use std::time::Duration;

/// Time between two looks at the run.
const POLL: Duration = Duration::from_millis(500);
/// Looks in a row without an answer before giving up: one minute.
const SILENT_LOOKS: u32 = 120;

#[derive(clap::Args)]
pub struct Arguments {
    /// Run identifier, as `robopheus runs` prints it
    run: uuid::Uuid,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let run = follow(&settings.client()?, arguments.run, output).await?;
    conclude(&run, output)
}

/// Waits until a run has ended, showing where it is; survives a service that restarts meanwhile.
pub async fn follow(client: &Client, id: uuid::Uuid, output: &Output) -> anyhow::Result<RunView> {
    let bar = output.bar(100, "{spinner} {msg} {wide_bar} {elapsed}");
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut silent = 0;
    loop {
        match client.run_get(id).await {
            Ok(run) => {
                silent = 0;
                bar.set_message(status(&run));
                bar.set_position(percent(&run));
                if run.state.is_terminal() {
                    bar.finish_and_clear();
                    return Ok(run);
                }
            }
            Err(error @ (ClientError::Unreachable { .. } | ClientError::Unexpected { .. })) => {
                silent += 1;
                if silent >= SILENT_LOOKS {
                    return Err(error.into());
                }
                bar.set_message("the service does not answer, trying again");
            }
            Err(error) => return Err(error.into()),
        }
        tokio::time::sleep(POLL).await;
    }
}

/// Prints how a run ended; anything but `done` ends the program with status 1.
pub fn conclude(run: &RunView, output: &Output) -> anyhow::Result<()> {
    output.result(run, || status(run))?;
    match run.state {
        RunState::Done => Ok(()),
        state => Err(Unsuccessful(format!("run {} ended {}", run.id, state.as_str())).into()),
    }
}

fn status(run: &RunView) -> String {
    let state = run.state.as_str();
    if let Some(fault) = &run.fault {
        return format!(
            "{state}: {} (fault of the {:?}, {})",
            fault.message, fault.whose, fault.code
        )
        .to_lowercase();
    }
    match (&run.waiting_reason, run.queue_position, &run.verdict) {
        (Some(why), Some(position), _) => format!("{state}, number {position} in the queue: {why}"),
        (Some(why), None, _) => format!("{state}: {why}"),
        (None, _, Some(verdict)) if run.state == RunState::Rejected => format!("{state}: {}", verdict.sentence),
        _ => state.to_owned(),
    }
}

fn percent(run: &RunView) -> u64 {
    match run.state {
        RunState::Draft | RunState::Validating => 5,
        RunState::Queued => 10,
        RunState::Preparing => 15,
        RunState::Running => {
            let ran_s = run.started_at.map_or(0.0, |start| {
                let now = std::time::SystemTime::now()
                    .duration_since(std::time::UNIX_EPOCH)
                    .unwrap_or_default();
                now.as_secs_f64() - start.timestamp_millis() as f64 / 1e3
            });
            15 + (80.0 * (ran_s / run.experiment.duration_s).clamp(0.0, 1.0)) as u64
        }
        RunState::Uploading => 97,
        _ => 100,
    }
}
