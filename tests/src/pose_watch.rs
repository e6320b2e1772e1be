//! Where the robots are, from the emulator's tracker stream beside the laboratory.

use anyhow::Context;
use serde::Deserialize;
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, BufReader};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Poses kept of each robot: 10 s.
const KEPT: usize = 1200;

#[derive(Debug, Deserialize)]
struct Line {
    exposure_us: i64,
    poses: Vec<Tracked>,
}

#[derive(Debug, Deserialize)]
struct Tracked {
    number: u8,
    x_m: f64,
    y_m: f64,
}

type Tracks = BTreeMap<u8, VecDeque<(Instant, [f64; 2])>>;

/// A time of `CLOCK_MONOTONIC`, which is also the clock of [`Instant`] here.
#[allow(unsafe_code)] // clock_gettime(2) has no safe wrapper in std
pub fn instant_of(monotonic_us: i64) -> Instant {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    let now = Instant::now();
    // SAFETY: the call writes one timespec, which is ours.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    let age_us = time.tv_sec * 1_000_000 + time.tv_nsec / 1000 - monotonic_us;
    let age = Duration::from_micros(age_us.unsigned_abs());
    let moved = if age_us < 0 {
        now.checked_add(age)
    } else {
        now.checked_sub(age)
    };
    moved.unwrap_or(now)
}

/// See the module.
pub struct PoseWatch(Arc<Mutex<Tracks>>);

impl PoseWatch {
    pub fn start(socket: &Path) -> anyhow::Result<Self> {
        let stream = UnixStream::connect(socket).with_context(|| format!("no tracker at {}", socket.display()))?;
        let tracks = Arc::new(Mutex::new(Tracks::new()));
        let written = tracks.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(stream).lines() {
                let Some(line) = line.ok().and_then(|line| serde_json::from_str::<Line>(&line).ok()) else {
                    return;
                };
                let taken = instant_of(line.exposure_us);
                let mut tracks = written.lock().unwrap_or_else(PoisonError::into_inner);
                for pose in line.poses {
                    let track = tracks.entry(pose.number).or_default();
                    track.push_back((taken, [pose.x_m, pose.y_m]));
                    while track.len() > KEPT {
                        track.pop_front();
                    }
                }
            }
        });
        Ok(Self(tracks))
    }

    fn tracks(&self) -> MutexGuard<'_, Tracks> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Mean place of a robot over a span.
    pub fn mean_m(&self, robot: u8, from: Instant, span: Duration) -> Option<[f64; 2]> {
        let tracks = self.tracks();
        let seen = tracks.get(&robot)?.iter();
        let seen: Vec<_> = seen.filter(|(at, _)| *at >= from && *at < from + span).collect();
        let count = seen.len() as f64;
        let mean = |axis: usize| seen.iter().map(|(_, place)| place[axis]).sum::<f64>() / count;
        (!seen.is_empty()).then(|| [mean(0), mean(1)])
    }

    /// Speed of a robot over a span, m/s: from the mean place in its first to that in its last half.
    pub fn speed_m_per_s(&self, robot: u8, from: Instant, span: Duration) -> Option<f64> {
        let half = span / 2;
        let (before, after) = (self.mean_m(robot, from, half)?, self.mean_m(robot, from + half, half)?);
        Some(f64::hypot(after[0] - before[0], after[1] - before[1]) / half.as_secs_f64())
    }
}
