//! Tick lateness from the records.

use super::manifest::{BUNCHED_US, TickJitter};
use crate::realtime::Realtime;
use crate::record::Record;

/// Collects lateness while a journal is read.
#[derive(Debug, Default)]
pub struct Punctuality {
    late_us: Vec<i64>,
    work_us: Vec<i64>,
    sleep_us: Vec<i64>,
    last_woke_us: Option<i64>,
    bunched: u64,
    missed: i64,
    realtime: Option<Realtime>,
}

impl Punctuality {
    /// Looks at a record.
    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Motion(motion) => self.realtime = Some(motion.realtime),
            Record::SleepLate(late_us) => self.sleep_us.push(*late_us),
            Record::Tick(tick) => {
                self.late_us.push(tick.woke_us - tick.due_us);
                self.work_us.push(tick.done_us - tick.woke_us);
                let close = self.last_woke_us.is_some_and(|last| tick.woke_us - last < BUNCHED_US);
                self.bunched += u64::from(close);
                self.last_woke_us = Some(tick.woke_us);
                self.missed = tick.missed;
            }
            _ => {}
        }
    }

    /// Ticks seen.
    pub fn ticks(&self) -> i64 {
        self.late_us.len() as i64
    }

    /// Slots dropped by the loop.
    pub const fn missed(&self) -> i64 {
        self.missed
    }

    /// The figures of the manifest.
    pub fn finish(mut self) -> TickJitter {
        TickJitter {
            late_p50_ms: quantile_ms(&mut self.late_us, 0.5),
            late_p99_ms: quantile_ms(&mut self.late_us, 0.99),
            late_max_ms: quantile_ms(&mut self.late_us, 1.0),
            bunched: self.bunched,
            work_p99_ms: quantile_ms(&mut self.work_us, 0.99),
            sleep_samples: self.sleep_us.len() as u64,
            sleep_late_p50_ms: quantile_ms(&mut self.sleep_us, 0.5),
            sleep_late_p99_ms: quantile_ms(&mut self.sleep_us, 0.99),
            sleep_late_max_ms: quantile_ms(&mut self.sleep_us, 1.0),
            realtime: self.realtime,
        }
    }
}

/// The smallest sample that `share` of all samples do not exceed.
fn quantile_ms(samples_us: &mut [i64], share: f64) -> f64 {
    samples_us.sort_unstable();
    let rank = (share * samples_us.len() as f64).ceil() as usize;
    samples_us
        .get(rank.saturating_sub(1))
        .map_or(0.0, |us| *us as f64 * 1e-3)
}
