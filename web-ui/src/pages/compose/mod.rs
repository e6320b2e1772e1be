//! The Compose page: what is shown (`data`) and how (`ui`).

pub mod data;
pub mod editor;
mod handles;
pub mod program;
mod settings;
pub mod ui;
