//! The Compose page: what is shown (`data`) and how (`ui`).

mod correction;
pub mod data;
pub mod editor;
mod handles;
pub mod program;
mod settings;
pub mod ui;
