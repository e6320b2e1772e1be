//! Offset between the clocks of the two ends of a link, with a bound that holds for any split of the round trip.
//!
//! Every frame carries its sender's clock `L` and echoes our clock `E` of the last frame that the sender had received.
//! It arrives at our time `A`. The sender read its clock after we read `E` and before we read `A`, so with whole
//! milliseconds on both sides `L - A - 1 <= offset <= L - E + 1` (offset = peer clock - local clock). The estimator keeps the
//! intersection of these intervals and widens it by the largest drift as time passes: no assumption of symmetry.

/// Most that two quartz clocks drift apart, parts per million, with a factor of two in hand.
const DRIFT_PPM: i64 = 200;
/// Echoes and estimates older than this are not used.
pub const MAX_AGE_MS: u32 = 2000;
/// An estimate with a larger bound is not used.
pub const MAX_BOUND_US: i64 = 15_000;
const RESOLUTION_US: i64 = 1000;

/// Estimator of peer clock minus local clock; both are millisecond counters that wrap around.
#[derive(Debug, Clone, Copy, Default)]
pub struct ClockOffset {
    interval: Option<Interval>,
}

#[derive(Debug, Clone, Copy)]
struct Interval {
    /// Peer minus local clock (modulo 2^32) that the ends are relative to.
    reference_ms: u32,
    low_us: i64,
    high_us: i64,
    updated_local_ms: u32,
}

/// Age of a received time stamp: it lies within `estimate_ms` +- `bound_ms`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Age {
    pub estimate_ms: f64,
    pub bound_ms: f64,
}

impl Age {
    /// The age is certainly not larger.
    pub fn largest_ms(&self) -> f64 {
        self.estimate_ms + self.bound_ms
    }
}

/// The clocks that meet when a frame arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockSample {
    /// Local clock on arrival.
    pub local_ms: u32,
    /// `clock_ms` of the frame.
    pub peer_ms: u32,
    /// `echo_ms` of the frame: our own clock, seen by the peer; 0 = it has not heard us yet.
    pub echo_ms: u32,
}

impl ClockOffset {
    /// Takes the clocks of a frame. Frames out of order must not come here; a frame that was merely slow may.
    ///
    /// A sample that contradicts the interval means that the peer's clock was set anew; the estimate starts over.
    pub fn observe(&mut self, sample: ClockSample) {
        let round_trip_ms = sample.local_ms.wrapping_sub(sample.echo_ms);
        if sample.echo_ms == 0 || round_trip_ms > MAX_AGE_MS {
            return;
        }
        let reference_ms = self
            .interval
            .map_or(sample.peer_ms.wrapping_sub(sample.local_ms), |interval| {
                interval.reference_ms
            });
        let relative_us = |local_ms: u32| {
            1000 * i64::from(
                sample
                    .peer_ms
                    .wrapping_sub(local_ms)
                    .wrapping_sub(reference_ms)
                    .cast_signed(),
            )
        };
        let new = Interval {
            reference_ms,
            low_us: relative_us(sample.local_ms) - RESOLUTION_US,
            high_us: relative_us(sample.echo_ms) + RESOLUTION_US,
            updated_local_ms: sample.local_ms,
        };
        self.interval = Some(match self.at(sample.local_ms) {
            Some(old) if old.low_us <= new.high_us && new.low_us <= old.high_us => Interval {
                low_us: old.low_us.max(new.low_us),
                high_us: old.high_us.min(new.high_us),
                ..new
            },
            _ => new,
        });
    }

    /// Forgets everything, for a peer that may have restarted.
    pub fn reset(&mut self) {
        self.interval = None;
    }

    /// Half the width of the interval now; `None` without a sample in the last [`MAX_AGE_MS`].
    pub fn bound_ms(&self, local_ms: u32) -> Option<f64> {
        self.at(local_ms)
            .map(|interval| (interval.high_us - interval.low_us) as f64 / 2000.0)
    }

    /// Age of the peer's time stamp now; `None` while the bound exceeds [`MAX_BOUND_US`] or the last sample is too old.
    pub fn age(&self, local_ms: u32, peer_ms: u32) -> Option<Age> {
        let interval = self.at(local_ms)?;
        let bound_us = (interval.high_us - interval.low_us) / 2;
        if bound_us > MAX_BOUND_US {
            return None;
        }
        let apparent_ms = local_ms
            .wrapping_add(interval.reference_ms)
            .wrapping_sub(peer_ms)
            .cast_signed();
        let age_us = 1000 * i64::from(apparent_ms) + i64::midpoint(interval.low_us, interval.high_us);
        // Both readings are whole milliseconds rounded down.
        Some(Age {
            estimate_ms: age_us as f64 / 1000.0,
            bound_ms: (bound_us + RESOLUTION_US) as f64 / 1000.0,
        })
    }

