//! Robots and tracker in software, for a laboratory without hardware.
//!
//! [`Laboratory`] is everything without IO: firmware ([`robot::firmware`]) and plant of every robot, what the tracker sees,
//! and the fault menu; time is an argument. The program adds sockets and the clock. The plant is on purpose not the digital
//! twin: other equations at a finer step, and a hidden configuration that nobody else reads.

pub mod applied;
pub mod camera;
pub mod clock;
pub mod commissioning;
pub mod faults;
pub mod hand;
pub mod hidden;
pub mod keys;
pub mod laboratory;
pub mod link;
pub mod medium;
pub mod noise;
pub mod plant;
pub mod receiver;
pub mod sensors;
pub mod socket;
pub mod tracker;
pub mod unit;
pub mod watchdog_log;

pub use laboratory::Laboratory;
