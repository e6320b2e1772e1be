//! ONNX Runtime beside our own evaluations. Not pure: it loads a shared library; absent or too old ones are errors, never
//! a panic.

mod check;
mod library;

pub use check::{LIMIT, check};
pub use library::{Runtime, RuntimeError, candidates};
