//! S8: every frame that leaves the laboratory, against the order of its tick.

use crate::attack::{Attack, Fault};
use crate::fan::fan;
use crate::ledger::{Counts, Ledger};
use crate::table::{self, Row};
use anyhow::{Context, Result};
use emulator::noise::Noise;

const RUN_S: f64 = 10.0;
const TICK_HZ: f64 = 120.0;
/// Numbers of these runs, away from those of the other drills.
const FIRST_ATTACK: u64 = 7_000_000;
/// Runs between two looks at how many frames there were.
const BATCH: u64 = 40;
/// Ticks under the new epoch, after a restart.
const RESTARTED_TICKS: u32 = 240;

/// What one run was made of.
#[derive(Debug, Clone, Copy, Default)]
struct Audited {
    counts: Counts,
    stopped: bool,
    restarted: bool,
    grouped: bool,
}

/// A hostile run of 1 to 10 robots with its faults, in a third a protective stop; then the laboratory starts anew.
fn audited(number: u64, seed: u64) -> Result<Audited> {
    let robots = 1 + (number % 10) as usize;
    let attack = Attack::random(seed, FIRST_ATTACK + number, robots, RUN_S);
    let mut random = Noise::new(seed, 0x00A0_D17E ^ (number << 24));
    let stop_s = (random.uniform() < 1.0 / 3.0).then(|| RUN_S * random.uniform());
    let (scene, mut rig) = attack.begin(true)?;
    rig.keep_records = false;
    let mut ledger = Ledger::new(rig.key(), rig.driven());
    let fault = Fault::of(&attack);
    let mut late = Noise::new(seed, 0x7A_B1E5 ^ (number << 24));
    for tick in 0..(RUN_S * TICK_HZ) as i64 {
        let now_s = tick as f64 / TICK_HZ;
        fault.set(&mut rig, now_s);
        rig.signals.protective_stop = stop_s.is_some_and(|stop_s| now_s >= stop_s);
        if late.uniform() < 0.02 {
            rig.pilot_mut().overdue(1 + u32::from(late.uniform() < 0.5));
        }
        let goes_on = rig.tick();
        ledger.take(&mut rig)?;
        if !goes_on {
            break;
        }
    }
    rig.signals.protective_stop = false;
    (rig.up.cut, rig.up.cut_for) = (false, None);
    (rig.light.lies.dark, rig.light.lies.hidden) = (false, None);
    let restarted = rig.restart(&scene, 2, 1).is_ok();
    if restarted {
        for _ in 0..RESTARTED_TICKS {
            if !rig.tick() {
                break;
            }
        }
    }
    ledger.take(&mut rig)?;
    Ok(Audited {
        counts: ledger.counts(),
        stopped: stop_s.is_some(),
        restarted,
        grouped: robots > 1,
    })
}

/// Runs until `count` frames were audited.
///
/// - Errors: a run that cannot be set up.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let mut runs: Vec<Audited> = Vec::new();
    let mut total = Counts::default();
    while total.frames < count {
        let first = runs.len() as u64;
        let batch = BATCH.min(1 + (count - total.frames) / 4000);
        let one = |k: u64| audited(first + k, seed).with_context(|| format!("run {}", first + k));
        let batch = fan(batch, threads, one, |_| {})?;
        total = batch.iter().fold(total, |total, run| total.with(run.counts));
        runs.extend(batch);
        if count >= 100_000 {
            eprintln!("audit: {} of {count} frames", total.frames);
        }
    }
    let row = table::rows_of("S8", total.frames, seed);
    let none = |what: &str, number: u64| row(what, number.to_string(), "0", number == 0);
    let of = |is: fn(&Audited) -> bool| runs.iter().filter(|run| is(run)).count();
    Ok(vec![
        none("frames that nobody ordered in their tick", total.unordered),
        none("frames that the robot cannot read, or without its tag", total.untagged),
        none("frames that differ from their order", total.different),
        none("orders without a frame", total.unsent),
        row(
            "frames that drive / rest or clear / stop",
            format!("{} / {} / {}", total.drive, total.rest, total.stop),
            "half drive; some of each",
            2 * total.drive >= total.frames && total.rest > 0 && (total.stop > 0 || runs.len() < 12),
        ),
        row(
            "runs / in groups / stopped / started anew",
            format!(
                "{} / {} / {} / {}",
                runs.len(),
                of(|run| run.grouped),
                of(|run| run.stopped),
                of(|run| run.restarted)
            ),
            "nine of ten start anew",
            of(|run| run.restarted) as f64 >= 0.9 * runs.len() as f64,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_of_some_runs_is_the_order_of_its_tick() {
        assert!(table::print(&run(40_000, 1, 2).expect("runs")));
    }

    /// The audit of a whole run finds one frame that somebody puts beside the outlet.
    #[test]
    fn one_frame_beside_the_outlet_is_found() {
        let (_, mut rig) = Attack::random(1, 1, 3, 1.0).begin(true).expect("a rig");
        let mut ledger = Ledger::new(rig.key(), rig.driven());
        for _ in 0..60 {
            rig.tick();
        }
        let mut beside = rig.commander(1).expect("a commander").clone();
        let still = lab::commander::Order::Still(lab::commander::Still::Rest);
        let (frame, _) = beside.frame(still, 60, rig.now_us(), 0);
        let now_us = rig.now_us();
        rig.up.send(1, frame.as_bytes(), now_us);
        ledger.take(&mut rig).expect("notes");
        assert_eq!(ledger.counts().unordered, 1, "{:?}", ledger.counts());
    }
}
