//! Wire vocabulary of the service: what crosses HTTP, WebSocket and files.
//!
//! No behaviour lives here. Every scalar carries its unit in its name; unknown fields are refused
//! in documents that people write (experiments, robot descriptions, laboratory descriptions).

pub mod arena;
pub mod comparison;
pub mod diagnosis;
pub mod docks;
pub mod experiment;
pub mod health;
pub mod lab;
pub mod live;
pub mod model;
pub mod note;
pub mod problem;
pub mod robot;
pub mod run;
pub mod verdict;

/// Prefix of every REST path.
pub const BASE_PATH: &str = "/api/v1";

/// Control ticks per second; time on the wire is an integer tick at this rate unless a unit says otherwise.
pub const CONTROL_HZ: u32 = 120;
