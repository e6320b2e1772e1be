//! The latency budget of the laboratory.

use std::time::Duration;

use anyhow::{Result, bail};
use clap::Args;

use crate::setup::{Needs, set_up};
use crate::{End, paths, run, test};

/// Longest measurement: a long video and one run.
const LIMIT: Duration = Duration::from_secs(1800);

#[derive(Args)]
pub struct LabArguments {
    /// Pictures of the rendered video; 100000 is the full search for false identities
    #[arg(long, default_value_t = 3000)]
    frames: u64,
}

impl Default for LabArguments {
    fn default() -> Self {
        Self { frames: 3000 }
    }
}

/// `cargo xtask bench lab`.
pub fn bench(arguments: &LabArguments) -> Result<End> {
    let needs = Needs {
        wasm: false,
        postgres: true,
        browser: false,
        python: false,
    };
    if set_up(needs)?.is_none() {
        return Ok(End::Missing);
    }
    test::build()?;
    let mut command = run::command(paths::program_folder()?.join("robopheus-lab-bench"));
    command.arg(arguments.frames.to_string());
    test::export_own_program(&mut command)?;
    match run::within(&mut command, LIMIT)? {
        Some(status) if status.success() => Ok(End::Good),
        Some(_) => Ok(End::Failed),
        None => bail!("the measurement took longer than {} min", LIMIT.as_secs() / 60),
    }
}
