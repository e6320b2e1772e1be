//! `run.mcap`: the run for Foxglove and friends. Poses, frame transforms and log use Foxglove's well-known JSON
//! schemas, commands, telemetry and safety interventions their own. Log times are wall-clock times.

use crate::notes;
use crate::record::{LogLevel, Pose, Record};
use api::lab::Assignment;
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Names the world frame in poses and transforms.
const WORLD_FRAME: &str = "world";
/// Small enough that a reader can seek; readers need not hold more.
const CHUNK_BYTES: u64 = 512 << 10;

/// Channels of one robot.
#[derive(Debug)]
struct RobotChannels {
    name: String,
    pose: Channel,
    /// Age and spread of every pose, believed or not.
    quality: Channel,
    command: Channel,
    telemetry: Channel,
    /// The virtual robot.
    shadow: Channel,
    learning: Channel,
}

#[derive(Debug)]
struct Channel {
    id: u16,
    sequence: u32,
}

/// Wall clock in nanoseconds from the monotonic clock of the records.
#[derive(Debug, Clone, Copy)]
pub struct WallClock {
    wall_ns: i64,
    at_us: i64,
}

impl WallClock {
    /// `wall_ns` since 1970 is the same moment as `at_us`.
    pub const fn new(wall_ns: i64, at_us: i64) -> Self {
        Self { wall_ns, at_us }
    }

    /// Nanoseconds since 1970.
    pub fn ns(self, at_us: i64) -> u64 {
        u64::try_from(self.wall_ns + (at_us - self.at_us) * 1000).unwrap_or(0)
    }
}

/// Writes `run.mcap` while a journal is read.
pub struct McapFile {
    writer: Writer<BufWriter<File>>,
    clock: WallClock,
    robots: BTreeMap<u8, RobotChannels>,
    transforms: Channel,
    safety: Channel,
    log: Channel,
    /// What the user's own controller says and draws.
    controller: Channel,
}