    /// The interval widened to the present.
    fn at(&self, local_ms: u32) -> Option<Interval> {
        let old = self.interval?;
        // A negative difference (time stamps of one instant read in the other order) counts as no time.
        let elapsed_ms = i64::from(local_ms.wrapping_sub(old.updated_local_ms).cast_signed()).max(0);
        if elapsed_ms > i64::from(MAX_AGE_MS) {
            return None;
        }
        let drift_us = elapsed_ms * DRIFT_PPM / 1000 + 1;
        Some(Interval {
            low_us: old.low_us - drift_us,
            high_us: old.high_us + drift_us,
            ..old
        })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    /// Two clocks, a link with the given one-way times; both sides send every `period_us`.
    struct Link {
        offset_us: i64,
        drift_ppm: i64,
        down_us: i64,
        up_us: i64,
    }

    impl Link {
        fn local_ms(&self, true_us: i64) -> u32 {
            (true_us / 1000) as u32
        }

        fn peer_ms(&self, true_us: i64) -> u32 {
            ((true_us + self.offset_us + true_us * self.drift_ppm / 1_000_000).div_euclid(1000)) as u32
        }

        /// Frame the peer sends at `sent_us`, echoing the newest of our frames (sent every 8333 us) that has reached it.
        fn sample(&self, sent_us: i64) -> ClockSample {
            let echoed_us = (sent_us - self.up_us).div_euclid(8333) * 8333;
            ClockSample {
                local_ms: self.local_ms(sent_us + self.down_us),
                peer_ms: self.peer_ms(sent_us),
                echo_ms: self.local_ms(echoed_us),
            }
        }
    }

    fn check(link: &Link, start_us: i64) {
        let mut clock = ClockOffset::default();
        let mut sent_us = start_us;
        for _ in 0..20_000 {
            sent_us += 8334;
            let sample = link.sample(sent_us);
            clock.observe(sample);
            let age = clock
                .age(sample.local_ms, sample.peer_ms)
                .expect("bound is small enough");
            let true_ms = link.down_us as f64 / 1000.0;
            assert!(
                (age.estimate_ms - true_ms).abs() <= age.bound_ms,
                "true {true_ms} not in {age:?} at {sent_us}"
            );
            assert!(age.largest_ms() < 50.0, "{age:?}");
        }
    }

    #[test]
    fn true_age_lies_within_the_bound_with_drift_and_an_asymmetric_link() {
        for drift_ppm in [-100, 0, 100] {
            check(
                &Link {
                    offset_us: 123_456_789,
                    drift_ppm,
                    down_us: 12_000,
                    up_us: 2_000,
                },
                3_000_000,
            );
            check(
                &Link {
                    offset_us: -123_456,
                    drift_ppm,
                    down_us: 2_000,
                    up_us: 12_000,
                },
                3_000_000,
            );
            check(
                &Link {
                    offset_us: 7,
                    drift_ppm,
                    down_us: 50,
                    up_us: 60,
                },
                3_000_000,
            );
        }
    }

    #[test]
    fn clocks_may_wrap_around() {
        let wrap_us = (1i64 << 32) * 1000;
        check(
            &Link {
                offset_us: 40_000_000,
                drift_ppm: 0,
                down_us: 3_000,
                up_us: 3_000,
            },
            wrap_us - 30_000_000,
        );
        check(
            &Link {
                offset_us: -40_000_000,
                drift_ppm: 0,
                down_us: 3_000,
                up_us: 3_000,
            },
            wrap_us - 30_000_000,
        );
        check(
            &Link {
                offset_us: 70_000_000,
                drift_ppm: 0,
                down_us: 3_000,
                up_us: 3_000,
            },
            wrap_us - 100_000_000,
        );
    }

    #[test]
    fn a_restarted_peer_starts_the_estimate_over() {
        let mut clock = ClockOffset::default();
        let before = Link {
            offset_us: 5_000_000,
            drift_ppm: 0,
            down_us: 1000,
            up_us: 1000,
        };
        let after = Link {
            offset_us: -1_000_000,
            ..before
        };
        for step in 0..100 {
            clock.observe(before.sample(3_000_000 + step * 8334));
        }
        let sample = after.sample(4_000_000);
        clock.observe(sample);
        let age = clock.age(sample.local_ms, sample.peer_ms).unwrap();
        assert!((age.estimate_ms - 1.0).abs() <= age.bound_ms, "{age:?}");
    }

    #[test]
    fn unknown_without_echo_after_silence_and_with_a_wide_bound() {
        let mut clock = ClockOffset::default();
        clock.observe(ClockSample {
            local_ms: 5000,
            peer_ms: 9000,
            echo_ms: 0,
        });
        assert!(clock.age(5000, 9000).is_none());
        clock.observe(ClockSample {
            local_ms: 5000,
            peer_ms: 9000,
            echo_ms: 4960,
        });
        assert!(clock.bound_ms(5000).is_some() && clock.age(5000, 9000).is_none());
        clock.observe(ClockSample {
            local_ms: 5100,
            peer_ms: 9100,
            echo_ms: 5090,
        });
        assert!(clock.age(5100, 9100).is_some());
        assert!(clock.age(7101, 11_100).is_none());
        clock.observe(ClockSample {
            local_ms: 8000,
            peer_ms: 12_000,
            echo_ms: 8100,
        });
        assert!(
            clock.age(8000, 12_000).is_none(),
            "an echo from the future is no sample"
        );
    }
}
