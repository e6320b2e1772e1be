//! The end of a run with docks, on real processes: robots drive home and charge, the next run does not wait, a press ends
//! the way, and who does not get home is carried to the rack.

use anyhow::ensure;
use api::run::{RunState, RunView};
use serde_json::{Value, json};
use std::time::Duration;
use system_tests::{System, repository};

/// A run of a few seconds with everything around it, on a busy machine.
const RUN_LIMIT: Duration = Duration::from_secs(90);
/// The way home: at most 60 s, and the stop at its end.
const HOME_LIMIT: Duration = Duration::from_secs(80);

/// The rectangle on one robot, cut off after a while.
fn rectangle(robot: &str, duration_s: f64) -> Value {
    let path = repository().join("examples/experiments/rectangle-omni4.json");
    let mut experiment: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    experiment["robots"][0]["name"] = robot.into();
    experiment["duration_s"] = duration_s.into();
    experiment
}

async fn done(system: &System, robot: &str, duration_s: f64) -> anyhow::Result<RunView> {
    let run = system.submit(&rectangle(robot, duration_s), None).await?;
    let run = system.wait_until_ended(run, RUN_LIMIT).await?;
    ensure!(run.state == RunState::Done, "{}: {:?}", run.state.as_str(), run.fault);
    Ok(run)
}

async fn activity(system: &System, robot: &str, wanted: Value, limit: Duration) -> anyhow::Result<Value> {
    let what = format!("activity {wanted}");
    system
        .wait_for_robot(robot, &what, limit, |robot| robot["activity"] == wanted)
        .await
}

/// A run of `robot`, and then its way home until the robot is well under way.
async fn on_the_way(system: &System, robot: &str) -> anyhow::Result<()> {
    let rides = || system.process_log("lab").matches("1 robots drive home").count();
    let before = rides();
    done(system, robot, 4.0).await?;
    activity(system, robot, json!("driving_home"), HOME_LIMIT).await?;
    system_tests::wait_for("the ride home", HOME_LIMIT, || async {
        Ok((rides() > before).then_some(()))
    })
    .await?;
    tokio::time::sleep(Duration::from_millis(1500)).await; // let it drive
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_drive_home_after_the_result_and_give_way_to_the_next_run_and_to_the_stop() -> anyhow::Result<()> {
    let flags = ["--tracker", "--docks", "examples/lab/docks.json"];
    let system = System::start_with("homeward", &flags).await?;

    // Home, and the result does not wait for it: it is done while the robot still drives.
    let run = done(&system, "omni-01", 4.0).await?;
    activity(&system, "omni-01", json!("driving_home"), HOME_LIMIT).await?;
    ensure!(system.run(run.id).await?.state == RunState::Done);
    let docked = activity(&system, "omni-01", json!("charging"), HOME_LIMIT).await?;
    ensure!(docked["state"] == "idle", "{docked}");
    system.wait_for_log("lab", "robots are home", HOME_LIMIT).await?;

    // Another robot's run does not wait for it, and lets it stand at its dock; that robot goes home, too.
    done(&system, "omni-02", 4.0).await?;
    ensure!(system.process_log("lab").contains("omni-01 stays at its dock"));
    activity(&system, "omni-02", json!("charging"), HOME_LIMIT).await?;
    activity(&system, "omni-01", json!("charging"), HOME_LIMIT).await?;

    // From home to the starts by itself; and a run that is waiting ends the way home of a robot that it does not need.
    on_the_way(&system, "omni-01").await?;
    on_the_way(&system, "omni-03").await?;
    ensure!(
        system
            .process_log("lab")
            .contains("the way home ends, robots stay where they are")
    );
    ensure!(!system.process_log("lab").contains("robots are carried to their starts"));

    // A press ends it for good: the robot stays where it is until a run needs it.
    let state = system.stop_port("POST /stop")?;
    ensure!(state["stopped"] == true, "{state}");
    system
        .wait_for_log("lab", "the protective stop was pressed", HOME_LIMIT)
        .await?;
    activity(&system, "omni-03", Value::Null, HOME_LIMIT).await?;
    system.stop_port("POST /clear")?;

    // Who cannot get home is carried, and the reason is in the log.
    on_the_way(&system, "omni-03").await?;
    system.fault(3, json!({"kind": "tracker_lost"}))?;
    system
        .wait_for_log("lab", "robots do not get home by themselves", HOME_LIMIT)
        .await?;
    system
        .wait_for_log("lab", "robots are taken to the rack robots=[3]", HOME_LIMIT)
        .await?;
    system.fault(3, json!({"kind": "none"}))?;
    let carried = activity(&system, "omni-03", Value::Null, HOME_LIMIT).await?;
    ensure!(carried["state"] == "idle", "{carried}");
    done(&system, "omni-03", 2.0).await?;
    let left = system.stop()?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
