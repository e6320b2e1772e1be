//! The protective stop on real processes, without service and database, with frames lost and robots at rest; with robots that drive:
//! `driving_stop.rs`.

mod stop_rig;

use anyhow::ensure;
use serde_json::Value;
use std::collections::BTreeSet;
use std::time::Duration;
use stop_rig::StopRig;

/// From the press to the first stop frame of every robot, 99 of 100 presses.
const FIRST_P99: Duration = Duration::from_millis(20);
const LOSS: f64 = 0.3;

fn presses(name: &str, count: usize) -> anyhow::Result<()> {
    let mut rig = StopRig::start(name)?;
    rig.lose_frames(LOSS)?;
    let (mut firsts, mut gaps) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let press = rig.press()?;
        firsts.push(press.first);
        gaps.push(press.gap);
        rig.until_obeyed()?;
        let (_, state) = rig.ask("POST /clear")?;
        ensure!(state["stopped"] == false, "{state}");
    }
    firsts.sort();
    gaps.sort();
    let at = |times: &[Duration], share: f64| times[((share * times.len() as f64).ceil() as usize).max(1) - 1];
    println!(
        "S10 {name}: {count} presses, {} robots at rest, {:.0} % of frames lost: first stop frame p50 {:?} p99 {:?} most {:?}; between two at most {:?}",
        rig.numbers.len(),
        100.0 * LOSS,
        at(&firsts, 0.5),
        at(&firsts, 0.99),
        at(&firsts, 1.0),
        at(&gaps, 1.0)
    );
    let p99 = at(&firsts, 0.99);
    ensure!(p99 <= FIRST_P99, "p99 {p99:?} of {count} presses");

    // Latched over a crash; cleared by nothing but a clear, which the audit log has.
    rig.press()?;
    rig.kill_lab()?;
    rig.start_lab()?;
    let (_, state) = rig.ask("GET /state")?;
    ensure!(state["stopped"] == true, "forgotten over a restart: {state}");
    let (_, state) = rig.ask("POST /clear")?;
    ensure!(state["stopped"] == false, "{state}");
    let audit = rig.audit()?;
    let lines = |word: &str| audit.iter().filter(|line| line.contains(word)).count();
    ensure!(
        lines("pressed") == count + 1 && lines("cleared") == count + 1,
        "{audit:?}"
    );
    Ok(())
}

#[test]
fn a_press_reaches_every_robot_at_once_and_stays_until_it_is_cleared() -> anyhow::Result<()> {
    presses("stop", 20)
}

/// `robopheus stop` on a laboratory that has neither service nor database.
#[test]
fn the_command_line_stops_robots_without_a_service() -> anyhow::Result<()> {
    let rig = StopRig::start("stop-cli")?;
    while rig.stops.try_recv().is_ok() {}
    let output = rig.stop_by_command_line(None)?;
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(output.status.code() == Some(0), "{told}{words}");
    let told: Value = serde_json::from_str(&told)?;
    ensure!(told["stopped"] == true && told["cancelled"].is_null(), "{told}");
    let problems = told["problems"].as_array().map_or(0, Vec::len);
    ensure!(
        problems == 1 && told["problems"][0].to_string().contains("service http://127.0.0.1:9"),
        "{told}"
    );
    let mut stopped = BTreeSet::new();
    while stopped.len() < rig.numbers.len() {
        stopped.insert(rig.stops.recv_timeout(Duration::from_secs(2))?.robot);
    }
    rig.until_obeyed()?;
    let (_, state) = rig.ask("GET /state")?;
    ensure!(state["stopped"] == true, "{state}");

    // Where nothing answers at all nobody may believe that robots stand.
    let output = rig.stop_by_command_line(Some("http://127.0.0.1:9"))?;
    let told: Value = serde_json::from_slice(&output.stdout)?;
    ensure!(
        output.status.code() == Some(1) && told["stopped"].is_null(),
        "{:?} {told}",
        output.status
    );
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(words.contains("use the hardware stop"), "{words}");
    Ok(())
}

#[test]
#[ignore = "two minutes; part of the soak"]
fn five_hundred_presses() -> anyhow::Result<()> {
    presses("stop-soak", 500)
}
