//! The dashboard's protective stop, in a real browser, while the service itself stands still.

use anyhow::ensure;
use api::run::RunState;
use serde_json::Value;
use std::time::{Duration, Instant};
use system_tests::{Browser, System, repository, wait_for};

/// From before the click, which the driver takes a second for on a busy machine, to the laboratory's own word that it is stopped.
const PRESSED: Duration = Duration::from_secs(4);
const LIMIT: Duration = Duration::from_secs(60);

fn swap() -> anyhow::Result<Value> {
    let path = repository().join("examples/experiments/swap-corners.json");
    Ok(serde_json::from_str(&std::fs::read_to_string(path)?)?)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_dashboard_stops_robots_while_the_service_stands_still() -> anyhow::Result<()> {
    let system = System::start("stop-button").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    let pictures = repository().join("target/pictures");
    let stop_page = std::fs::read_to_string(system.data.join("lab-stop.addr"))?;
    let stop_page = format!("http://{}", stop_page.trim());
    let http = reqwest::Client::new();
    let run = system.submit(&swap()?, None).await?;
    let seen = system.wait_for_state(run, RunState::Running, LIMIT).await?;
    ensure!(seen.state == RunState::Running, "{:?}", seen.fault);
    browser.click("nav.live").await?;
    browser
        .wait("robots that drive", LIMIT, |seen| {
            seen["state"]["live"]["tick"].as_i64() > Some(120) && seen["widgets"]["nav.stop"].is_object()
        })
        .await?;
    browser.picture(&pictures.join("stop-before.png")).await?;

    system.signal_all("server", libc::SIGSTOP)?;
    let pressed = Instant::now();
    browser.click("nav.stop").await?;
    let stopped = async |wanted: bool| {
        wait_for("the laboratory's word about its stop", LIMIT, || async {
            let state: Value = http.get(format!("{stop_page}/state")).send().await?.json().await?;
            Ok((state["stopped"] == wanted).then_some(()))
        })
        .await
    };
    stopped(true).await?;
    let took = pressed.elapsed();
    println!("stopped {took:?} after the click, with the service standing still");
    system.signal_all("server", libc::SIGCONT)?;
    ensure!(took < PRESSED, "{took:?}");

    let ended = system.wait_until_ended(run, LIMIT).await?;
    let fault = ended.fault.map(|fault| fault.code);
    ensure!(
        fault.as_deref() == Some("protective_stop"),
        "{:?}: {fault:?}",
        ended.state
    );
    browser
        .wait("the way to the page that clears the stop", LIMIT, |seen| {
            seen["widgets"]["nav.stopped"].is_object()
        })
        .await?;
    browser.picture(&pictures.join("stop-pressed.png")).await?;

    // Cleared at the laboratory: the button is armed again, and the next run works.
    let cleared = http.post(format!("{stop_page}/clear")).send().await?;
    ensure!(cleared.status().is_success(), "{}", cleared.status());
    stopped(false).await?;
    browser
        .wait("the button", LIMIT, |seen| seen["widgets"]["nav.stop"].is_object())
        .await?;
    let next = system.submit(&swap()?, None).await?;
    let next = system.wait_until_ended(next, Duration::from_secs(90)).await?;
    ensure!(next.state == RunState::Done, "{:?} {:?}", next.state, next.fault);
    browser.close().await?;
    let left = system.stop()?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
