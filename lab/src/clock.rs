//! The host's monotonic clock, in the numbers the tracker uses, and absolute sleeping.

use libc::{CLOCK_MONOTONIC, TIMER_ABSTIME, timespec};

/// Nanoseconds in a second.
const NS_PER_S: i64 = 1_000_000_000;
/// Tail of a wait that is spun rather than slept: wake-up latency of a timer is of this order.
const SPIN_NS: i64 = 300_000;

/// `CLOCK_MONOTONIC` in nanoseconds.
pub fn monotonic_ns() -> i64 {
    let mut time = timespec { tv_sec: 0, tv_nsec: 0 };
    // The one reason for libc here: `Instant` does not reveal its number, and the tracker speaks in that number.
    #[allow(unsafe_code)]
    // SAFETY: `time` is a valid, exclusively borrowed timespec.
    unsafe {
        libc::clock_gettime(CLOCK_MONOTONIC, &raw mut time);
    }
    time.tv_sec * NS_PER_S + time.tv_nsec
}

/// `CLOCK_MONOTONIC` in microseconds, the unit of the tracker stream and of all records.
pub fn monotonic_us() -> i64 {
    monotonic_ns() / 1000
}

/// Sleeps to shortly before an absolute monotonic time and spins the rest.
pub fn wait_until_ns(deadline_ns: i64) {
    sleep_until_ns(deadline_ns - SPIN_NS);
    while monotonic_ns() < deadline_ns {
        std::hint::spin_loop();
    }
}

fn sleep_until_ns(deadline_ns: i64) {
    while monotonic_ns() < deadline_ns {
        let wake = timespec {
            tv_sec: deadline_ns / NS_PER_S,
            tv_nsec: deadline_ns % NS_PER_S,
        };
        // An absolute deadline does not drift with the time spent before the call, which `thread::sleep` would.
        #[allow(unsafe_code)]
        // SAFETY: `wake` is a valid timespec; the remaining-time pointer may be null.
        unsafe {
            libc::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &raw const wake, std::ptr::null_mut());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_never_end_early() {
        for _ in 0..5 {
            let deadline = monotonic_ns() + 2_000_000;
            wait_until_ns(deadline);
            assert!(monotonic_ns() >= deadline);
        }
    }
}
