//! S9: antipodal swaps on the emulated plant.

use crate::fan::{fan, progress};
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::Result;
use emulator::noise::Noise;
use lab::record::Record;
use lab::safety::Ending;
use std::f64::consts::TAU;

/// Time that a swap may take.
const SWAP_S: f64 = 60.0;
const TICK_HZ: f64 = 120.0;
/// Margin between robots of the safety filter, less the largest error of two poses: what separation must not fall below.
const LEAST_M: f64 = 0.03 - 0.01;
/// Further off its goal than this a robot has not arrived.
const ARRIVED_M: f64 = 0.1;
/// All robots together are slower than this while nobody has arrived: they hold each other.
const HELD_M_PER_S: f64 = 0.02;

/// What came of one swap.
#[derive(Debug, Clone, Copy)]
struct Swap {
    ending: Option<Ending>,
    /// Everybody is where they should be.
    arrived: bool,
    separation_m: f64,
    /// From when everybody stood to the first way round; 0 when nobody was held.
    detected_s: f64,
}

fn swap(number: u64, seed: u64) -> Result<Swap> {
    let mut random = Noise::new(seed, 0x0D_EAD0 ^ (number << 20));
    let robots = 2 + (number % 5) as usize;
    let kinds = ["omni4", "diff2"];
    let mixed = random.uniform() < 0.5;
    let chassis: Vec<&str> = (0..robots)
        .map(|_| kinds[usize::from(mixed && random.uniform() < 0.5)])
        .collect();
    let turn = random.uniform() * TAU;
    // On an ellipse, evenly, with a little disorder; everybody goes to the other side.
    let places: Vec<SceneRobot> = (0..robots)
        .map(|k| {
            let angle = turn + TAU * k as f64 / robots as f64 + 0.1 * (random.uniform() - 0.5);
            let (sin, cos) = angle.sin_cos();
            let [x, y] = [1.4 * cos, 1.1 * sin];
            SceneRobot {
                start: [x, y, TAU * (random.uniform() - 0.5)],
                goal: [-x, -y],
            }
        })
        .collect();
    let scene = Scene::mixed(&chassis, &places, SWAP_S)?;
    let settings = RigSettings {
        seed: seed ^ (number << 8),
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    let mut rig = Rig::new(&scene, &settings)?;
    let (mut held_since, mut detected_s): (Option<f64>, f64) = (None, 0.0);
    let mut now_s = 0.0;
    while rig.ended().is_none() && now_s < SWAP_S + 2.0 {
        rig.records.clear();
        rig.tick();
        now_s += 1.0 / TICK_HZ;
        let fastest = (0..robots).map(|k| rig.speed_m_per_s(k)).fold(0.0, f64::max);
        let round = rig.records.iter().any(|record| match record {
            Record::Intervention(one) => one.cause == "deadlock",
            _ => false,
        });
        let driving = rig.records.iter().any(|record| match record {
            Record::Command(one) => !one.finished && one.desired.iter().any(|part| part.abs() > 0.1),
            _ => false,
        });
        match (round, fastest < HELD_M_PER_S && driving && now_s > 0.5) {
            (true, _) => held_since = None,
            (false, true) => {
                let since_s = *held_since.get_or_insert(now_s);
                detected_s = detected_s.max(now_s - since_s);
            }
            (false, false) => held_since = None,
        }
    }
    let off_m = |(pose, place): (&[f64; 3], &SceneRobot)| (pose[0] - place.goal[0]).hypot(pose[1] - place.goal[1]);
    let arrived = rig
        .poses()
        .iter()
        .zip(&places)
        .map(off_m)
        .all(|off_m| off_m < ARRIVED_M);
    Ok(Swap {
        ending: rig.ended(),
        arrived,
        separation_m: rig.separation().robots_m,
        detected_s,
    })
}

/// `count` swaps of 2 to 6 robots in turn.
///
/// - Errors: a scene that cannot be set up.
pub fn run(first: u64, count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let one = |k: u64| {
        let swap = swap(first + k, seed)?;
        if !swap.arrived || swap.separation_m < LEAST_M {
            eprintln!("swap {}: {swap:?}", first + k);
        }
        Ok(swap)
    };
    let swaps = fan(count, threads, one, progress("deadlock", 100, count))?;
    let resolved = swaps.iter().filter(|swap| swap.arrived).count();
    let without = swaps.iter().filter(|swap| swap.ending.is_none()).count();
    let separation_m = swaps.iter().map(|swap| swap.separation_m).fold(f64::INFINITY, f64::min);
    let detected_s = swaps.iter().map(|swap| swap.detected_s).fold(0.0, f64::max);
    let row = table::rows_of("S9", count, seed);
    Ok(vec![
        row(
            "swaps resolved",
            format!("{resolved}"),
            ">= 95 %",
            resolved as f64 >= 0.95 * count as f64,
        ),
        row("swaps without an ending", without.to_string(), "0", without == 0),
        row(
            "least distance between robots",
            format!("{:.1} mm", 1e3 * separation_m),
            &format!(">= {:.0} mm", 1e3 * LEAST_M),
            separation_m >= LEAST_M,
        ),
        row(
            "longest standing before the way round",
            format!("{detected_s:.2} s"),
            "<= 5 s",
            detected_s <= 5.0,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_swaps_are_resolved() {
        assert!(table::print(&run(0, 5, 1, 2).expect("swaps")));
    }
}
