//! `cargo xtask bench twin`: the workload of `twin::workload`, natively and in the browser's engine.

mod report;

use std::fs;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::Args;

use crate::setup::{Needs, set_up};
use crate::{End, bundle, page, paths, run};
use report::{BrowserRow, NativeReport, Report};

/// Robot-seconds of one repetition in the browser, and repetitions that the compiler behind it may warm up in.
const BROWSER_ROBOT_S: u32 = 2000;
const BROWSER_WARM_UP: usize = 2;
/// Longest wait for the browser.
const BROWSER_LIMIT: Duration = Duration::from_secs(20 * 60);

#[derive(Args)]
pub struct TwinArguments {
    /// All six chassis, not only omni4 and awd
    #[arg(long)]
    all: bool,
    /// Repetitions of every row; the median counts
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u64).range(5..=1000))]
    repetitions: u64,
    /// Leave out WebAssembly in Chromium
    #[arg(long)]
    no_browser: bool,
}

impl Default for TwinArguments {
    fn default() -> Self {
        Self {
            all: false,
            repetitions: 7,
            no_browser: false,
        }
    }
}

pub fn bench(arguments: &TwinArguments) -> Result<End> {
    let Some(found) = set_up(Needs {
        wasm: !arguments.no_browser,
        browser: !arguments.no_browser,
        ..Needs::default()
    })?
    else {
        return Ok(End::Missing);
    };
    if let Some(toolchain) = &found.wasm {
        bundle::build(toolchain)?;
    }
    let native = native(arguments)?;
    let browser = match &found.browser {
        Some(browser) => {
            let script = script(&native, arguments.repetitions as usize);
            let text = page::evaluate(&browser.chromium, &script, BROWSER_LIMIT)?;
            let rows: Vec<BrowserRow> = serde_json::from_str(&text).context("what the browser measured")?;
            Some(rows)
        }
        None => None,
    };
    let report = Report::new(native, browser);
    report.print();
    let path = paths::root().join("target/bench/twin.json");
    fs::create_dir_all(path.parent().context("a folder")?)?;
    fs::write(&path, serde_json::to_string_pretty(&report)?)?;
    println!("\nwritten to {}", path.display());
    let problems = report.problems();
    for problem in &problems {
        eprintln!("bench: {problem}");
    }
    Ok(if problems.is_empty() { End::Good } else { End::Failed })
}

fn native(arguments: &TwinArguments) -> Result<NativeReport> {
    let mut command = run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--release",
        "--package",
        "twin",
        "--example",
        "speed",
        "--",
        "--json",
        "--repetitions",
    ]);
    command.arg(arguments.repetitions.to_string());
    if arguments.all {
        command.arg("--all");
    }
    serde_json::from_str(&run::read(&mut command)?).context("what the twin's benchmark said")
}

/// Every row of the native table once more. The rows are the outer loop: an engine compiles for the row at hand.
fn script(native: &NativeReport, repetitions: usize) -> String {
    let rows: Vec<String> = native
        .rows
        .iter()
        .map(|row| format!("['{}', {}, '{}', {}]", row.chassis, row.robots, row.effect, row.digest))
        .collect();
    format!(
        "const rows = [];
for (const [chassis, robots, effect, digest] of [{}]) {{
  const work = new sim.SpeedWork(chassis, robots, effect, digest);
  const [rates, wall_rates] = [[], []];
  for (let repetition = 0; repetition < {}; repetition += 1) {{
    const begun_ms = await cpu_ms();
    const [wall_ms, laps] = work.run({BROWSER_ROBOT_S});
    const used_ms = await cpu_ms() - begun_ms;
    rates.push(laps * work.lap_robot_s() / (used_ms / 1000));
    wall_rates.push(laps * work.lap_robot_s() / (wall_ms / 1000));
  }}
  rows.push({{ chassis, robots, effect, digest, rates: rates.slice({BROWSER_WARM_UP}), wall_rates: wall_rates.slice({BROWSER_WARM_UP}), lap_digest: digest ? work.lap_digest() : null }});
  work.free();
}}
return JSON.stringify(rows);",
        rows.join(", "),
        repetitions + BROWSER_WARM_UP
    )
}
