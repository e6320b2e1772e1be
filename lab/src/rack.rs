//! Between runs: robots that are not fit to drive leave the floor for the rack, where they charge.
//!
//! They come back by themselves with the start of the next run that has them. A robot at its dock charges there and stays, and
//! one on its way home is left alone.

use crate::hand;
use crate::lab::Lab;
use crate::ladder::Finding;

/// What the hand is to do.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Floor {
    /// Robots that stay where they are, seen or not.
    pub stay: Vec<u8>,
    /// Unfit robots that stand on the floor.
    pub go: Vec<u8>,
}

/// A robot between runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Idler {
    pub number: u8,
    pub finding: Finding,
    /// Seen on the floor.
    pub seen: bool,
    /// At its dock.
    pub docked: bool,
    /// On its way there.
    pub homeward: bool,
}

impl Idler {
    /// A dock helps against an empty battery and nothing else.
    fn is_well_placed(&self) -> bool {
        let charges = self.docked && self.finding.is_of_battery();
        self.finding == Finding::Fine || self.homeward || charges
    }
}

impl Floor {
    pub(crate) fn sort(robots: impl IntoIterator<Item = Idler>) -> Self {
        let mut floor = Self::default();
        for robot in robots {
            match (robot.is_well_placed(), robot.seen) {
                (true, _) => floor.stay.push(robot.number),
                (false, true) => floor.go.push(robot.number),
                (false, false) => {}
            }
        }
        floor
    }
}

/// Has the hand take unfit robots off the floor. What fails is tried again before the next claim.
pub(crate) async fn clear_floor(lab: &Lab) {
    let robots = lab.link.robots();
    let floor = Floor::sort(robots.map(|robot| Idler {
        number: robot.number,
        finding: robot.finding(),
        seen: lab.seen(robot.number).is_some(),
        docked: lab.is_docked(robot.number),
        homeward: lab.is_homeward(robot.number),
    }));
    if !floor.go.is_empty() {
        take_away(lab, &floor).await;
    }
}

/// Has the hand take `floor.go` to the rack.
pub(crate) async fn take_away(lab: &Lab, floor: &Floor) {
    match hand::place(lab.hand.as_deref(), &[], &floor.stay).await {
        Ok(()) => tracing::info!(robots = ?floor.go, "robots are taken to the rack"),
        Err(error) => tracing::warn!(robots = ?floor.go, %error, "robots could not be taken to the rack"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn idler(number: u8, finding: Finding, seen: bool) -> Idler {
        Idler {
            number,
            finding,
            seen,
            docked: false,
            homeward: false,
        }
    }

    #[test]
    fn everything_but_fine_leaves_the_floor() {
        let floor = Floor::sort([
            idler(1, Finding::Fine, true),
            idler(2, Finding::BatteryLow, true),
            idler(3, Finding::Stalled, true),
            idler(4, Finding::Fine, false),
            idler(5, Finding::BatteryEmpty, false),
        ]);
        assert_eq!((floor.stay, floor.go), (vec![1, 4], vec![2, 3]));
    }

    #[test]
    fn a_dock_keeps_robots_that_only_have_to_charge_and_the_way_there_keeps_all() {
        let docked = |number, finding| Idler {
            docked: true,
            ..idler(number, finding, true)
        };
        let homeward = |number, finding| Idler {
            homeward: true,
            ..idler(number, finding, true)
        };
        let floor = Floor::sort([
            docked(1, Finding::BatteryLow),
            docked(2, Finding::BatteryCritical),
            docked(3, Finding::BatteryEmpty),
            docked(4, Finding::Stalled),
            docked(5, Finding::SensorFault),
            homeward(6, Finding::BatteryCritical),
        ]);
        assert_eq!((floor.stay, floor.go), (vec![1, 2, 3, 6], vec![4, 5]));
    }
}
