//! S1: cuts of the link to a robot on the emulated plant. S2: a bursty link and the watchdog alone.

use crate::attack::CHASSIS;
use crate::fan::{fan, progress};
use crate::hostile::Hostile;
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Context, Result};
use control::law::{Demand, Law, Observation};
use emulator::noise::Noise;
use lab::record::Record;
use robot::frame::Command;
use robot::watchdog::{Watchdog, WatchdogSettings, WatchdogState};

/// A count of the robot's clock and one step of its firmware: the latest that a limit is noticed.
const NOTICED_US: i64 = 1000 + 2084;
const RAMP_AFTER_US: i64 = 100_000;
const LATCH_AFTER_US: i64 = 500_000;
/// Deceleration of the body that is promised, on a floor that allows it.
const RAMP_M_PER_S2: f64 = 2.0;
/// Share of friction that is counted on.
const FRICTION_SHARE: f64 = 0.8;
const GRAVITY_M_PER_S2: f64 = 9.81;
/// Of the wheels of the six chassis.
const WHEEL_RADIUS_M: f64 = 0.05;
/// A robot that is slower says nothing about the distance.
const LEAST_M_PER_S: f64 = 0.1;
/// Rollers of omni wheels whose drive stands still roll on for a while.
const REST_M_PER_S: f64 = 0.01;
/// A robot whose fastest rim is hardly faster than itself does not turn.
const STRAIGHT: f64 = 1.1;

#[derive(Debug, Clone, Copy)]
struct Cut {
    ramp_us: i64,
    latch_us: i64,
    distance_m: f64,
    bound_m: f64,
    straight: bool,
    fastest_m_per_s: f64,
    /// 2.5 s after the cut.
    speed_m_per_s: f64,
}

impl Cut {
    fn at_rest(&self) -> bool {
        self.speed_m_per_s < REST_M_PER_S
    }
}

/// What a chassis does by itself.
#[derive(Debug, Clone, Copy)]
struct Nature {
    /// Delay of its answer, straight on and in its sharpest turns.
    straight_s: f64,
    turning_s: f64,
    braking_m_per_s2: f64,
}

impl Nature {
    fn of(chassis: &str) -> Result<Self> {
        let straight_s = answer_s(chassis, BRAKE_M_PER_S, 0.0)?;
        let mut turning_s = straight_s;
        for m_per_s in TURNS_M_PER_S {
            turning_s = turning_s.max(answer_s(chassis, m_per_s, TURNS_RAD_PER_S)?);
        }
        Ok(Self {
            straight_s,
            turning_s,
            braking_m_per_s2: braking_m_per_s2(chassis)?,
        })
    }
}

/// a_b: the ramp, or what four fifths of the floor's friction give to the wheels that brake.
fn braking_m_per_s2(chassis: &str) -> Result<f64> {
    let scene = Scene::mixed(&[chassis], &[AT_THE_MIDDLE], 10.0)?;
    let robot = scene
        .robots()?
        .first()
        .map(|robot| &robot.description)
        .context("no robot")?;
    let wheels = robot.wheels.len() as f64;
    // Omni wheels brake along their own direction only; with the motion along one pair that pair is alone.
    let brakes = |kind: &str| if kind == "omni" { 0.5 } else { 1.0 };
    let driven = robot.wheels.iter().filter(|wheel| wheel.driven);
    let traction_share = driven.map(|wheel| brakes(&wheel.kind)).sum::<f64>() / wheels;
    Ok(RAMP_M_PER_S2.min(FRICTION_SHARE * robot.floor_friction * GRAVITY_M_PER_S2 * traction_share))
}

