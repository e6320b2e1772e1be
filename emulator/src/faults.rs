//! Faults on demand, for drills and tests.

use crate::medium::{Bursts, Impairment};
use serde::{Deserialize, Serialize};

/// One entry of the fault menu.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum FaultKind {
    /// No power: firmware and motors are off, nothing answers. Ends with `none`; the robot then starts as from power-on.
    Dead,
    /// A driven wheel is held fast; `wheel` is its position among the driven ones.
    StuckWheel { wheel: usize },
    /// This share of frames is lost, each way or one way only.
    DropFrames {
        fraction: f64,
        #[serde(default)]
        way: LostWay,
    },
    /// Interference around this robot: bursts of this mean length take this share of the time and most frames, each way.
    BurstFrames { mean_ms: f64, share: f64 },
    /// Every frame takes this much longer, each way.
    DelayFrames { delay_ms: f64 },
    /// This share of frames arrives twice, each way.
    CopyFrames { fraction: f64 },
    /// This share of frames is overtaken by later ones, each way.
    ReorderFrames { fraction: f64 },
    /// Tracker and cameras take this robot and that one for each other.
    SwapIdentity { with: u8 },
    /// The tracker does not see the robot.
    TrackerLost,
    /// The tracker repeats the last pose.
    TrackerFrozen,
    /// The battery holds this charge, 0 to 1.
    LowBattery { charge: f64 },
    /// The battery loses this much of its charge in a second, besides what the robot draws.
    DrainBattery { charge_per_s: f64 },
    /// Ends all faults of the robot (a battery stays as it is).
    None,
}

/// Where frames are lost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LostWay {
    #[default]
    Both,
    /// To the robot: it is heard and hears nothing.
    Down,
    /// From the robot.
    Up,
}

/// `{"fault": {"number": 1, "kind": "dead"}}`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FaultRequest {
    pub number: u8,
    #[serde(flatten)]
    pub kind: FaultKind,
}

/// Faults of one robot that are on.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Faults {
    pub dead: bool,
    pub stuck_wheel: Option<usize>,
    pub dropped_fraction: f64,
    pub dropped_way: LostWay,
    /// What the medium does to this robot's frames besides its own.
    pub impairment: Impairment,
    /// Number that tracker and cameras see on this robot.
    pub seen_as: Option<u8>,
    pub drain_per_s: f64,
    pub tracker_lost: bool,
    pub tracker_frozen: bool,
}

/// Loss and mean delay within a burst of [`FaultKind::BurstFrames`].
const BURST_LOSS: f64 = 0.8;
const BURST_DELAY_MS: f64 = 8.0;

impl FaultKind {
    /// The first parameter that is out of range: its name, value and range.
    pub fn problem(&self) -> Option<(&'static str, f64, &'static str)> {
        let (name, value, least, most, range) = match *self {
            Self::DropFrames { fraction, .. } | Self::CopyFrames { fraction } | Self::ReorderFrames { fraction } => {
                ("fraction", fraction, 0.0, 1.0, "0..=1")
            }
            Self::BurstFrames { mean_ms, share } if (0.0..=0.9).contains(&share) => {
                ("mean_ms", mean_ms, 1.0, 10_000.0, "1..=10000")
            }
            Self::BurstFrames { share, .. } => ("share", share, 0.0, 0.9, "0..=0.9"),
            Self::DelayFrames { delay_ms } => ("delay_ms", delay_ms, 0.0, 5_000.0, "0..=5000"),
            Self::LowBattery { charge } => ("charge", charge, 0.0, 1.0, "0..=1"),
            Self::DrainBattery { charge_per_s } => ("charge_per_s", charge_per_s, 0.0, 1.0, "0..=1"),
            Self::StuckWheel { wheel } => ("wheel", wheel as f64, 0.0, 3.0, "0..4"),
            Self::Dead | Self::SwapIdentity { .. } | Self::TrackerLost | Self::TrackerFrozen | Self::None => {
                return None;
            }
        };
        (!(least..=most).contains(&value)).then_some((name, value, range))
    }
}

impl Faults {
    /// Puts a fault of the link on.
    pub(crate) fn impair(&mut self, kind: FaultKind) {
        match kind {
            FaultKind::BurstFrames { mean_ms, share } => {
                self.impairment.bursts = Some(Bursts {
                    mean_ms,
                    share,
                    loss: BURST_LOSS,
                    delay_ms: BURST_DELAY_MS,
                });
            }
            FaultKind::DelayFrames { delay_ms } => self.impairment.delay_ms = delay_ms,
            FaultKind::CopyFrames { fraction } => self.impairment.copies = fraction,
            FaultKind::ReorderFrames { fraction } => self.impairment.overtaken = fraction,
            _ => {}
        }
    }
}
