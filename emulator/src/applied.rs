//! When each robot's firmware first drove by a command: the far end of the latency budget, for measurements.

use crate::unit::Unit;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A file with a line for each command that a firmware step used: robot, sequence, `CLOCK_MONOTONIC` microseconds.
#[derive(Debug)]
pub struct AppliedLog {
    file: BufWriter<File>,
    last: Vec<u32>,
}

impl AppliedLog {
    /// Makes or replaces the file.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "robot,sequence,applied_us")?;
        Ok(Self { file, last: Vec::new() })
    }

    /// Firmware steps are over.
    pub fn note(&mut self, now_us: i64, units: &[Unit]) -> io::Result<()> {
        self.last.resize(units.len(), 0);
        for (unit, last) in units.iter().zip(&mut self.last) {
            let sequence = unit.firmware().applied_sequence();
            if std::mem::replace(last, sequence) != sequence {
                writeln!(self.file, "{},{sequence},{now_us}", unit.robot().number)?;
            }
        }
        Ok(())
    }

    /// To the disk, for a reader that does not wait for the end.
    pub fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
