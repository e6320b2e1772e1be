//! Handlers: extract, call `app`, view. One noun a file.

pub mod archives;
pub mod arenas;
pub mod body;
pub mod comparison;
pub mod diagnoses;
pub mod docs;
pub mod events;
pub mod experiments;
pub mod file_reply;
pub mod headers;
pub mod health;
pub mod lab;
pub mod lab_files;
pub mod lab_stream;
pub mod live;
pub mod models;
pub mod pages;
pub mod params;
pub mod problem;
pub mod robots;
pub mod runs;
