//! S14: what the laboratory makes of robots whose battery runs down, whose wheels are held and whose gyro lies.

use crate::fan::{fan, progress};
use crate::hostile::{Hostile, WISH_GENES};
use crate::rig::Report;
use crate::table::{self, Row};
use crate::{Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Context, Result, ensure};
use emulator::faults::{FaultKind, FaultRequest};
use emulator::hidden::{Hidden, HiddenRobot};
use emulator::noise::Noise;
use lab::ladder::{Consequence, Finding, RELEASE_US};
use lab::safety::Ending;

/// Length of a trace, and of the time before its faults.
const TRACE_S: f64 = 30.0;
const BEFORE_S: f64 = 1.0;
/// A pair of faults is known, and the run over, within this.
const KNOWN_S: f64 = 12.0;
/// Robots come to rest within this once the run is to end.
const STOPPING_S: f64 = 2.0;
const TICK_HZ: f64 = 120.0;
/// Two reports of a robot may be this far apart.
const REPORT_US: i64 = 200_000;
const WELL_CHARGE: f64 = 0.6;
/// No gyro shows as much.
const GYRO_LIES_RAD_PER_S: f64 = 99.0;
/// Chassis that the law drives straight at walls, where a held wheel is driven hard.
const CHASSIS: [&str; 2] = ["diff2", "omni4"];

/// A fault that the plant can have, in rising severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    Low,
    Critical,
    Held,
    Gyro,
    Empty,
}

impl Fault {
    const ALL: [Self; 5] = [Self::Low, Self::Critical, Self::Held, Self::Gyro, Self::Empty];

    /// Written down by hand: what the ladder is to call it, and what is to follow.
    fn is_known_as(self) -> (Finding, Consequence) {
        match self {
            Self::Low => (Finding::BatteryLow, Consequence::NoNewRun),
            Self::Critical => (Finding::BatteryCritical, Consequence::EndRun),
            Self::Held => (Finding::Stalled, Consequence::Stop),
            Self::Gyro => (Finding::SensorFault, Consequence::Stop),
            Self::Empty => (Finding::BatteryEmpty, Consequence::Stop),
        }
    }

    fn begin(self, rig: &mut Rig, number: u8) -> Result<()> {
        let kind = match self {
            Self::Low => FaultKind::LowBattery { charge: 0.125 },
            Self::Critical => FaultKind::LowBattery { charge: 0.09 },
            Self::Empty => FaultKind::LowBattery { charge: 0.0 },
            Self::Held => FaultKind::StuckWheel { wheel: 0 },
            // From the beginning on; see `rig`.
            Self::Gyro => return Ok(()),
        };
        Ok(rig.laboratory.set_fault(FaultRequest { number, kind })?)
    }
}

/// Two robots side by side that drive to and fro, as fast as they may.
///
/// - `gyro_lies`: of which robots.
fn rig(seed: u64, gyro_lies: [bool; 2]) -> Result<Rig> {
    let mut random = Noise::new(seed, 0x1ADD_E201);
    let places = [[-1.2, -0.7, 0.0], [-1.2, 0.7, 0.0]].map(|start| SceneRobot {
        start,
        goal: [start[0], start[1]],
    });
    let scene = Scene::mixed(&CHASSIS, &places, 2.0 * TRACE_S)?;
    let mut hidden = Hidden::neutral();
    for (lies, (number, chassis)) in gyro_lies.iter().zip((1..).zip(CHASSIS)) {
        let robot = HiddenRobot {
            gyro_bias_rad_per_s: if *lies { GYRO_LIES_RAD_PER_S } else { 0.0 },
            ..HiddenRobot::default()
        };
        hidden.robots.insert(format!("{chassis}-{number:02}"), robot);
    }
    let settings = RigSettings {
        seed,
        hidden,
        health: true,
        ..RigSettings::default()
    };
    // At the walls left and right in turn.
    let genes: [f64; WISH_GENES] = [0.05, 0.5, 0.9, random.uniform(), 0.5, 0.2, 0.55];
    let arena = &scene.laboratory.arena;
    let law = Hostile::new(vec![genes; 2], [arena.width_m, arena.height_m]).at_walls();
    let mut rig = Rig::with_law(&scene, &settings, Box::new(law))?;
    rig.keep_records = false;
    Ok(rig)
}

/// The ladder as it should be, from all reports of a robot so far: the gravest of those that are not yet old.
fn as_it_should_be(reports: &[Report], at: usize) -> Option<Finding> {
    let now = reports.get(at)?;
    let own = reports.iter().take(at + 1).filter(|report| report.place == now.place);
    let recent = own.filter(|report| now.at_us - report.at_us < RELEASE_US);
    recent.map(|report| report.findings.gravest()).max()
}

