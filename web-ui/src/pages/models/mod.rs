//! Models: versions of a robot's twin, which one is in use, and two of them on a run.

mod comparison;
pub mod data;
pub mod ui;
