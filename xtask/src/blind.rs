//! The blind identification bench (`docs/blind.md`).

use anyhow::Result;
use clap::Args;

use crate::{End, run};

#[derive(Args)]
pub struct BlindArguments {
    /// Options of the bench: --quick, --shard I/N, --seed S, --kind K, --chassis C, --effect E, --resume DIR, ...
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<String>,
}

/// `cargo xtask blind`.
pub fn blind(arguments: &BlindArguments) -> Result<End> {
    let mut bench = run::cargo(["run", "--quiet", "--locked", "--bin", "robopheus-blind", "--"]);
    run::succeed(bench.args(&arguments.options))?;
    Ok(End::Good)
}