/// What came of a trace or a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Judged {
    reports: u64,
    /// Reports after which the ladder was not as it should be.
    wrong: u64,
    /// Findings dropped before they had been away for long enough.
    early: u64,
    /// Times that the ladder went up, and down.
    up: u64,
    down: u64,
    /// Runs that did not end as the gravest finding of the moment asks.
    ending: u64,
    ended: bool,
}

fn judge(rig: &Rig) -> Result<Judged> {
    let reports = &rig.ward.as_ref().context("a ward")?.reports;
    let mut judged = Judged::default();
    let mut before = [Finding::Fine; 2];
    for (at, report) in reports.iter().enumerate() {
        judged.reports += 1;
        judged.wrong += u64::from(as_it_should_be(reports, at) != Some(report.held.gravest));
        let before = before.get_mut(report.place).context("a place")?;
        if report.held.gravest > *before {
            judged.up += 1;
        } else if report.held.gravest < *before {
            judged.down += 1;
            let own = reports.iter().take(at).filter(|other| other.place == report.place);
            let last = own
                .filter(|other| other.findings.gravest() >= *before)
                .map(|other| other.at_us)
                .max();
            let away_us = last.map_or(0, |last| report.at_us - last);
            judged.early += u64::from(away_us < RELEASE_US - REPORT_US);
        }
        *before = report.held.gravest;
    }
    Ok(judged)
}

/// Drives until the run ends, at most for `seconds`, and says whether the end is what the findings of that tick ask for: a grave one ends
/// the run as soon as all rest, nothing else does.
fn drive(rig: &mut Rig, seconds: f64) -> bool {
    let least = (seconds * TICK_HZ) as u32;
    for tick in 0..least + (STOPPING_S * TICK_HZ) as u32 {
        let told = rig.signals.robot_finding;
        let grave = told.is_some_and(|(_, finding)| finding.consequence() >= Consequence::EndRun);
        if tick >= least && !grave {
            return true;
        }
        rig.tick();
        match rig.ended() {
            Some(Ending::RobotUnfit(_, finding)) => return grave && finding.consequence() >= Consequence::EndRun,
            Some(_) => return false,
            None => {}
        }
    }
    false
}

/// A random trace: charges that hover about the thresholds, wheels that are held for a while, and all well again at the end.
fn trace(number: u64, seed: u64) -> Result<Judged> {
    let mut random = Noise::new(seed, 0x1ADD_E202 ^ (number << 24));
    let mut rig = rig(seed ^ (number << 8), [false; 2])?;
    rig.run_for(BEFORE_S);
    let mut runs = true;
    let mut held = [false; 2];
    let mut ending = 0;
    for _ in 0..(TRACE_S / 0.5) as u32 {
        for robot in 0..2_u8 {
            let number = robot + 1;
            let mut fault = |kind| rig.laboratory.set_fault(FaultRequest { number, kind });
            if random.uniform() < 0.3 {
                // 0.15, 0.10 and 0.055 are the thresholds.
                let about = [0.152, 0.102, 0.058, 0.16, WELL_CHARGE];
                let middle = about
                    .get((random.uniform() * 5.0) as usize)
                    .copied()
                    .unwrap_or(WELL_CHARGE);
                fault(FaultKind::LowBattery {
                    charge: middle + 0.01 * (random.uniform() - 0.5),
                })?;
            }
            if let Some(held) = held.get_mut(usize::from(robot))
                && random.uniform() < 0.1
            {
                *held = !*held;
                fault(if *held {
                    FaultKind::StuckWheel { wheel: 0 }
                } else {
                    FaultKind::None
                })?;
            }
        }
        if runs {
            ending += u64::from(!drive(&mut rig, 0.5));
            runs = rig.ended().is_none();
        } else {
            rig.idle_for(0.5);
        }
    }
    for number in [1, 2] {
        for kind in [FaultKind::None, FaultKind::LowBattery { charge: WELL_CHARGE }] {
            rig.laboratory.set_fault(FaultRequest { number, kind })?;
        }
    }
    // A robot leaves its levels one after the other, 1 s each; a finding is held for 5 s.
    rig.idle_for(15.0);
    let judged = judge(&rig)?;
    Ok(Judged {
        ending: ending + u64::from(rig.ward.as_ref().and_then(crate::rig::Ward::finding).is_some()),
        ended: !runs,
        ..judged
    })
}

