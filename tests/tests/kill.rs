//! SIGKILL of any one process during a run: the others survive, the run ends with whose fault or goes on to its
//! end, what was recorded can be downloaded, and the next run works without a person touching anything.

use api::run::{RunState, RunView};
use serde_json::Value;
use std::time::Duration;
use system_tests::{Archive, LiveReader, System, repository};

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
        // The laboratory may still be saving what the crash left.
        let what = format!("the archive after killing {process}");
        let path = format!("/api/v1/runs/{}/archive", run.id);
        let (rows, commands, manifest) = system_tests::wait_for(&what, Duration::from_secs(40), || async {
            let saved = async {
                let archive = Archive::open(system.download(&path).await?)?;
                let telemetry = archive.telemetry("omni-01")?;
                anyhow::Ok((telemetry.rows, telemetry.commands, archive.manifest))
            };
            Ok(saved.await.ok())
        })
        .await?;
        // What a crash lost of what the live page had seen; rows with a command are ticks.
        let lost_s = (seen - commands as i64) as f64 / 120.0;
        println!(
            "killed {process}: tick {seen} seen live, {rows} rows and {commands} commands saved ({lost_s:.2} s less), {} ticks missed",
            manifest["ticks_missed"]
        );
        anyhow::ensure!(rows >= 180, "killed {process}: only {rows} rows saved of two seconds");
        // And the next run works by itself.
        let next = system.submit(&experiment(2.0), None).await?;
        let next = system.wait_until_ended(next, Duration::from_secs(90)).await?;
        anyhow::ensure!(
            next.state == RunState::Done,
            "after {process}: {} {:?}",
            next.state.as_str(),
            next.fault
        );
    }
    let left = system.stop()?;
    anyhow::ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
