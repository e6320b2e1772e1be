//! A controller of one's own in a real browser: written with a mistake, mended, tried in the twin, submitted, watched, looked at.

use anyhow::ensure;
use api::run::RunState;
use serde_json::Value;
use std::time::Duration;
use system_tests::{Archive, Browser, System, repository};

const LIMIT: Duration = Duration::from_secs(90);
/// Ten robots find their way to their starts, or are carried.
const START_LIMIT: Duration = Duration::from_secs(180);

fn pictures() -> std::path::PathBuf {
    repository().join("target/pictures")
}

/// Beside the robot that the page opens with.
const JOINING: [&str; 9] = [
    "omni-02", "omni-03", "omni-04", "omni-05", "omni-06", "omni-07", "omni-08", "omni-09", "omni-10",
];

/// Drives every robot a little towards the middle, says where they are and draws how far they still have to go. It lasts 20 s, so that a
/// slow page sees them drive.
const MENDED: &str = r#"fn step(now) {
    if now.tick == 0 { this.starts = []; for robot in now.robots { this.starts.push([robot.x_m, robot.y_m]); } }
    for robot in now.robots {
        let share = parameter("share", 0.8);
        let start = this.starts[robot.index];
        let x = share * start[0] - robot.x_m;
        let y = share * start[1] - robot.y_m;
        velocity(robot.index, clamp(x, -0.25, 0.25), clamp(y, -0.25, 0.25));
        line(robot.x_m, robot.y_m, robot.x_m + x, robot.y_m + y, 1);
        point(robot.x_m + x, robot.y_m + y, 2);
        text(robot.x_m, robot.y_m + 0.3, `${now.tick / 120} s`, 6);
        if now.tick % 60 == 0 && robot.index < 4 { print(`${robot.name} is ${hypot(x, y)} from its goal`); }
        if hypot(x, y) < 0.05 { stop(robot.index); if now.tick > 2400 { finished(robot.index); } }
    }
}
"#;
/// Line of the last mistake that the story makes.
const MISTAKEN_LINE: u64 = 12;

fn program(seen: &Value) -> &Value {
    &seen["state"]["compose"]
}

/// The rehearsal of what is written now has ended.
fn settled(seen: &Value) -> bool {
    seen["state"]["twin"]["running"] == false
}

fn mistake_line(seen: &Value) -> Option<u64> {
    program(seen)["mistake"][0][0].as_u64()
}

