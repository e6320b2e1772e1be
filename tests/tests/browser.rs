//! The path of a newcomer in a real browser: compose, watch the twin, submit, watch the robots, download.

use api::run::RunState;
use serde_json::Value;
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
    let settled =
        |seen: &Value| seen["state"]["twin"]["running"] == false && seen["state"]["twin"]["digest"].is_string();
    let accepted = |seen: &Value| settled(seen) && seen["state"]["twin"]["accepted"] == true;

    let seen = browser
        .wait(
            "the twin's verdict on the first template",
            Duration::from_secs(90),
            accepted,
        )
        .await?;
    assert_eq!(seen["page"], "compose");
    let first_digest = seen["state"]["twin"]["digest"].clone();
    browser.picture(&pictures().join("compose.png")).await?;

    browser.click("compose.template.swap-corners").await?;
    let other = |seen: &Value| accepted(seen) && seen["state"]["twin"]["digest"] != first_digest;
    let seen = browser
        .wait("the twin's verdict on the swap", Duration::from_secs(60), other)
        .await?;
    let digest = seen["state"]["twin"]["digest"].clone();
    browser.picture(&pictures().join("compose-swap.png")).await?;

    // A robot dragged onto another: the page says so and does not let it be submitted.
    let at = |robot: &str, key: &str| seen["widgets"][robot][key].as_f64().unwrap_or_default();
    let way = |key: &str| (at("compose.robot.1", key) - at("compose.robot.0", key)) as i64;
    browser.drag("compose.robot.0", way("x"), way("y")).await?;
    let refused = |seen: &Value| {
        let (twin, compose) = (&seen["state"]["twin"], &seen["state"]["compose"]);
        let said = [&twin["problems"], &twin["findings"]]
            .iter()
            .any(|list| list[0].is_string());
        twin["running"] == false && twin["accepted"] != true && said && compose["submit_obstacle"].is_string()
    };
    browser
        .wait(
            "the refusal of robots on top of each other",
            Duration::from_secs(30),
            refused,
        )
        .await?;
    browser.picture(&pictures().join("compose-refused.png")).await?;
    browser.click("compose.template.swap-corners").await?;
    let again = |seen: &Value| accepted(seen) && seen["state"]["twin"]["digest"] == digest;
    browser
        .wait("the template's own start poses", Duration::from_secs(60), again)
        .await?;

    browser.press_control_enter().await?;
    let submitted = |seen: &Value| seen["state"]["queue"]["runs"][0][0].is_string();
    let seen = browser
        .wait("the submission", Duration::from_secs(30), submitted)
        .await?;
    let id: uuid::Uuid = seen["state"]["queue"]["runs"][0][0]
        .as_str()
        .unwrap_or_default()
        .parse()?;
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
            seen["state"]["live"]["tick"].as_i64() > Some(360) // trails of three seconds for the picture
        })
        .await?;
    browser.picture(&pictures().join("live.png")).await?;

    let run = system.wait_until_ended(id, Duration::from_secs(90)).await?;
    assert_eq!(run.state, RunState::Done, "{:?}", run.fault);
    browser.click("nav.run").await?;
    let ended = |seen: &Value| seen["page"] == "run" && seen["state"]["run"]["state"] == "done";
    browser
        .wait("the Run page of a finished run", Duration::from_secs(20), ended)
        .await?;
    browser
        .wait("the measured track", Duration::from_secs(20), |seen| {
            seen["state"]["run"]["has_track"] == true && seen["state"]["run"]["has_twin"] == true
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
        import('/bundle/sim_wasm.js').then(async sim => {
            await sim.default({ module_or_path: '/bundle/sim_wasm_bg.wasm' });
            done(sim.gallery_digests());
        }).catch(error => done('error: ' + error));";
    let answer = browser.page.execute_async(script, Vec::new()).await?.json().clone();
    let text = answer.as_str().unwrap_or_default();
    let wasm: BTreeMap<String, String> =
        serde_json::from_str(text).map_err(|error| anyhow::anyhow!("{error}: {text}"))?;
    let mut native = control::gallery::digests();
    native.extend(controllers::gallery::digests());
    let scenarios = control::gallery::digest_scenarios().len();
    assert!(scenarios >= 20, "only {scenarios} scenarios with collisions");
    assert!(native.len() >= scenarios + 200, "only {} traces", native.len());
    assert!(native.values().all(|digest| !digest.is_empty()));
    assert_eq!(native, wasm);
    println!("{} traces, all digests equal in Chromium and natively", native.len());
    browser.close().await
}
