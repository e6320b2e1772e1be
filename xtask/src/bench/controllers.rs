//! `cargo xtask bench controllers`: time of a tick of own controllers, natively in the profile that the product runs in, and
//! in the browser.

use std::time::Duration;

use anyhow::{Context, Result};
use clap::Args;
use serde::Deserialize;

use crate::setup::{Needs, set_up};
use crate::{End, bundle, page, run};

/// Longest wait for the browser.
const BROWSER_LIMIT: Duration = Duration::from_secs(300);
/// Batches of ticks of each program, of which the median is told.
const BATCHES: usize = 50;

#[derive(Args, Default)]
pub struct ControllersArguments {
    /// Native only
    #[arg(long)]
    no_browser: bool,
}

/// A program in the browser.
#[derive(Debug, Deserialize)]
struct Row {
    name: String,
    robots: usize,
    /// `None`: a limit stops it.
    tick_ms: Option<f64>,
}

/// What `controllers/examples/tick_times.rs` prints, and the same programs in the browser.
pub fn bench(arguments: &ControllersArguments) -> Result<End> {
    let with_browser = !arguments.no_browser;
    let Some(found) = set_up(Needs {
        wasm: with_browser,
        browser: with_browser,
        ..Needs::default()
    })?
    else {
        return Ok(End::Missing);
    };
    if let Some(toolchain) = &found.wasm {
        bundle::build(toolchain)?;
    }
    run::succeed(&mut run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--package",
        "controllers",
        "--example",
        "tick_times",
    ]))?;
    let Some(browser) = &found.browser else {
        return Ok(End::Good);
    };
    // Once before, so that the engine has compiled what it will.
    let script = format!(
        "sim.controller_times(10, 5);\nreturn JSON.stringify([1, 10, 50].flatMap((n) => JSON.parse(sim.controller_times(n, {BATCHES}))));"
    );
    let text = page::evaluate(&browser.chromium, &script, BROWSER_LIMIT)?;
    let rows: Vec<Row> = serde_json::from_str(&text).context("what the browser measured")?;
    for row in rows {
        match row.tick_ms {
            Some(ms) => println!("browser: {:28} {:3} robots  p50 {ms:7.3} ms", row.name, row.robots),
            None => println!(
                "browser: {:28} {:3} robots  stopped by its limits",
                row.name, row.robots
            ),
        }
    }
    Ok(End::Good)
}
