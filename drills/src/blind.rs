//! S3: the localisation goes blind, or lies.

use crate::attack::CHASSIS;
use crate::fan::{fan, progress};
use crate::hostile::{Hostile, WISH_GENES};
use crate::table::Row;
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::Result;
use emulator::noise::Noise;
use lab::record::Record;

const KINDS: [&str; 5] = ["one robot not seen", "all dark", "frozen", "jump", "swapped"];
/// Asked of each kind, and one tick of the loop, the grain of it.
const ASKED_S: [f64; 5] = [0.1, 0.1, 0.2, 0.1, 0.1];
const TICK_S: f64 = 1.0 / 120.0;
/// Oldest pose that a robot may be driven by.
const OLDEST_US: i64 = 100_000;
/// Share of ticks that come too late for new commands, in every other trial.
const LATE: f64 = 0.2;
const LIE_S: f64 = 0.6;
/// Wheels have turned noticeably.
const TRAVELLED_M: f64 = 0.02;
/// Slower than this a robot is not worth lying about.
const MOVING_M_PER_S: f64 = 0.15;
const ROBOTS: usize = 3;

#[derive(Debug, Clone, Copy)]
struct Trial {
    /// Longest of the robots concerned until its wheels were told to stop; `None`: some never were.
    stop_s: Option<f64>,
    /// Somebody concerned was moving when the lie began.
    moved: bool,
    /// Poses that lie and were believed.
    believed: u64,
    /// Commands to move on a pose that is too old.
    old: u64,
    separation_m: f64,
}

