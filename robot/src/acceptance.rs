//! Which commands may move a robot: current epoch, in order, fresh.

use crate::clock_offset::{ClockOffset, ClockSample};
use crate::frame::Header;
use core::fmt;

/// Oldest command that may move a robot, the bound of the clock offset included.
pub const MAX_COMMAND_AGE_MS: f64 = 50.0;

/// Why an authentic frame does not move the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// Telemetry, or meant for another robot.
    NotForThisRobot,
    /// A commander that has been replaced.
    OldEpoch { largest: u32, found: u32 },
    /// Repeated or overtaken.
    OutOfOrder { largest: u32, found: u32 },
    /// Too little is known about the sender's clock to judge the age; a few telemetry echoes cure it.
    ClockUnknown,
    /// On the way for too long.
    Stale { age_ms: f64 },
}

impl Refusal {
    /// The sender is the current commander, only its frame cannot be used.
    pub fn is_in_order(&self) -> bool {
        matches!(self, Self::ClockUnknown | Self::Stale { .. })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotForThisRobot => write!(f, "not a command for this robot"),
            Self::OldEpoch { largest, found } => write!(f, "epoch {found} is older than {largest}"),
            Self::OutOfOrder { largest, found } => write!(f, "sequence {found} does not follow {largest}"),
            Self::ClockUnknown => write!(f, "the sender's clock is not known well enough"),
            Self::Stale { age_ms } => write!(f, "command may be {age_ms:.1} ms old"),
        }
    }
}

impl core::error::Error for Refusal {}

/// Largest epoch and sequence seen, and the offset to the commander's clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct Acceptance {
    largest: Option<(u32, u32)>,
    clock: ClockOffset,
}

impl Acceptance {
    /// Largest epoch of any authentic frame; 0 before the first.
    pub fn epoch(&self) -> u32 {
        self.largest.map_or(0, |(epoch, _)| epoch)
    }

    pub fn clock(&self) -> &ClockOffset {
        &self.clock
    }

    /// First rule: epoch not smaller than the largest seen, sequence strictly increasing within it.
    ///
    /// A frame that passes counts as seen, whatever the other rule says, and its clocks enter the offset estimate.
    /// A new epoch may come from another process with another clock, so the estimate then starts over.
    pub fn check_order(&mut self, header: &Header, now_ms: u32) -> Result<(), Refusal> {
        match self.largest {
            Some((largest, _)) if header.epoch < largest => {
                return Err(Refusal::OldEpoch {
                    largest,
                    found: header.epoch,
                });
            }
            Some((epoch, largest)) if header.epoch == epoch && header.sequence <= largest => {
                return Err(Refusal::OutOfOrder {
                    largest,
                    found: header.sequence,
                });
            }
            Some((epoch, _)) if header.epoch > epoch => self.clock.reset(),
            _ => {}
        }
        self.largest = Some((header.epoch, header.sequence));
        self.clock.observe(ClockSample {
            local_ms: now_ms,
            peer_ms: header.clock_ms,
            echo_ms: header.echo_ms,
        });
        Ok(())
    }

    /// Second rule: certainly not older than [`MAX_COMMAND_AGE_MS`]. Returns the largest age it may have.
    pub fn check_age(&self, header: &Header, now_ms: u32) -> Result<f64, Refusal> {
        let age_ms = self
            .clock
            .age(now_ms, header.clock_ms)
            .ok_or(Refusal::ClockUnknown)?
            .largest_ms();
        if age_ms > MAX_COMMAND_AGE_MS {
            Err(Refusal::Stale { age_ms })
        } else {
            Ok(age_ms)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(epoch: u32, sequence: u32, clock_ms: u32, echo_ms: u32) -> Header {
        Header {
            robot: 1,
            epoch,
            sequence,
            tick: 0,
            clock_ms,
            echo_ms,
        }
    }

    #[test]
    fn epochs_only_grow_and_sequences_only_increase() {
        let mut acceptance = Acceptance::default();
        assert_eq!(acceptance.check_order(&header(5, 10, 1, 0), 1), Ok(()));
        assert_eq!(
            acceptance.check_order(&header(4, 99, 1, 0), 1),
            Err(Refusal::OldEpoch { largest: 5, found: 4 })
        );
        assert_eq!(
            acceptance.check_order(&header(5, 10, 1, 0), 1),
            Err(Refusal::OutOfOrder { largest: 10, found: 10 })
        );
        assert_eq!(
            acceptance.check_order(&header(5, 9, 1, 0), 1),
            Err(Refusal::OutOfOrder { largest: 10, found: 9 })
        );
        assert_eq!(acceptance.check_order(&header(5, 12, 1, 0), 1), Ok(()));
        assert_eq!(acceptance.check_order(&header(6, 1, 1, 0), 1), Ok(()));
        assert_eq!(acceptance.epoch(), 6);
    }

    #[test]
    fn age_is_judged_with_its_bound() {
        let mut acceptance = Acceptance::default();
        let first = header(1, 1, 70_000, 0);
        assert_eq!(acceptance.check_order(&first, 1000), Ok(()));
        assert_eq!(acceptance.check_age(&first, 1000), Err(Refusal::ClockUnknown));
        let second = header(1, 2, 70_008, 1004);
        assert_eq!(acceptance.check_order(&second, 1008), Ok(()));
        assert!(
            acceptance
                .check_age(&second, 1008)
                .is_ok_and(|age_ms| age_ms <= MAX_COMMAND_AGE_MS)
        );
        let slow = header(1, 3, 70_016, 1012);
        assert_eq!(acceptance.check_order(&slow, 1070), Ok(()));
        assert!(matches!(acceptance.check_age(&slow, 1070), Err(Refusal::Stale { age_ms }) if age_ms > 50.0));
    }

    #[test]
    fn a_new_epoch_forgets_the_old_clock() {
        let mut acceptance = Acceptance::default();
        let _ = acceptance.check_order(&header(1, 1, 70_008, 1004), 1008);
        let replaced = header(2, 1, 70_016, 0);
        assert_eq!(acceptance.check_order(&replaced, 1016), Ok(()));
        assert_eq!(acceptance.check_age(&replaced, 1016), Err(Refusal::ClockUnknown));
    }
}
