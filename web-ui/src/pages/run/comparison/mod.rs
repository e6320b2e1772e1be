//! Runs along one path beside each other: what is shown (`data`) and how (`ui`).

pub mod data;
pub mod ui;
