//! The panel in which an own controller is written.

pub mod data;
pub mod ui;
