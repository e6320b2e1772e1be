//! The Run page: what is shown (`data`) and how (`ui`).

pub mod comparison;
pub mod data;
pub mod ui;
