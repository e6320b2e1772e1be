//! SIGKILL of any one process during a run: the others survive, the run ends with whose fault or goes on to its
//! end, what was recorded can be downloaded, and the next run works without a person touching anything.

use api::run::{RunState, RunView};
use serde_json::Value;
use std::time::Duration;
use system_tests::{Archive, LiveReader, System, repository};
use uuid::Uuid;

const PROCESSES: [&str; 8] = [
    "simulate",
    "learning",
    "camera-0",
    "emulator",
    "lab",
    "server",
    "scheduler",
    "postgres",
];

fn experiment(duration_s: f64) -> Value {
    let path = repository().join("examples/experiments/rectangle-omni4.json");
    let mut experiment: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    experiment["duration_s"] = duration_s.into();
    experiment
}

/// What a crash may lose of what was seen live.
const LOST_S: f64 = 0.5;
const TICK_HZ: f64 = 120.0;

/// One run in which `process` is killed in mid motion; returns how the run ended, and the newest tick that its live page had seen by then.
async fn killed_run(system: &System, process: &str) -> anyhow::Result<(RunView, i64)> {
    let id = system.submit(&experiment(12.0), None).await?;
    let run = system
        .wait_for_state(id, RunState::Running, Duration::from_secs(60))
        .await?;
    anyhow::ensure!(
        run.state == RunState::Running,
        "{process}: ended early: {:?}",
        run.fault
    );
    let page = LiveReader::open(&system.base, id).await?;
    tokio::time::sleep(Duration::from_secs(2)).await; // let it record something: two seconds of motion
    let before = system.up_file()?.pids;
    let seen = page.seen().newest.map_or(0, |frame| frame.tick);
    system.kill_9(process)?;
    drop(page);
    let run = system.wait_until_ended(id, Duration::from_secs(60)).await?;
    let after = system.up_file()?.pids;
    for other in PROCESSES.iter().filter(|name| **name != process) {
        anyhow::ensure!(
            before.get(*other) == after.get(*other),
            "killing {process} took {other} with it"
        );
    }
    Ok((run, seen))
}

#[tokio::test(flavor = "multi_thread")]
async fn any_one_process_may_die_during_a_run() -> anyhow::Result<()> {
    let system = System::start("kill").await?;
    for process in PROCESSES {
        let (run, seen) = killed_run(&system, process).await?;
        let fault = run
            .fault
            .as_ref()
            .map(|fault| (fault.whose, fault.code.as_str(), fault.message.as_str()));
        println!("killed {process}: run ended {} {fault:?}", run.state.as_str());
        match run.state {
            RunState::Interrupted | RunState::Failed if ["simulate", "learning"].contains(&process) => {
                anyhow::bail!("{process} stands beside the run and took it with it: {fault:?}");
            }
            // Nothing was lost: the laboratory carried on alone until the process was back.
            RunState::Done => anyhow::ensure!(
                !["lab", "emulator"].contains(&process),
                "a run cannot be done when the {process} died in it"
            ),
            RunState::Interrupted | RunState::Failed => {
                anyhow::ensure!(fault.is_some(), "killed {process}: ended without a fault");
            }
            other => anyhow::bail!("killed {process}: run ended {}", other.as_str()),
        }
        let (rows, lost_s) = saved(&system, run.id, seen).await?;
        println!("killed {process}: tick {seen} seen live, {rows} rows saved, {lost_s:.2} s of it lost");
        // Beside the run's own end, what was seen before the kill must be there.
        anyhow::ensure!(lost_s <= LOST_S, "killed {process}: {lost_s} s lost");
        next_run_works(&system, process).await?;
    }
    let left = system.stop()?;
    anyhow::ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}

/// Rows of the run's record, and how much of what was seen live is not in it, s.
async fn saved(system: &System, run: Uuid, seen: i64) -> anyhow::Result<(usize, f64)> {
    // The laboratory may still be saving what the crash left.
    let path = format!("/api/v1/runs/{run}/archive");
    let telemetry = system_tests::wait_for("the archive", Duration::from_secs(40), || async {
        let archive = async { Archive::open(system.download(&path).await?)?.telemetry("omni-01") };
        Ok(archive.await.ok())
    })
    .await?;
    Ok((telemetry.rows, seen as f64 / TICK_HZ - telemetry.last_command_s))
}

async fn next_run_works(system: &System, killed: &str) -> anyhow::Result<()> {
    let next = system.submit(&experiment(2.0), None).await?;
    let next = system.wait_until_ended(next, Duration::from_secs(90)).await?;
    anyhow::ensure!(
        next.state == RunState::Done,
        "after {killed}: {} {:?}",
        next.state.as_str(),
        next.fault
    );
    Ok(())
}

/// S11 on the real process: the laboratory dies in mid motion, again and again.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "a minute for two kills; part of the soak"]
async fn the_laboratory_dies_twenty_times_and_loses_half_a_second_at_most() -> anyhow::Result<()> {
    let system = System::start("kill-lab").await?;
    let mut all: Vec<f64> = Vec::new();
    for kill in 0..20 {
        let (run, seen) = killed_run(&system, "lab").await?;
        let fault = run.fault.as_ref().map(|fault| fault.code.as_str());
        anyhow::ensure!(fault == Some("lab_restarted"), "{}: {fault:?}", run.state.as_str());
        let (rows, lost_s) = saved(&system, run.id, seen).await?;
        println!("kill {kill}: tick {seen} seen live, {rows} rows saved, {lost_s:.2} s of it lost");
        all.push(lost_s);
        next_run_works(&system, "lab").await?;
    }
    all.sort_by(f64::total_cmp);
    let (half, most) = (all[all.len() / 2], all[all.len() - 1]);
    println!(
        "S11 kill -9 of the laboratory: {} kills, lost of what was seen live: median {half:.2} s, most {most:.2} s",
        all.len()
    );
    anyhow::ensure!(most <= LOST_S, "{most} s lost");
    let left = system.stop()?;
    anyhow::ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
