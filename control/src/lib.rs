//! Control laws, safety filter and rehearsal of an experiment in the twin.
//!
//! Pure and deterministic: no input or output, no clock, no randomness. The same code runs in the browser, in the
//! service and in the laboratory's 120 Hz loop.
//!
//! ```text
//! Scenario --check--> Team = Predictor -> Law -> acceleration limit -> SafetyFilter -> SafeCommand (wheel set-points)
//!                       ^                                                                  |
//!                       +--- RobotObservation --- twin World (Rehearsal) <-----------------+   or the laboratory's link
//! ```

pub mod answer;
pub mod effectiveness;
pub mod gallery;
pub mod ideal;
pub mod interaction;
pub mod law;
pub mod notebook;
pub mod path_error;
pub mod prediction;
pub mod rehearsal;
pub mod safety;
pub mod scenario;
pub mod team;
pub mod verdict;

mod vector;

/// Control ticks per second.
pub const TICK_RATE_HZ: u32 = 120;
/// Length of a control tick.
pub const TICK_S: f64 = 1.0 / TICK_RATE_HZ as f64;
