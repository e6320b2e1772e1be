//! The digital twin: robots, wheels, motors, contact and the world they share.
//!
//! Pure and deterministic: no IO, no clock, no randomness, no hash order, no platform mathematics. The same
//! inputs give the same bits in every build; [`world::World::digest`] witnesses it. The equations are those of
//! `docs/notation.md`; each is written beside the code that evaluates it.
#![forbid(unsafe_code)]

pub mod command;
mod contact;
pub mod digest;
pub mod effect;
pub mod free;
pub mod golden;
mod kernel;
mod kinematics;
mod lanes;
mod linear;
mod load;
pub mod math;
mod model;
pub mod model_document;
mod motor;
pub mod motor_control;
pub mod pairing;
pub mod parameter;
pub mod pose;
pub mod replay;
pub mod residual;
pub mod reversals;
pub mod robot;
pub mod sensor;
pub mod snapshot;
mod state;
mod steering;
mod told;
pub mod tread;
pub mod twist;
mod tyre;
pub mod workload;
pub mod world;

/// Version of the numbers this crate produces. Changes whenever any bit of any trace changes.
pub const VERSION: &str = "twin-0.1.0/8";

/// Control ticks per second.
pub const CONTROL_RATE_HZ: u32 = 120;
/// Physics steps (and samples of the motors' speed loops) per second.
pub const PHYSICS_RATE_HZ: u32 = 480;
/// Physics steps in one control tick.
pub const SUBSTEPS: u32 = PHYSICS_RATE_HZ / CONTROL_RATE_HZ;
/// Length of one control tick, s.
pub const CONTROL_PERIOD_S: f64 = 1.0 / CONTROL_RATE_HZ as f64;
/// Length of one physics step, s.
pub const PHYSICS_PERIOD_S: f64 = 1.0 / PHYSICS_RATE_HZ as f64;
/// Most wheels on one robot.
pub const MAX_WHEELS: usize = 6;
/// Standard gravity, m/s^2.
pub const GRAVITY_M_PER_S2: f64 = 9.81;
/// Slip speed at which the friction force reaches tanh(1) = 76 % of its limit, m/s (`s0`).
pub const SLIP_SCALE_M_PER_S: f64 = 0.02;
/// Wheel speed that rounds the sign of the drive's dry friction, rad/s.
pub const COULOMB_SCALE_RAD_PER_S: f64 = 0.3;
