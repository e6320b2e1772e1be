//! From a journal to the files of a run archive. One path for both: a run that ended in order and one that a crash
//! cut off.

pub mod bundle;
pub mod manifest;
pub mod mcap;
pub mod parquet;
mod punctuality;
mod stages;
pub mod track;

pub use bundle::{ArchiveError, build};
pub use manifest::{FileEntry, Manifest};