fn cut(number: u64, seed: u64, natures: &[Nature]) -> Result<Cut> {
    let mut random = Noise::new(seed, 0x0C07 ^ (number << 20));
    let chassis = CHASSIS.get((number % 6) as usize).copied().unwrap_or("omni4");
    let nature = natures.get((number % 6) as usize).copied().context("no such chassis")?;
    let mut draw = |least: f64, most: f64| least + (most - least) * random.uniform();
    let start = [draw(-1.2, 1.2), draw(-0.8, 0.8), draw(-3.1, 3.1)];
    let robot = SceneRobot {
        start,
        goal: [start[0], start[1]],
    };
    let scene = Scene::mixed(&[chassis], &[robot], 10.0)?;
    let genes = std::array::from_fn(|_| draw(0.0, 1.0));
    let cut_s = draw(0.3, 2.5);
    let settings = RigSettings {
        seed: seed ^ number,
        phase: (number % 4) as i64,
        ..RigSettings::default()
    };
    let law = Hostile::new(vec![genes], [4.0, 3.0]);
    let mut rig = Rig::with_law(&scene, &settings, Box::new(law))?;
    rig.keep_records = false;
    rig.run_for(cut_s);
    rig.keep_records = true;
    rig.tick();
    let rim_m_per_s = rig.records.iter().map(rim_m_per_s).fold(0.0, f64::max);
    let asked_m_per_s = rig.records.iter().filter_map(asked_m_per_s).fold(0.0, f64::max);
    rig.keep_records = false;
    rig.up.cut = true;
    // Longer than latch, ramp and the speed loops' tail; frames that were on their way still arrive.
    rig.run_for(2.5);
    let watch = rig.watches().first().copied().context("no robot")?;
    let since = |at_us: Option<i64>| at_us.map_or(i64::MAX, |at_us| at_us - watch.heard_us);
    let straight = rim_m_per_s <= STRAIGHT * watch.fastest_m_per_s;
    let answer_s = if straight { nature.straight_s } else { nature.turning_s };
    // The fastest that the last set-point can make it: a robot that is still speeding up goes on to do so.
    let v = watch.fastest_m_per_s.max(asked_m_per_s);
    Ok(Cut {
        ramp_us: since(watch.ramping_us),
        latch_us: since(watch.latched_us),
        distance_m: watch.travelled_m,
        straight,
        bound_m: v * (0.1 + NOTICED_US as f64 * 1e-6 + answer_s) + v * v / (2.0 * nature.braking_m_per_s2),
        fastest_m_per_s: watch.fastest_m_per_s,
        speed_m_per_s: rig.speed_m_per_s(0),
    })
}

/// A law that drives on for a while, then stands: speed and yaw rate.
#[derive(Debug)]
struct Brake([f64; 2]);

/// Speed straight on, and end of the driving.
const BRAKE_M_PER_S: f64 = 0.5;
const BRAKE_TICK: u64 = 180;
/// Speeds of the turns, and their yaw rate: what the filter allows.
const TURNS_M_PER_S: [f64; 3] = [LEAST_M_PER_S, 0.2, 0.5];
const TURNS_RAD_PER_S: f64 = 3.0;
const AT_THE_MIDDLE: SceneRobot = SceneRobot {
    start: [0.0; 3],
    goal: [0.0; 2],
};

impl Law for Brake {
    fn name(&self) -> &'static str {
        "brake"
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let [forward_m_per_s, yaw_rate_rad_per_s] = if observation.tick < BRAKE_TICK {
            self.0
        } else {
            [0.0; 2]
        };
        for demand in demands {
            demand.twist.forward_m_per_s = forward_m_per_s;
            demand.twist.yaw_rate_rad_per_s = yaw_rate_rad_per_s;
        }
    }
}

/// Time that a chassis takes to answer, measured with the link whole: the way that it goes further than it is told while it
/// comes to rest, over its speed. The link's 3 ms are in it. What is told counts as the robot does it before.
fn answer_s(chassis: &str, m_per_s: f64, rad_per_s: f64) -> Result<f64> {
    // diff2 drives along its x as all do: from the left to the right.
    let start = if rad_per_s == 0.0 {
        [-1.6, 0.0, 0.0]
    } else {
        AT_THE_MIDDLE.start
    };
    let robot = SceneRobot { start, ..AT_THE_MIDDLE };
    let scene = Scene::mixed(&[chassis], &[robot], 10.0)?;
    let law = Box::new(Brake([m_per_s, rad_per_s]));
    let mut rig = Rig::with_law(&scene, &RigSettings::default(), law)?;
    let at = |rig: &Rig| rig.poses().first().copied().unwrap_or_default();
    rig.run_for(BRAKE_TICK as f64 / 120.0);
    let (mut here, speed_m_per_s) = (at(&rig), rig.speed_m_per_s(0));
    let told_m_per_s = rig.records.iter().rev().filter_map(asked_m_per_s).next();
    let told_m_per_s = told_m_per_s.context("no command")?;
    rig.records.clear();
    let mut way_m = 0.0;
    for _ in 0..360 {
        rig.tick();
        let there = at(&rig);
        way_m += (there[0] - here[0]).hypot(there[1] - here[1]);
        here = there;
    }
    let told_m = rig.records.iter().filter_map(asked_m_per_s).sum::<f64>() / 120.0;
    Ok((way_m - told_m * speed_m_per_s / told_m_per_s) / speed_m_per_s)
}

