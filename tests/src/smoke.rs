//! `cargo xtask smoke`: one experiment from submission to a checked archive, on a system of its own.
//!
//! Prints a table with every figure and its limit; the exit status says whether all held.

use anyhow::Context;
use api::run::RunState;
use serde_json::Value;
use std::time::{Duration, Instant};
use system_tests::{Archive, BareLoop, BareTicks, System, repository};

/// Ticks in which a robot comes to rest at the end of its run, by the laboratory's own bounds.
const STOP_TICKS: std::ops::RangeInclusive<usize> = 36..=181;

/// Share of the ticks that must be in the record ...
const TICK_SHARE: f64 = 0.995;
/// ... unless a bare loop beside it could not do that either: then this much less than the bare loop.
const BARE_MARGIN: f64 = 0.004;
const TICK_LIMIT: &str = ">= 99.5 % or bare - 0.4 %";

/// One line of the table.
struct Row {
    what: &'static str,
    figure: String,
    limit: &'static str,
    holds: bool,
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let mut rows = Vec::new();
    let result = smoke(&mut rows).await;
    println!("\n{:<34} {:<40} {:<26} holds", "what", "figure", "limit");
    for row in &rows {
        println!(
            "{:<34} {:<40} {:<26} {}",
            row.what,
            row.figure,
            row.limit,
            if row.holds { "yes" } else { "NO" }
        );
    }
    result?;
    let failed = rows.iter().filter(|row| !row.holds).count();
    println!("\n{} passed, {failed} failed", rows.len() - failed);
    std::process::exit(i32::from(failed > 0))
}

async fn smoke(rows: &mut Vec<Row>) -> anyhow::Result<()> {
    let document = repository().join("examples/experiments/rectangle-omni4.json");
    let text = std::fs::read_to_string(&document).with_context(|| format!("cannot read {}", document.display()))?;
    let mut experiment: Value = serde_json::from_str(&text)?;
    lap_until_the_end(&mut experiment)?;
    let duration_s = experiment["duration_s"].as_f64().context("duration_s")?;
    let name = experiment["robots"][0]["name"]
        .as_str()
        .context("robot name")?
        .to_owned();

    let clock = Instant::now();
    let system = System::start("smoke").await?;
    time(rows, "start of the system", clock);

    let clock = Instant::now();
    let id = system.submit(&experiment, None).await?;
    let validated = system
        .wait_for_state(id, RunState::Queued, Duration::from_secs(30))
        .await;
    time(rows, "submission and validation", clock);
    validated?;

    let clock = Instant::now();
    let run = system
        .wait_for_state(id, RunState::Running, Duration::from_secs(60))
        .await?;
    time(rows, "queue and preparation", clock);
    anyhow::ensure!(
        run.state == RunState::Running,
        "the run ended {}: {:?}",
        run.state.as_str(),
        run.fault
    );

    let clock = Instant::now();
    let bare_loop = BareLoop::start();
    let limit = Duration::from_secs_f64(duration_s + 30.0);
    let run = system.wait_for_state(id, RunState::Uploading, limit).await?;
    time(rows, "motion", clock);
    let bare = bare_loop.finish();

    let clock = Instant::now();
    let run = if run.state.is_terminal() {
        run
    } else {
        system.wait_until_ended(id, Duration::from_secs(60)).await?
    };
    time(rows, "archive and upload", clock);
    row(
        rows,
        "state",
        format!("{} {}", run.state.as_str(), fault(&run)),
        "done",
        run.state == RunState::Done,
    );

    let clock = Instant::now();
    let archive = Archive::open(system.download(&format!("/api/v1/runs/{id}/archive")).await?)?;
    time(rows, "download and manifest check", clock);
    figures(rows, &archive, &name, bare)?;

    let server = run.digest.server.clone().unwrap_or_default();
    let own = own_digest(&experiment, &system.data)?;
    row(
        rows,
        "digest server / command line",
        format!("{server} / {own}"),
        "equal",
        !own.is_empty() && server == own,
    );

    let left = system.stop()?;
    row(
        rows,
        "left behind after stopping",
        format!("{left:?}"),
        "nothing",
        left.is_empty(),
    );
    Ok(())
}

/// Repeats the path so that the robot drives for the whole duration.
fn lap_until_the_end(experiment: &mut Value) -> anyhow::Result<()> {
    let path = experiment["targets"].as_array().context("targets")?.clone();
    experiment["targets"] = path.iter().cycle().take(6 * path.len()).cloned().collect();
    Ok(())
}

