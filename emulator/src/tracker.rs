//! The tracker: poses of the robots on the floor, 120 per second, to every reader of a local socket.

use crate::noise::Noise;
use crate::socket::SocketFile;
use crate::unit::Unit;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::io::{ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

/// Share of robots that a picture misses.
const DROP_OUT: f64 = 0.001;
/// Exposure to sending.
const LATENCY_US: f64 = 7_700.0;
const LATENCY_DEVIATION_US: f64 = 300.0;
/// A reader that is further behind than this is let go.
const MAX_BACKLOG_BYTES: usize = 64 << 10;
const MAX_READERS: usize = 32;

/// Where the tracker sees a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackedPose {
    pub number: u8,
    pub x_m: f64,
    pub y_m: f64,
    /// Wrapped to +-pi.
    pub yaw_rad: f64,
}

/// One line of the stream; times are `CLOCK_MONOTONIC` of the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrackerFrame {
    pub frame: u64,
    pub camera: String,
    pub exposure_us: i64,
    pub sent_us: i64,
    pub poses: Vec<TrackedPose>,
}

/// Noise, drop-outs and faults of the tracker.
#[derive(Debug)]
pub struct TrackerModel {
    random: Noise,
    last: Vec<TrackedPose>,
}

impl TrackerModel {
    pub fn new(random: Noise) -> Self {
        Self {
            random,
            last: Vec::new(),
        }
    }

    /// Poses of the robots on the floor as a picture taken now shows them.
    pub fn expose(&mut self, units: &[Unit]) -> Vec<TrackedPose> {
        let mut poses = Vec::with_capacity(units.len());
        for unit in units {
            let Some(body) = unit.on_floor() else { continue };
            if unit.faults().tracker_lost || self.random.uniform() < DROP_OUT {
                continue;
            }
            let robot = unit.robot();
            let frozen = self
                .last
                .iter()
                .find(|pose| unit.faults().tracker_frozen && pose.number == robot.number);
            poses.push(frozen.copied().unwrap_or_else(|| {
                let noise = robot.description.noise.clone().unwrap_or_default();
                let (pose, mut error) = (body.pose(), |deviation: Option<f64>| {
                    deviation.unwrap_or(0.0) * self.random.normal()
                });
                TrackedPose {
                    number: robot.number,
                    x_m: pose.x_m + error(noise.pose_xy_m),
                    y_m: pose.y_m + error(noise.pose_xy_m),
                    yaw_rad: wrap(pose.yaw_rad + error(noise.pose_yaw_rad)),
                }
            }));
        }
        for pose in &poses {
            match self.last.iter_mut().find(|last| last.number == pose.number) {
                Some(last) => *last = *pose,
                None => self.last.push(*pose),
            }
        }
        poses
    }
}

fn wrap(angle_rad: f64) -> f64 {
    angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
}

/// The socket, its readers, and pictures on their way through the camera.
#[derive(Debug)]
pub struct TrackerStream {
    socket: SocketFile,
    readers: Vec<Reader>,
    on_their_way: VecDeque<(i64, TrackerFrame)>,
    frames: u64,
    random: Noise,
}

#[derive(Debug)]
struct Reader {
    stream: UnixStream,
    backlog: Vec<u8>,
}

impl TrackerStream {
    pub fn listen(path: &Path, seed: u64) -> std::io::Result<Self> {
        Ok(Self {
            socket: SocketFile::listen(path)?,
            readers: Vec::new(),
            on_their_way: VecDeque::new(),
            frames: 0,
            random: Noise::new(seed, u64::MAX - 1),
        })
    }

    /// A picture was taken.
    pub fn expose(&mut self, exposure_us: i64, poses: Vec<TrackedPose>) {
        let due_us = exposure_us + (LATENCY_US + LATENCY_DEVIATION_US * self.random.normal()) as i64;
        self.on_their_way.push_back((
            due_us,
            TrackerFrame {
                frame: self.frames,
                camera: "tracker".to_owned(),
                exposure_us,
                sent_us: 0,
                poses,
            },
        ));
        self.frames += 1;
    }

    /// Sends what is due, in order.
    pub fn poll(&mut self, now_us: i64) {
        while let Some(stream) = self.socket.accept() {
            if self.readers.len() < MAX_READERS {
                self.readers.push(Reader {
                    stream,
                    backlog: Vec::new(),
                });
            }
        }
        while self.on_their_way.front().is_some_and(|(due_us, _)| *due_us <= now_us) {
            let Some((_, mut frame)) = self.on_their_way.pop_front() else {
                break;
            };
            frame.sent_us = now_us;
            let Ok(mut line) = serde_json::to_vec(&frame) else {
                continue;
            };
            line.push(b'\n');
            self.readers.retain_mut(|reader| reader.send(&line));
        }
    }
}

impl Reader {
    /// `false` when the reader is gone or too slow.
    fn send(&mut self, line: &[u8]) -> bool {
        if self.backlog.len() + line.len() > MAX_BACKLOG_BYTES {
            tracing::warn!("a tracker reader is too slow and is let go");
            return false;
        }
        self.backlog.extend_from_slice(line);
        match self.stream.write(&self.backlog) {
            Ok(written) => {
                self.backlog.drain(..written);
                true
            }
            Err(error) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
        }
    }
}
