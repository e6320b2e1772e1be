//! The path of a newcomer in a real browser: compose, watch the twin, submit, watch the robots, download.

use api::run::RunState;
use std::collections::BTreeMap;
use std::time::Duration;
use system_tests::{Archive, Browser, System, repository};

fn pictures() -> std::path::PathBuf {
    repository().join("target/pictures")
}

#[tokio::test(flavor = "multi_thread")]
async fn newcomer_composes_submits_watches_and_downloads() -> anyhow::Result<()> {
    let system = System::start("browser").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    let accepted = |seen: &serde_json::Value| seen["twin"]["accepted"] == true && seen["twin"]["running"] == false;

    let seen = browser
        .wait(
            "the twin's verdict on the first template",
            Duration::from_secs(90),
            accepted,
        )
        .await?;
    assert_eq!(seen["page"], "compose");
    let first_digest = seen["twin"]["digest"].clone();
    browser.picture(&pictures().join("compose.png")).await?;

    browser.click("compose.template.swap-corners").await?;
    let other = |seen: &serde_json::Value| accepted(seen) && seen["twin"]["digest"] != first_digest;
    let seen = browser
        .wait("the twin's verdict on the swap", Duration::from_secs(60), other)
        .await?;
    let digest = seen["twin"]["digest"].clone();
    browser.picture(&pictures().join("compose-swap.png")).await?;

    browser.press_control_enter().await?;
    let submitted = |seen: &serde_json::Value| seen["run"]["id"].is_string();
    let seen = browser
        .wait("the submission", Duration::from_secs(30), submitted)
        .await?;
    let id: uuid::Uuid = seen["run"]["id"].as_str().unwrap_or_default().parse()?;
    browser.picture(&pictures().join("queue.png")).await?;

    let run = system
        .wait_for_state(id, RunState::Running, Duration::from_secs(60))
        .await?;
    assert_eq!(run.state, RunState::Running, "{:?}", run.fault);
    assert_eq!(
        run.digest.equal,
        Some(true),
        "browser and server disagree: {:?}",
        run.digest
    );
    assert_eq!(run.digest.claimed.as_deref(), digest.as_str());
    browser.click("nav.live").await?;
    browser
        .wait("live robots", Duration::from_secs(20), |seen| {
            seen["live"]["robots"].as_u64() == Some(4)
        })
        .await?;
    tokio::time::sleep(Duration::from_secs(3)).await; // let the trails grow before the picture
    browser.picture(&pictures().join("live.png")).await?;

    let run = system.wait_until_ended(id, Duration::from_secs(90)).await?;
    assert_eq!(run.state, RunState::Done, "{:?}", run.fault);
    browser.click("nav.run").await?;
    let ended = |seen: &serde_json::Value| seen["page"] == "run" && seen["run"]["state"] == "done";
    browser
        .wait("the Run page of a finished run", Duration::from_secs(20), ended)
        .await?;
    browser
        .wait("the measured track", Duration::from_secs(20), |seen| {
            seen["run"]["track"] == true
        })
        .await?;
    browser.picture(&pictures().join("run.png")).await?;

    browser.click("run.download.archive").await?;
    let zip = system_tests::wait_for("the downloaded archive", Duration::from_secs(30), || async {
        let found = std::fs::read_dir(&browser.downloads)?
            .flatten()
            .map(|entry| entry.path());
        Ok(found
            .into_iter()
            .find(|path| path.extension().is_some_and(|kind| kind == "zip")))
    })
    .await?;
    let archive = Archive::open(std::fs::read(zip)?)?;
    assert_eq!(archive.manifest["complete"], true);
    browser.close().await?;
    let left = system.stop()?;
    assert!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_browser_computes_the_bits_of_the_native_twin() -> anyhow::Result<()> {
    let system = System::start("digest").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    let script = "const done = arguments[arguments.length - 1];
        import('/bundle/sim_wasm.js').then(async sim => { await sim.default(); done(sim.gallery_digests()); })
            .catch(error => done('error: ' + error));";
    let answer = browser.page.execute_async(script, Vec::new()).await?.json().clone();
    let text = answer.as_str().unwrap_or_default();
    let wasm: BTreeMap<String, String> =
        serde_json::from_str(text).map_err(|error| anyhow::anyhow!("{error}: {text}"))?;
    let native: BTreeMap<String, String> = control::gallery::digest_scenarios()
        .into_iter()
        .map(|(name, _)| (name.clone(), control::gallery::digest_of(&name)))
        .collect();
    assert!(native.len() >= 20, "only {} scenarios", native.len());
    assert_eq!(native, wasm);
    println!("{} scenarios, all digests equal in Chromium and natively", native.len());
    browser.close().await
}
