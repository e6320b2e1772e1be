//! What the service does, without HTTP and without SQL.

pub mod archives;
pub mod comparison;
pub mod contents;
pub mod diagnoses;
pub mod drift;
pub mod error;
pub mod experiments;
pub mod files;
pub mod health;
pub mod lab;
pub mod manoeuvre;
pub mod models;
pub mod runs;
