//! The Queue page: what is shown (`data`) and how (`ui`).

pub mod data;
pub mod ui;