/// Everything in the editor is replaced by a text, typed.
async fn write(browser: &Browser, text: &str) -> anyhow::Result<()> {
    browser.click("compose.editor").await?;
    browser.press_control('a').await?;
    // Lines of a real keyboard are indented by the editor; these are typed without their blanks.
    browser
        .type_text(&text.lines().map(str::trim).collect::<Vec<_>>().join("\n"))
        .await
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "five minutes on two slow cores: cargo xtask soak page"]
async fn somebody_writes_a_controller_and_sees_robots_follow_it() -> anyhow::Result<()> {
    let system = System::start("own-page").await?;
    let browser = Browser::open(&system.base, &system.data).await?;
    browser
        .wait("the first rehearsal", LIMIT, |seen| {
            seen["state"]["twin"]["status"] == "done"
        })
        .await?;

    // An own controller from the list of laws; the editor opens with an example.
    browser.click("compose.laws").await?;
    browser.click("compose.law.own").await?;
    let opened = |seen: &Value| program(seen)["script"].is_string() && seen["widgets"]["compose.editor"].is_object();
    browser.wait("the editor", LIMIT, opened).await?;
    browser.picture(&pictures().join("own-opened.png")).await?;

    // A mistake that the compiler finds.
    write(&browser, "fn step(now) {\nlet x = ;\n}\n").await?;
    let seen = browser
        .wait("the mistake's line", LIMIT, |seen| {
            settled(seen) && mistake_line(seen).is_some()
        })
        .await?;
    ensure!(mistake_line(&seen) == Some(2), "{}", program(&seen)["mistake"]);
    ensure!(
        seen["widgets"]["compose.mistake"].is_object(),
        "no sentence under the editor"
    );
    browser.picture(&pictures().join("own-mistake.png")).await?;

    // Words are completed by keyboard.
    write(&browser, "fn step(now) {\nvelo").await?;
    browser
        .wait("the list of words", LIMIT, |seen| {
            seen["widgets"]["compose.words"].is_object()
        })
        .await?;
    browser.picture(&pictures().join("own-words.png")).await?;
    browser.press_enter().await?;
    browser
        .wait("the completed word", LIMIT, |seen| {
            program(seen)["script"]
                .as_str()
                .is_some_and(|text| text.ends_with("velocity("))
        })
        .await?;

    // A mistake that only a tick finds.
    write(&browser, &MENDED.replace("now.tick % 60", "now.ticks % 60")).await?;
    let seen = browser
        .wait("the line of the tick that failed", LIMIT, |seen| {
            settled(seen) && mistake_line(seen) == Some(MISTAKEN_LINE)
        })
        .await?;
    println!("{}", program(&seen)["mistake"]);

    // Mended: robots move in the twin, with log and drawings; the twin started soon after the last key.
    write(&browser, MENDED).await?;
    let seen = browser
        .wait("an accepted rehearsal", LIMIT, |seen| {
            settled(seen) && seen["state"]["twin"]["accepted"] == true && mistake_line(seen).is_none()
        })
        .await?;
    // Typed without blanks at the beginnings of lines: the editor put them there.
    let script = program(&seen)["script"].as_str().unwrap_or_default();
    ensure!(script == MENDED.trim_end(), "the editor made {script}");
    let pause_s = seen["state"]["twin"]["pause_s"].as_f64().unwrap_or(f64::NAN);
    println!("the twin started {pause_s:.3} s after the last key");

    // Nine robots join the one of the template.
    browser.click("compose.side.settings").await?;
    browser.click("compose.team").await?;
    for name in JOINING {
        let chip = format!("compose.take.{name}");
        // The list is longer than the window.
        browser.scroll_to(&chip, "compose.team").await?;
        browser.click(&chip).await?;
        browser
            .wait("the robot on the floor", LIMIT, |seen| {
                let robots = program(seen)["document"]["robots"].as_array();
                robots.is_some_and(|robots| robots.iter().any(|robot| robot["name"] == name))
            })
            .await?;
    }
    let seen = browser
        .wait("an accepted rehearsal of ten", LIMIT, |seen| {
            let robots = program(seen)["document"]["robots"].as_array();
            settled(seen) && seen["state"]["twin"]["accepted"] == true && robots.map(Vec::len) == Some(10)
        })
        .await?;
    browser.picture(&pictures().join("own-team.png")).await?;

    ensure!(
        program(&seen)["log_lines"].as_u64() > Some(3),
        "{}",
        program(&seen)["log_lines"]
    );
    browser.click("compose.side.program").await?;
    // Only then the floor and what is below it stand where they will be pressed.
    browser.wait("the editor again", LIMIT, opened).await?;
    browser.click("compose.play").await?;
    browser
        .wait("drawings beside moving robots", LIMIT, |seen| {
            program(seen)["playback_s"].as_f64() > Some(1.0) && program(seen)["drawings"].as_u64() >= Some(2)
        })
        .await?;
    browser.picture(&pictures().join("own-twin.png")).await?;

    // On the robots.
    browser.press_control_enter().await?;
    let seen = browser
        .wait("the submission", LIMIT, |seen| {
            seen["state"]["queue"]["runs"][0][0].is_string()
        })
        .await?;
    let id: uuid::Uuid = seen["state"]["queue"]["runs"][0][0]
        .as_str()
        .unwrap_or_default()
        .parse()?;
    system.wait_for_state(id, RunState::Running, START_LIMIT).await?;
    browser.click("nav.live").await?;
    browser
        .wait("log and drawings of the running controller", LIMIT, |seen| {
            let live = &seen["state"]["live"];
            live["log_lines"].as_u64() > Some(1)
                && live["drawings"].as_u64() >= Some(2)
                && live["tick"].as_i64() > Some(120)
        })
        .await?;
    browser.picture(&pictures().join("own-live.png")).await?;

    let run = system.wait_until_ended(id, LIMIT).await?;
    ensure!(run.state == RunState::Done, "{:?}", run.fault);
    browser.click("nav.run").await?;
    browser
        .wait("the recorded notes", LIMIT, |seen| {
            let run = &seen["state"]["run"];
            run["has_track"] == true && run["notes_of"] == "in the run" && run["log_lines"].as_u64() > Some(3)
        })
        .await?;
    browser.click("run.play").await?;
    browser
        .wait("drawings at playback", LIMIT, |seen| {
            let run = &seen["state"]["run"];
            run["playback_s"].as_f64() > Some(1.0) && run["drawings"].as_u64() >= Some(2)
        })
        .await?;
    browser.picture(&pictures().join("own-run.png")).await?;

    let archive = system
        .download(&format!("/api/v1/runs/{id}/archive"))
        .await
        .and_then(Archive::open)?;
    let log = String::from_utf8_lossy(archive.member("log.txt")?).into_owned();
    ensure!(log.contains("controller: omni-01 is "), "{log}");
    let files = archive.manifest["files"].to_string();
    let missing: Vec<&str> = JOINING
        .into_iter()
        .filter(|name| !files.contains(&format!("{name}/")))
        .collect();
    ensure!(missing.is_empty(), "no files of {missing:?}: {files}");
    let recorded = archive.member("run.mcap")?;
    let topic = b"/controller/notes";
    ensure!(
        recorded.windows(topic.len()).any(|part| part == topic),
        "no notes in run.mcap"
    );
    browser.close().await?;
    system.stop()?;
    Ok(())
}
