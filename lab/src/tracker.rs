//! The tracker's stream of poses: newline-delimited JSON on a local socket, about 120 frames a second.

use crate::clock::monotonic_us;
use crate::feed::Feed;
use crate::record::CameraName;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Wait before connecting again.
const RECONNECT: Duration = Duration::from_millis(200);
/// A tracker that says nothing for this long is connected anew.
const SILENCE: Duration = Duration::from_secs(2);
/// The longest line: 250 robots take 25 KiB.
const LINE_LIMIT_BYTES: u64 = 256 << 10;

/// One picture, as the tracker understood it.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFrame {
    pub frame: u64,
    pub camera: CameraName,
    /// Mid-exposure, `CLOCK_MONOTONIC`.
    pub exposure_us: i64,
    pub arrival_us: i64,
    pub poses: Vec<TrackedPose>,
}

/// A robot in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct TrackedPose {
    pub number: u8,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

#[derive(Debug, Deserialize)]
struct Line<'a> {
    frame: u64,
    #[serde(borrow)]
    camera: std::borrow::Cow<'a, str>,
    exposure_us: i64,
    poses: Vec<TrackedPose>,
}

/// What is known of the floor between runs.
#[derive(Debug, Default)]
struct Seen {
    newest_exposure_us: Option<i64>,
    robots: BTreeMap<u8, (TrackedPose, i64)>,
}

/// The connection to the tracker.
#[derive(Debug, Default)]
pub struct Tracker {
    feed: Feed<PoseFrame>,
    seen: Mutex<Seen>,
}

impl Tracker {
    /// Connects in the background, again and again, until the process ends.
    pub fn start(socket: PathBuf) -> io::Result<Arc<Self>> {
        let tracker = Arc::new(Self::default());
        let reader = tracker.clone();
        std::thread::Builder::new().name("tracker".to_owned()).spawn(move || {
            let mut quiet = false;
            loop {
                let result = reader.read(&socket);
                if !quiet {
                    tracing::warn!(socket = %socket.display(), result = ?result.err(), "tracker disconnected");
                }
                quiet = true;
                std::thread::sleep(RECONNECT);
                if UnixStream::connect(&socket).is_ok() {
                    quiet = false;
                }
            }
        })?;
        Ok(tracker)
    }

    /// Pictures from now on, for one control loop.
    pub fn listen(&self) -> std::sync::mpsc::Receiver<PoseFrame> {
        self.feed.listen()
    }

    /// Age of the newest picture.
    pub fn age_us(&self) -> Option<i64> {
        self.seen()
            .newest_exposure_us
            .map(|exposure_us| monotonic_us() - exposure_us)
    }

    /// Newest pose of a robot and its age.
    pub fn pose(&self, robot: u8) -> Option<(TrackedPose, i64)> {
        self.seen()
            .robots
            .get(&robot)
            .map(|(pose, exposure_us)| (*pose, monotonic_us() - exposure_us))
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read(&self, socket: &Path) -> io::Result<()> {
        let stream = UnixStream::connect(socket)?;
        stream.set_read_timeout(Some(SILENCE))?;
        tracing::info!(socket = %socket.display(), "tracker connected");
        let mut reader = BufReader::with_capacity(64 << 10, stream);
        let mut line = Vec::new();
        let mut camera: CameraName = "".into();
        loop {
            line.clear();
            if reader.by_ref().take(LINE_LIMIT_BYTES).read_until(b'\n', &mut line)? == 0 {
                return Ok(());
            }
            let arrival_us = monotonic_us();
            let parsed: Line = serde_json::from_slice(&line)?;
            if parsed.camera != *camera {
                camera = parsed.camera.as_ref().into();
            }
            self.take(PoseFrame {
                frame: parsed.frame,
                camera: camera.clone(),
                // A picture cannot come from the future; a wrong clock must not look fresh for ever.
                exposure_us: parsed.exposure_us.min(arrival_us),
                arrival_us,
                poses: parsed.poses,
            });
        }
    }

    fn take(&self, frame: PoseFrame) {
        {
            let mut seen = self.seen();
            seen.newest_exposure_us = seen.newest_exposure_us.max(Some(frame.exposure_us));
            for pose in &frame.poses {
                seen.robots.insert(pose.number, (*pose, frame.exposure_us));
            }
        }
        self.feed.send(frame);
    }
}
