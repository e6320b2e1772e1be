//! What runs on a robot: link frames, rules of acceptance, watchdog, estimators, command fusion and motor control.
//!
//! No heap, no IO, no clock: bytes, times and sensor values come in as arguments, so the same code runs on the
//! robot's controller, in the emulated laboratory and in the laboratory's side of the link. Byte layout and rules
//! are described in `docs/link.md`.
#![no_std]

pub mod acceptance;
pub mod battery;
pub mod clock_offset;
mod crc;
pub mod estimator;
pub mod firmware;
pub mod frame;
pub mod fusion;
pub mod health;
mod hex;
pub mod key;
pub mod kinematics;
pub mod medium;
pub mod motor_control;
pub mod ramp;
pub mod speed_loop;
pub mod watchdog;

/// Most motors one robot drives over the link.
pub const MAX_MOTORS: usize = 4;
/// Most wheels of one robot, casters included.
pub const MAX_WHEELS: usize = 6;
