//! Asking the kernel for punctuality. Everything here is optional: without the rights the loop runs as a plain thread.

/// Priority of the control loop among real-time threads; below kernel threads, above everything of ours.
const FIFO_PRIORITY: i32 = 40;
/// Wake-ups may be batched by the kernel within this slack; the default is 50 microseconds.
const TIMER_SLACK_NS: libc::c_ulong = 1000;

/// What the kernel granted to the calling thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Realtime {
    /// `SCHED_FIFO` is on.
    pub fifo: bool,
    /// Present pages are locked in memory.
    pub locked: bool,
}

/// Asks for `SCHED_FIFO`, small timer slack and locked memory for the calling thread.
pub fn request() -> Realtime {
    let parameter = libc::sched_param {
        sched_priority: FIFO_PRIORITY,
    };
    #[allow(unsafe_code)]
    // SAFETY: pid 0 is the calling thread; the parameter outlives the call; mlockall without MCL_FUTURE
    // cannot make later allocations fail.
    unsafe {
        libc::prctl(libc::PR_SET_TIMERSLACK, TIMER_SLACK_NS, 0, 0, 0);
        Realtime {
            fifo: libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameter) == 0,
            locked: libc::mlockall(libc::MCL_CURRENT) == 0,
        }
    }
}
