//! Between runs: robots that are not fit to drive leave the floor for the rack, where they charge.
//!
//! They come back by themselves with the start of the next run that has them.

use crate::hand;
use crate::lab::Lab;
use crate::ladder::Finding;

/// A robot that was not seen for longer stands on no floor.
const SEEN_US: i64 = 500_000;

/// What the hand is to do.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Floor {
    /// Fit robots: they stay where they are, seen or not.
    pub stay: Vec<u8>,
    /// Unfit robots that stand on the floor.
    pub go: Vec<u8>,
}

impl Floor {
    /// - `robots`: number, finding, and whether it is seen on the floor.
    pub(crate) fn sort(robots: impl IntoIterator<Item = (u8, Finding, bool)>) -> Self {
        let mut floor = Self::default();
        for (number, finding, seen) in robots {
            match (finding, seen) {
                (Finding::Fine, _) => floor.stay.push(number),
                (_, true) => floor.go.push(number),
                (_, false) => {}
            }
        }
        floor
    }
}

/// Has the hand take unfit robots off the floor. What fails is tried again before the next claim.
pub(crate) async fn clear_floor(lab: &Lab) {
    let seen = |number: u8| {
        lab.localisation
            .pose(number)
            .is_some_and(|(_, age_us)| age_us < SEEN_US)
    };
    let robots = lab.link.robots();
    let floor = Floor::sort(robots.map(|robot| (robot.number, robot.finding(), seen(robot.number))));
    if floor.go.is_empty() {
        return;
    }
    match hand::place(&lab.hand, &[], &floor.stay).await {
        Ok(()) => tracing::info!(robots = ?floor.go, "robots are taken to the rack"),
        Err(error) => tracing::warn!(robots = ?floor.go, %error, "robots could not be taken to the rack"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_but_fine_leaves_the_floor() {
        let floor = Floor::sort([
            (1, Finding::Fine, true),
            (2, Finding::BatteryLow, true),
            (3, Finding::Stalled, true),
            (4, Finding::Fine, false),
            (5, Finding::BatteryEmpty, false),
        ]);
        assert_eq!((floor.stay, floor.go), (vec![1, 4], vec![2, 3]));
    }
}
