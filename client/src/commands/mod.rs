//! One file per verb: its flags and what it does.

pub mod cancel;
pub mod diagnose;
pub mod diagnoses;
pub mod fetch;
pub mod import;
pub mod login;
pub mod models;
pub mod runs;
pub mod simulate;
pub mod stop;
pub mod submit;
pub mod validate;
pub mod watch;
