//! The paper's comparison in a real browser: its path under feedback alone, then corrected by a model of the robot, and the page that
//! holds both against each other.

use anyhow::ensure;
use api::run::RunState;
use serde_json::{Value, json};
use std::time::Duration;
use system_tests::{Browser, System, repository};

const ROBOT: &str = "omni-01";
const LIMIT: Duration = Duration::from_secs(90);
/// The way to the start, and the path.
const RUN_LIMIT: Duration = Duration::from_secs(150);
/// Half of the paper's band.
const BAND_M: f64 = 0.075;

fn pictures() -> std::path::PathBuf {
    repository().join("target/pictures")
}

/// The twin accepts what is composed now.
async fn wait_for_twin(browser: &Browser, mode: &str, corrected: bool) -> anyhow::Result<Value> {
    browser
        .wait(&format!("an accepted experiment, {mode}"), LIMIT, |seen| {
            let (twin, document) = (&seen["state"]["twin"], &seen["state"]["compose"]["document"]);
            twin["running"] == false
                && twin["accepted"] == true
                && document["mode"] == mode
                && document["control"]["law"] == "path_following"
                && document["control"]["interaction"].is_object() == corrected
        })
        .await
}

/// Submits what is composed and waits until it was driven.
async fn drive(system: &System, browser: &Browser, runs_before: usize) -> anyhow::Result<String> {
    browser.press_control_enter().await?;
    let listed = |seen: &Value| {
        let runs = seen["state"]["queue"]["runs"].as_array();
        runs.map_or(0, Vec::len) == runs_before + 1
    };
    let seen = browser.wait("the submission", LIMIT, listed).await?;
    let id = seen["state"]["queue"]["runs"][0][0]
        .as_str()
        .unwrap_or_default()
        .to_owned();
    let run = system.wait_until_ended(id.parse()?, RUN_LIMIT).await?;
    ensure!(run.state == RunState::Done, "{:?}", run.fault);
    ensure!(
        run.digest.equal == Some(true),
        "browser and server disagree: {:?}",
        run.digest
    );
    Ok(id)
}

/// RMS distances of the runs on the page, by run.
fn compared(seen: &Value) -> Vec<(String, String, Option<f64>)> {
    let rows = seen["state"]["run"]["compared"].as_array().cloned().unwrap_or_default();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    rows.iter()
        .map(|row| (text(&row[0]), text(&row[1]), row[2].as_f64()))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn feedback_alone_and_a_corrected_run_are_held_against_each_other() -> anyhow::Result<()> {
    let system = System::start("paper-path").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    browser
        .wait("the first rehearsal", LIMIT, |seen| {
            seen["state"]["twin"]["status"] == "done"
        })
        .await?;
    browser.click("compose.template.paper-path").await?;
    let seen = wait_for_twin(&browser, "physical", false).await?;
    let control = &seen["state"]["compose"]["document"]["control"];
    ensure!(control["feedback_alone"] == true, "{control}");
    browser.picture(&pictures().join("paper-compose-a.png")).await?;
    let alone = drive(&system, &browser, 0).await?;

    browser.click("nav.compose").await?;
    browser.click("compose.step.c").await?;
    let seen = wait_for_twin(&browser, "interactive", true).await?;
    let control = &seen["state"]["compose"]["document"]["control"];
    ensure!(control["interaction"] == json!({"horizon_s": 0.3}), "{control}");
    ensure!(control["feedback_alone"].is_null(), "{control}");
    ensure!(
        seen["widgets"]["compose.horizon"].is_object(),
        "no slider of the horizon"
    );
    browser.picture(&pictures().join("paper-compose-c.png")).await?;
    let corrected = drive(&system, &browser, 1).await?;

    browser.click("nav.run").await?;
    let figures = |seen: &Value| {
        let rows = compared(seen);
        rows.len() == 2 && rows.iter().all(|(.., rms_m)| rms_m.is_some())
    };
    let seen = browser.wait("the figures of both runs", LIMIT, figures).await?;
    browser.picture(&pictures().join("paper-run.png")).await?;
    let rows = compared(&seen);
    println!("{}\n{rows:?}", seen["state"]["run"]["tracking"]);
    ensure!(
        rows[0].0 == corrected && rows[0].1 == "Corrected by the nominal model",
        "{rows:?}"
    );
    ensure!(rows[1].0 == alone && rows[1].1 == "Feedback alone", "{rows:?}");
    let [corrected_m, alone_m] = [rows[0].2, rows[1].2].map(Option::unwrap_or_default);
    ensure!(
        0.0 < corrected_m && corrected_m < alone_m && alone_m < BAND_M,
        "{rows:?}"
    );
    let sentence = seen["state"]["run"]["tracking"].as_str().unwrap_or_default();
    let said = format!("{:.1} times nearer than with feedback alone", alone_m / corrected_m);
    ensure!(sentence.contains(&said), "{sentence}: not {said}");

    browser.click("run.side.comparison").await?;
    let table = |seen: &Value| {
        let widgets = &seen["widgets"];
        widgets[format!("run.peer.{alone}")].is_object() && widgets["run.comparison.plot"].is_object()
    };
    browser.wait("the table", LIMIT, table).await?;
    browser.picture(&pictures().join("paper-comparison.png")).await?;
    browser.click(&format!("run.peer.{alone}")).await?;
    let other = |seen: &Value| seen["state"]["run"]["id"] == alone.as_str() && figures(seen);
    let seen = browser.wait("the run under feedback alone", LIMIT, other).await?;
    ensure!(compared(&seen)[0].1 == "Feedback alone", "{:?}", compared(&seen));

    browser.click("run.comparison.models").await?;
    let models = |seen: &Value| seen["page"] == "models" && seen["state"]["models"]["robot"] == ROBOT;
    browser.wait("the models of the robot", LIMIT, models).await?;
    browser.close().await?;
    system.stop()?;
    Ok(())
}
