//! The laboratory without a clock: the lab's own pilot, fusion and link code against the emulator's own plant and firmware,
//! in virtual time. Faults and hostile numbers go in between, where the air and the light are.
//!
//! ```text
//! plant 480 Hz -> poses (error, delay, loss) -> fusion -> pilot 120 Hz -> frames (delay, loss, copies) -> firmware
//!                                                  ^------------------- telemetry (the same air) <-----------'
//! ```

pub mod abc;
pub mod adversary;
pub mod agent;
mod air;
pub mod approach;
pub mod attack;
pub mod audit;
pub mod blind;
pub mod closest;
pub mod deadlock;
pub mod evolution;
pub mod falsify;
pub mod fan;
mod furniture;
pub mod hostile;
pub mod ladder;
pub mod ledger;
pub mod liar;
mod light;
pub mod link_loss;
pub mod obstacles;
pub mod quick;
mod rig;
mod scene;
pub mod sight;
pub mod stale;
pub mod strangers;
pub mod table;
pub mod tracking;
mod walkers;

pub use air::{Air, AirSettings};
pub use light::{Light, LightSettings};
pub use rig::{Rig, RigSettings, Said, SaidWhat, Separation, StopWatch};
pub use scene::{Scene, SceneRobot};
