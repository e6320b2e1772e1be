//! `cargo xtask soak`: what `test` does, for long, and the rows of the reliability goals at their full counts.

mod rows;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::builds::Extent;
use crate::setup::{Found, Needs, set_up};
use crate::stages::Stages;
use crate::{End, test};
use rows::Row;

/// Folder with records of real robots, for tests that want them.
const REAL_LOGS: &str = "ROBOPHEUS_REAL_LOGS";

#[derive(Args)]
pub struct SoakArguments {
    /// Only these rows (S1 to S14, X1 to X7, names, page, a part as in S10-driving); without: all, and the tests and smoke runs for long
    pub rows: Vec<String>,
    /// Rows that were measured at this commit are not measured again
    #[arg(long)]
    pub resume: bool,
    /// Experiments from submission to archive, one after the other
    #[arg(long, default_value_t = 20)]
    pub smokes: u32,
    /// Random cases of every property test
    #[arg(long, default_value_t = 20_000)]
    pub cases: u32,
}

/// What `test` does, at full counts.
pub fn soak(arguments: &SoakArguments) -> Result<End> {
    let rows = rows::chosen(&arguments.rows)?;
    let everything = arguments.rows.is_empty();
    let logs = std::env::var_os(REAL_LOGS).map(PathBuf::from);
    if everything && !logs.is_some_and(|folder| folder.is_dir()) {
        eprintln!("soak: set {REAL_LOGS} to the folder with records of real robots, or name rows.");
        return Ok(End::Failed);
    }
    let Some(found) = set_up(Needs {
        wasm: everything,
        postgres: true,
        browser: everything,
        python: everything,
    })?
    else {
        return Ok(End::Missing);
    };
    let mut stages = Stages::new(&[]);
    let built = stages.run("build", test::build);
    if everything {
        for_long(&mut stages, built, &found, arguments);
    }
    let kept = rows::kept_folder()?;
    for row in &rows {
        match row.kept(&kept).filter(|_| arguments.resume) {
            Some((true, _)) => stages.leave_out(row.name, "holds already"),
            Some((false, _)) => {
                stages.run(row.name, || anyhow::bail!("missed already"));
            }
            None => {
                stages.run_if(built, "the build failed", row.name, || row.measure(&kept));
            }
        }
    }
    print_table(&rows, &kept);
    Ok(stages.finish())
}

fn for_long(stages: &mut Stages, built: bool, found: &Found, arguments: &SoakArguments) {
    stages.run_if(built, "the build failed", "tests", || {
        test::with_database(found, |url| {
            test::package_tests(url, &[("PROPTEST_CASES", arguments.cases.to_string())])
        })
    });
    let bundled = stages.run("wasm", || test::build_bundles(found));
    stages.run_if(bundled, "the bundles are not built", "builds", || {
        test::compare_builds(found, Extent::All)
    });
    for _ in 0..arguments.smokes {
        stages.run_if(built, "the build failed", "smoke", test::run_smoke);
    }
}

fn print_table(rows: &[Row], kept: &std::path::Path) {
    println!("\nfigures ({})", kept.display());
    for row in rows {
        let Some((held, text)) = row.kept(kept) else { continue };
        let lines = row.table(&text);
        for line in &lines {
            println!("{line}");
        }
        if lines.is_empty() {
            println!("{:<4} {}", row.name, if held { "holds" } else { "MISSED" });
        }
    }
}
