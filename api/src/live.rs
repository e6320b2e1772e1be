//! Live picture of a run: text messages on `/api/v1/lab/stream` (laboratory to service) and
//! `/api/v1/runs/{id}/live` (service to anyone).

use crate::note::Note;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiveFrame {
    pub run_id: Uuid,
    pub epoch: i64,
    /// Control tick since the start of the motion; negative while preparing.
    pub tick: i64,
    pub time_s: f64,
    pub robots: Vec<LiveRobot>,
    pub ticks_missed: i64,
    /// Where the virtual robots are; empty without a virtual side.
    #[serde(default)]
    pub shadow: Vec<LiveShadow>,
    /// How well the robots are predicted; empty without a learning server.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learning: Vec<LiveLearning>,
    /// What the user's own controller said since the last frame, and what it drew last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<Note>,
    /// How long the stages from light to command took since the last frame.
    #[serde(default)]
    pub stages: Option<LiveStages>,
}

/// A robot of the virtual side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiveShadow {
    pub name: String,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

/// Distance between where a robot was seen and where it was predicted 0.5 s before, RMS over the last two seconds of motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiveLearning {
    pub name: String,
    /// By the model that the run began with.
    pub parent_m: f64,
    /// By what was learned in the run.
    pub learnt_m: f64,
}

/// Means since the last frame of one run's picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LiveStages {
    /// Mid-exposure to the whole picture at the localiser.
    pub camera_ms: f64,
    /// Finding the tags.
    pub locate_ms: f64,
    /// To the laboratory's process, and fusion.
    pub fuse_ms: f64,
    /// Waiting for the next tick.
    pub wait_ms: f64,
    /// Law, safety filter, frames to all robots.
    pub control_ms: f64,
    /// One way on the robot link, by the estimated clock offsets.
    pub link_ms: f64,
    /// Pictures in these means.
    pub pictures: u32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiveRobot {
    pub name: String,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub target_x_m: f64,
    pub target_y_m: f64,
    /// Age of the pose when the command was computed.
    pub pose_age_ms: f64,
    /// Age of the last telemetry frame from the robot.
    pub link_age_ms: f64,
    pub bus_v: f64,
    /// What the safety filter changed on this tick: `wall`, `robot`, `speed`, `stop`, or nothing.
    pub safety: Option<String>,
}
