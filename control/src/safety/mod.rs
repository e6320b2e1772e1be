//! Safety filter: the only maker of commands for robots.
//!
//! A control-barrier filter on velocities. For robots i, j with bounding circles (radii R), gap
//! `s = |x_i - x_j| - R_i - R_j - margin`, and n the unit vector from j to i:
//!
//! ```text
//! minimise  sum |v_i - v_i,desired|^2
//! subject to  n . (v_i - v_j) >= -approach(s),   approach(s) = min(alpha s, sqrt(2 a s)) for s > 0, else 0
//!             n_w . v_i       >= -approach(s_w)  for the four walls
//! ```
//!
//! `s` is reduced by what the latency of measurement and actuation lets the gap shrink. Standing still always
//! satisfies every constraint, so the result can be shortened towards standstill until it does: "infeasible" means
//! stop. Limits on speed and wheels shorten the commands of all robots that share constraints by one factor, which
//! keeps the constraints; nothing is clipped afterwards. Works for one robot (walls) as for fifty.

mod constraints;
mod filter;
mod intervention;
mod solver;

use serde::Serialize;
use twin::command::WheelCommand;
use twin::twist::BodyTwist;

pub use filter::{FilterBody, SafetyFilter};
pub use intervention::{Cause, Intervention, WallSide};

/// Numbers of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Fastest body speed.
    pub speed_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
    /// Share of the no-load wheel speed that commands may use.
    pub wheel_share: f64,
    /// Gap kept between two bounding circles.
    pub robot_margin_m: f64,
    /// Gap kept between a bounding circle and a wall.
    pub wall_margin_m: f64,
    /// `alpha`: approach speed for each metre of gap.
    pub approach_gain_per_s: f64,
    /// `a`: deceleration that the approach speed relies on.
    pub braking_m_per_s2: f64,
    /// Time from measurement to the effect of a command.
    pub latency_s: f64,
    /// A pose older than this stops its robot.
    pub oldest_pose_s: f64,
    /// A robot with a stale pose is seen as a disc that grows this fast, up to `stale_growth_m`.
    pub stale_growth_m_per_s: f64,
    pub stale_growth_m: f64,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            speed_m_per_s: 0.8,
            yaw_rate_rad_per_s: 3.0,
            wheel_share: 0.85,
            robot_margin_m: 0.05,
            wall_margin_m: 0.03,
            approach_gain_per_s: 2.0,
            braking_m_per_s2: 1.0,
            latency_s: 0.1,
            oldest_pose_s: 0.1,
            stale_growth_m_per_s: 0.5,
            stale_growth_m: 0.15,
        }
    }
}

/// A command that has passed the safety filter: what a link may send.
///
/// Only the filter can make one:
///
/// ```compile_fail,E0451
/// use control::safety::SafeCommand;
/// use twin::{command::WheelCommand, twist::BodyTwist};
/// let forged = SafeCommand { twist: BodyTwist::default(), wheels: WheelCommand::default() };
/// ```
///
/// ```compile_fail,E0277
/// fn readable<T: serde::de::DeserializeOwned>() {}
/// readable::<control::safety::SafeCommand>();
/// ```
///
/// ```compile_fail,E0277
/// fn from_nothing<T: Default>() {}
/// from_nothing::<control::safety::SafeCommand>();
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SafeCommand {
    twist: BodyTwist,
    wheels: WheelCommand,
}

impl SafeCommand {
    /// Set-points for the wheels, within the robot's limits.
    pub fn wheel_command(&self) -> WheelCommand {
        self.wheels
    }

    /// Body twist of the command.
    pub fn twist(&self) -> BodyTwist {
        self.twist
    }
}

/// Command of one robot and what the filter did to it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Filtered {
    pub command: SafeCommand,
    pub intervention: Option<Intervention>,
}
