//! A robot that is not in the run stands in the way, or somebody pushes it about.

use crate::attack::CHASSIS;
use crate::fan::{fan, progress};
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Context, Result};
use emulator::noise::Noise;

const TICK_HZ: f64 = 120.0;
const RUN_S: f64 = 15.0;
const RADIUS_M: f64 = 0.25;
/// Number of the stranger's tag.
const NUMBER: u16 = 200;
/// Largest change of its velocity; the laboratory counts on 1 m/s2.
const PUSH_M_PER_S2: f64 = 0.8;
const FASTEST_M_PER_S: f64 = 0.5;
/// A robot that is slower than this towards the stranger when they touch was run into.
const DRIVING_M_PER_S: f64 = 0.02;

/// What came of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Meeting {
    gap_m: f64,
    /// Speed of the robot towards the stranger when they touched.
    driving_m_per_s: f64,
    travelled_m: f64,
}

fn meet(number: u64, seed: u64, pushed: bool) -> Result<Meeting> {
    let mut random = Noise::new(seed, 0x57_4A46 ^ (number << 20));
    let chassis = *CHASSIS.get(number as usize % CHASSIS.len()).context("a chassis")?;
    let side = 0.6 * (random.uniform() - 0.5);
    let robot = SceneRobot {
        start: [-1.5, side, std::f64::consts::TAU * (random.uniform() - 0.5)],
        goal: [1.5, -side],
    };
    let scene = Scene::new(chassis, &[robot], RUN_S)?;
    let settings = RigSettings {
        seed: seed ^ (number << 8),
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    let mut at = [0.3 * (random.uniform() - 0.5), 0.4 * (random.uniform() - 0.5)];
    let mut rig = Rig::new(&scene, &settings)?;
    let (mut speed, mut goal) = ([0.0; 2], [0.0; 2]);
    let mut meeting = Meeting {
        gap_m: f64::INFINITY,
        driving_m_per_s: 0.0,
        travelled_m: 0.0,
    };
    let mut before = rig.poses().first().copied().context("a robot")?;
    for tick in 0..(RUN_S * TICK_HZ) as i64 {
        let here = before;
        if pushed && tick % 60 == 0 {
            let way = [here[0] - at[0], here[1] - at[1]];
            let size = way[0].hypot(way[1]).max(1e-6);
            let push = FASTEST_M_PER_S * (2.0 * random.uniform() - 1.0).max(0.0);
            goal = way.map(|part| push * part / size);
        }
        for ((at, speed), goal) in at.iter_mut().zip(&mut speed).zip(&goal) {
            let step = std::f64::consts::FRAC_1_SQRT_2 * PUSH_M_PER_S2 / TICK_HZ;
            *speed += (goal - *speed).clamp(-step, step);
            *at += *speed / TICK_HZ;
        }
        rig.strangers = vec![(NUMBER, [at[0], at[1], 0.0])];
        if !rig.tick() {
            break;
        }
        let pose = rig.poses().first().copied().context("a robot")?;
        let velocity = [0, 1].map(|axis: usize| {
            let part = |pose: &[f64; 3]| pose.get(axis).copied().unwrap_or_default();
            (part(&pose) - part(&before)) * TICK_HZ
        });
        let away = [pose[0] - at[0], pose[1] - at[1]];
        let distance_m = away[0].hypot(away[1]);
        let gap_m = distance_m - 2.0 * RADIUS_M;
        meeting.gap_m = meeting.gap_m.min(gap_m);
        meeting.travelled_m += velocity[0].hypot(velocity[1]) / TICK_HZ;
        // Bodies that touch stop or push each other; here they pass through each other, which says nothing further in.
        if (-0.03..0.0).contains(&gap_m) {
            let driving = -(velocity[0] * away[0] + velocity[1] * away[1]) / distance_m;
            meeting.driving_m_per_s = meeting.driving_m_per_s.max(driving);
        }
        before = pose;
    }
    Ok(meeting)
}

/// `count` runs with a stranger that stands and as many with one that is pushed.
///
/// - Errors: a scene that cannot be set up.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let one = |k: u64| {
        let meeting = meet(k / 2, seed, k % 2 == 1)?;
        if meeting.driving_m_per_s > DRIVING_M_PER_S {
            eprintln!("run {}: {meeting:?}", k / 2);
        }
        Ok(meeting)
    };
    let meetings = fan(2 * count, threads, one, progress("strangers", 100, 2 * count))?;
    let of = |pushed: usize| meetings.iter().skip(pushed).step_by(2);
    let least_m = |pushed: usize| of(pushed).map(|one| one.gap_m).fold(f64::INFINITY, f64::min);
    let driven = |pushed: usize| of(pushed).filter(|one| one.driving_m_per_s > DRIVING_M_PER_S).count();
    let touched = of(1).filter(|one| one.gap_m < 0.0).count();
    let moved = meetings.iter().filter(|one| one.travelled_m > 0.3).count();
    let row = table::rows_of("S5", count, seed);
    Ok(vec![
        row(
            "a stranger stands: least distance",
            format!("{:.1} mm", 1e3 * least_m(0)),
            "> 0",
            least_m(0) > 0.0,
        ),
        row(
            "a stranger is pushed: robots that drove into it",
            driven(1).to_string(),
            "0",
            driven(1) == 0,
        ),
        row(
            "the same: robots that it was pushed into",
            format!("{touched}, least {:.1} mm", 1e3 * least_m(1)),
            "",
            true,
        ),
        row(
            "runs that moved",
            moved.to_string(),
            "90 %",
            moved as f64 >= 1.8 * count as f64,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_drives_into_a_stranger() {
        assert!(table::print(&run(6, 1, 2).expect("runs")));
    }
}
