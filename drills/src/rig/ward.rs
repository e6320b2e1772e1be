//! What the laboratory makes of the robots' health: its own ladder for each robot, fed with their frames.

use lab::ladder::{Finding, Findings, Held, Ladder, gravest};
use robot::frame::Health;

/// A health frame, and what counted once it was there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    pub at_us: i64,
    /// In the experiment.
    pub place: usize,
    /// As the robot says.
    pub findings: Findings,
    /// As the ladder has it.
    pub held: Held,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Ward {
    ladders: Vec<Ladder>,
    gravest: Vec<Finding>,
    /// All so far.
    pub reports: Vec<Report>,
}

impl Ward {
    pub(super) fn new(robots: usize) -> Self {
        Self {
            ladders: vec![Ladder::default(); robots],
            gravest: vec![Finding::Fine; robots],
            reports: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, place: usize, health: &Health, at_us: i64) {
        let (Some(ladder), Some(slot)) = (self.ladders.get_mut(place), self.gravest.get_mut(place)) else {
            return;
        };
        let findings = Findings::of(health);
        let held = ladder.report(&findings, at_us);
        *slot = held.gravest;
        self.reports.push(Report {
            at_us,
            place,
            findings,
            held,
        });
    }

    /// As the laboratory's loop is told.
    pub fn finding(&self) -> Option<(usize, Finding)> {
        gravest(self.gravest.iter().copied())
    }
}
