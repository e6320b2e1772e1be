//! The full circle of the discrepancy workflow in a real browser: an effect hidden in the emulated robot, found and named on
//! the Gap page, accepted with the mouse, and gone from the next run's gap.

use serde_json::{Value, json};
use std::time::Duration;
use system_tests::{Browser, System, repository};

const ROBOT: &str = "omni-01";
/// The first of its versions.
const VERSION: &str = "omni-01/1";
/// Wheels larger by this share; the library calls 0.5 to 8 % practical to large.
const LARGER: f64 = 0.05;
/// Runs that the person keeps back for the figures.
const KEPT_BACK: usize = 2;
const SHORT: Duration = Duration::from_secs(60);
/// Half a minute of two idle cores; many times that on a machine with other work.
const DIAGNOSIS: Duration = Duration::from_secs(900);

fn pictures() -> std::path::PathBuf {
    repository().join("target/pictures")
}

/// Runs on the page, newest first, whose gap is known.
fn gaps(seen: &Value) -> Vec<(String, f64)> {
    let runs = seen["state"]["gap"]["runs"].as_array().cloned().unwrap_or_default();
    runs.iter()
        .filter_map(|run| Some((run[0].as_str()?.to_owned(), run[1].as_f64()?)))
        .collect()
}

async fn wait_for_gaps(browser: &Browser, count: usize) -> anyhow::Result<Vec<(String, f64)>> {
    let seen = browser
        .wait("the gaps of all runs", SHORT, |seen| gaps(seen).len() == count)
        .await?;
    Ok(gaps(&seen))
}

fn rms(gaps: &[(String, f64)]) -> f64 {
    (gaps.iter().map(|(_, gap_m)| gap_m * gap_m).sum::<f64>() / gaps.len() as f64).sqrt()
}

/// The version on the Models page: held against the nominal twin on the newest run, given back, and taken again.
async fn visit_models(browser: &Browser) -> anyhow::Result<()> {
    browser.click("nav.models").await?;
    let in_use = |seen: &Value, version: Option<&str>| {
        let models = &seen["state"]["models"];
        let listed = models["versions"]
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one == VERSION));
        seen["page"] == "models" && models["robot"] == ROBOT && listed && models["in_use"].as_str() == version
    };
    browser
        .wait("the version in use", SHORT, |seen| in_use(seen, Some(VERSION)))
        .await?;
    browser.click("models.compare").await?;
    let told = |seen: &Value| seen["state"]["models"]["sentence"].is_string();
    let seen = browser.wait("the comparison", SHORT, told).await?;
    let models = &seen["state"]["models"];
    let sentence = models["sentence"].as_str().unwrap_or_default();
    println!("{sentence}");
    assert_eq!(models["compared"], json!(["Nominal twin", VERSION]), "{models}");
    assert!(
        sentence.contains(&format!("{VERSION} is nearer to this run than the nominal twin")),
        "{sentence}"
    );
    browser.picture(&pictures().join("models-compared.png")).await?;
    for (row, version) in [("Nominal twin", None), (VERSION, Some(VERSION))] {
        browser.click(&format!("models.row.{row}")).await?;
        let usable = |seen: &Value| seen["widgets"]["models.use"]["enabled"] == true;
        browser.wait("a version that can be used", SHORT, usable).await?;
        browser.click("models.use").await?;
        browser.wait(row, SHORT, |seen| in_use(seen, version)).await?;
    }
    Ok(())
}

