//! What came in at the laboratory's edge, used or not: counts of cameras, fusion, robot link and the robots' own. They are written
//! into a run's manifest and shown at the stop port; nothing is decided by them.

use crate::camera::refusals::PictureRefusals;
use crate::lab::Lab;
use crate::localisation::CameraStatus;
use crate::record::Record;
use localise::{CameraHealth, FusionCounts};
use robot::frame::Counters;
use serde::{Deserialize, Serialize};

/// Since the start of the process; in a manifest, of the run from its first preparation to its last frame.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Edge {
    /// None with a tracker.
    pub fusion: Option<FusionCounts>,
    /// In the order of their numbers; none with a tracker.
    pub cameras: Vec<CameraEdge>,
    pub robots: Vec<RobotEdge>,
    /// Datagrams on the robot link that are for no robot of this laboratory.
    pub strange_datagrams: u64,
}

/// One camera.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct CameraEdge {
    /// None before its first picture.
    pub name: Option<String>,
    /// `silent`, `live`, `stalled` or `frozen`; in a manifest, at the end.
    pub health: String,
    /// Pictures that its process could not use.
    pub refused: PictureRefusals,
}

/// One robot.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct RobotEdge {
    pub robot: String,
    /// Frames to it that could not be sent.
    pub unsent: u64,
    pub heard: HeardCounts,
    /// What it says of the frames that it got; none before it tells.
    pub told: Option<ToldCounts>,
}

/// Frames of a robot as the laboratory heard them: every datagram counts in one of all but `lost`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct HeardCounts {
    pub used: u64,
    /// Sequence numbers that never came, or came too late to count.
    pub lost: u64,
    /// Copies, and frames overtaken by newer ones.
    pub late: u64,
    /// Damaged, forged or of no known type.
    pub refused: u64,
    /// Authentic and old.
    pub replayed: u64,
}

/// A robot's counters (`docs/link.md`, type 5). They wrap around; a robot that was switched off and on counts from 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ToldCounts {
    pub accepted: u32,
    pub fixes: u32,
    pub malformed: u32,
    pub unknown: u32,
    pub crc: u32,
    pub mac: u32,
    pub reserved: u32,
    pub not_for_this_robot: u32,
    pub old_epoch: u32,
    pub out_of_order: u32,
    pub clock_unknown: u32,
    pub stale: u32,
}

impl From<Counters> for ToldCounts {
    fn from(told: Counters) -> Self {
        Self {
            accepted: told.accepted,
            fixes: told.fixes,
            malformed: told.malformed,
            unknown: told.unknown,
            crc: told.crc,
            mac: told.mac,
            reserved: told.reserved,
            not_for_this_robot: told.not_for_this_robot,
            old_epoch: told.old_epoch,
            out_of_order: told.out_of_order,
            clock_unknown: told.clock_unknown,
            stale: told.stale,
        }
    }
}

impl Edge {
    /// The counts now.
    pub fn of(lab: &Lab) -> Self {
        let robots = lab.link.robots().map(|robot| {
            let heard = robot.statistics();
            RobotEdge {
                robot: robot.name.clone(),
                unsent: robot.unsent(),
                heard: HeardCounts {
                    used: heard.received,
                    lost: heard.lost,
                    late: heard.late,
                    refused: heard.refused,
                    replayed: heard.replayed,
                },
                told: robot.counters().map(ToldCounts::from),
            }
        });
        Self {
            fusion: lab.localisation.counts(),
            cameras: lab.localisation.cameras().iter().map(CameraEdge::of).collect(),
            robots: robots.collect(),
            strange_datagrams: lab.link.strange_datagrams(),
        }
    }

    /// What was added since `before`, of these robots only; health as it is now.
    #[must_use]
    pub fn since(&self, before: &Self, robots: &[String]) -> Self {
        let fusion = self.fusion.map(|now| match before.fusion {
            Some(before) => fusion_since(now, before),
            None => now,
        });
        let cameras = self.cameras.iter().enumerate().map(|(number, now)| CameraEdge {
            refused: match before.cameras.get(number) {
                Some(before) => now.refused.since(&before.refused),
                None => now.refused,
            },
            ..now.clone()
        });
        let of_run = self.robots.iter().filter(|robot| robots.contains(&robot.robot));
        let since = |now: &RobotEdge| match before.robots.iter().find(|robot| robot.robot == now.robot) {
            Some(before) => now.since(before),
            None => now.clone(),
        };
        Self {
            fusion,
            cameras: cameras.collect(),
            robots: of_run.map(since).collect(),
            strange_datagrams: self.strange_datagrams.saturating_sub(before.strange_datagrams),
        }
    }

