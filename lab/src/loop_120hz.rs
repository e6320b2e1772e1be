//! The control loop: localisation and telemetry in, commands out, 120 times a second on a thread of its own.
//!
//! It takes no lock, does no input or output except sending on the robot link, and hands everything it knows to the
//! recorder's queue. A tick that was slept through is dropped, not made up for. What a tick does: [`crate::pilot`].

use crate::clock::{monotonic_ns, monotonic_us, wait_until_ns};
use crate::link::HeldPort;
use crate::pilot::{Pilot, PilotRobot, Sink};
use crate::pose_frame::PoseFrame;
use crate::realtime;
use crate::record::{Motion, Record, Telemetry, Tick};
use crate::recorder::RecorderHandle;
use crate::safety::{Ending, Signals};
use crate::schedule::{Due, TICK_HZ, TickSchedule};
use crate::strangers::Strangers;
use crate::voice::Voice;
use control::team::Team;
use std::sync::mpsc::Receiver;

/// Time from the start of the thread to the first tick.
const LEAD_NS: i64 = 20_000_000;
/// A tick that begins later than this after its time gets no new commands; see [`Pilot::overdue`].
const DEADLINE_NS: i64 = 4_000_000;

/// Everything a run's loop owns.
pub struct Setup {
    pub team: Team,
    /// In the order of the experiment.
    pub robots: Vec<PilotRobot>,
    /// Who stands on the floor besides them.
    pub strangers: Strangers,
    /// In the same order.
    pub ports: Vec<HeldPort>,
    pub poses: Receiver<PoseFrame>,
    pub telemetry: Receiver<Telemetry>,
    pub recorder: RecorderHandle,
    /// Signals from outside, read once per tick; must not block.
    pub signals: Box<dyn Fn() -> Signals + Send>,
    pub duration_ticks: i64,
    /// Where in their period ticks should come, as the rest of the time divided by it; anywhere when none.
    pub phase_us: Option<f64>,
    /// Number of the first tick: 0 for the run, negative for what comes before it.
    pub first_tick: i64,
}

/// What is left of a setup when the robots are at rest.
pub struct LoopEnd {
    pub result: LoopResult,
    /// Why the user's own controller could not go on.
    pub fault: Option<String>,
    /// In the order of the experiment.
    pub ports: Vec<HeldPort>,
}

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoopResult {
    pub ending: Ending,
    pub ticks: i64,
    pub missed: i64,
}

/// Runs to the end of the experiment, or to whatever ends it before, and until the wheels are at rest.
pub fn run(setup: Setup) -> LoopEnd {
    let Setup {
        team,
        robots,
        strangers,
        ports,
        poses,
        telemetry,
        mut recorder,
        signals,
        duration_ticks,
        first_tick,
        phase_us,
    } = setup;
    let realtime = realtime::request();
    let start_ns = first_tick_ns(monotonic_ns() + LEAD_NS, phase_us);
    let start_us = start_ns / 1000;
    let mut schedule = TickSchedule::new(start_ns);
    let mut pilot = Pilot::new(team, robots, duration_ticks, start_us)
        .numbered_from(first_tick)
        .among(strangers);
    let mut ports = Voice::new(ports);
    if first_tick >= 0 {
        recorder.push(Record::Motion(Motion { start_us, realtime }));
    }
    let mut ticks = 0;
    loop {
        let due_ns = schedule.due_ns();
        wait_until_ns(due_ns);
        let woke_ns = monotonic_ns();
        let missed_before = schedule.missed();
        let Due { slot, late_ns } = schedule.wake(woke_ns);
        pilot.overdue(overdue_ticks(late_ns, schedule.missed() - missed_before));
        ticks += 1;
        let woke_us = woke_ns / 1000;
        while let Ok(frame) = poses.try_recv() {
            pilot.see(&frame, woke_us, &mut recorder);
        }
        while let Ok(telemetry) = telemetry.try_recv() {
            pilot.hear(telemetry, &mut recorder);
        }
        let ended = pilot.tick(slot, monotonic_us(), signals(), &mut ports, &mut recorder);
        schedule.done(monotonic_ns());
        recorder.push(Record::Tick(Tick {
            tick: first_tick + slot,
            due_us: woke_us - late_ns / 1000,
            woke_us,
            done_us: monotonic_us(),
            missed: schedule.missed(),
            exposure_us: pilot.newest_exposure_us(),
        }));
        if let Some(ending) = ended {
            let missed = schedule.missed();
            return LoopEnd {
                result: LoopResult { ending, ticks, missed },
                fault: pilot.team().fault().map(ToString::to_string),
                ports: ports.into_ports(),
            };
        }
    }
}

/// The first moment from `earliest_ns` on that has the wanted phase.
fn first_tick_ns(earliest_ns: i64, phase_us: Option<f64>) -> i64 {
    let Some(phase_us) = phase_us else { return earliest_ns };
    let period_ns = 1e9 / TICK_HZ as f64;
    let behind_ns = (phase_us * 1e3 - earliest_ns as f64 % period_ns).rem_euclid(period_ns);
    earliest_ns + behind_ns as i64
}

/// Ticks in a row, up to this one, that came too late for new commands: none when it is in time, two when ticks before it
/// were dropped.
fn overdue_ticks(late_ns: i64, dropped: i64) -> u32 {
    match (late_ns > DEADLINE_NS, dropped > 0) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => 2,
    }
}

impl Sink for RecorderHandle {
    fn push(&mut self, record: Record) {
        RecorderHandle::push(self, record);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_tick_has_the_wanted_phase() {
        let period_us = 1e6 / TICK_HZ as f64;
        for earliest_ns in [0, 123_456_789_012_345, 1_000_000_007] {
            let start_ns = first_tick_ns(earliest_ns, Some(2500.0));
            assert!((0..8_333_334).contains(&(start_ns - earliest_ns)));
            let phase_us = start_ns as f64 / 1e3 % period_us;
            assert!((phase_us - 2500.0).abs() < 0.1, "{phase_us}");
        }
        assert_eq!(first_tick_ns(77, None), 77);
    }

    #[test]
    fn a_tick_in_time_gets_new_commands_whatever_was_dropped_before() {
        assert_eq!(overdue_ticks(DEADLINE_NS, 0), 0);
        assert_eq!(overdue_ticks(DEADLINE_NS, 3), 0);
        assert_eq!(overdue_ticks(DEADLINE_NS + 1, 0), 1);
        assert_eq!(overdue_ticks(DEADLINE_NS + 1, 1), 2);
    }
}
