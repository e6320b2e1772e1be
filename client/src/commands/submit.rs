//! `robopheus submit`

use super::{validate, watch};
use crate::output::{Output, Unsuccessful};
use crate::program::experiment;
use crate::settings::Settings;
use api::experiment::{DigestClaim, SubmitRequest};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Experiment document (robopheus.experiment/1)
    experiment: PathBuf,
    /// Own controller that takes the place of the experiment's law: a script, a WebAssembly module or a policy (.onnx)
    #[arg(long)]
    program: Option<PathBuf>,
    /// Text shown in lists [default: the file's name]
    #[arg(long)]
    label: Option<String>,
    /// Repeating a call with the same key never makes a second run [default: a new key]
    #[arg(long)]
    idempotency_key: Option<String>,
    /// Follow the run until it ends
    #[arg(long)]
    watch: bool,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let experiment = experiment(&arguments.experiment, arguments.program.as_deref())?;
    let laboratory = validate::laboratory_from_service(settings, &experiment).await?;
    let rehearsed = validate::rehearse(&arguments.experiment, experiment, &laboratory, None)?;
    if !rehearsed.verdict.accepted {
        let text = validate::verdict_text(&rehearsed.verdict);
        return Err(Unsuccessful(format!("not sent, the twin rejects it: {text}")).into());
    }
    let stem = arguments
        .experiment
        .file_stem()
        .map(|name| name.to_string_lossy().into_owned());
    let request = SubmitRequest {
        experiment: rehearsed.experiment,
        claim: Some(DigestClaim {
            digest: rehearsed.verdict.digest,
            twin_version: rehearsed.verdict.twin_version,
            engine: "client".into(),
        }),
        label: arguments.label.or(stem),
    };
    let key = arguments
        .idempotency_key
        .unwrap_or_else(|| uuid::Uuid::now_v7().to_string());
    let client = settings.client()?;
    let submission = client.experiment_submit(&request, &key).await?;
    if arguments.watch {
        let run = watch::follow(&client, submission.view.run_id, output).await?;
        return watch::conclude(&run, output);
    }
    output.result(&submission.view, || {
        format!(
            "run {} is on its way; follow it with `robopheus watch {0}`",
            submission.view.run_id
        )
    })
}