/// Two faults at the same moment: of robot 1 both, or of both robots one each.
fn pair(one: Fault, two: Fault, apart: bool, seed: u64) -> Result<Judged> {
    let lies = if apart {
        [one == Fault::Gyro, two == Fault::Gyro]
    } else {
        [one == Fault::Gyro || two == Fault::Gyro, false]
    };
    let mut rig = rig(seed, lies)?;
    if lies == [false; 2] {
        rig.run_for(BEFORE_S);
    }
    // A battery has one charge: the lower of two.
    let (first, second) = (one.min(two), one.max(two));
    if apart {
        one.begin(&mut rig, 1)?;
        two.begin(&mut rig, 2)?;
    } else {
        first.begin(&mut rig, 1)?;
        second.begin(&mut rig, 1)?;
    }
    let well = drive(&mut rig, KNOWN_S);
    // A robot that stands cannot show a held wheel; those that go on driving do, in the same time.
    if rig.ended().is_some() {
        rig.idle_for(4.0);
    }
    let told = rig
        .ward
        .as_ref()
        .and_then(crate::rig::Ward::finding)
        .map(|(_, finding)| finding);
    let (gravest, consequence) = second.is_known_as();
    let (lesser, _) = first.is_known_as();
    // What ends the run at once keeps a wheel from being driven against its holder: then the other one alone is known.
    let masked = second == Fault::Held && first == Fault::Critical;
    let named = told == Some(gravest) || (masked && told == Some(lesser));
    let ended = matches!(rig.ended(), Some(Ending::RobotUnfit(..)));
    let as_asked = ended == (consequence >= Consequence::EndRun);
    let judged = judge(&rig)?;
    if !(well && named && as_asked) {
        eprintln!("{one:?} and {two:?}, apart {apart}: {told:?}, {:?}", rig.ended());
    }
    Ok(Judged {
        ending: u64::from(!(well && named && as_asked)),
        ended,
        ..judged
    })
}

/// `count` traces, and all pairs of faults.
///
/// - Errors: a rig that cannot be set up.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let traces = fan(
        count,
        threads,
        |number| trace(number, seed),
        progress("ladder", 20, count),
    )?;
    let mut pairs = Vec::new();
    for (k, one) in Fault::ALL.into_iter().enumerate() {
        for two in Fault::ALL {
            pairs.push((one, two, true));
        }
        for two in Fault::ALL.into_iter().skip(k + 1) {
            // A wheel is held against a drive, and a robot whose gyro lies does not drive.
            if !(one == Fault::Held && two == Fault::Gyro) {
                pairs.push((one, two, false));
            }
        }
    }
    let of_pair = |k: u64| {
        let (one, two, apart) = *pairs.get(k as usize).context("a pair")?;
        pair(one, two, apart, seed ^ (k << 16))
    };
    let paired = fan(pairs.len() as u64, threads, of_pair, |_| {})?;
    ensure!(!traces.is_empty(), "no traces");
    let sum = |of: fn(&Judged) -> u64, all: &[Judged]| all.iter().map(of).sum::<u64>();
    let both = |of: fn(&Judged) -> u64| sum(of, &traces) + sum(of, &paired);
    let row = |what: &str, count: u64, figure: String, asked: &str, holds: bool| {
        table::rows_of("S14", count, seed)(what, figure, asked, holds)
    };
    let ended = traces.iter().filter(|trace| trace.ended).count() as u64;
    let none = |what: &str, count: u64, number: u64| row(what, count, number.to_string(), "0", number == 0);
    Ok(vec![
        none(
            "reports after which not the gravest counted",
            both(|one| one.reports),
            both(|one| one.wrong),
        ),
        none(
            "findings dropped before 5 s without them",
            both(|one| one.down),
            both(|one| one.early),
        ),
        none(
            "traces that ended or went on wrongly",
            count,
            sum(|one| one.ending, &traces),
        ),
        none(
            "pairs of faults, wrong finding or consequence",
            paired.len() as u64,
            sum(|one| one.ending, &paired),
        ),
        row(
            "traces: findings came / went / runs ended",
            count,
            format!(
                "{} / {} / {ended}",
                sum(|one| one.up, &traces),
                sum(|one| one.down, &traces)
            ),
            "two of each a trace",
            sum(|one| one.up, &traces) >= 2 * count && sum(|one| one.down, &traces) >= 2 * count && ended > 0,
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_traces_and_all_pairs_climb_the_ladder_as_asked() {
        assert!(table::print(&run(4, 1, 2).expect("traces")));
    }
}
