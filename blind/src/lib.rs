//! The blind bench: sets made by the emulated plant with an effect that nobody tells the diagnosis, a sealed truth, the
//! diagnosis on nothing but bundles, and a score for every figure it must reach (`docs/blind.md`).

pub mod background;
pub mod bench;
pub mod change;
pub mod drawn_robot;
pub mod drive;
pub mod effects;
pub mod firmware;
pub mod fit;
pub mod forces;
pub mod interval;
pub mod kind;
pub mod manoeuvre;
pub mod model_errors;
pub mod namer;
pub mod oracle;
pub mod reach;
pub mod recorder;
pub mod score;
pub mod sensing;
pub mod set;
pub mod table;
pub mod telemetry;
pub mod truth;
pub mod unknown;
