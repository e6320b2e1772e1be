//! What the laboratory writes down, one record per happening. Times are `CLOCK_MONOTONIC` microseconds of the host.

use crate::edge::Edge;
use crate::realtime::Realtime;
use api::lab::Assignment;
use api::note::Note;
use api::run::{Fault, RunState};
use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};

/// Wheels a command or telemetry frame carries, by position among the driven wheels.
pub const LINK_WHEELS: usize = 4;

/// One line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    Start(Box<Start>),
    Motion(Motion),
    Tick(Tick),
    Picture(Picture),
    Command(Command),
    Pose(Pose),
    Telemetry(Telemetry),
    Intervention(Intervention),
    Shadow(Shadow),
    Learning(Learning),
    Notes(Notes),
    /// A plain 8.33 ms sleep of another thread took this much longer.
    SleepLate(i64),
    Log(Log),
    /// What came in during the run, used or not; before the end.
    Edge(Box<Edge>),
    End(Box<End>),
}

/// First record of every journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    pub assignment: Assignment,
    /// The same moment on the wall clock and on the monotonic clock.
    pub wall: DateTime<Utc>,
    pub at_us: i64,
}

/// The control loop begins: slot 0 is due at `start_us`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub start_us: i64,
    pub realtime: Realtime,
}

/// One control tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    pub tick: i64,
    pub due_us: i64,
    pub woke_us: i64,
    /// When the last frame of the tick was handed to the kernel.
    pub done_us: i64,
    pub missed: i64,
    /// Mid-exposure of the newest picture that the tick knew.
    #[serde(default)]
    pub exposure_us: i64,
}

/// One picture that the localisation understood, and when each of its stages was over.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Picture {
    #[serde(with = "camera_name")]
    pub camera: CameraName,
    /// Number of the picture at its camera.
    pub frame: u64,
    /// Mid-exposure.
    pub exposure_us: i64,
    /// The whole picture had arrived at the localiser.
    pub received_us: i64,
    /// The tags were found.
    pub located_us: i64,
    /// The poses were fused and on their way to the loop.
    pub arrival_us: i64,
    /// Robots seen in it.
    pub robots: u32,
}

/// What was sent to one robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Command {
    pub tick: i64,
    pub robot: u8,
    pub sent_us: i64,
    pub sequence: u32,
    pub enable: bool,
    /// As sent, in the resolution of the link.
    pub wheel_rad_per_s: [f64; LINK_WHEELS],
    pub steering_rad: f64,
    /// Body twist behind the wheel speeds: forward m/s, left m/s, yaw rate rad/s.
    pub twist: [f64; 3],
    /// What the control law wanted, same order.
    pub desired: [f64; 3],
    /// Moving target of the control law; none while the law is not asked.
    pub target_m: Option<[f64; 2]>,
    /// Age of the pose when the command was computed.
    pub pose_age_us: i64,
    /// Age of the last telemetry frame.
    pub link_age_us: i64,
    pub finished: bool,
    /// The run has ended, and the robot comes to rest by itself.
    #[serde(default)]
    pub ended: bool,
}

/// One robot in one tracker frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub robot: u8,
    pub frame: u64,
    #[serde(with = "camera_name")]
    pub camera: CameraName,
    pub exposure_us: i64,
    pub arrival_us: i64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// False when the estimator did not believe it.
    pub accepted: bool,
    /// Standard deviations of place (its most uncertain direction) and yaw of the cameras' fused pose at the exposure, m and rad;
    /// none of poses that cameras do not fuse.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<[f64; 2]>,
}

/// Name of the camera, shared rather than copied: it goes through the control loop.
pub type CameraName = std::sync::Arc<str>;

mod camera_name {
    use super::CameraName;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(name: &CameraName, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(name)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<CameraName, D::Error> {
        Ok(String::deserialize(deserializer)?.into())
    }
}

/// One telemetry frame of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    pub robot: u8,
    pub arrival_us: i64,
    /// Sampling instant on the host's clock.
    pub sample_us: i64,
    /// Half width of the interval that `sample_us` is known to lie in.
    pub sample_bound_us: i64,
    pub robot_clock_ms: u32,
    pub status: u8,
    pub applied_sequence: u32,
    pub wheel_rad_per_s: [f64; LINK_WHEELS],
    pub wheel_rad: [f64; LINK_WHEELS],
    pub current_a: [f64; LINK_WHEELS],
    pub bus_v: f64,
    pub gyro_z_rad_per_s: f64,
    pub accel_m_per_s2: [f64; 2],
    pub steering_rad: f64,
}

/// Where the virtual robots are at a tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shadow {
    pub tick: i64,
    /// When the tick was due.
    pub at_us: i64,
    pub robots: Vec<ShadowPose>,
}

/// One virtual robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShadowPose {
    /// Number of its physical twin.
    pub robot: u8,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// How far the last believed pose was from what the twin expected there 0.5 s before; when it follows its robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_m: Option<f64>,
}

/// How well robots are predicted, from the learning server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Learning {
    pub tick: i64,
    /// When the tick was due.
    pub at_us: i64,
    pub robots: Vec<LearningGap>,
}

/// Distance between where a robot was seen and where it was predicted 0.5 s before, RMS over the last two seconds of motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LearningGap {
    pub robot: u8,
    /// By the model that the run began with.
    pub parent_m: f64,
    /// By what was learned in the run, as it was when the prediction began.
    pub learnt_m: f64,
    /// Predictions of the run so far.
    pub predictions: u64,
    /// Times that what was learned was thrown away.
    pub discarded: u32,
}

/// What the user's own controller said and drew in a tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Notes {
    pub tick: i64,
    pub at_us: i64,
    pub notes: Vec<Note>,
}

/// The safety filter changed a command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intervention {
    pub tick: i64,
    pub at_us: i64,
    pub robot: u8,
    /// `wall`, `robot`, `speed` or `stop`.
    pub kind: SafetyKind,
    /// The constraint behind it, for example `wall_left`, `pose_age`, `wheel_speed`.
    pub cause: std::borrow::Cow<'static, str>,
    /// The other robot, for `robot`.
    pub other: Option<u8>,
    /// Length of the change of the body velocity.
    pub change_m_per_s: f64,
    pub change_rad_per_s: f64,
    /// What was asked of the filter: forward m/s, left m/s, yaw rate rad/s.
    #[serde(default)]
    pub requested: [f64; 3],
    /// What pushed, strongest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pressures: Vec<Pressure>,
}

/// How much one constraint moved a command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pressure {
    /// As of an intervention.
    pub cause: std::borrow::Cow<'static, str>,
    pub other: Option<u8>,
    pub push_m_per_s: f64,
}

/// Which limit made the safety filter act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SafetyKind {
    Wall,
    Robot,
    Speed,
    Stop,
}

impl SafetyKind {
    /// Name on the wire.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Wall => "wall",
            Self::Robot => "robot",
            Self::Speed => "speed",
            Self::Stop => "stop",
        }
    }
}

/// Something a person may want to read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    pub at_us: i64,
    pub level: LogLevel,
    pub message: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LogLevel {
    Info,
    Warning,
    Error,
}

/// Last record of a journal that ended in order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    pub at_us: i64,
    pub state: RunState,
    pub fault: Option<Fault>,
    /// Records the loop could not hand to the recorder because its queue was full.
    pub records_dropped: u64,
}
