//! Discrepancy workflow: where twin and measurement disagree.
//!
//! Pure: run bundles in as text, findings out. [`bundle`] reads what laboratories deliver and refuses what cannot be
//! meant; [`gap`] is residual r5, the end-to-end prediction gap that people see.
#![forbid(unsafe_code)]

pub mod anchor;
pub mod bundle;
pub mod channel;
pub mod gap;
pub mod telemetry;
