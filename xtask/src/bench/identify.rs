//! How long a diagnosis of ten minutes of logs takes.

use anyhow::Result;
use clap::Args;

use crate::{End, run};

#[derive(Args, Default)]
pub struct IdentifyArguments {
    /// Chassis, effect, size and seed of the logs; omni4 payload 3 1 when left out
    #[arg(trailing_var_arg = true)]
    logs: Vec<String>,
}

/// `cargo xtask bench identify`.
pub fn bench(arguments: &IdentifyArguments) -> Result<End> {
    let mut command = run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--release",
        "--package",
        "identify",
        "--example",
        "ten_minutes",
        "--",
    ]);
    command.args(&arguments.logs);
    Ok(if command.status()?.success() {
        End::Good
    } else {
        End::Failed
    })
}
