//! The laboratory's control server: link -> estimator -> controller -> filter -> link at a fixed 120 Hz.
//!
//! Start reading at [`safety`] (may there be motion at all?), then [`pilot`] (one tick), [`loop_120hz`] (120 of them a second), [`run`] (one run) and
//! [`claim`] (the life of the process). [`journal`] and [`archive`] are the record.

pub mod approach;
pub mod archive;
pub mod backoff;
pub mod camera;
pub mod carry_out;
pub mod claim;
pub mod clock;
pub mod clock_map;
pub mod commander;
pub mod config;
pub mod delay;
mod deliver;
pub mod desk;
mod durable;
pub mod ear;
pub mod epochs;
pub mod estimator;
mod feed;
pub mod follower;
mod hand;
pub mod hub;
pub mod idle;
pub mod journal;
pub mod lab;
pub mod ladder;
mod lease;
pub mod link;
pub mod link_statistics;
pub mod live;
mod live_stages;
pub mod localisation;
pub mod loop_120hz;
pub mod medium;
pub mod pilot;
pub mod pose_frame;
mod prepare;
mod rack;
pub mod realtime;
pub mod record;
pub mod recorder;
pub mod robot_limits;
pub mod run;
pub mod safety;
pub mod salvage;
pub mod schedule;
pub mod service;
pub mod shadow;
mod sleep_probe;
pub mod stop_latch;
pub mod stop_port;
pub mod stream;
pub mod virtual_loop;
pub mod virtual_run;
mod voice;
