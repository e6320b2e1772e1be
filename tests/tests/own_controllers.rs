//! What users write, on the robots: a script drives them and speaks in the run's log, one with a fault in it is rejected with its
//! line, and one that is only wrong on real robots ends its own run and nothing else.

use anyhow::{Context, ensure};
use api::run::{RunState, Whose};
use serde_json::{Value, json};
use std::time::Duration;
use system_tests::{Archive, System, repository};

const LIMIT: Duration = Duration::from_secs(90);

/// One robot that drives along x for a metre under a script.
fn experiment(script: &str) -> Value {
    let path = repository().join("examples/experiments/rectangle-omni4.json");
    let mut experiment: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    experiment["robots"][0]["start"] = json!({"x_m": -0.5, "y_m": 0.2, "yaw_rad": 0.0});
    experiment["control"] = json!({"law": "own", "parameters": {"script": script, "speed_m_per_s": 0.3}});
    experiment["targets"] = json!([]);
    experiment["duration_s"] = 12.0.into();
    experiment
}

const DRIVES: &str = r#"fn step(now) {
    let robot = now.robot(0);
    if now.tick == 0 { print(`off at ${robot.x_m}`); }
    if robot.x_m > 0.5 {
        stop(0);
        finished(0);
    } else {
        velocity(0, parameter("speed_m_per_s"), 0.0);
    }
}
"#;

/// The twin drives exactly straight on, no robot does.
const HANGS_ON_ROBOTS: &str = r#"fn step(now) {
    let robot = now.robot(0);
    velocity(0, 0.3, 0.0);
    if robot.x_m > 0.5 { stop(0); finished(0); }
    if now.tick > 120 && abs(robot.y_m - 0.2) > 0.0000001 {
        loop { }
    }
}
"#;

#[tokio::test(flavor = "multi_thread")]
async fn scripts_drive_robots_and_harm_nobody() -> anyhow::Result<()> {
    let system = System::start("own").await?;

    let rejected = system
        .submit(
            &experiment("fn step(now) {\n    let x = 1;\n    nothing_of_that_name(x);\n}\n"),
            None,
        )
        .await?;
    let rejected = system.wait_until_ended(rejected, LIMIT).await?;
    ensure!(rejected.state == RunState::Rejected, "{:?}", rejected.state);
    let said = serde_json::to_string(&rejected.verdict)?;
    ensure!(
        said.contains("line 3") && said.contains("nothing_of_that_name"),
        "{said}"
    );

    let hangs = system.submit(&experiment(HANGS_ON_ROBOTS), None).await?;
    let hangs = system.wait_until_ended(hangs, LIMIT).await?;
    let fault = hangs
        .fault
        .with_context(|| format!("{:?} without a fault", hangs.state))?;
    ensure!(hangs.state == RunState::Failed, "{:?}: {}", hangs.state, fault.message);
    ensure!(
        fault.whose == Whose::User && fault.code == "controller_fault",
        "{} {}",
        fault.code,
        fault.message
    );
    let says = |words: &str| fault.message.contains(words);
    ensure!(says("tick 12") && says("operations in one tick"), "{}", fault.message);

    // The robot is free again at once.
    let drives = system.submit(&experiment(DRIVES), None).await?;
    let run = system.wait_until_ended(drives, LIMIT).await?;
    ensure!(run.state == RunState::Done, "{:?}", run.fault);
    let path = format!("/api/v1/runs/{drives}/archive");
    let archive = system_tests::wait_for("the archive", LIMIT, || async {
        Ok(system.download(&path).await.and_then(Archive::open).ok())
    })
    .await?;
    let log = String::from_utf8_lossy(archive.member("log.txt")?).into_owned();
    ensure!(log.contains("off at -0."), "{log}");
    let telemetry = archive.telemetry("omni-01")?;
    ensure!(telemetry.rows > 300, "{} rows", telemetry.rows);
    system.stop()?;
    Ok(())
}
