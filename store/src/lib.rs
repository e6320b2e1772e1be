//! All SQL of the service.
//!
//! One noun a file; every function is one short transaction. Rows are private; what comes out are the
//! views of `api` or the types of [`outcome`]. Expiry is decided by the database's `clock_timestamp()` only,
//! and every write of a laboratory or a worker is fenced by its epoch or attempt.
//!
//! Row locks are taken in one order everywhere: run, then lease or job, then arena. The claim holds its arena
//! first and skips locked runs, so it never waits for one.

mod connect;
mod diagnosis;
mod diagnosis_job;
mod error;
mod experiment;
mod identity;
mod job;
mod laboratory;
mod lease;
mod listen;
mod model;
pub mod outcome;
mod reap;
mod robot_health;
mod run;
mod run_file;
mod run_gap;
mod run_view;
mod state;
mod waiting;

/// A private PostgreSQL and a database per test, also for the crates above.
#[cfg(feature = "testing")]
#[path = "../tests/support/mod.rs"]
pub mod testing;

pub use connect::{Store, StoreOptions};
pub use diagnosis::DIAGNOSES_OPEN_MOST;
pub use diagnosis_job::DIAGNOSIS_ATTEMPTS;
pub use error::{Result, StoreError};
pub use outcome::*;
pub use run_gap::{GAP_HORIZON_S, GAP_MARGIN, GAP_REFERENCES_LEAST};

/// Attempts of a run that never moved, before it fails.
pub const RUN_ATTEMPTS: i32 = 3;
/// How long an arena stays held after a run was interrupted in motion, unless its laboratory registers again: robots
/// latch off after 0.5 s, the rest is margin.
pub const ARENA_HOLD: std::time::Duration = std::time::Duration::from_secs(5);
/// A robot or laboratory that has said nothing for this long is offline.
pub const SILENT_S: f64 = 5.0;
/// What a run takes besides its motion (placing robots, uploading), for the expected start.
pub const RUN_OVERHEAD_S: f64 = 15.0;
/// Most rows a list returns.
pub const LIST_LIMIT: i64 = 500;
