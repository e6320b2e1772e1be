//! The protective stop on real processes, without service and database, with frames lost.

mod stop_rig;

use anyhow::ensure;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use stop_rig::{StopFrame, StopRig};

/// From the press to the first stop frame of every robot, 99 of 100 presses.
const FIRST_P99: Duration = Duration::from_millis(20);
const LOSS: f64 = 0.3;
const REPEATS: usize = 10;

/// Time from the press to the moment when every robot's first stop frame had passed.
fn press(rig: &StopRig) -> anyhow::Result<(Duration, Duration)> {
    while rig.stops.try_recv().is_ok() {}
    let (pressed, state) = rig.ask("POST /stop")?;
    ensure!(state["stopped"] == true, "{state}");
    let mut seen: BTreeMap<u8, Vec<Instant>> = BTreeMap::new();
    let enough = |seen: &BTreeMap<u8, Vec<Instant>>| {
        seen.len() == rig.numbers.len() && seen.values().all(|times| times.len() >= REPEATS)
    };
    while !enough(&seen) {
        let StopFrame { robot, at } = rig.stops.recv_timeout(Duration::from_secs(2))?;
        seen.entry(robot).or_default().push(at);
        ensure!(pressed.elapsed() < Duration::from_secs(5), "{} robots", seen.len());
    }
    let first = seen.values().filter_map(|times| times.first()).max().copied();
    let gaps = seen
        .values()
        .flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0]));
    Ok((
        first.map_or(Duration::MAX, |first| first - pressed),
        gaps.max().unwrap_or_default(),
    ))
}

fn presses(name: &str, count: usize) -> anyhow::Result<()> {
    let mut rig = StopRig::start(name)?;
    rig.lose_frames(LOSS)?;
    let (mut firsts, mut gaps) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let (first, gap) = press(&rig)?;
        firsts.push(first);
        gaps.push(gap);
        rig.until("every robot says that it stopped", |state| {
            state["robots"]
                .as_array()
                .is_some_and(|robots| robots.iter().all(|robot| robot["stop_acknowledged"] == true))
        })?;
        let (_, state) = rig.ask("POST /clear")?;
        ensure!(state["stopped"] == false, "{state}");
    }
    firsts.sort();
    gaps.sort();
    let at = |times: &[Duration], share: f64| times[((share * times.len() as f64).ceil() as usize).max(1) - 1];
    println!(
        "{count} presses, {} robots, {:.0} % of frames lost: first stop frame p50 {:?} p99 {:?} most {:?}; between two at most {:?}",
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
    press(&rig)?;
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