/// The same from a terminal: the list, the comparison, the files, and what is refused.
fn call_models(system: &System, run: &str) -> anyhow::Result<()> {
    let program = std::env::var_os("ROBOPHEUS_UP").map_or_else(std::env::current_exe, |path| Ok(path.into()))?;
    let call = |arguments: &[&str]| {
        let mut ancestors = program.ancestors().map(|folder| folder.join("robopheus"));
        let own = ancestors
            .find(|path| path.is_file())
            .expect("the program is built beside the tests");
        let mut command = std::process::Command::new(own);
        command
            .args(["--json", "--server", &system.base, "models"])
            .args(arguments);
        command.env("HOME", &system.data).env("XDG_CONFIG_HOME", &system.data);
        command.output()
    };
    let read = |arguments: &[&str]| -> anyhow::Result<Value> {
        let output = call(arguments)?;
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        anyhow::ensure!(output.status.success(), "{arguments:?}: {words}");
        Ok(serde_json::from_slice(&output.stdout)?)
    };
    let listed = read(&["list", "--robot", ROBOT])?;
    assert_eq!(listed[0]["version"], VERSION, "{listed}");
    assert_eq!(read(&["list", "--robot", "omni-02"])?, json!([]));
    let found = read(&["compare", run, "--robot", ROBOT, "nominal", VERSION])?;
    assert_eq!(found["nearer"], "second", "{found}");
    let folder = system.data.join("fetched");
    let out = folder.display().to_string();
    read(&["fetch", VERSION, "--out", &out])?;
    let document: Value = serde_json::from_slice(&std::fs::read(folder.join("model.json"))?)?;
    assert_eq!(document, listed[0]["document"]);
    assert!(!folder.join("model.onnx").exists(), "it carries no network");
    for refused in [
        ["fetch", VERSION, "--out", &out].as_slice(),
        &["use", ROBOT, "omni-01/99"],
        &["compare", run, "--robot", "diff-01", "nominal", VERSION],
    ] {
        assert!(!call(refused)?.status.success(), "{refused:?}");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hidden_effect_is_named_accepted_and_gone() -> anyhow::Result<()> {
    let system = System::start_with("gap-circle", &["--quick"]).await?;
    let unchanged = system.drive(ROBOT, &[1, 2, 3, 4, 5, 6], "as always").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    browser.click("nav.gap").await?;
    let settled = |seen: &Value| seen["page"] == "gap" && seen["state"]["gap"]["robot"] == ROBOT;
    browser.wait("the Gap page of the robot", SHORT, settled).await?;
    let floor = wait_for_gaps(&browser, unchanged.len()).await?;
    for id in &unchanged {
        browser.click(&format!("gap.run.{id}.same")).await?;
    }

    system.hand(&json!({"hide": {"effect": "wheel_radius", "robot": ROBOT, "relative": LARGER}}))?;
    let changed = system.drive(ROBOT, &[1, 2, 3, 4, 5, 6], "after the new tyres").await?;
    let before = wait_for_gaps(&browser, unchanged.len() + changed.len()).await?;
    let before = &before[..changed.len()];
    let (floor_m, before_m) = (rms(&floor), rms(before));
    assert!(
        before_m > 1.5 * floor_m,
        "the effect hardly shows: {before_m} m, floor {floor_m} m"
    );
    for (place, id) in changed.iter().enumerate() {
        let role = if place < KEPT_BACK { "locked" } else { "changed" };
        browser.click(&format!("gap.run.{id}.{role}")).await?;
    }
    let ticked = |seen: &Value| {
        let gap = &seen["state"]["gap"];
        gap["unchanged"] == unchanged.len()
            && gap["changed"] == changed.len() - KEPT_BACK
            && gap["kept_back"] == KEPT_BACK
    };
    browser.wait("all ticks", SHORT, ticked).await?;
    browser.picture(&pictures().join("gap-ticked.png")).await?;
    browser.click("gap.start").await?;
    let running = |seen: &Value| seen["state"]["gap"]["diagnosis"].is_string();
    browser.wait("the diagnosis under way", SHORT, running).await?;
    browser.picture(&pictures().join("gap-running.png")).await?;
    let told = |seen: &Value| {
        let gap = &seen["state"]["gap"];
        gap["diagnosis_state"] == "failed" || gap["headline"].is_string()
    };
    let seen = browser.wait("the result", DIAGNOSIS, told).await?;
    browser.picture(&pictures().join("gap-result.png")).await?;
    let gap = &seen["state"]["gap"];
    let headline = gap["headline"].as_str().unwrap_or_default();
    println!("{}: {headline}", gap["verdict"]);
    assert_eq!(gap["verdict"], "confirmed", "{headline}");
    assert!(
        headline.starts_with(ROBOT) && headline.contains("larger than described"),
        "{headline}"
    );
    assert!(headline.contains("two runs that were not used"), "{headline}");
    let view = system.get("/api/v1/diagnoses").await?;
    let kept: Vec<String> = changed.iter().take(KEPT_BACK).map(ToString::to_string).collect();
    assert_eq!(view["diagnoses"][0]["locked_runs"], json!(kept), "{view}");

    browser.click("gap.accept").await?;
    let in_use =
        |seen: &Value| seen["state"]["gap"]["model_is_current"] == true && seen["state"]["gap"]["model"].is_string();
    browser.wait("the model in use", SHORT, in_use).await?;
    let again = system.drive(ROBOT, &[1, 2, 3, 4, 5, 6], "with the new model").await?;
    let after = wait_for_gaps(&browser, unchanged.len() + changed.len() + again.len()).await?;
    let after = &after[..again.len()];
    assert!(
        after
            .iter()
            .all(|(id, _)| again.iter().any(|run| run.to_string() == *id))
    );
    let after_m = rms(after);
    let shown = [before_m, after_m, floor_m].map(|gap_m| format!("{:.1} mm", 1000.0 * gap_m));
    println!(
        "gap 2 s ahead: before {}, after {}, floor {}",
        shown[0], shown[1], shown[2]
    );
    // The service's own margin, and unchanged runs against the twin before anything was changed.
    assert!(after_m <= 1.5 * floor_m, "before, after, floor: {shown:?}");
    browser.picture(&pictures().join("gap-accepted.png")).await?;
    visit_models(&browser).await?;
    call_models(&system, &again[0].to_string())?;
    browser.close().await?;
    let left = system.stop()?;
    assert!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
