//! One camera's process, the edge computer beside it: pictures in, poses on the floor out.
//!
//! ```text
//! frame stream -> [`frame_stream`] -> tracked or full search -> [`sighting`] lines to every reader ([`outlet`])
//! ```
//! [`tool`] makes calibration files from pictures of a tag board and reads recorded streams.

pub mod eye;
pub mod frame_stream;
pub mod identity;
pub mod outlet;
pub mod pgm;
pub mod refusals;
pub mod sighting;
pub mod tool;