fn figures(rows: &mut Vec<Row>, archive: &Archive, robot: &str, bare: BareTicks) -> anyhow::Result<()> {
    let manifest = &archive.manifest;
    let recorded = manifest["ticks_recorded"]
        .as_f64()
        .context("manifest: ticks_recorded")?;
    let missed = manifest["ticks_missed"].as_f64().context("manifest: ticks_missed")?;
    let share = recorded / (recorded + missed).max(1.0);
    let text = format!("{recorded} of {} ({:.2} %)", recorded + missed, 100.0 * share);
    // A machine whose processors are taken away for longer than a tick cannot give any loop its ticks.
    let wanted = TICK_SHARE.min(bare.share() - BARE_MARGIN);
    row(rows, "120 Hz ticks recorded", text, TICK_LIMIT, share >= wanted);
    let text = format!(
        "{} of {} ({:.2} %)",
        bare.ran,
        bare.ran + bare.missed,
        100.0 * bare.share()
    );
    row(rows, "ticks of a bare loop beside it", text, "reported", true);
    let jitter = &manifest["tick_jitter"];
    let bunched = jitter["bunched"].as_u64().context("manifest: tick_jitter.bunched")?;
    row(
        rows,
        "ticks less than 4 ms apart",
        bunched.to_string(),
        "0",
        bunched == 0,
    );
    let text = format!(
        "{:.3} (plain sleep {:.3})",
        jitter["late_p99_ms"].as_f64().unwrap_or(f64::NAN),
        jitter["sleep_late_p99_ms"].as_f64().unwrap_or(f64::NAN)
    );
    row(
        rows,
        "tick lateness p99, ms",
        text,
        "reported",
        jitter["late_p99_ms"].is_number(),
    );

    // The poses came out of pictures, not from a tracker that knows them.
    let edge = &manifest["edge"];
    let cameras = edge["cameras"].as_array().context("manifest: edge.cameras")?;
    let live = cameras.iter().filter(|camera| camera["health"] == "live").count();
    let used = edge["fusion"]["used"].as_u64().unwrap_or(0);
    let text = format!("{live} of {} live, {used} sightings used", cameras.len());
    let holds = live > 0 && live == cameras.len() && used as f64 > 0.5 * recorded;
    row(rows, "cameras", text, "all live, the robot seen", holds);

    let topics = archive.mcap_topics()?;
    let messages: usize = topics.values().sum();
    row(
        rows,
        "run.mcap",
        format!("{messages} messages, {} topics", topics.len()),
        "> 1000",
        messages > 1000,
    );
    let telemetry = archive.telemetry(robot)?;
    let text = format!(
        "{} rows, {} columns, {} commands, {} with set-points",
        telemetry.rows,
        telemetry.columns.len(),
        telemetry.commands,
        telemetry.set_points
    );
    let without = telemetry.commands.saturating_sub(telemetry.set_points);
    let holds = telemetry.columns[0] == "time_s"
        && telemetry.commands as f64 >= 0.99 * recorded
        && STOP_TICKS.contains(&without);
    let wanted = "a command for every tick, with set-points until the robot stops";
    row(rows, "telemetry.parquet", text, wanted, holds);
    Ok(())
}

/// The same experiment in the twin of the command line, as a user would check it.
fn own_digest(experiment: &Value, folder: &std::path::Path) -> anyhow::Result<String> {
    let document = folder.join("experiment.json");
    std::fs::write(&document, experiment.to_string())?;
    let program = std::env::current_exe()?.with_file_name("robopheus");
    let output = std::process::Command::new(program)
        .args(["--json", "validate", "--lab"])
        .arg(repository().join("examples/lab/reference.json"))
        .arg(document)
        .output()
        .context("cannot run robopheus validate")?;
    anyhow::ensure!(
        output.status.success(),
        "validate: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let verdict: Value = serde_json::from_slice(&output.stdout)?;
    Ok(verdict["digest"].as_str().unwrap_or_default().to_owned())
}

fn fault(run: &api::run::RunView) -> String {
    run.fault
        .as_ref()
        .map(|fault| format!("({}: {})", fault.code, fault.message))
        .unwrap_or_default()
}

fn time(rows: &mut Vec<Row>, what: &'static str, since: Instant) {
    row(
        rows,
        what,
        format!("{:.2} s", since.elapsed().as_secs_f64()),
        "reported",
        true,
    );
}

fn row(rows: &mut Vec<Row>, what: &'static str, figure: String, limit: &'static str, holds: bool) {
    println!("{what}: {figure}");
    rows.push(Row {
        what,
        figure,
        limit,
        holds,
    });
}
