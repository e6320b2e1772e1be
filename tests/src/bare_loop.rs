//! What the machine itself can do: a loop of 120 Hz that only sleeps, at a real-time priority, beside the laboratory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const HZ: u64 = 120;
/// The priority that the laboratory's loop asks for.
const FIFO_PRIORITY: i32 = 40;

/// Ticks of the bare loop.
#[derive(Debug, Clone, Copy, Default)]
pub struct BareTicks {
    pub ran: u64,
    /// Slots that were slept through.
    pub missed: u64,
}

impl BareTicks {
    /// Share of the slots that ran.
    pub fn share(&self) -> f64 {
        self.ran as f64 / (self.ran + self.missed).max(1) as f64
    }
}

/// Runs until [`BareLoop::finish`].
pub struct BareLoop {
    over: Arc<AtomicBool>,
    thread: JoinHandle<BareTicks>,
}

impl BareLoop {
    pub fn start() -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let seen = over.clone();
        Self {
            over,
            thread: std::thread::spawn(move || run(&seen)),
        }
    }

    pub fn finish(self) -> BareTicks {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or_default()
    }
}

fn run(over: &AtomicBool) -> BareTicks {
    ask_for_punctuality();
    let start = Instant::now();
    let mut ticks = BareTicks::default();
    let mut next = 1;
    while !over.load(Ordering::Relaxed) {
        let due = Duration::from_nanos(next * 1_000_000_000 / HZ);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let slot = ((start.elapsed().as_nanos() * u128::from(HZ)) / 1_000_000_000) as u64;
        ticks.ran += 1;
        ticks.missed += slot.saturating_sub(next);
        next = slot.max(next) + 1;
    }
    ticks
}

/// Without the rights the loop is a plain thread, as the laboratory's then is.
#[allow(unsafe_code)]
fn ask_for_punctuality() {
    let parameter = libc::sched_param {
        sched_priority: FIFO_PRIORITY,
    };
    // SAFETY: pid 0 is the calling thread, and the parameter outlives the call.
    unsafe {
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameter);
    }
}
