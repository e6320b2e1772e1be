//! Growing waits between attempts, with jitter so that several laboratories do not come back in step.

use std::time::Duration;

const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(5);

/// Waits of 0.1 s, 0.2 s, ... 5 s, each shortened by up to half.
#[derive(Debug, Default)]
pub struct Backoff {
    failures: u32,
}

impl Backoff {
    /// After a success the next wait is short again.
    pub fn reset(&mut self) {
        self.failures = 0;
    }

    /// How long to wait after one more failure.
    pub fn next_wait(&mut self) -> Duration {
        let longest = LONGEST.min(FIRST.saturating_mul(1 << self.failures.min(16)));
        self.failures = self.failures.saturating_add(1);
        // Random bits of a fresh UUID spare a random number generator.
        let share = f64::from(uuid::Uuid::now_v7().as_u128() as u32) / f64::from(u32::MAX);
        longest.mul_f64(0.5 + 0.5 * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_a_limit_and_fall_back() {
        let mut backoff = Backoff::default();
        let waits: Vec<_> = (0..40).map(|_| backoff.next_wait()).collect();
        assert!(waits[0] <= FIRST && waits[0] >= FIRST / 2);
        assert!(waits.iter().skip(8).all(|wait| (LONGEST / 2..=LONGEST).contains(wait)));
        assert!(waits.iter().skip(8).any(|wait| *wait != waits[39]), "no jitter");
        backoff.reset();
        assert!(backoff.next_wait() <= FIRST);
    }
}
