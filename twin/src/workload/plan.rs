//! Set-points of the workload.

use crate::command::WheelCommand;
use crate::robot::Robot;
use crate::twist::BodyTwist;

/// Ticks that a set-point holds: 0.4 s.
pub const HOLD_TICKS: u64 = 48;
/// Forward m/s, left m/s (where the chassis can), yaw rate rad/s. The second half undoes the first, so that nobody leaves.
const TWISTS: [[f64; 3]; 8] = [
    [0.8, 0.0, 0.0],
    [0.8, 0.2, 1.0],
    [0.4, 0.4, -1.0],
    [0.6, -0.3, 0.6],
    [-0.8, 0.0, 0.0],
    [-0.8, -0.2, -1.0],
    [-0.4, -0.4, 1.0],
    [-0.6, 0.3, -0.6],
];
/// Set-points until the plan begins anew.
pub(super) const PHASES: usize = TWISTS.len();

/// What robot number `index` is told in a phase: neighbours are at different places in the plan, at different speeds.
pub(super) fn command(robot: &Robot, index: usize, phase: usize) -> WheelCommand {
    let [forward, left, yaw_rate] = TWISTS[(phase + index) % PHASES];
    let scale = 0.8 + 0.1 * ((index + 2) % 5) as f64;
    let can_go_sideways = robot.chassis() == "omni4";
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: scale * forward,
        left_m_per_s: if can_go_sideways { scale * left } else { 0.0 },
        yaw_rate_rad_per_s: scale * yaw_rate,
    })
}