fn rig(kind: usize, number: u64, seed: u64) -> Result<Rig> {
    let mut random = Noise::new(seed, 0x0B11 ^ (number << 20) ^ ((kind as u64) << 50));
    let mut draw = |least: f64, most: f64| least + (most - least) * random.uniform();
    let chassis: Vec<&str> = (0..ROBOTS)
        .map(|_| CHASSIS.get(draw(0.0, 6.0) as usize).copied().unwrap_or("omni4"))
        .collect();
    let columns = [-1.3, 0.0, 1.3];
    let robots: Vec<SceneRobot> = columns
        .iter()
        .map(|x| {
            let start = [x + draw(-0.2, 0.2), draw(-1.0, 1.0), draw(-3.1, 3.1)];
            SceneRobot {
                start,
                goal: [start[0], start[1]],
            }
        })
        .collect();
    let scene = Scene::mixed(&chassis, &robots, 30.0)?;
    let genes: Vec<[f64; WISH_GENES]> = (0..ROBOTS).map(|_| std::array::from_fn(|_| draw(0.0, 1.0))).collect();
    let settings = RigSettings {
        seed: seed ^ number,
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    Rig::with_law(&scene, &settings, Box::new(Hostile::new(genes, [4.0, 3.0])))
}

/// What the laboratory said and believed in one tick.
struct Heard {
    /// Robots whose wheels are told to turn.
    moving: [bool; ROBOTS],
    believed: [bool; ROBOTS],
    old: u64,
}

fn tick(rig: &mut Rig) -> Heard {
    rig.records.clear();
    rig.tick();
    let mut heard = Heard {
        moving: [false; ROBOTS],
        believed: [false; ROBOTS],
        old: 0,
    };
    let place = |number: u8| usize::from(number).wrapping_sub(1);
    for record in &rig.records {
        match record {
            Record::Command(one) => {
                let moves = one.enable && one.wheel_rad_per_s.iter().any(|wheel| wheel.abs() > 1e-9);
                if let Some(moving) = heard.moving.get_mut(place(one.robot)) {
                    *moving = moves;
                }
                heard.old += u64::from(moves && one.pose_age_us > OLDEST_US);
            }
            Record::Pose(one) => {
                if let Some(believed) = heard.believed.get_mut(place(one.robot)) {
                    *believed |= one.accepted;
                }
            }
            _ => {}
        }
    }
    heard
}

fn lie(rig: &mut Rig, kind: usize, victim: usize, random: &mut Noise) -> [bool; ROBOTS] {
    let number = victim as u16 + 1;
    let lies = &mut rig.light.lies;
    let mut concerned = [kind == 1 || kind == 2; ROBOTS];
    concerned[victim] = true;
    match kind {
        0 => lies.hidden = Some(number),
        1 => lies.dark = true,
        2 => lies.frozen = true,
        3 => {
            let (angle, far_m) = (std::f64::consts::TAU * random.uniform(), 0.3 + 0.7 * random.uniform());
            lies.jump = Some((number, [far_m * angle.cos(), far_m * angle.sin()]));
        }
        _ => {
            let other = (victim + 1) % ROBOTS;
            lies.swapped = Some([number, other as u16 + 1]);
            concerned[other] = true;
        }
    }
    concerned
}

fn trial(kind: usize, number: u64, seed: u64) -> Result<Trial> {
    let mut rig = rig(kind, number, seed)?;
    let mut random = Noise::new(seed, 0x0071_C1E5 ^ (number << 20));
    let warm_ticks = 30 + (90.0 * random.uniform()) as usize;
    let victim = (number % ROBOTS as u64) as usize;
    let mut ticks = 0;
    // From the drawn moment on, as soon as the robot moves.
    while ticks < 400 && (ticks < warm_ticks || rig.speed_m_per_s(victim) < MOVING_M_PER_S) {
        tick(&mut rig);
        ticks += 1;
    }
    let moved = rig.speed_m_per_s(victim) >= MOVING_M_PER_S;
    let concerned = lie(&mut rig, kind, victim, &mut random);
    let begin_us = rig.now_us();
    let mut since_s: [Option<f64>; ROBOTS] = [(kind != 2).then_some(0.0); ROBOTS];
    let mut travelled_m = [0.0; ROBOTS];
    let mut stopped_s: [Option<f64>; ROBOTS] = [None; ROBOTS];
    let (mut believed, mut old, mut late) = (0, 0, false);
    while ((rig.now_us() - begin_us) as f64) * 1e-6 < LIE_S {
        let now_s = (rig.now_us() - begin_us) as f64 * 1e-6;
        // Two in a row would stop all robots, seen or not.
        late = number % 2 == 1 && !late && random.uniform() < LATE;
        if late {
            rig.pilot_mut().overdue(1);
        }
        let heard = tick(&mut rig);
        old += heard.old;
        for robot in 0..ROBOTS {
            travelled_m[robot] += rig.speed_m_per_s(robot) * TICK_S;
            if travelled_m[robot] > TRAVELLED_M && since_s[robot].is_none() {
                since_s[robot] = Some(now_s + TICK_S);
            }
            if !heard.moving[robot] && since_s[robot].is_some_and(|since_s| now_s >= since_s) {
                stopped_s[robot].get_or_insert(now_s);
            }
            // Pictures from before the lie are on their way for a tick or two.
            let lying = concerned[robot] && now_s > 3.0 * TICK_S;
            believed += u64::from(lying && kind > 2 && heard.believed[robot]);
        }
    }
    let waited = |robot: usize| match (since_s[robot], stopped_s[robot]) {
        (Some(since_s), Some(at_s)) => Some(at_s - since_s),
        // It did not move enough for anybody to notice.
        (None, _) => Some(0.0),
        // It moved so late that the lie ended before the time to notice it.
        (Some(since_s), None) if since_s + ASKED_S[kind] > LIE_S => Some(0.0),
        (Some(_), None) => None,
    };
    let waits: Option<Vec<f64>> = (0..ROBOTS).filter(|robot| concerned[*robot]).map(waited).collect();
    let separation = rig.separation();
    Ok(Trial {
        stop_s: waits.map(|waits| waits.into_iter().fold(0.0, f64::max)),
        moved,
        believed,
        old,
        separation_m: separation.robots_m.min(separation.walls_m),
    })
}

/// `count` trials of each kind.
///
/// - Errors: a scene that cannot be set up.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut separation_m = f64::INFINITY;
    for (kind, (name, asked_s)) in KINDS.iter().zip(ASKED_S).enumerate() {
        let trials = fan(
            count,
            threads,
            |number| trial(kind, number, seed),
            progress(name, 500, count),
        )?;
        let longest_s = trials
            .iter()
            .map(|trial| trial.stop_s.unwrap_or(f64::INFINITY))
            .fold(0.0, f64::max);
        let late = trials
            .iter()
            .filter(|trial| trial.stop_s.is_none_or(|stop_s| stop_s > asked_s + TICK_S + 1e-6));
        let late = late.count();
        let moved = trials.iter().filter(|trial| trial.moved).count();
        let believed = trials.iter().filter(|trial| trial.believed > 0).count();
        let old = trials.iter().filter(|trial| trial.old > 0).count();
        separation_m = trials
            .iter()
            .map(|trial| trial.separation_m)
            .fold(separation_m, f64::min);
        rows.push(Row {
            name: "S3",
            what: format!("{name}: longest to stop"),
            count,
            seed,
            figure: format!(
                "{:.0} ms, {late} late, {moved} moved, {believed} believed, {old} on old poses",
                1e3 * longest_s
            ),
            asked: format!("<= {:.0} ms + tick, 0 believed, 0 old", 1e3 * asked_s),
            holds: late == 0 && believed == 0 && old == 0 && moved as u64 * 2 >= count,
        });
    }
    rows.push(Row {
        name: "S3",
        what: "least distance of all kinds".to_owned(),
        count: count * KINDS.len() as u64,
        seed,
        figure: format!("{:.1} mm", 1e3 * separation_m),
        asked: "> 0".to_owned(),
        holds: separation_m > 0.0,
    });
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table;

    #[test]
    fn eight_lies_of_each_kind_stop_the_robots() {
        assert!(table::print(&run(8, 1, 2).expect("trials")));
    }
}
