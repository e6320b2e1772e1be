//! `cargo xtask bench lab`: the latency budget of the laboratory, stage by stage, beside the paper's.
//!
//! First localisation alone on rendered video, then ten robots swapping places on a running system: cameras at 60 Hz,
//! control at 120 Hz, the robot link's medium injected. "Applied" is told by the emulator: the moment a robot's firmware first
//! drove by a command.

use anyhow::{Context, ensure};
use api::run::RunState;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use system_tests::{Archive, LiveReader, System, repository};

/// Milliseconds of the paper: finding tags, fusion, one way on the link, and all of it, usually and at most.
const PAPER_LOCATE_MS: f64 = 6.0;
const PAPER_FUSE_MS: f64 = 1.0;
const PAPER_LINK_MS: f64 = 12.0;
const PAPER_USUAL_MS: f64 = 21.0;
const PAPER_MOST_MS: f64 = 25.0;
/// Mid-exposure to the command on its way.
const CAPTURE_TO_COMMAND_MS: f64 = 13.0;
/// Ticks that may be lost with the live page open.
const MISSED_SHARE: f64 = 0.005;

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let frames = std::env::args().nth(1).unwrap_or_else(|| "3000".to_owned());
    let drills = std::env::current_exe()?.with_file_name("robopheus-drills");
    let sight = std::process::Command::new(&drills)
        .args(["sight", "--frames", &frames])
        .status()
        .with_context(|| format!("cannot run {}", drills.display()))?;
    println!();
    let holds = run().await? && sight.success();
    std::process::exit(i32::from(!holds))
}

/// `true` when every figure is as asked.
async fn run() -> anyhow::Result<bool> {
    let path = repository().join("examples/experiments/swap-ten.json");
    let experiment: Value = serde_json::from_slice(&std::fs::read(&path)?)?;
    let system = System::start_with("lab-bench", &["--measure"]).await?;
    let id = system.submit(&experiment, None).await?;
    system
        .wait_for_state(id, RunState::Running, Duration::from_secs(120))
        .await?;
    let page = LiveReader::open(&system.base, id).await?;
    let run = system.wait_until_ended(id, Duration::from_secs(180)).await?;
    ensure!(
        run.state == RunState::Done,
        "the run ended {}: {:?}",
        run.state.as_str(),
        run.fault
    );
    let frames = page.seen().frames;
    drop(page);
    let archive = Archive::open(system.download(&format!("/api/v1/runs/{id}/archive")).await?)?;
    let applied_file = system.data.join("logs/applied.csv");
    // The rest of the log is written when the emulator ends; the folder stays until `system` is gone.
    let keep = tempfile(&system.data)?;
    let left = system.stop_and(|| std::fs::copy(&applied_file, &keep).map(|_| ()))?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    let applied = read_applied(&keep)?;
    std::fs::remove_file(&keep).ok();
    let stages = &archive.manifest["stages"];
    ensure!(
        stages["localisation"] == "cameras",
        "the run was not localised by cameras"
    );
    report(stages, &archive, &applied, frames)
}

fn tempfile(data: &Path) -> anyhow::Result<std::path::PathBuf> {
    let name = data
        .file_name()
        .context("a folder without a name")?
        .to_string_lossy()
        .into_owned();
    Ok(std::env::temp_dir().join(format!("{name}-applied.csv")))
}

/// Times by robot and sequence.
type Applied = BTreeMap<(u64, u64), i64>;

fn read_applied(path: &Path) -> anyhow::Result<Applied> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut applied = Applied::new();
    for line in text.lines().skip(1) {
        let mut fields = line.split(',').map(str::parse::<i64>);
        if let (Some(Ok(robot)), Some(Ok(sequence)), Some(Ok(at_us))) = (fields.next(), fields.next(), fields.next()) {
            // The last run of the file wins: earlier ones have other epochs and the same sequences.
            applied.insert((robot as u64, sequence as u64), at_us);
        }
    }
    Ok(applied)
}

