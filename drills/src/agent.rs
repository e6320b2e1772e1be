//! S11 in virtual time: the laboratory's process is killed, or stopped for a while.

use crate::fan::{fan, progress};
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::Result;
use emulator::noise::Noise;

/// A robot that gets further than this in a second has moved.
const MOVED_M: f64 = 0.005;
/// Link, watchdog and ramp: longer than this after its last frame nothing moves.
const AT_REST_S: f64 = 0.8;

#[derive(Debug, Clone, Copy)]
struct Nap {
    /// Speed when it happened; way of the fastest robot until it stood.
    speed_m_per_s: f64,
    /// Way after it should have stood, of the sleeping and the woken laboratory, and under an old epoch.
    asleep_m: f64,
    awake_m: f64,
    old_epoch_m: f64,
    /// Way under the new epoch.
    new_epoch_m: f64,
    separation_m: f64,
}

/// Longest way of any robot while `go` happens.
fn way_m(rig: &mut Rig, go: impl FnOnce(&mut Rig)) -> f64 {
    let before = rig.poses();
    go(rig);
    let ways = before.iter().zip(rig.poses());
    ways.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
}

fn nap(number: u64, seed: u64) -> Result<Nap> {
    let mut random = Noise::new(seed, 0x0A6E ^ (number << 20));
    let kinds = ["omni4", "diff2", "rwd"];
    let corners = [[-1.2, -0.8, 0.0], [1.2, 0.8, 3.1]];
    let chassis = kinds.get((number % 3) as usize).copied().unwrap_or("omni4");
    let robots = corners.map(|start| SceneRobot {
        start,
        goal: [-0.9 * start[0], 0.5 * start[1]],
    });
    let scene = Scene::mixed(&[chassis; 2], &robots, 60.0)?;
    let settings = RigSettings {
        seed: seed ^ number,
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    let mut rig = Rig::new(&scene, &settings)?;
    rig.keep_records = false;
    rig.run_for(0.6 + 1.5 * random.uniform());
    let speed_m_per_s = (0..2).map(|robot| rig.speed_m_per_s(robot)).fold(0.0, f64::max);
    let sleep_s = 1.0 + 9.0 * random.uniform();
    rig.sleep_for(AT_REST_S);
    let asleep_m = way_m(&mut rig, |rig| rig.sleep_for(sleep_s - AT_REST_S));
    // Stopped and woken: the same process goes on. Killed: another one that has no new epoch tries.
    let awake_m = way_m(&mut rig, |rig| rig.run_for(2.0));
    let sequence = if number.is_multiple_of(2) { 1 } else { 100 };
    let old_epoch_m = way_m(&mut rig, |rig| {
        // Whether it is answered or not: nothing may move.
        if rig.restart(&scene, 1, sequence).is_ok() {
            rig.run_for(1.0);
        }
    });
    rig.restart(&scene, 2, 1)?;
    let new_epoch_m = way_m(&mut rig, |rig| rig.run_for(3.0));
    let separation = rig.separation();
    Ok(Nap {
        speed_m_per_s,
        asleep_m,
        awake_m,
        old_epoch_m,
        new_epoch_m,
        separation_m: separation.robots_m.min(separation.walls_m),
    })
}

/// `count` naps of 1 to 10 s.
///
/// - Errors: a laboratory that does not come back under a new epoch.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let naps = fan(count, threads, |number| nap(number, seed), progress("agent", 50, count))?;
    let most = |of: fn(&Nap) -> f64| naps.iter().map(of).fold(0.0, f64::max);
    let row = table::rows_of("S11", count, seed);
    let still = |what: &str, of: fn(&Nap) -> f64| {
        let figure = format!("{:.2} mm", 1e3 * most(of));
        row(what, figure, &format!("< {:.0} mm", 1e3 * MOVED_M), most(of) < MOVED_M)
    };
    let least = |of: fn(&Nap) -> f64| naps.iter().map(of).fold(f64::INFINITY, f64::min);
    let fast = naps.iter().filter(|nap| nap.speed_m_per_s > 0.1).count() as u64;
    let moves = naps.iter().filter(|nap| nap.new_epoch_m > 0.05).count() as u64;
    Ok(vec![
        still("way later than 0.8 s after the last frame", |nap| nap.asleep_m),
        still("way after the process is woken, old epoch", |nap| nap.awake_m),
        still("way after a start under the old epoch", |nap| nap.old_epoch_m),
        row(
            "moved when it happened",
            fast.to_string(),
            ">= 90 %",
            fast * 10 >= count * 9,
        ),
        row(
            "moves under a new epoch",
            moves.to_string(),
            ">= 90 %",
            moves * 10 >= count * 9,
        ),
        row(
            "least distance",
            format!("{:.1} mm", 1e3 * least(|nap| nap.separation_m)),
            "> 0",
            least(|nap| nap.separation_m) > 0.0,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_moves_without_a_new_epoch() {
        assert!(table::print(&run(6, 1, 2).expect("naps")));
    }
}
