//! Behaviour of the store on a real PostgreSQL.

#[path = "../support/mod.rs"]
mod support;

mod cancel;
mod claim;
mod diagnosis;
mod fence;
mod fixture;
mod identity;
mod job;
mod laboratory;
mod listen;
mod reap;
mod robot_health;
mod side;
mod submit;
mod terminal;
mod waiting;
