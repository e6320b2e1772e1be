//! Robots drive from wherever they stand to the starts of an experiment, as the laboratory has them drive before a run.

use crate::attack::{CHASSIS, RADIUS_M};
use crate::fan::{fan, progress};
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Context, Result, anyhow};
use api::experiment::{Experiment, Pose};
use api::lab::Assignment;
use emulator::noise::Noise;
use lab::approach::{TIME_LIMIT_S, is_at_start, left_over, team};
use lab::record::{Command, Record};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Gap around every place: of every second five rides where people would put robots, of the others as narrow as starts may be.
const ROOMY_M: f64 = 0.25;
const TIGHT_M: f64 = 0.03;
const HALF_ARENA_M: [f64; 2] = [2.0, 1.5];
/// Draws before places may be closer.
const ATTEMPTS: u32 = 2000;
const TICK_HZ: f64 = 120.0;
/// Robots come to rest within this after the time is over.
const STOPPING_S: f64 = 2.0;
/// A robot whose start is further from where it stands must have moved.
const FAR_M: f64 = 0.2;

/// What came of one ride.
#[derive(Debug, Clone, PartialEq)]
struct Ride {
    robots_m: f64,
    walls_m: f64,
    /// Time of the ride.
    seconds: f64,
    /// Why robots are carried; none when all are at their starts.
    left: Option<String>,
    moved: bool,
    roomy: bool,
    /// Chassis of every robot, how far it is from its start, m and rad, and whether that counts as there.
    robots: Vec<(&'static str, f64, f64, bool)>,
}

/// Places for robots, so far from each other and from walls; as far as they can be where they are too many for that.
fn places(random: &mut Noise, robots: usize, gap_m: f64) -> Vec<[f64; 3]> {
    let mut gap_m = gap_m;
    loop {
        let reach_m = HALF_ARENA_M.map(|half_m| half_m - RADIUS_M - gap_m);
        let mut found: Vec<[f64; 3]> = Vec::with_capacity(robots);
        for _ in 0..ATTEMPTS {
            let [x, y] = reach_m.map(|reach_m| reach_m * (2.0 * random.uniform() - 1.0));
            let clear = |other: &[f64; 3]| (other[0] - x).hypot(other[1] - y) >= 2.0 * RADIUS_M + gap_m;
            if found.iter().all(clear) {
                found.push([x, y, TAU * (random.uniform() - 0.5)]);
            }
            if found.len() == robots {
                return found;
            }
        }
        gap_m *= 0.9;
    }
}

fn pose([x_m, y_m, yaw_rad]: [f64; 3]) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn ride(number: u64, seed: u64) -> Result<Ride> {
    ride_watched(number, seed, false, |_, _| ())
}

/// Repeats a ride and prints, second by second, each robot's chassis, pose, way to its start, moving target, and what was wanted and sent.
///
/// - Errors: a ride that cannot be set up.
pub fn print(number: u64, seed: u64) -> Result<()> {
    let ride = ride_watched(number, seed, true, |rig, starts| {
        let commands: Vec<Command> = rig
            .records
            .drain(..)
            .filter_map(|record| match record {
                Record::Command(command) => Some(command),
                _ => None,
            })
            .collect();
        for (place, ([x, y, yaw], start)) in rig.poses().into_iter().zip(starts).enumerate() {
            let way_m = (x - start[0]).hypot(y - start[1]);
            let speed = rig.speed_m_per_s(place);
            let newest = commands
                .iter()
                .rev()
                .find(|command| usize::from(command.robot) == place + 1);
            let told = newest.map_or_else(String::new, |command| {
                let ([f, l, r], [sf, sl, sr]) = (command.desired, command.twist);
                let [tx, ty] = command.target_m.unwrap_or_default();
                format!("to ({tx:.2} {ty:.2}) wanted ({f:.2} {l:.2} {r:.2}) sent ({sf:.2} {sl:.2} {sr:.2})")
            });
            println!(
                "{:5.1} s {}: ({x:.2} {y:.2} {:.0}) {way_m:.2} m to go, {speed:.2} m/s, {told}",
                rig.slot() as f64 / TICK_HZ,
                place + 1,
                yaw.to_degrees()
            );
        }
    })?;
    println!("{ride:?}");
    Ok(())
}

fn ride_watched(number: u64, seed: u64, keeps: bool, mut watch: impl FnMut(&mut Rig, &[[f64; 3]])) -> Result<Ride> {
    let mut random = Noise::new(seed, 0x00A9_94AC ^ (number << 24));
    let robots = 2 + (number % 5) as usize;
    let chassis: Vec<&'static str> = (0..robots)
        .map(|_| {
            let at = (random.uniform() * CHASSIS.len() as f64) as usize;
            CHASSIS.get(at).copied().unwrap_or("omni4")
        })
        .collect();
    let roomy = (number / 5).is_multiple_of(2);
    let gap_m = if roomy { ROOMY_M } else { TIGHT_M };
    let standing = places(&mut random, robots, gap_m);
    let starts = places(&mut random, robots, gap_m);
    let stands: Vec<SceneRobot> = standing
        .iter()
        .map(|start| SceneRobot {
            start: *start,
            goal: [start[0], start[1]],
        })
        .collect();
    let scene = Scene::mixed(&chassis, &stands, TIME_LIMIT_S)?;
    let assignment = assignment(&scene, &starts)?;
    let goals: Vec<Option<Pose>> = starts.iter().map(|start| Some(pose(*start))).collect();
    let standing_poses: Vec<Pose> = standing.iter().map(|start| pose(*start)).collect();
    let team = team(&assignment, &standing_poses, &goals).map_err(|why| anyhow!("ride {number}: {why}"))?;
    let settings = RigSettings {
        seed: seed ^ (number << 8),
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    let mut rig = Rig::with_team(&scene, &settings, &scene.scenario()?, team)?;
    rig.keep_records = keeps;
    for _ in 0..(TIME_LIMIT_S + STOPPING_S) as u32 {
        rig.run_for(1.0);
        watch(&mut rig, &starts);
    }
    let ticks = rig.slot();
    let here = rig.poses();
    let placed = chassis.iter().zip(here.iter().zip(&starts));
    let robots: Vec<(&'static str, f64, f64, bool)> = placed
        .map(|(chassis, (here, start))| {
            let off_rad = (here[2] - start[2]).sin().atan2((here[2] - start[2]).cos()).abs();
            let there = is_at_start(&pose(*here), &pose(*start));
            (*chassis, (here[0] - start[0]).hypot(here[1] - start[1]), off_rad, there)
        })
        .collect();
    let at_starts = robots.iter().all(|(.., there)| *there);
    let left = match rig.ended().map(|ending| left_over(ending, ticks)) {
        Some(Ok(None)) if at_starts => None,
        Some(Ok(None)) => Some("they stopped elsewhere".to_owned()),
        Some(Ok(Some(why))) => Some(why),
        Some(Err(ending)) => Some(format!("the run ended: {ending:?}")),
        None => Some("no ending".to_owned()),
    };
    let mut ways = here.iter().zip(&standing).zip(&starts);
    let far = |a: &[f64; 3], b: &[f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let separation = rig.separation();
    Ok(Ride {
        robots_m: separation.robots_m,
        walls_m: separation.walls_m,
        seconds: ticks as f64 / TICK_HZ,
        left,
        moved: ways.any(|((here, stood), start)| far(stood, start) > FAR_M && far(here, stood) > FAR_M),
        roomy,
        robots,
    })
}

/// The experiment as the laboratory gets it: with its own starts.
fn assignment(scene: &Scene, starts: &[[f64; 3]]) -> Result<Assignment> {
    let mut experiment: Experiment = serde_json::from_value(scene.experiment().clone()).context("an experiment")?;
    for (robot, start) in experiment.robots.iter_mut().zip(starts) {
        robot.start = pose(*start);
    }
    Ok(Assignment {
        run_id: Default::default(),
        epoch: 1,
        experiment,
        arena: scene.laboratory.arena.clone(),
        robots: scene.robots()?.into_iter().cloned().collect(),
        models: BTreeMap::new(),
        verdict: serde_json::Value::Null,
        lease_s: 60.0,
    })
}

/// `count` rides of 2 to 6 robots in turn, numbers from `first`.
///
/// - Errors: a ride that cannot be set up.
pub fn run(first: u64, count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let one = |k: u64| {
        let ride = ride(first + k, seed)?;
        if ride.left.is_some() || ride.robots_m.min(ride.walls_m) < 0.0 {
            eprintln!("ride {}: {ride:?}", first + k);
        }
        Ok(ride)
    };
    let rides = fan(count, threads, one, progress("approach", 100, count))?;
    let least = |of: fn(&Ride) -> f64| rides.iter().map(of).fold(f64::INFINITY, f64::min);
    let arrived: Vec<f64> = rides
        .iter()
        .filter(|ride| ride.left.is_none())
        .map(|ride| ride.seconds)
        .collect();
    let there = |roomy: bool| {
        let all = rides.iter().filter(|ride| ride.roomy == roomy);
        (all.clone().filter(|ride| ride.left.is_none()).count(), all.count())
    };
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for why in rides.iter().filter_map(|ride| ride.left.as_deref()) {
        *reasons.entry(why).or_default() += 1;
    }
    let clear = !reasons
        .keys()
        .any(|why| why.contains("no ending") || why.contains("the run ended"));
    let reasons: Vec<String> = reasons.iter().map(|(why, count)| format!("{count} {why}")).collect();
    let moved = rides.iter().filter(|ride| ride.moved).count();
    let longest_s = arrived.iter().copied().fold(0.0, f64::max);
    let mean_s = arrived.iter().sum::<f64>() / (arrived.len() as f64).max(1.0);
    let of_size = |size: usize| {
        let teams = rides.iter().filter(|ride| ride.robots.len() == size);
        let there = teams.clone().filter(|ride| ride.left.is_none()).count();
        format!("{size}: {there}/{}", teams.count())
    };
    let of_chassis = |chassis: &&str| {
        let robots = rides
            .iter()
            .flat_map(|ride| &ride.robots)
            .filter(|(own, ..)| own == chassis);
        let there = robots.clone().filter(|(.., there)| *there).count();
        format!("{chassis} {there}/{}", robots.count())
    };
    let sizes: Vec<String> = (2..=6).map(of_size).collect();
    let kinds: Vec<String> = CHASSIS.iter().map(of_chassis).collect();
    let row = table::rows_of("S5", count, seed);
    // The share is an aim: those that do not arrive are carried.
    let share = |what: &str, (there, of): (usize, usize)| row(what, format!("{there} of {of}"), "aim 95 %", true);
    let (robots_m, walls_m) = (least(|ride| ride.robots_m), least(|ride| ride.walls_m));
    let mm = |least_m: f64| format!("{:.1} mm", 1e3 * least_m);
    Ok(vec![
        share("rides that arrive, 250 mm of room around places", there(true)),
        share("rides that arrive, 30 mm of room", there(false)),
        row(
            "time of those, mean and longest",
            format!("{mean_s:.1} s, {longest_s:.1} s"),
            "<= 60 s",
            longest_s <= TIME_LIMIT_S,
        ),
        row("rides that arrive, by robots", sizes.join(", "), "", true),
        row("robots that arrive, by chassis", kinds.join(", "), "", true),
        row("why the others are carried", reasons.join(", "), "a reason", clear),
        row("least distance between robots", mm(robots_m), "> 0", robots_m > 0.0),
        row("least distance to walls", mm(walls_m), "> 0", walls_m > 0.0),
        row(
            "rides that moved",
            moved.to_string(),
            "90 %",
            moved as f64 >= 0.9 * count as f64,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rides_touch_nothing_and_end_with_a_reason() {
        assert!(table::print(&run(0, 6, 1, 2).expect("rides")));
    }
}
