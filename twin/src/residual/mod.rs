//! Learned residual: a small network for what no named effect explains.
//!
//! Inputs are quantities of the robot (a fixed list, [`INPUTS`]), normalised inside the document; outputs are
//! accelerations in the body frame. At the start of every control tick (120 Hz) the network is evaluated once on what
//! the sensors' models report then, and the force m a and torque J a that it gives are held for the four physics steps
//! of the tick. Commands, logs and training have that rate; the hold delays the force by half a tick on average
//! (4.2 ms), which keeps a drag a = -c u stable up to c = 240 1/s.
//!
//! ```text
//! x_i   = (clamp(q_i, low_i, high_i) - mean_i) / scale_i
//! y     = layers(x),  each  f(b + w_0 x_0 + w_1 x_1 + ...)  summed in this order
//! fade  = product over inputs of 1 - 3 e_i^2 + 2 e_i^3,  e_i = min(1, distance of q_i from [low_i, high_i] / (fade (high_i - low_i)))
//! a_j   = fade clamp(scale_j y_j, +-limit_j)
//! ```
//!
//! Inside the validity ranges the fade is exactly 1; further outside than the share `fade` of a range it is exactly 0, so
//! the nominal twin is left where nothing was learned. The outputs are bounded by their limits whatever the weights are.
//! A residual can put energy into the motion: nothing makes a network dissipative. Its power is bounded by
//! m |a| |velocity| + J |a_yaw| |r|, and so is the speed it can add in a given time.
//!
//! What a force does to the motion depends on the wheels: motors that hold their speed resist it, with slip and current. A
//! robot whose description has no motors has wheels that follow their set-points at once: what is wrong there is at the wheels,
//! and no force on the body is like it. Its network may give set-points besides ([`SHIFTS`]).

mod check;
mod document;
mod input;
mod network;
mod source;

pub use document::{Activation, Input, Layer, Output, ResidualDocument};
pub use input::{INPUTS, InputEntry, Observation, Of, Quantity};
pub use network::Residual;
pub use source::Source;

use crate::robot::RobotDescription;

/// The format this crate reads and writes.
pub const FORMAT: &str = "robopheus.residual/1";
/// Most inputs, and most units of one layer.
pub const MAX_UNITS: usize = 64;
/// Most layers, that of the outputs included. With the limits above a network has at most 12 672 weights.
pub const MAX_LAYERS: usize = 4;
/// Longest look back of an input, control ticks: 0.5 s.
pub const MAX_TICKS_AGO: usize = 60;
/// Accelerations: name, unit, largest limit. They stay inside the margin of the twin's search for collisions.
pub const OUTPUTS: [(&str, &str, f64); 3] = [
    ("acceleration_forward_m_per_s2", "m/s^2", 10.0),
    ("acceleration_left_m_per_s2", "m/s^2", 10.0),
    ("acceleration_yaw_rad_per_s2", "rad/s^2", 100.0),
];
/// Set-points, of robots without motors only: name, unit, largest limit. Twist of slip-free rolling that the wheels do besides
/// what they are told, behind all effects of commands.
pub const SHIFTS: [(&str, &str, f64); 3] = [
    ("set_point_forward_m_per_s", "m/s", 2.0),
    ("set_point_left_m_per_s", "m/s", 2.0),
    ("set_point_yaw_rate_rad_per_s", "rad/s", 10.0),
];
/// All outputs: accelerations, then set-points.
pub const AXES: usize = OUTPUTS.len() + SHIFTS.len();

/// Outputs in the order in which a robot is given them; without motors set-points as well.
pub fn outputs(robot: &RobotDescription) -> impl Iterator<Item = (&'static str, &'static str, f64)> + use<> {
    let shifts = if robot.motor.is_none() { SHIFTS.len() } else { 0 };
    OUTPUTS.into_iter().chain(SHIFTS.into_iter().take(shifts))
}
