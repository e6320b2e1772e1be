//! A robot's millisecond clock on the host's clock, from frames that carry the sender's clock and echo the peer's.
//!
//! A telemetry frame was sent after the command it echoes was sent and before it arrived. Each frame therefore
//! bounds the offset from both sides; the tightest bounds of the last seconds give an estimate and its error.

/// Bounds are collected in buckets so that old ones can go: drift of 100 ppm is 0.5 ms over the window.
const BUCKETS: usize = 10;
const BUCKET_US: i64 = 500_000;
/// One count of a millisecond clock.
const COUNT_US: i64 = 1000;

#[derive(Debug, Clone, Copy)]
struct Bounds {
    number: i64,
    lower_us: i64,
    upper_us: i64,
}

const EMPTY: Bounds = Bounds {
    number: i64::MIN,
    lower_us: i64::MIN,
    upper_us: i64::MAX,
};

/// See the module.
#[derive(Debug, Clone)]
pub struct ClockMap {
    buckets: [Bounds; BUCKETS],
    /// Robot clock with its wraps undone.
    robot_ms: i64,
    heard: bool,
}

/// A robot's moment on the host's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MappedTime {
    pub at_us: i64,
    /// The truth lies within this distance.
    pub bound_us: i64,
}

/// The clock field of a frame sent at this moment.
pub const fn link_clock_ms(now_us: i64) -> u32 {
    (now_us / COUNT_US) as u32
}

impl Default for ClockMap {
    fn default() -> Self {
        Self {
            buckets: [EMPTY; BUCKETS],
            robot_ms: 0,
            heard: false,
        }
    }
}

impl ClockMap {
    /// Takes the clocks of one telemetry frame and places its sending time on the host's clock.
    ///
    /// - `robot_clock_ms`, `echo_ms`: as in the frame; an echo of 0 means that the robot heard nothing yet.
    pub fn observe(&mut self, robot_clock_ms: u32, echo_ms: u32, arrival_us: i64) -> MappedTime {
        let step_ms = i64::from(robot_clock_ms.wrapping_sub(self.robot_ms as u32) as i32);
        if !self.heard || step_ms.abs() > 10_000 {
            // First frame, or a robot that was switched off and on.
            *self = Self {
                robot_ms: i64::from(robot_clock_ms),
                heard: true,
                ..Self::default()
            };
        } else {
            self.robot_ms += step_ms;
        }
        let robot_us = self.robot_ms * COUNT_US;
        let upper_us = arrival_us - robot_us;
        let lower_us = echoed_us(echo_ms, arrival_us).map(|sent_us| sent_us - robot_us - COUNT_US);
        self.store(arrival_us, lower_us, upper_us);
        self.map(robot_us, arrival_us)
    }

    fn store(&mut self, arrival_us: i64, lower_us: Option<i64>, upper_us: i64) {
        let number = arrival_us / BUCKET_US;
        let place = number.rem_euclid(BUCKETS as i64) as usize;
        if let Some(bucket) = self.buckets.get_mut(place) {
            if bucket.number != number {
                *bucket = Bounds { number, ..EMPTY };
            }
            bucket.upper_us = bucket.upper_us.min(upper_us);
            bucket.lower_us = bucket.lower_us.max(lower_us.unwrap_or(i64::MIN));
        }
    }

    fn map(&self, robot_us: i64, arrival_us: i64) -> MappedTime {
        let oldest = arrival_us / BUCKET_US - BUCKETS as i64;
        let live = || self.buckets.iter().filter(|bucket| bucket.number > oldest);
        let upper_us = live().map(|bucket| bucket.upper_us).min().unwrap_or(i64::MAX);
        let lower_us = live().map(|bucket| bucket.lower_us).max().unwrap_or(i64::MIN);
        if lower_us == i64::MIN {
            // Nothing bounds the link delay yet: the arrival is the best guess.
            return MappedTime {
                at_us: arrival_us,
                bound_us: i64::MAX,
            };
        }
        // Drift inside the window can cross the bounds by a fraction of a millisecond.
        let (lower_us, upper_us) = (lower_us.min(upper_us), upper_us);
        let offset_us = lower_us + (upper_us - lower_us) / 2;
        MappedTime {
            at_us: (robot_us + offset_us).min(arrival_us),
            bound_us: (upper_us - lower_us) / 2,
        }
    }
}

/// Host time of the echoed count: the newest moment before `arrival_us` with these low bits.
fn echoed_us(echo_ms: u32, arrival_us: i64) -> Option<i64> {
    let age_ms = link_clock_ms(arrival_us).wrapping_sub(echo_ms);
    (echo_ms != 0 && age_ms < 2000).then(|| (arrival_us / COUNT_US - i64::from(age_ms)) * COUNT_US)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_holds_on_a_lopsided_link_with_drift() {
        let mut map = ClockMap::default();
        // Robot clock runs 100 ppm fast, starts near its wrap; 3 ms to the robot, 5..9 ms back.
        let robot_count_us = |host_us: i64| (host_us - 7_000_000) + (host_us - 7_000_000) / 10_000 + 4_294_965_000_000;
        let mut tight = 0;
        for k in 0..2000_i64 {
            let sample_us = 50_000_000 + k * 8333;
            let clock_ms = (robot_count_us(sample_us) / 1000) as u32;
            let echo_ms = link_clock_ms(sample_us - 3000 - (k * 1237) % 8333);
            let mapped = map.observe(clock_ms, echo_ms, sample_us + 5000 + (k * 977) % 4000);
            assert!(
                (mapped.at_us - sample_us).abs() <= mapped.bound_us.saturating_add(1500),
                "{k}: {mapped:?} {sample_us}"
            );
            tight += i64::from(mapped.bound_us < 6000);
        }
        assert!(tight > 1900, "only {tight} tight estimates");
    }

    #[test]
    fn a_robot_restart_starts_over() {
        let mut map = ClockMap::default();
        map.observe(900_000, 990, 1_000_000);
        let mapped = map.observe(5, 1990, 2_000_000);
        assert!(mapped.at_us <= 2_000_000 && mapped.at_us > 1_980_000);
    }
}
