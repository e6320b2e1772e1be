//! The protective stop on real processes, without service and database, with frames lost and robots at rest; with robots that drive:
//! `driving_stop.rs`.

mod stop_rig;

use anyhow::ensure;
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

#[test]
#[ignore = "two minutes; part of the soak"]
fn five_hundred_presses() -> anyhow::Result<()> {
    presses("stop-soak", 500)
}