/// Speed of the fastest rim in a record's command.
fn rim_m_per_s(record: &Record) -> f64 {
    match record {
        Record::Command(one) => WHEEL_RADIUS_M * one.wheel_rad_per_s.iter().fold(0.0, |most: f64, w| most.max(w.abs())),
        _ => 0.0,
    }
}

/// Speed of the body that a command asks for; `None` of other records.
fn asked_m_per_s(record: &Record) -> Option<f64> {
    match record {
        Record::Command(one) => Some(one.twist[0].hypot(one.twist[1])),
        _ => None,
    }
}

/// S1, `count` cuts.
///
/// - Errors: a scene that cannot be set up.
pub fn cuts(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let natures = fan(
        6,
        threads,
        |k| Nature::of(CHASSIS.get(k as usize).copied().unwrap_or("omni4")),
        |_| {},
    )?;
    let cuts = fan(
        count,
        threads,
        |number| {
            let cut = cut(number, seed, &natures)?;
            if !cut.at_rest() || (cut.distance_m > cut.bound_m && cut.fastest_m_per_s > LEAST_M_PER_S) {
                eprintln!("cut {number}: {cut:?}");
            }
            Ok(cut)
        },
        progress("link-loss", 1000, count),
    )?;
    let row = table::rows_of("S1", count, seed);
    let span = |of: fn(&Cut) -> i64| {
        let least = cuts.iter().map(of).min().unwrap_or(0);
        (least, cuts.iter().map(of).max().unwrap_or(i64::MAX))
    };
    let timed = |what: &str, (least, most): (i64, i64), limit_us: i64| {
        let allowed = (limit_us - NOTICED_US..=limit_us + NOTICED_US).contains(&most) && least >= limit_us - NOTICED_US;
        let figure = format!("{:.1} to {:.1} ms", least as f64 * 1e-3, most as f64 * 1e-3);
        row(what, figure, &format!("{} +- 3.1 ms", limit_us / 1000), allowed)
    };
    let moving: Vec<&Cut> = cuts.iter().filter(|cut| cut.fastest_m_per_s > LEAST_M_PER_S).collect();
    let share = |straight: bool| {
        let of = moving.iter().filter(|cut| cut.straight || !straight);
        of.map(|cut| cut.distance_m / cut.bound_m).fold(0.0, f64::max)
    };
    let straight = moving.iter().filter(|cut| cut.straight).count();
    let (all, along) = (share(false), share(true));
    let longest_m = moving.iter().map(|cut| cut.distance_m).fold(0.0, f64::max);
    let fastest = moving.iter().map(|cut| cut.fastest_m_per_s).fold(0.0, f64::max);
    let moved = moving.len() as u64;
    let listed = |of: fn(&Nature) -> f64| -> String {
        let each: Vec<String> = natures.iter().map(|nature| format!("{:.2}", of(nature))).collect();
        each.join(" ")
    };
    let answered = |of: fn(&Nature) -> f64| natures.iter().all(|nature| (0.0..0.43).contains(&of(nature)));
    let creeping_m_per_s = cuts.iter().map(|cut| cut.speed_m_per_s).fold(0.0, f64::max);
    let resting = cuts.iter().filter(|cut| cut.at_rest()).count();
    Ok(vec![
        row(
            "answer of the six chassis, link whole",
            format!("{} s", listed(|nature| nature.straight_s)),
            "< 0.43 s",
            answered(|nature| nature.straight_s),
        ),
        row(
            "the same in the sharpest turns",
            format!("{} s", listed(|nature| nature.turning_s)),
            "< 0.43 s",
            answered(|nature| nature.turning_s),
        ),
        timed("last frame to ramp", span(|cut| cut.ramp_us), RAMP_AFTER_US),
        timed("last frame to latch", span(|cut| cut.latch_us), LATCH_AFTER_US),
        row(
            "stopping distance over v (0.1 + answer) + v2/2a, straight",
            format!("{along:.2}, {straight} straight"),
            "<= 1",
            along <= 1.0 && straight > 0,
        ),
        row(
            "the same, all",
            format!("{all:.2}; {:.0} mm, {fastest:.2} m/s, {moved} moved", 1e3 * longest_m),
            "<= 1",
            all <= 1.0 && moved * 4 >= count * 3,
        ),
        row(
            "below 10 mm/s 2.5 s after the cut",
            format!("{resting}, fastest {:.1} mm/s", 1e3 * creeping_m_per_s),
            "99.9 %, 15 mm/s",
            resting as u64 * 1000 >= count * 999 && creeping_m_per_s < 0.015,
        ),
    ])
}

