//! The laboratory's control server: link -> estimator -> controller -> filter -> link at a fixed 120 Hz.
//!
//! Start reading at [`safety`] (may there be motion at all?), then [`loop_120hz`] (one tick), [`run`] (one run) and
//! [`claim`] (the life of the process). [`journal`] and [`archive`] are the record.

pub mod archive;
mod backoff;
pub mod claim;
pub mod clock;
pub mod clock_map;
pub mod config;
mod crc32;
mod deliver;
mod durable;
pub mod epochs;
pub mod estimator;
mod feed;
mod hand;
pub mod idle;
pub mod journal;
pub mod lab;
mod lease;
pub mod link;
pub mod live;
pub mod loop_120hz;
mod prepare;
pub mod realtime;
pub mod record;
pub mod recorder;
pub mod run;
pub mod safety;
pub mod salvage;
pub mod schedule;
pub mod service;
mod sleep_probe;
pub mod stop_latch;
pub mod stop_port;
pub mod stream;
pub mod tracker;
