//! `robopheus`: the service from the command line.
//!
//! Results go to standard output (with `--json` as one JSON document), progress and errors to standard error.
//! Exit status: 0 done, 1 refused or failed, 2 wrong usage, 3 service out of reach, 4 damaged data.

mod commands;
mod import;
mod output;
mod program;
mod settings;

use clap::{Parser, Subcommand};
use output::Output;

#[derive(Parser)]
#[command(
    name = "robopheus",
    version,
    about = "Experiments with mobile robots, from your own machine"
)]
struct Arguments {
    /// Address of the service [default: what `login` stored, else http://127.0.0.1:8080]
    #[arg(long, global = true, env = "ROBOPHEUS_SERVER")]
    server: Option<String>,
    /// API token; a local service needs none
    #[arg(long, global = true, env = "ROBOPHEUS_TOKEN", hide_env_values = true)]
    token: Option<String>,
    /// Print one JSON document and no progress
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Remember a service and its token for this user
    Login(commands::login::Arguments),
    /// Check an experiment in the twin on this machine, without sending it
    Validate(commands::validate::Arguments),
    /// Send an experiment; checks it here first and sends the trace digest along
    Submit(commands::submit::Arguments),
    /// Follow a run until it ends
    Watch(commands::watch::Arguments),
    /// List runs, newest first
    Runs(commands::runs::Arguments),
    /// Ask a run to stop
    Cancel(commands::cancel::Arguments),
    /// Press the laboratory's protective stop
    Stop(commands::stop::Arguments),
    /// Download and check a run's archive
    Fetch(commands::fetch::Arguments),
    /// Turn another laboratory's table (CSV, Parquet) into run bundles
    Import(commands::import::Arguments),
    /// Replay the commands of a run bundle through the twin and write a bundle
    Simulate(commands::simulate::Arguments),
    /// Find where runs and twin disagree, name the missing effect, and write a report and a new model version
    Diagnose(commands::diagnose::Arguments),
    /// Diagnoses in the service: start, list, show, cancel, accept, revert, next
    Diagnoses(commands::diagnoses::Arguments),
    /// Model versions in the service: list, fetch, compare, use
    Models(commands::models::Arguments),
}

fn main() {
    let arguments = Arguments::parse();
    client::install_tls();
    let output = Output::new(arguments.json);
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => output.fail(&error.into()),
    };
    if let Err(error) = runtime.block_on(run(arguments, &output)) {
        output.fail(&error);
    }
}

async fn run(arguments: Arguments, output: &Output) -> anyhow::Result<()> {
    let settings = settings::Settings::resolve(arguments.server, arguments.token)?;
    match arguments.command {
        Command::Login(a) => commands::login::run(a, &settings, output).await,
        Command::Validate(a) => commands::validate::run(a, &settings, output).await,
        Command::Submit(a) => commands::submit::run(a, &settings, output).await,
        Command::Watch(a) => commands::watch::run(a, &settings, output).await,
        Command::Runs(a) => commands::runs::run(a, &settings, output).await,
        Command::Cancel(a) => commands::cancel::run(a, &settings, output).await,
        Command::Stop(a) => commands::stop::run(a, &settings, output).await,
        Command::Fetch(a) => commands::fetch::run(a, &settings, output).await,
        Command::Import(a) => commands::import::run(&a, output),
        Command::Simulate(a) => commands::simulate::run(&a, output),
        Command::Diagnose(a) => commands::diagnose::run(&a, output),
        Command::Diagnoses(a) => commands::diagnoses::run(a, &settings, output).await,
        Command::Models(a) => commands::models::run(a, &settings, output).await,
    }
}
