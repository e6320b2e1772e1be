//! The three modes of an experiment, each with the other side out of the way.

use api::run::RunState;
use serde_json::Value;
use std::time::Duration;
use system_tests::{Archive, System, repository};

const SHORT_S: f64 = 6.0;
const LIMIT: Duration = Duration::from_secs(60);

fn experiment(mode: &str) -> Value {
    let path = repository().join("examples/experiments/rectangle-omni4.json");
    let mut experiment: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    experiment["mode"] = mode.into();
    experiment["duration_s"] = SHORT_S.into();
    experiment
}

/// Carries a run out and opens its archive.
async fn archive_of(system: &System, mode: &str) -> anyhow::Result<Archive> {
    let id = system.submit(&experiment(mode), None).await?;
    let run = system.wait_until_ended(id, LIMIT).await?;
    anyhow::ensure!(run.state == RunState::Done, "{mode}: {:?}", run.fault);
    let path = format!("/api/v1/runs/{id}/archive");
    system_tests::wait_for("the archive", LIMIT, || async {
        Ok(system.download(&path).await.and_then(Archive::open).ok())
    })
    .await
}

/// Rows at least as many as ticks, commands and poses in them.
fn assert_whole(archive: &Archive, mode: &str) -> anyhow::Result<()> {
    let telemetry = archive.telemetry("omni-01")?;
    anyhow::ensure!(
        telemetry.rows as f64 >= 120.0 * (SHORT_S - 0.5),
        "{mode}: {} rows",
        telemetry.rows
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_mode_runs_with_the_other_side_stopped() -> anyhow::Result<()> {
    let system = System::start("modes").await?;
    let physical_side = ["lab", "emulator"];
    for process in physical_side {
        system.signal(process, libc::SIGSTOP)?;
    }
    let archive = archive_of(&system, "virtual").await?;
    assert_whole(&archive, "virtual")?;
    let manifest: Value = serde_json::from_slice(archive.member("manifest.json")?)?;
    anyhow::ensure!(manifest["stages"]["localisation"] == "twin", "{manifest}");
    for process in physical_side {
        system.signal(process, libc::SIGCONT)?;
    }
    let archive = archive_of(&system, "interactive").await?;
    assert_whole(&archive, "interactive")?;
    let topics = archive.mcap_topics()?;
    let followed = topics.get("/virtual/omni-01/pose").copied().unwrap_or(0);
    anyhow::ensure!(followed as f64 >= 20.0 * (SHORT_S - 1.5), "{topics:?}");
    system.wait_for_log("simulate", "followed: gap", LIMIT).await?;
    // Five figures a second from the first prediction on, and a judgement at the end.
    let learned = topics.get("/learning/omni-01/gap").copied().unwrap_or(0);
    anyhow::ensure!(learned as f64 >= 4.0 * (SHORT_S - 3.0), "{topics:?}");
    system.wait_for_log("learning", "learned: 0.5 s ahead", LIMIT).await?;
    let beside = ["simulate", "learning"];
    for process in beside {
        system.signal(process, libc::SIGSTOP)?;
    }
    for mode in ["physical", "interactive"] {
        let archive = archive_of(&system, mode).await?;
        assert_whole(&archive, mode)?;
    }
    for process in beside {
        system.signal(process, libc::SIGCONT)?;
    }
    system.stop()?;
    Ok(())
}
