//! `robopheus-learn check OUT`

use std::path::PathBuf;

use anyhow::Context;
use learn::runtime::{Runtime, check};

#[derive(clap::Args)]
pub struct Arguments {
    /// Folder that `train` wrote
    out: PathBuf,
    /// Result as JSON
    #[arg(long)]
    json: bool,
}

/// False when ONNX Runtime gives other values than the twin.
pub fn run(arguments: &Arguments) -> anyhow::Result<bool> {
    let [model, onnx, _] = super::files(&arguments.out);
    let model = super::model(&model)?;
    let bytes = std::fs::read(&onnx).with_context(|| format!("cannot read {}", onnx.display()))?;
    let found = check(&Runtime::load()?, &model, &bytes)?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&found)?);
    } else {
        println!(
            "{} rows in {}: at most {:.1e} from the twin, {:.1e} from the training side (limit {:.0e}): {}",
            found.rows,
            found.runtime,
            found.max_difference_twin,
            found.max_difference_training,
            found.limit,
            if found.agrees { "agrees" } else { "DIFFERS" }
        );
    }
    Ok(found.agrees)
}