/// Mid-exposure to applied, and sent to applied, for the first command of each robot that knew a picture.
fn latencies(archive: &Archive, applied: &Applied) -> anyhow::Result<[Vec<f64>; 2]> {
    let mut newest: BTreeMap<u64, i64> = BTreeMap::new();
    let (mut whole, mut link) = (Vec::new(), Vec::new());
    for message in mcap::MessageStream::new(archive.member("run.mcap")?)? {
        let message = message?;
        if !message.channel.topic.ends_with("/command") {
            continue;
        }
        let command: Value = serde_json::from_slice(&message.data)?;
        let number = |name: &str| {
            command[name]
                .as_i64()
                .with_context(|| format!("command without {name}"))
        };
        if number("tick")? < 0 || command["enable"] != true {
            continue;
        }
        let (robot, sequence) = (number("robot")? as u64, number("sequence")? as u64);
        let sent_us = number("sent_us")?;
        let exposure_us = sent_us - number("pose_age_us")?;
        let Some(applied_us) = applied.get(&(robot, sequence)) else {
            continue;
        };
        link.push((applied_us - sent_us) as f64 * 1e-3);
        // The age is taken a few microseconds before the frame is sent: exposures closer than 1 ms are the same.
        let known = newest.entry(robot).or_insert(i64::MIN);
        if exposure_us > known.saturating_add(1000) {
            *known = exposure_us;
            whole.push((applied_us - exposure_us) as f64 * 1e-3);
        }
    }
    whole.sort_by(f64::total_cmp);
    link.sort_by(f64::total_cmp);
    Ok([whole, link])
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

/// - `live_frames`: what the live page got.
fn report(stages: &Value, archive: &Archive, applied: &Applied, live_frames: u64) -> anyhow::Result<bool> {
    let [whole, link] = latencies(archive, applied)?;
    ensure!(
        whole.len() > 1000,
        "only {} pictures can be followed to a robot",
        whole.len()
    );
    println!(
        "{:<52} {:>8} {:>8} {:>8} {:>8}",
        "ten robots, cameras at 60 Hz, control at 120 Hz, ms", "p50", "p95", "paper", "asked"
    );
    let row = |what: &str, p50: f64, p95: f64, paper: Option<f64>, asked: Option<f64>| {
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.0}"));
        println!(
            "{what:<52} {p50:>8.2} {p95:>8.2} {:>8} {:>8}",
            optional(paper),
            optional(asked)
        );
        asked.is_none_or(|asked| p95 <= asked)
    };
    let of = |name: &str| {
        let figure = |which: &str| stages[name][which].as_f64().unwrap_or(f64::NAN);
        (figure("p50_ms"), figure("p95_ms"))
    };
    let mut holds = true;
    for (what, name, paper, asked) in [
        ("mid-exposure to the whole picture", "camera", None, None),
        ("find the tags", "locate", Some(PAPER_LOCATE_MS), Some(PAPER_LOCATE_MS)),
        (
            "to the laboratory, fusion",
            "fuse",
            Some(PAPER_FUSE_MS),
            Some(PAPER_FUSE_MS),
        ),
        ("wait for the tick", "wait", None, None),
        ("law, safety filter, frames", "control", None, None),
        (
            "mid-exposure to command",
            "exposure_to_sent",
            None,
            Some(CAPTURE_TO_COMMAND_MS),
        ),
    ] {
        let (p50, p95) = of(name);
        holds &= row(what, p50, p95, paper, asked);
    }
    holds &= row(
        "command sent to set-point applied",
        quantile(&link, 0.5),
        quantile(&link, 0.95),
        Some(PAPER_LINK_MS),
        Some(PAPER_LINK_MS),
    );
    holds &= row(
        "mid-exposure to set-point applied",
        quantile(&whole, 0.5),
        quantile(&whole, 0.95),
        Some(PAPER_MOST_MS),
        Some(PAPER_MOST_MS),
    );
    println!("the paper: {PAPER_USUAL_MS:.0} ms from picture to robot, {PAPER_MOST_MS:.0} ms at most");
    let (recorded, missed) = (
        archive.manifest["ticks_recorded"].as_i64().unwrap_or(0),
        archive.manifest["ticks_missed"].as_i64().unwrap_or(0),
    );
    println!(
        "ticks: {recorded} recorded, {missed} missed with a live page open that got {live_frames} frames; {} pictures followed to a robot",
        whole.len()
    );
    holds &= live_frames > 0 && missed as f64 <= MISSED_SHARE * (recorded + missed) as f64;
    if !holds {
        println!("a figure is not what is asked");
    }
    Ok(holds)
}
