//! Command line, files and threads.

mod check;
mod train;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;
use twin::model_document::ModelDocument;

/// Learns what no named effect explains.
#[derive(Parser)]
#[command(name = "robopheus-learn", version)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Trains a residual and writes model.json, model.onnx and report.json
    Train(train::Arguments),
    /// Compares model.onnx in ONNX Runtime with the twin's evaluation of model.json
    Check(check::Arguments),
}

/// Exit code of a network that was discarded, or of an ONNX file that does not agree.
const UNSUCCESSFUL: u8 = 1;
const REFUSED: u8 = 2;

pub fn main() -> ExitCode {
    let done = match Arguments::parse().verb {
        Verb::Train(arguments) => train::run(&arguments),
        Verb::Check(arguments) => check::run(&arguments),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(UNSUCCESSFUL),
        Err(error) => {
            eprintln!("robopheus-learn: {error:#}");
            ExitCode::from(REFUSED)
        }
    }
}

fn model(path: &Path) -> anyhow::Result<ModelDocument> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    ModelDocument::parse(&text).with_context(|| format!("{}", path.display()))
}

/// Names of the files in the output folder.
fn files(out: &Path) -> [PathBuf; 3] {
    ["model.json", "model.onnx", "report.json"].map(|name| out.join(name))
}