    /// As it goes into the journal.
    pub fn record(self) -> Record {
        Record::Edge(Box::new(self))
    }
}

impl CameraEdge {
    fn of(status: &CameraStatus) -> Self {
        let health = match status.health {
            CameraHealth::Silent => "silent",
            CameraHealth::Live => "live",
            CameraHealth::Stalled { .. } => "stalled",
            CameraHealth::Frozen { .. } => "frozen",
        };
        Self {
            name: status.name.as_ref().map(ToString::to_string),
            health: health.to_owned(),
            refused: status.refused,
        }
    }
}

impl RobotEdge {
    fn since(&self, before: &Self) -> Self {
        let (now, past) = (&self.heard, &before.heard);
        Self {
            robot: self.robot.clone(),
            unsent: self.unsent.saturating_sub(before.unsent),
            heard: HeardCounts {
                used: now.used.saturating_sub(past.used),
                lost: now.lost.saturating_sub(past.lost),
                late: now.late.saturating_sub(past.late),
                refused: now.refused.saturating_sub(past.refused),
                replayed: now.replayed.saturating_sub(past.replayed),
            },
            told: self.told.map(|now| before.told.map_or(now, |past| now.since(&past))),
        }
    }
}

impl ToldCounts {
    fn fields(&self) -> [u32; 12] {
        [
            self.accepted,
            self.fixes,
            self.malformed,
            self.unknown,
            self.crc,
            self.mac,
            self.reserved,
            self.not_for_this_robot,
            self.old_epoch,
            self.out_of_order,
            self.clock_unknown,
            self.stale,
        ]
    }

    fn since(&self, before: &Self) -> Self {
        let pairs = self.fields().into_iter().zip(before.fields());
        // A count that wrapped went on by little; one that fell far began anew.
        let restarted = pairs.clone().any(|(now, past)| now.wrapping_sub(past) > u32::MAX / 2);
        if restarted {
            return *self;
        }
        let mut difference = pairs.map(|(now, past)| now.wrapping_sub(past));
        let mut next = || difference.next().unwrap_or(0);
        Self {
            accepted: next(),
            fixes: next(),
            malformed: next(),
            unknown: next(),
            crc: next(),
            mac: next(),
            reserved: next(),
            not_for_this_robot: next(),
            old_epoch: next(),
            out_of_order: next(),
            clock_unknown: next(),
            stale: next(),
        }
    }
}

fn fusion_since(now: FusionCounts, before: FusionCounts) -> FusionCounts {
    FusionCounts {
        used: now.used.saturating_sub(before.used),
        jumps: now.jumps.saturating_sub(before.jumps),
        duplicates: now.duplicates.saturating_sub(before.duplicates),
        invalid: now.invalid.saturating_sub(before.invalid),
        relocations: now.relocations.saturating_sub(before.relocations),
        out_of_order_frames: now.out_of_order_frames.saturating_sub(before.out_of_order_frames),
        too_old_frames: now.too_old_frames.saturating_sub(before.too_old_frames),
        frozen_frames: now.frozen_frames.saturating_sub(before.frozen_frames),
        missed_frames: now.missed_frames.saturating_sub(before.missed_frames),
        unknown_camera_frames: now.unknown_camera_frames.saturating_sub(before.unknown_camera_frames),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str, used: u64, accepted: u32) -> RobotEdge {
        RobotEdge {
            robot: name.to_owned(),
            heard: HeardCounts {
                used,
                ..HeardCounts::default()
            },
            told: Some(ToldCounts {
                accepted,
                ..ToldCounts::default()
            }),
            ..RobotEdge::default()
        }
    }

    #[test]
    fn a_run_has_its_own_share_of_the_counts_and_of_its_own_robots() {
        let fusion = |used| {
            Some(FusionCounts {
                used,
                ..FusionCounts::default()
            })
        };
        let before = Edge {
            fusion: fusion(100),
            robots: vec![robot("a", 10, 10), robot("b", 20, u32::MAX), robot("c", 1, 5000)],
            strange_datagrams: 3,
            ..Edge::default()
        };
        let now = Edge {
            fusion: fusion(160),
            robots: vec![robot("a", 11, 12), robot("b", 25, 4), robot("c", 2, 7)],
            strange_datagrams: 4,
            ..Edge::default()
        };
        let run = now.since(&before, &["b".to_owned(), "c".to_owned()]);
        assert_eq!(run.fusion, fusion(60));
        // b's counter wrapped; c was switched off and on.
        assert_eq!(run.robots, [robot("b", 5, 5), robot("c", 1, 7)]);
        assert_eq!(run.strange_datagrams, 1);
    }
}
