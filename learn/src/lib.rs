//! Learned residual: from run bundles and a physical model to a small network for what no named effect explains.
//!
//! The library is pure but for [`runtime`] (feature `program`): runs come through a [`session::Shelf`], work goes to the
//! caller's [`identify::workers::Workers`], the same input gives the same bits. `docs/learning.md` has method and figures.
//!
//! Runs become [`window`]s; the twin is driven through them ([`rollout`]) and linearised in accelerations of its body
//! ([`linear`]); a [`network`] is [`train`]ed on those linear problems and the twin driven again. [`black_box`] is the rival
//! without physics, [`evaluate`] compares all three on locked runs, [`onnx`] writes the network for others.
#![forbid(unsafe_code)]

pub mod adam;
pub mod black_box;
pub mod compare;
pub mod evaluate;
pub mod inputs;
pub mod linear;
pub mod network;
pub mod online;
pub mod onnx;
pub mod problem;
pub mod report;
pub mod rollout;
#[cfg(feature = "program")]
pub mod runtime;
pub mod session;
pub mod train;
pub mod window;
