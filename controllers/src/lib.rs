//! Controllers that users write: the same program in the browser's twin, in the service and in the laboratory.
//!
//! ```text
//! Source --compile--> Program --OwnLaw (Law)--> Team: acceleration limit, safety filter --> robots, or the twin
//!                        ^ View (poses, twists, ranges, targets)
//! ```
//!
//! A program is a script (rhai), a core WebAssembly module (wasmi) or a trained network (ONNX, [`policy`]). What it may use is counted, never timed, so that the
//! same program comes to the same end at the same tick natively and in the browser: operations and fuel, stack, memory, log
//! and drawings ([`limits`]). What goes wrong is a [`control::law::Fault`] and the robots stop. Pure: no input or output, no
//! clock, no randomness. How to write one: `docs/controllers.md`.

pub mod answer;
pub mod experiment;
pub mod gallery;
pub mod law;
pub mod limits;
mod maths;
mod module;
pub mod policy;
pub mod program;
pub mod ranges;
mod script;
pub mod source;
pub mod variety;
pub mod view;
pub mod vocabulary;
pub mod workload;
