//! The emulated plant: robots with bristle contact, electric motors behind geared play, a battery, sprung wheels and bumpers.
//!
//! Integrated by semi-implicit Euler (velocities first, positions with the new velocities); bristles and currents implicitly.

pub mod arena;
pub mod battery;
pub mod body;
pub mod contact;
pub mod contents;
pub mod load;
pub mod motor;
pub mod steering;
pub mod swivel;
pub mod wheel;

/// Firmware steps per second; motor voltages are held in between.
pub const TICK_HZ: u32 = 480;
/// Plant steps in a firmware step: 7680 per second.
pub const SUBSTEPS: u32 = 16;
/// Most wheels of a robot, casters included.
pub const MAX_WHEELS: usize = 6;

pub(crate) const GRAVITY_M_PER_S2: f64 = 9.81;

/// Position of a body origin on the floor.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pose {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

/// Length of a step.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    pub dt_s: f64,
}
