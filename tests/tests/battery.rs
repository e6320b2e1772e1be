//! The battery ladder as one story on real processes (S14): low gets no new run, critical ends the run in order and the
//! robot charges at its dock, charged it is back by itself, and empty stops at once.

use anyhow::{Context, ensure};
use api::run::{RunState, RunView, Whose};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use system_tests::{System, repository};
use uuid::Uuid;

const LIMIT: Duration = Duration::from_secs(90);
/// Robot of the story, with its number.
const ROBOT: (&str, u8) = ("omni-01", 1);
const OTHER: &str = "omni-02";

fn rectangle(robot: &str, duration_s: f64) -> Value {
    let path = repository().join("examples/experiments/rectangle-omni4.json");
    let mut experiment: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let path = experiment["targets"].as_array().cloned().unwrap_or_default();
    // Round and round: the run ends with its time, not with its path.
    experiment["targets"] = path.iter().cycle().take(20 * path.len()).cloned().collect();
    experiment["robots"][0]["name"] = robot.into();
    experiment["duration_s"] = duration_s.into();
    experiment
}

fn charge(system: &System, charge: f64) -> anyhow::Result<()> {
    system.fault(ROBOT.1, json!({"kind": "low_battery", "charge": charge}))
}

async fn battery(system: &System, level: &str) -> anyhow::Result<Value> {
    let is = |robot: &Value| robot["health"]["battery"] == level;
    system
        .wait_for_robot(ROBOT.0, &format!("battery {level}"), LIMIT, is)
        .await
}

async fn activity(system: &System, wanted: Value) -> anyhow::Result<Value> {
    let is = |robot: &Value| robot["activity"] == wanted;
    system
        .wait_for_robot(ROBOT.0, &format!("activity {wanted}"), LIMIT, is)
        .await
}

async fn rest_v(system: &System) -> anyhow::Result<f64> {
    let robot = system.robot(ROBOT.0).await?;
    robot["health"]["rest_v"].as_f64().context("rest_v")
}

/// A run of the robot that drives.
async fn running(system: &System) -> anyhow::Result<Uuid> {
    let run = system.submit(&rectangle(ROBOT.0, 60.0), None).await?;
    let seen = system.wait_for_state(run, RunState::Running, LIMIT).await?;
    ensure!(seen.state == RunState::Running, "{:?}", seen.fault);
    Ok(run)
}

fn ensure_critical(run: &RunView) -> anyhow::Result<()> {
    let fault = run.fault.as_ref().context("no fault")?;
    ensure!(
        run.state == RunState::Failed && fault.code == "battery_critical" && fault.whose == Whose::Robot,
        "{}: {fault:?}",
        run.state.as_str()
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_battery_of_one_robot_runs_down_and_is_charged() -> anyhow::Result<()> {
    let flags = ["--tracker", "--docks", "examples/lab/docks.json"];
    let system = System::start_with("battery", &flags).await?;

    // Low in the middle of a run: the run goes on.
    let run = running(&system).await?;
    charge(&system, 0.14)?;
    battery(&system, "low").await?;
    ensure!(
        system.run(run).await?.state == RunState::Running,
        "low is no reason to end a run"
    );

    // Critical: it ends in order, its record whole; the robot drives to its dock and charges.
    charge(&system, 0.09)?;
    let ended = system.wait_until_ended(run, LIMIT).await?;
    ensure_critical(&ended)?;
    system_tests::wait_for("the archive", LIMIT, || async {
        Ok(system.download(&format!("/api/v1/runs/{run}/archive")).await.ok())
    })
    .await?;
    activity(&system, json!("driving_home")).await?;
    activity(&system, json!("charging")).await?;
    let (since, before_v) = (Instant::now(), rest_v(&system).await?);

    // No new run for it, and the queue says why; another robot's run goes past it.
    let waiting = system.submit(&rectangle(ROBOT.0, 3.0), None).await?;
    let reason = format!("{} is charging (battery ", ROBOT.0);
    system_tests::wait_for(&reason, LIMIT, || async {
        let said = system.run(waiting).await?.waiting_reason;
        Ok(said.filter(|said| said.starts_with(&reason)))
    })
    .await?;
    let other = system.submit(&rectangle(OTHER, 3.0), None).await?;
    let other = system.wait_until_ended(other, LIMIT).await?;
    ensure!(other.state == RunState::Done, "{:?}", other.fault);
    ensure!(system.run(waiting).await?.state == RunState::Queued);
    ensure!(
        system
            .process_log("lab")
            .contains(&format!("{} stays at its dock", ROBOT.0))
    );
    ensure!(system.robot(ROBOT.0).await?["activity"] == "charging");
    let (elapsed_s, gained_v) = (since.elapsed().as_secs_f64(), rest_v(&system).await? - before_v);
    println!("charged for {elapsed_s:.0} s: {gained_v:.2} V more");
    // 24 V (0.1 + 0.25/0.12) a unit of charge below 0.12 and 24 V 0.1 above, 1/900 of it a second.
    ensure!(
        gained_v > 0.001 * elapsed_s,
        "the dock does not charge: {gained_v} V in {elapsed_s} s"
    );

    // Nearly charged (the minutes in between are skipped): back by itself, and the waiting run begins at the dock.
    charge(&system, 0.28)?;
    let run = system.wait_until_ended(waiting, LIMIT).await?;
    ensure!(run.state == RunState::Done, "{:?}", run.fault);
    ensure!(!system.process_log("lab").contains("robots are carried to their starts"));

    // Empty on the way home: it stops at once, and is carried.
    let run = running(&system).await?;
    charge(&system, 0.09)?;
    ensure_critical(&system.wait_until_ended(run, LIMIT).await?)?;
    activity(&system, json!("driving_home")).await?;
    charge(&system, 0.0)?;
    let words = format!(
        "robots do not get home by themselves: The battery of {} is empty",
        ROBOT.0
    );
    system.wait_for_log("lab", &words, LIMIT).await?;
    system
        .wait_for_log("lab", "robots are taken to the rack robots=[1]", LIMIT)
        .await?;
    battery(&system, "empty").await?;
    let left = system.stop()?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
