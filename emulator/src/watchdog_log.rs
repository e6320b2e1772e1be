//! When each robot's watchdog changed its mind, and when it was fed last: for measurements of what robots do without a link.

use crate::unit::Unit;
use robot::watchdog::WatchdogState;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// A file with a line for each change; times are `CLOCK_MONOTONIC` microseconds.
///
/// - `robot`, `state` (`running`, `ramping`, `latched`), `at_us`: after the firmware step of the change.
/// - `fed_us`: after the step that first used the last accepted command.
/// - `step_us`: from the steps before, so much the change may be older than `at_us`.
///
/// Robot 0 with the state `held`: the emulator itself was held up, and nothing is known of so much time before.
#[derive(Debug)]
pub struct WatchdogLog {
    file: File,
    last: Vec<Fed>,
    noted_us: Option<i64>,
}

/// Longer between two steps of 2 ms is not what a robot's own processor would do.
const HELD_US: i64 = 10_000;

#[derive(Debug, Clone, Copy)]
struct Fed {
    epoch: u32,
    sequence: u32,
    at_us: i64,
    state: WatchdogState,
}

impl WatchdogLog {
    /// Makes or replaces the file.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut file = File::create(path)?;
        writeln!(file, "robot,state,at_us,fed_us,step_us")?;
        Ok(Self {
            file,
            last: Vec::new(),
            noted_us: None,
        })
    }

    /// Firmware steps are over. Changes are rare, so each is written at once.
    pub fn note(&mut self, now_us: i64, units: &[Unit]) -> io::Result<()> {
        let unknown = Fed {
            epoch: 0,
            sequence: 0,
            at_us: now_us,
            state: WatchdogState::Latched,
        };
        self.last.resize(units.len(), unknown);
        let step_us = self.noted_us.replace(now_us).map_or(0, |before_us| now_us - before_us);
        if step_us > HELD_US {
            writeln!(self.file, "0,held,{now_us},{now_us},{step_us}")?;
        }
        for (unit, fed) in units.iter().zip(&mut self.last) {
            let firmware = unit.firmware();
            let (epoch, sequence) = (firmware.epoch(), firmware.applied_sequence());
            if (epoch, sequence) != (fed.epoch, fed.sequence) {
                (fed.epoch, fed.sequence, fed.at_us) = (epoch, sequence, now_us);
            }
            let state = firmware.watchdog().state();
            if std::mem::replace(&mut fed.state, state) != state {
                let (number, word, fed_us) = (unit.robot().number, word(state), fed.at_us);
                writeln!(self.file, "{number},{word},{now_us},{fed_us},{step_us}")?;
            }
        }
        Ok(())
    }
}

const fn word(state: WatchdogState) -> &'static str {
    match state {
        WatchdogState::Running => "running",
        WatchdogState::Ramping => "ramping",
        WatchdogState::Latched => "latched",
    }
}
