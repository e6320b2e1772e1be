//! Which tick is due: a fixed 120 Hz grid on which a late tick is dropped, never made up for.

/// Control ticks per second.
pub const TICK_HZ: i64 = api::CONTROL_HZ as i64;
/// A tick that would start later than this after its slot is dropped; this is also the least distance of two ticks.
const LATEST_START_NS: i64 = 1_000_000_000 / TICK_HZ / 2;

/// What to do after waking up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wake {
    /// Run the tick of this slot; it starts this much late.
    Run { slot: i64, late_ns: i64 },
    /// Too late for the slot: wait for the next one.
    Skip,
}

/// Slots at `start + k / 120 s`, without accumulated rounding.
#[derive(Debug, Clone)]
pub struct TickSchedule {
    start_ns: i64,
    next_slot: i64,
    missed: i64,
}

impl TickSchedule {
    /// Slot 0 is due at `start_ns`.
    pub const fn new(start_ns: i64) -> Self {
        Self {
            start_ns,
            next_slot: 0,
            missed: 0,
        }
    }

    /// When the next slot is due.
    pub const fn due_ns(&self) -> i64 {
        self.slot_ns(self.next_slot)
    }

    /// Slots that were dropped so far.
    pub const fn missed(&self) -> i64 {
        self.missed
    }

    const fn slot_ns(&self, slot: i64) -> i64 {
        self.start_ns + slot * 1_000_000_000 / TICK_HZ
    }

    /// Decides on waking at `now_ns`, which is not before [`Self::due_ns`].
    pub fn wake(&mut self, now_ns: i64) -> Wake {
        let mut slot = ((now_ns - self.start_ns) * TICK_HZ / 1_000_000_000).max(self.next_slot);
        // Integer division may land one slot early when `now` is within a rounding error of the grid.
        if self.slot_ns(slot + 1) <= now_ns {
            slot += 1;
        }
        self.missed += slot - self.next_slot;
        let late_ns = now_ns - self.slot_ns(slot);
        self.next_slot = slot + 1;
        if late_ns > LATEST_START_NS {
            self.missed += 1;
            return Wake::Skip;
        }
        Wake::Run { slot, late_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Drives the schedule in virtual time; `delay_ns(k)` is how late wake-up k is.
    fn run(wake_ups: usize, delay_ns: impl Fn(usize) -> i64) -> (Vec<(i64, i64)>, i64) {
        let mut schedule = TickSchedule::new(5 * MS);
        let mut now = 0;
        let mut ran = Vec::new();
        for k in 0..wake_ups {
            now = schedule.due_ns().max(now) + delay_ns(k);
            if let Wake::Run { slot, late_ns } = schedule.wake(now) {
                assert_eq!(now - late_ns, schedule.slot_ns(slot));
                ran.push((slot, now));
            }
        }
        (ran, schedule.missed())
    }

    #[test]
    fn punctual_wake_ups_run_every_slot() {
        let (ran, missed) = run(1000, |_| 100_000);
        assert_eq!((ran.len(), missed), (1000, 0));
        assert!(ran.iter().enumerate().all(|(k, (slot, _))| k as i64 == *slot));
        assert_eq!(ran[960].1 - ran[0].1, 8_000 * MS);
    }

    #[test]
    fn a_stall_drops_its_slots_and_keeps_the_grid() {
        let (ran, missed) = run(100, |k| if k == 10 { 30 * MS } else { 0 });
        // Due at slot 10, woken 30 ms later: slots 10, 11, 12 and (5 ms late) 13 are gone.
        assert_eq!(missed, 4);
        assert_eq!(ran[9].0, 9);
        assert_eq!(ran[10].0, 14);
    }

    #[test]
    fn late_ticks_are_never_bunched() {
        // A deterministic mess of delays from 0 to 21 ms.
        let (ran, missed) = run(5000, |k| ((k * 7919 + k * k * 31) % 22_000) as i64 * 1000);
        let least = ran.windows(2).map(|pair| pair[1].1 - pair[0].1).min().expect("ticks");
        assert!(least >= 4 * MS, "two ticks {least} ns apart");
        let last = ran.last().expect("ticks").0;
        assert!(missed > 0 && ran.len() as i64 + missed > last);
    }
}
