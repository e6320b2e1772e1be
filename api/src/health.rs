//! A robot's health and how well its frames come through.

use serde::{Deserialize, Serialize};

/// How much a battery has left, with the hysteresis of the robot's own monitor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum BatteryLevel {
    Good,
    /// No new run.
    Low,
    /// The run ends and the robot goes to charge.
    Critical,
    /// The robot stops by itself.
    Empty,
}

impl BatteryLevel {
    /// As in JSON and in the database.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Low => "low",
            Self::Critical => "critical",
            Self::Empty => "empty",
        }
    }
}

/// What a robot says about itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotHealth {
    pub battery: BatteryLevel,
    /// Battery voltage without its load.
    pub rest_v: f64,
    /// A motor was driven hard and did not turn.
    pub stalled: bool,
    /// A sensor gave values that cannot be.
    pub sensor_fault: bool,
    /// The robot's own estimate of its pose is tied to the world and its errors are bounded.
    pub bounded_estimate: bool,
}

/// What a robot does that is in no run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum RobotActivity {
    /// On the way to its dock after a run.
    DrivingHome,
    /// At its dock.
    Charging,
}

impl RobotActivity {
    /// As in JSON and in the database.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::DrivingHome => "driving_home",
            Self::Charging => "charging",
        }
    }
}

/// Measured on the robot link, from the robot to the laboratory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LinkQuality {
    /// Frames that did not come through, 0 to 1.
    pub loss_share: f64,
    /// One way.
    pub delay_p50_ms: f64,
    pub delay_p95_ms: f64,
    /// Half of the range between the 5 % and the 95 % quantile.
    pub jitter_ms: f64,
}
