//! `cargo xtask demo`: what the product does, shown on the emulated laboratory.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};

use crate::setup::{Needs, set_up};
use crate::{End, paths, run, test};

/// Longest demonstration: nine diagnoses on a busy machine.
const LIMIT: Duration = Duration::from_secs(3600);

#[derive(Args)]
pub struct DemoArguments {
    #[command(subcommand)]
    subject: Subject,
}

#[derive(Subcommand)]
enum Subject {
    /// Hide effects in the emulated robots, let the service find, name and add them; a table (docs/how-to/find-an-effect.md)
    Gap(GapArguments),
    /// The paper's experiments A, A+, B and C on hidden floors of the emulated plant, in virtual time; a table (docs/interaction.md)
    Abc(AbcArguments),
}

#[derive(Args)]
struct AbcArguments {
    /// Only these chassis
    #[arg(long, value_name = "NAME")]
    chassis: Vec<String>,
    /// Hidden floors of each
    #[arg(long, default_value_t = 3)]
    floors: u64,
    /// Rounds on the paper's path
    #[arg(long, default_value_t = 2)]
    rounds: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Writes everything here as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Args)]
struct GapArguments {
    /// Only these effects (names as in the table)
    #[arg(long, value_name = "NAME")]
    effect: Vec<String>,
    /// Take the programs as they are
    #[arg(long, hide = true)]
    skip_build: bool,
}

/// `cargo xtask demo`.
pub fn demo(arguments: &DemoArguments) -> Result<End> {
    match &arguments.subject {
        Subject::Gap(arguments) => gap(arguments),
        Subject::Abc(arguments) => abc(arguments),
    }
}

fn gap(arguments: &GapArguments) -> Result<End> {
    let needs = Needs {
        wasm: false,
        postgres: true,
        browser: false,
        python: false,
    };
    if set_up(needs)?.is_none() {
        return Ok(End::Missing);
    }
    if !arguments.skip_build {
        test::build()?;
    }
    let mut command = run::command(paths::program_folder()?.join("robopheus-gap-demo"));
    command.args(&arguments.effect);
    test::export_own_program(&mut command)?;
    match run::within(&mut command, LIMIT)? {
        Some(status) if status.success() => Ok(End::Good),
        Some(_) => Ok(End::Failed),
        None => bail!("the demonstration took longer than {} min", LIMIT.as_secs() / 60),
    }
}

fn abc(arguments: &AbcArguments) -> Result<End> {
    let mut command = run::cargo(["run", "--quiet", "--locked", "--bin", "robopheus-drills", "--", "abc"]);
    for chassis in &arguments.chassis {
        command.args(["--chassis", chassis]);
    }
    let numbers = [
        ("--floors", arguments.floors),
        ("--rounds", arguments.rounds),
        ("--seed", arguments.seed),
    ];
    for (name, number) in numbers {
        command.arg(name).arg(number.to_string());
    }
    if let Some(path) = &arguments.json {
        command.arg("--json").arg(path);
    }
    Ok(if command.status()?.success() {
        End::Good
    } else {
        End::Failed
    })
}
