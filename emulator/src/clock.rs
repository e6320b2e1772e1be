//! The host's monotonic clock and the end of the program.

use std::sync::atomic::{AtomicBool, Ordering};

static END: AtomicBool = AtomicBool::new(false);

/// `CLOCK_MONOTONIC` in microseconds: the one clock that all processes of this host share.
#[allow(unsafe_code, reason = "the standard library's Instant does not tell its value")]
pub fn monotonic_us() -> i64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is a valid timespec for the whole call.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
    now.tv_sec * 1_000_000 + now.tv_nsec / 1000
}

/// Sleeps until `deadline_us` of [`monotonic_us`], or shorter when a signal arrives.
#[allow(
    unsafe_code,
    reason = "the standard library has no sleep to an absolute deadline on this clock"
)]
pub fn sleep_until(deadline_us: i64) {
    let deadline = libc::timespec {
        tv_sec: deadline_us.div_euclid(1_000_000),
        tv_nsec: deadline_us.rem_euclid(1_000_000) * 1000,
    };
    // SAFETY: `deadline` is a valid timespec, and a null remainder is allowed.
    unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const deadline,
            std::ptr::null_mut(),
        )
    };
}

/// Makes SIGTERM and SIGINT set the flag that [`end_requested`] reads.
#[allow(unsafe_code, reason = "signal handlers are set through libc")]
pub fn catch_end_signals() {
    extern "C" fn on_signal(_: libc::c_int) {
        END.store(true, Ordering::Relaxed);
    }
    let handler = on_signal as extern "C" fn(libc::c_int) as libc::sighandler_t;
    for signal in [libc::SIGTERM, libc::SIGINT] {
        // SAFETY: the handler only stores to an atomic, which is allowed in a signal handler.
        unsafe { libc::signal(signal, handler) };
    }
}

/// A signal asked the program to end.
pub fn end_requested() -> bool {
    END.load(Ordering::Relaxed)
}
