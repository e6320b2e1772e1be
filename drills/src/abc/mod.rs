//! The paper's experiments A, A+, B and C on the emulated plant, in virtual time.

pub mod course;
pub mod drive;
pub mod error;
