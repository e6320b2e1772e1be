//! `robopheus diagnoses`: diagnoses in the service.

use crate::output::{Output, Unsuccessful};
use crate::settings::Settings;
use api::diagnosis::{DiagnosisRequest, DiagnosisState, DiagnosisView, NOMINAL};
use api::model::RobotModel;
use clap::Subcommand;
use client::Client;
use std::path::PathBuf;
use std::time::Duration;
use uuid::Uuid;

/// Time between two looks at a diagnosis that is followed.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Ask why runs and twin disagree
    Start(Start),
    /// List diagnoses, newest first
    List(List),
    /// Show one diagnosis; with --out, download its report
    Show(Show),
    /// Stop a diagnosis that waits or runs
    Cancel(One),
    /// Make the model that came out the robot's current one
    Accept(One),
    /// Give a robot an earlier model back, or the nominal twin
    Revert(Revert),
    /// Submit the experiment that the report proposes
    Next(One),
}

#[derive(clap::Args)]
struct Start {
    /// Robot whose records are compared
    #[arg(long)]
    robot: String,
    /// Runs with nothing changed; they calibrate the model and the noise floor
    #[arg(long, num_args = 1..)]
    reference: Vec<Uuid>,
    /// Runs whose disagreement with the twin is to be explained; at least two
    #[arg(long, num_args = 1.., required = true)]
    runs: Vec<Uuid>,
    /// Runs that are opened once, for the before and after figures; without them some of --runs are held back
    #[arg(long, num_args = 1..)]
    locked: Vec<Uuid>,
    /// Version of the model to start from, or `nominal`; the robot's current model when absent
    #[arg(long)]
    model: Option<String>,
    /// Follow it until it ends
    #[arg(long)]
    watch: bool,
}

#[derive(clap::Args)]
struct List {
    /// Only of this robot
    #[arg(long)]
    robot: Option<String>,
}

#[derive(clap::Args)]
struct One {
    /// Id of the diagnosis
    diagnosis: Uuid,
}

#[derive(clap::Args)]
struct Show {
    /// Id of the diagnosis
    diagnosis: Uuid,
    /// Folder for report.json and report.html; must not exist
    #[arg(long)]
    out: Option<PathBuf>,
}

#[derive(clap::Args)]
struct Revert {
    /// Name of the robot
    robot: String,
    /// Version to go back to; the nominal twin when absent
    #[arg(long, default_value = NOMINAL)]
    to: String,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let client = settings.client()?;
    match arguments.verb {
        Verb::Start(start) => begin(start, &client, output).await,
        Verb::List(list) => {
            let diagnoses = client.diagnosis_list(list.robot.as_deref()).await?;
            output.result(&diagnoses, || table(&diagnoses))
        }
        Verb::Show(show) => tell(show, &client, output).await,
        Verb::Cancel(one) => told(&client.diagnosis_post(one.diagnosis, "cancel").await?, output),
        Verb::Accept(one) => told(&client.diagnosis_post(one.diagnosis, "accept").await?, output),
        Verb::Next(one) => told(&client.diagnosis_post(one.diagnosis, "next-experiment").await?, output),
        Verb::Revert(revert) => {
            let now = client.robot_model_set(&revert.robot, &revert.to).await?;
            output.result(&now, || model_line(&now))
        }
    }
}

async fn begin(start: Start, client: &Client, output: &Output) -> anyhow::Result<()> {
    let request = DiagnosisRequest {
        robot: start.robot,
        reference_runs: start.reference,
        changed_runs: start.runs,
        locked_runs: start.locked,
        model: start.model,
    };
    let key = Uuid::now_v7().to_string();
    let mut view = client.diagnosis_submit(&request, &key).await?;
    if start.watch {
        let bar = output.bar(1000, "{bar:30} {msg}");
        while !view.state.is_terminal() {
            bar.set_position((1000.0 * view.progress) as u64);
            bar.set_message(view.stage.clone());
            tokio::time::sleep(LOOK_PERIOD).await;
            view = client.diagnosis_get(view.id).await?;
        }
        bar.finish_and_clear();
    }
    told(&view, output)?;
    failed(&view)
}

async fn tell(show: Show, client: &Client, output: &Output) -> anyhow::Result<()> {
    let view = client.diagnosis_get(show.diagnosis).await?;
    if let Some(out) = show.out {
        anyhow::ensure!(!out.exists(), "{} exists; name a new folder", out.display());
        let json = client.diagnosis_file(view.id, "report.json").await?;
        let html = client.diagnosis_file(view.id, "report.html").await?;
        std::fs::create_dir_all(&out)?;
        std::fs::write(out.join("report.json"), json)?;
        std::fs::write(out.join("report.html"), html)?;
    }
    told(&view, output)
}

fn told(view: &DiagnosisView, output: &Output) -> anyhow::Result<()> {
    output.result(view, || words(view))
}

/// Status 1 for a diagnosis that ended without a result.
fn failed(view: &DiagnosisView) -> anyhow::Result<()> {
    match (&view.problem, view.state) {
        (Some(problem), DiagnosisState::Failed | DiagnosisState::Cancelled) => {
            Err(anyhow::Error::new(Unsuccessful(problem.message.clone())))
        }
        _ => Ok(()),
    }
}

fn table(diagnoses: &[DiagnosisView]) -> String {
    if diagnoses.is_empty() {
        return "no diagnoses yet; ask for one with `robopheus diagnoses start --robot NAME --runs RUN RUN`".to_owned();
    }
    let mut text = format!("{:36}  {:9}  {:10}  {}", "DIAGNOSIS", "STATE", "ROBOT", "RESULT");
    for view in diagnoses {
        let result = view
            .sentence
            .as_deref()
            .or(view.problem.as_ref().map(|problem| problem.message.as_str()));
        text.push_str(&format!(
            "\n{}  {:9}  {:10}  {}",
            view.id,
            view.state.as_str(),
            view.robot,
            result.unwrap_or(&view.stage)
        ));
    }
    text
}

fn words(view: &DiagnosisView) -> String {
    let mut lines = vec![format!("{}  {} of {}", view.id, view.state.as_str(), view.robot)];
    match view.state {
        DiagnosisState::Running => lines.push(format!("{:.0} %, {}", 100.0 * view.progress, view.stage)),
        DiagnosisState::Queued => lines.push("waits for a worker".to_owned()),
        _ => {}
    }
    lines.extend(view.sentence.clone());
    lines.extend(view.problem.as_ref().map(|problem| problem.message.clone()));
    if let Some(model) = &view.model {
        let current = if view.model_is_current { ", in use" } else { "" };
        lines.push(format!("model {model}{current}"));
    }
    lines.extend(view.next_why.as_ref().map(|why| format!("next experiment: {why}")));
    lines.extend(view.next_run.map(|run| format!("proposed run {run}")));
    lines.extend(view.follow_up.map(|next| format!("followed by {next}")));
    lines.join("\n")
}

fn model_line(now: &RobotModel) -> String {
    let version = now.version.as_deref().unwrap_or("the nominal twin");
    format!("{} uses {version} on {}", now.robot, now.floor)
}
