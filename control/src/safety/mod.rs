//! Safety filter: the only maker of commands for robots. `docs/safety.md` has the equations and what they guarantee.
//!
//! A control-barrier filter on velocities. For robots i, j with bounding circles around their body origins, gap `s`
//! (margins and everything that may have shrunk since the measurement taken off, see `margin`) and n the unit vector
//! from j to i:
//!
//! ```text
//! minimise    sum |x_i - x_i,desired|^2          x_i: what the chassis can choose, in m/s
//! subject to  n . (v_i - v_j) >= -approach(s)    pairs of robots
//!             n . v_i >= -approach(s)            walls, sides of the geofence, obstacles; see `moving` for what others move
//!             |v_i|, |r_i|, |W_k| <= limits      speed, yaw rate, every wheel; steering by keeping the arc
//! ```
//!
//! The problem is solved exactly and group by group. What cannot be solved stops the robots concerned, along a
//! deceleration; the others are solved again around them. The result goes to the wheels without another change.

mod chassis;
mod deadlock;
mod filter;
mod groups;
mod intervention;
mod listing;
mod margin;
mod moving;
#[cfg(test)]
mod oracle;
mod pipeline;
mod rows;
mod solver;
mod surroundings;

use serde::Serialize;
use twin::command::WheelCommand;
use twin::twist::BodyTwist;

pub use deadlock::Deadlock;
pub use filter::{FilterBody, SafetyFilter};
pub use intervention::{Cause, Intervention, MAX_PRESSURES, Pressure, WallSide};
pub use moving::{MAX_MOVING, MovingDisc};
pub use surroundings::{Geofence, MAX_CORNERS};

/// Numbers of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Fastest body speed.
    pub speed_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
    /// Share of the no-load wheel speed that commands may use.
    pub wheel_share: f64,
    /// Gap kept between two bounding circles, errors not counted.
    pub robot_margin_m: f64,
    /// Gap kept between a bounding circle and a wall, a side of the geofence or an obstacle, errors not counted.
    pub wall_margin_m: f64,
    /// Largest error of a measured position.
    pub pose_error_m: f64,
    /// Largest difference of commanded and true velocity that counts against a gap while a command is on its way.
    pub tracking_m_per_s: f64,
    /// `alpha`: approach speed for each metre of gap.
    pub approach_gain_per_s: f64,
    /// `a`: deceleration that the approach speed relies on.
    pub braking_m_per_s2: f64,
    /// Deceleration of the commands of a robot that has to stop because nothing else was found; at least `a`.
    pub stopping_m_per_s2: f64,
    /// Time from the filter to the effect of a command: 0.08 s of the link and the 0.1 s that a robot's wheels take; see
    /// [`SafetyFilter::set_latency_s`].
    pub latency_s: f64,
    /// For how long a robot may go on with an older command because frames were lost.
    pub hold_s: f64,
    /// A pose older than this stops its robot.
    pub oldest_pose_s: f64,
    /// A robot with a stale pose is seen as a disc that grows this fast, up to `stale_growth_m`.
    pub stale_growth_m_per_s: f64,
    pub stale_growth_m: f64,
    /// Robots that hold each other for this long are sent round each other.
    pub deadlock_after_s: f64,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            speed_m_per_s: 0.8,
            yaw_rate_rad_per_s: 3.0,
            wheel_share: 0.85,
            robot_margin_m: 0.03,
            wall_margin_m: 0.02,
            pose_error_m: 0.005,
            tracking_m_per_s: 0.05,
            approach_gain_per_s: 2.0,
            braking_m_per_s2: 1.0,
            stopping_m_per_s2: 2.0,
            latency_s: 0.18,
            hold_s: 0.05,
            oldest_pose_s: 0.1,
            stale_growth_m_per_s: 0.5,
            stale_growth_m: 0.15,
            deadlock_after_s: 2.0,
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
