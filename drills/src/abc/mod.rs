//! The paper's experiments A, A+, B and C on the emulated plant, in virtual time (`docs/interaction.md`).

pub mod course;
pub mod drive;
pub mod experiment;
pub mod floor;
pub mod learned;
pub mod measured;
pub mod replay;
pub mod settings;
pub mod table;
