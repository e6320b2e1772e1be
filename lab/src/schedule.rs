//! Which tick is due: a fixed 120 Hz grid. A slot runs once, late if it must be, but never after its successor is due;
//! what was slept through is dropped, not made up for.

/// Control ticks per second.
pub const TICK_HZ: i64 = api::CONTROL_HZ as i64;
/// Least time from the end of a tick to the next one: after a late one the next waits this long.
const LEAST_SPACING_NS: i64 = 1_000_000_000 / TICK_HZ / 2;

/// The tick to run now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Due {
    pub slot: i64,
    /// Start after the slot's time on the grid.
    pub late_ns: i64,
}

/// Slots at `start + k / 120 s`, without accumulated rounding.
#[derive(Debug, Clone)]
pub struct TickSchedule {
    start_ns: i64,
    next_slot: i64,
    earliest_ns: i64,
    missed: i64,
}

impl TickSchedule {
    /// Slot 0 is due at `start_ns`.
    pub const fn new(start_ns: i64) -> Self {
        Self {
            start_ns,
            next_slot: 0,
            earliest_ns: start_ns,
            missed: 0,
        }
    }

    /// When to wake for the next tick.
    pub fn due_ns(&self) -> i64 {
        self.slot_ns(self.next_slot).max(self.earliest_ns)
    }

    /// Slots that were dropped so far.
    pub const fn missed(&self) -> i64 {
        self.missed
    }

    const fn slot_ns(&self, slot: i64) -> i64 {
        self.start_ns + slot * 1_000_000_000 / TICK_HZ
    }

    /// The tick ended now. A tick that was held up in its middle holds up the next one too.
    pub const fn done(&mut self, now_ns: i64) {
        self.earliest_ns = now_ns + LEAST_SPACING_NS;
    }

    /// Takes the slot for a wake-up at `now_ns`, which is not before [`Self::due_ns`].
    pub fn wake(&mut self, now_ns: i64) -> Due {
        let mut slot = ((now_ns - self.start_ns) * TICK_HZ / 1_000_000_000).max(self.next_slot);
        // Integer division may land one slot early when `now` is within a rounding error of the grid.
        if self.slot_ns(slot + 1) <= now_ns {
            slot += 1;
        }
        self.missed += slot - self.next_slot;
        self.next_slot = slot + 1;
        self.done(now_ns);
        Due {
            slot,
            late_ns: now_ns - self.slot_ns(slot),
        }
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
            let Due { slot, late_ns } = schedule.wake(now);
            assert_eq!(now - late_ns, schedule.slot_ns(slot));
            ran.push((slot, now));
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
        // Due at slot 10, woken 30 ms later: slots 10, 11 and 12 are gone, 13 runs 5 ms late.
        assert_eq!(missed, 3);
        assert_eq!((ran[9].0, ran[10].0, ran[11].0), (9, 13, 14));
        assert_eq!((ran[10].1 - ran[9].1) / 1000, 38_333);
    }

    #[test]
    fn a_tick_held_up_in_its_middle_keeps_its_distance_to_the_next() {
        let mut schedule = TickSchedule::new(0);
        let first = schedule.wake(0);
        schedule.done(7 * MS);
        let second = schedule.due_ns();
        assert_eq!((first.slot, second), (0, 7 * MS + LEAST_SPACING_NS));
        assert_eq!(schedule.wake(second).slot, 1);
        schedule.done(second);
        assert_eq!(schedule.due_ns(), schedule.slot_ns(2), "back on the grid");
    }

    #[test]
    fn a_stall_shorter_than_a_slot_drops_nothing() {
        let (ran, missed) = run(100, |k| if k % 10 == 5 { 8 * MS } else { 0 });
        assert_eq!((ran.len(), missed), (100, 0));
        assert!(ran.iter().enumerate().all(|(k, (slot, _))| k as i64 == *slot));
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