impl McapFile {
    /// Registers schemas and channels.
    pub fn create(path: &Path, assignment: &Assignment, clock: WallClock) -> Result<Self, McapError> {
        let options = WriteOptions::new()
            .chunk_size(Some(CHUNK_BYTES))
            .library(concat!("robopheus-lab ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(BufWriter::new(File::create(path)?))?;
        let mut schema = |name: &str, text: &str| writer.add_schema(name, "jsonschema", text.as_bytes());
        let pose = schema("foxglove.PoseInFrame", include_str!("schemas/pose_in_frame.json"))?;
        let transform = schema("foxglove.FrameTransform", include_str!("schemas/frame_transform.json"))?;
        let log = schema("foxglove.Log", include_str!("schemas/log.json"))?;
        let command = schema("robopheus.Command", include_str!("schemas/command.json"))?;
        let telemetry = schema("robopheus.Telemetry", include_str!("schemas/telemetry.json"))?;
        let intervention = schema("robopheus.Intervention", include_str!("schemas/intervention.json"))?;
        let learning = schema("robopheus.LearningGap", include_str!("schemas/learning_gap.json"))?;
        let notes = schema(
            "robopheus.ControllerNotes",
            include_str!("schemas/controller_notes.json"),
        )?;
        let quality = schema("robopheus.PoseQuality", include_str!("schemas/pose_quality.json"))?;
        let mut channel = |schema, topic: &str| {
            writer
                .add_channel(schema, topic, "json", &BTreeMap::new())
                .map(|id| Channel { id, sequence: 0 })
        };
        let mut robots = BTreeMap::new();
        for robot in &assignment.robots {
            let name = robot.description.name.clone();
            let channels = RobotChannels {
                pose: channel(pose, &format!("/robots/{name}/pose"))?,
                quality: channel(quality, &format!("/robots/{name}/pose_quality"))?,
                command: channel(command, &format!("/robots/{name}/command"))?,
                telemetry: channel(telemetry, &format!("/robots/{name}/telemetry"))?,
                shadow: channel(pose, &format!("/virtual/{name}/pose"))?,
                learning: channel(learning, &format!("/learning/{name}/gap"))?,
                name,
            };
            robots.insert(robot.number, channels);
        }
        let transforms = channel(transform, "/tf")?;
        let safety = channel(intervention, "/safety")?;
        let log = channel(log, "/log")?;
        let controller = channel(notes, "/controller/notes")?;
        Ok(Self {
            writer,
            clock,
            robots,
            transforms,
            safety,
            log,
            controller,
        })
    }

    /// Writes the messages of a record.
    pub fn take(&mut self, record: &Record) -> Result<(), McapError> {
        let Self {
            writer,
            clock,
            robots,
            transforms,
            safety,
            log,
            controller,
        } = self;
        match record {
            Record::Pose(pose) => {
                let Some(robot) = robots.get_mut(&pose.robot) else {
                    return Ok(());
                };
                let (exposure_ns, arrival_ns) = (clock.ns(pose.exposure_us), clock.ns(pose.arrival_us));
                let quality = pose_quality(pose);
                write(writer, &mut robot.quality, [arrival_ns, exposure_ns], &quality)?;
                if !pose.accepted {
                    return Ok(());
                }
                write(
                    writer,
                    &mut robot.pose,
                    [arrival_ns, exposure_ns],
                    &pose_in_frame([pose.x_m, pose.y_m, pose.yaw_rad], exposure_ns),
                )?;
                write(
                    writer,
                    transforms,
                    [arrival_ns, exposure_ns],
                    &frame_transform(pose, exposure_ns, &robot.name),
                )
            }
            Record::Command(command) => {
                let Some(robot) = robots.get_mut(&command.robot) else {
                    return Ok(());
                };
                write(writer, &mut robot.command, [clock.ns(command.sent_us); 2], command)
            }
            Record::Telemetry(telemetry) => {
                let Some(robot) = robots.get_mut(&telemetry.robot) else {
                    return Ok(());
                };
                let times = [clock.ns(telemetry.arrival_us), clock.ns(telemetry.sample_us)];
                write(writer, &mut robot.telemetry, times, telemetry)
            }
            Record::Shadow(shadow) => {
                let at_ns = clock.ns(shadow.at_us);
                for seen in &shadow.robots {
                    if let Some(robot) = robots.get_mut(&seen.robot) {
                        let message = pose_in_frame([seen.x_m, seen.y_m, seen.yaw_rad], at_ns);
                        write(writer, &mut robot.shadow, [at_ns; 2], &message)?;
                    }
                }
                Ok(())
            }
            Record::Learning(learning) => {
                for gap in &learning.robots {
                    if let Some(robot) = robots.get_mut(&gap.robot) {
                        write(writer, &mut robot.learning, [clock.ns(learning.at_us); 2], gap)?;
                    }
                }
                Ok(())
            }
            Record::Intervention(intervention) => {
                write(writer, safety, [clock.ns(intervention.at_us); 2], intervention)
            }
            Record::Log(line) => {
                let (at_ns, message) = (clock.ns(line.at_us), &line.message);
                write(
                    writer,
                    log,
                    [at_ns; 2],
                    &foxglove_log(line.level, message, "lab", at_ns),
                )
            }
            Record::Notes(told) => {
                let at_ns = clock.ns(told.at_us);
                for text in notes::lines(&told.notes) {
                    let message = foxglove_log(LogLevel::Info, text, "controller", at_ns);
                    write(writer, log, [at_ns; 2], &message)?;
                }
                let message = json!({"tick": told.tick, "notes": told.notes});
                write(writer, controller, [at_ns; 2], &message)
            }
            _ => Ok(()),
        }
    }

    /// Writes summary and footer.
    pub fn finish(mut self) -> Result<(), McapError> {
        self.writer.finish().map(|_| ())
    }
}

/// - `times_ns`: when the laboratory had it, and when it was measured.
fn write(
    writer: &mut Writer<BufWriter<File>>,
    channel: &mut Channel,
    times_ns: [u64; 2],
    message: &impl Serialize,
) -> Result<(), McapError> {
    channel.sequence += 1;
    let [log_time, publish_time] = times_ns;
    let header = MessageHeader {
        channel_id: channel.id,
        sequence: channel.sequence,
        log_time,
        publish_time,
    };
    let bytes = serde_json::to_vec(message).map_err(|error| McapError::Io(error.into()))?;
    writer.write_to_known_channel(&header, &bytes)
}

fn timestamp(ns: u64) -> Value {
    json!({"sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000})
}

fn quaternion(yaw_rad: f64) -> Value {
    let (sin, cos) = (0.5 * yaw_rad).sin_cos();
    json!({"x": 0.0, "y": 0.0, "z": sin, "w": cos})
}

fn pose_in_frame([x_m, y_m, yaw_rad]: [f64; 3], ns: u64) -> Value {
    json!({
        "timestamp": timestamp(ns),
        "frame_id": WORLD_FRAME,
        "pose": {"position": {"x": x_m, "y": y_m, "z": 0.0}, "orientation": quaternion(yaw_rad)},
    })
}

fn pose_quality(pose: &Pose) -> Value {
    let [position_sigma_m, yaw_sigma_rad] = pose.spread.map_or([None; 2], |spread| spread.map(Some));
    json!({
        "camera": &*pose.camera,
        "accepted": pose.accepted,
        "age_us": pose.arrival_us - pose.exposure_us,
        "position_sigma_m": position_sigma_m,
        "yaw_sigma_rad": yaw_sigma_rad,
    })
}

fn frame_transform(pose: &Pose, ns: u64, child: &str) -> Value {
    json!({
        "timestamp": timestamp(ns),
        "parent_frame_id": WORLD_FRAME,
        "child_frame_id": child,
        "translation": {"x": pose.x_m, "y": pose.y_m, "z": 0.0},
        "rotation": quaternion(pose.yaw_rad),
    })
}

fn foxglove_log(level: LogLevel, message: &str, name: &str, ns: u64) -> Value {
    let level = match level {
        LogLevel::Info => 2,
        LogLevel::Warning => 3,
        LogLevel::Error => 4,
    };
    json!({"timestamp": timestamp(ns), "level": level, "message": message, "name": name, "file": "", "line": 0})
}
