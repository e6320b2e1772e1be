//! Discrepancy workflow: where twin and measurement disagree, and which physical effect is missing.
//!
//! Pure: run bundles in, findings out; no clock, no threads, no randomness of its own. [`bundle`] reads what laboratories
//! deliver and refuses what cannot be meant; [`gap`] is the end-to-end prediction gap that people see; [`diagnose`] finds,
//! names, adds and verifies. Work items go to the caller's [`workers`] and come back in order.
#![forbid(unsafe_code)]

pub mod anchor;
pub mod bundle;
pub mod channel;
pub mod compare;
pub mod diagnose;
mod driven;
pub mod errors;
pub mod fit;
pub mod floor;
pub mod gap;
pub mod hypothesis;
pub mod linear;
pub mod locate;
pub mod lost;
pub mod random;
pub mod record;
pub mod report;
pub mod screen;
pub mod select;
pub mod steering_history;
pub mod stretch;
pub mod telemetry;
pub mod workers;