/// Frames a second and the bursty link: 2.4 % of the frames lost in bursts of 42 ms.
const FRAME_HZ: u64 = 120;
const LOSS: f64 = 0.024;
const BURST_FRAMES: f64 = 0.042 * FRAME_HZ as f64;
const HOUR_FRAMES: u64 = 3600 * FRAME_HZ;

#[derive(Debug, Clone, Copy, Default)]
struct Hour {
    lost: u64,
    ramps: u64,
    latches: u64,
    /// Longest from a set-point after a ramp to full speed.
    resume_ms: u32,
    /// Largest change of the set-point, rad/s per ms.
    steepest: f64,
}

fn hour(number: u64, seed: u64) -> Hour {
    let mut random = Noise::new(seed, 0x6E ^ (number << 16));
    let drive = Command {
        enable: true,
        wheel_rad_per_s: [10.0; robot::MAX_MOTORS],
        ..Command::default()
    };
    let clear = Command { clear: true, ..drive };
    let (leave, enter) = (1.0 / BURST_FRAMES, LOSS / (1.0 - LOSS) / BURST_FRAMES);
    let mut watchdog = Watchdog::new(WatchdogSettings::default());
    let (mut bad, mut latched, mut ramping) = (false, true, false);
    let mut resumed_ms: Option<u32> = None;
    let (mut before, mut before_ms) = (0.0, 0);
    let mut out = Hour::default();
    for frame in 0..HOUR_FRAMES {
        let now_ms = (frame * 1000 / FRAME_HZ) as u32;
        bad = random.uniform() >= if bad { leave } else { 1.0 - enter };
        if bad {
            out.lost += 1;
        } else {
            if ramping {
                resumed_ms = Some(now_ms);
            }
            watchdog.accept(if latched { &clear } else { &drive }, 1, now_ms);
        }
        let speed = watchdog.step(now_ms).wheel_rad_per_s.first().copied().unwrap_or(0.0);
        if now_ms > before_ms {
            out.steepest = out.steepest.max((speed - before).abs() / f64::from(now_ms - before_ms));
        }
        (before, before_ms) = (speed, now_ms);
        let state = watchdog.state();
        out.latches += u64::from(state == WatchdogState::Latched && !latched);
        out.ramps += u64::from(state == WatchdogState::Ramping && !ramping);
        latched = state == WatchdogState::Latched;
        ramping = state == WatchdogState::Ramping;
        if ramping || latched {
            resumed_ms = None;
        }
        if let Some(since_ms) = resumed_ms
            && speed >= 10.0 - 1e-9
        {
            out.resume_ms = out.resume_ms.max(now_ms - since_ms);
            resumed_ms = None;
        }
    }
    out
}

/// S2, `count` robot-hours.
///
/// - Errors: none.
pub fn nuisance(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let hours = fan(
        count,
        threads,
        |number| Ok(hour(number, seed)),
        progress("nuisance", 100, count),
    )?;
    let sum = |of: fn(&Hour) -> u64| hours.iter().map(of).sum::<u64>();
    let per_100_h = |events: u64| 100.0 * events as f64 / count as f64;
    let latches = sum(|hour| hour.latches);
    let lost = sum(|hour| hour.lost) as f64 / (count * HOUR_FRAMES) as f64;
    let resume_ms = hours.iter().map(|hour| hour.resume_ms).max().unwrap_or(0);
    let steepest = hours.iter().map(|hour| hour.steepest).fold(0.0, f64::max);
    let row = table::rows_of("S2", count, seed);
    Ok(vec![
        row(
            "latches in 100 robot-hours",
            format!("{:.2} ({latches})", per_100_h(latches)),
            "<= 1",
            per_100_h(latches) <= 1.0,
        ),
        row(
            "ramps in 100 robot-hours, each resumed by itself",
            format!("{:.0}", per_100_h(sum(|hour| hour.ramps))),
            "some",
            sum(|hour| hour.ramps) > 0,
        ),
        row(
            "longest from the next set-point to full speed",
            format!("{resume_ms} ms, {:.1} rad/s2", 1e3 * steepest),
            "<= 1000 ms, 40 rad/s2",
            resume_ms <= 1000 && resume_ms > 0 && steepest <= 0.04 + 1e-9,
        ),
        row(
            "frames lost",
            format!("{:.2} %", 100.0 * lost),
            "2.4 %",
            (lost - LOSS).abs() < 0.002,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixty_cuts_stop_in_time() {
        let rows = cuts(60, 1, 2).expect("cuts");
        assert!(table::print(&rows));
    }

    #[test]
    fn a_hundred_hours_on_a_bursty_link() {
        assert!(table::print(&nuisance(100, 1, 2).expect("hours")));
    }
}
