//! Record of what the safety filter changed.

use serde::Serialize;
use twin::twist::BodyTwist;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WallSide {
    Left,
    Right,
    Bottom,
    Top,
}

/// Which constraint changed a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// Another robot, by its position in the experiment.
    Robot {
        other: u32,
    },
    Wall {
        side: WallSide,
    },
    /// Body speed or yaw rate above the limit.
    Speed,
    /// A wheel would turn faster than it can.
    WheelSpeed,
    /// The pose is too old or was never known.
    PoseAge,
    /// The link to the robot is down.
    Offline,
    /// Pose or desired twist is not a finite number.
    NotFinite,
    /// No motion was found that satisfies every constraint.
    Infeasible,
}

/// One change of one robot's command on one tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Intervention {
    #[serde(flatten)]
    pub cause: Cause,
    /// Size of the change of the body velocity.
    pub change_m_per_s: f64,
    /// Size of the change of the yaw rate.
    pub change_rad_per_s: f64,
    pub requested: BodyTwist,
}

impl Intervention {
    /// One word for live pictures: `wall`, `robot`, `speed` or `stop`.
    pub fn label(&self) -> &'static str {
        match self.cause {
            Cause::Robot { .. } => "robot",
            Cause::Wall { .. } => "wall",
            Cause::Speed | Cause::WheelSpeed => "speed",
            Cause::PoseAge | Cause::Offline | Cause::NotFinite | Cause::Infeasible => "stop",
        }
    }
}
