//! The one that names: the diagnosis, with nothing but bundles.

use anyhow::{Result, anyhow};
use identify::diagnose::{Diagnosis, Input, Run, diagnose};
use identify::workers::Serial;
use twin::model_document::ModelDocument;

/// Seed of the diagnosis; not that of the set.
const SEED: u64 = 1;

/// Diagnoses runs on this thread.
pub fn name(references: &[Run], runs: &[Run], model: Option<ModelDocument>) -> Result<Diagnosis> {
    let input = Input {
        references: references.to_vec(),
        runs: runs.to_vec(),
        locked: Vec::new(),
        model,
        seed: SEED,
    };
    diagnose(&Serial, &input).map_err(|error| anyhow!("{error}"))
}
