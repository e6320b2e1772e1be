//! Faults on demand, for drills and tests.

use serde::{Deserialize, Serialize};

/// One entry of the fault menu.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum FaultKind {
    /// No power: firmware and motors are off, nothing answers. Ends with `none`; the robot then starts as from power-on.
    Dead,
    /// A driven wheel is held fast; `wheel` is its position among the driven ones.
    StuckWheel { wheel: usize },
    /// This share of frames is lost, each way.
    DropFrames { fraction: f64 },
    /// The tracker does not see the robot.
    TrackerLost,
    /// The tracker repeats the last pose.
    TrackerFrozen,
    /// The battery holds this charge, 0 to 1.
    LowBattery { charge: f64 },
    /// Ends all faults of the robot (a battery stays as it is).
    None,
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
    pub tracker_lost: bool,
    pub tracker_frozen: bool,
}
