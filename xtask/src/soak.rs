//! `cargo xtask soak`: what `test` does, for long.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::setup::{Needs, set_up};
use crate::stages::Stages;
use crate::{End, test};

/// Folder with records of real robots, for tests that want them.
const REAL_LOGS: &str = "ROBOPHEUS_REAL_LOGS";

#[derive(Args)]
pub struct SoakArguments {
    /// Experiments from submission to archive, one after the other
    #[arg(long, default_value_t = 20)]
    pub smokes: u32,
    /// Random cases of every property test
    #[arg(long, default_value_t = 20_000)]
    pub cases: u32,
}

/// What `test` does, at full counts.
pub fn soak(arguments: &SoakArguments) -> Result<End> {
    let logs = std::env::var_os(REAL_LOGS).map(PathBuf::from);
    if !logs.is_some_and(|folder| folder.is_dir()) {
        eprintln!("soak: set {REAL_LOGS} to the folder with records of real robots.");
        return Ok(End::Failed);
    }
    let Some(found) = set_up(Needs {
        wasm: true,
        postgres: true,
        browser: false,
        python: true,
    })?
    else {
        return Ok(End::Missing);
    };
    let mut stages = Stages::new(&[]);
    let built = stages.run("build", test::build);
    stages.run_if(built, "the build failed", "tests", || {
        test::with_database(&found, |url| {
            test::package_tests(url, &[("PROPTEST_CASES", arguments.cases.to_string())])
        })
    });
    for _ in 0..arguments.smokes {
        stages.run_if(built, "the build failed", "smoke", test::run_smoke);
    }
    Ok(stages.finish())
}
