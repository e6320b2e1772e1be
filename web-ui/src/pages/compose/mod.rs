//! The Compose page: what is shown (`data`) and how (`ui`).

pub mod data;
mod handles;
mod settings;
pub mod ui;
