//! Where the robots are: from the cameras' processes, or from a tracker that tells poses itself.
//!
//! Both end in [`PoseFrame`]s for the control loop and in the newest pose of every robot for everybody else.

mod cameras;
mod fuser;
mod line;
mod tracker;

use crate::clock::monotonic_us;
use crate::feed::Feed;
use crate::pose_frame::{PoseFrame, SeenPose};
use localise::FusionCounts;
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use fuser::{CameraStatus, Fuser};

/// Where poses come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// Sockets of the cameras' processes, in the order of their numbers.
    Cameras(Vec<PathBuf>),
    /// Socket of a tracker.
    Tracker(PathBuf),
}

impl Source {
    /// Name in the run's record.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Cameras(_) => "cameras",
            Self::Tracker(_) => "tracker",
        }
    }
}

/// What is known of the floor between runs.
#[derive(Debug, Default)]
struct Seen {
    newest_exposure_us: Option<i64>,
    robots: BTreeMap<u8, (SeenPose, i64)>,
}

/// Poses of the robots as they come in.
#[derive(Debug)]
pub struct Localisation {
    source: Source,
    feed: Feed<PoseFrame>,
    seen: Mutex<Seen>,
    /// None with a tracker.
    fuser: Option<Mutex<Fuser>>,
}

impl Localisation {
    /// Connects in the background, again and again, until the process ends.
    pub fn start(source: Source) -> io::Result<Arc<Self>> {
        let fuser = match &source {
            Source::Cameras(sockets) => Some(Mutex::new(Fuser::new(sockets.len()).map_err(io::Error::other)?)),
            Source::Tracker(_) => None,
        };
        let localisation = Arc::new(Self {
            source,
            feed: Feed::default(),
            seen: Mutex::default(),
            fuser,
        });
        match &localisation.source {
            Source::Tracker(socket) => tracker::start(localisation.clone(), socket.clone())?,
            Source::Cameras(sockets) => {
                for (number, socket) in sockets.iter().enumerate() {
                    cameras::start(localisation.clone(), number as u16, socket.clone())?;
                }
            }
        }
        Ok(localisation)
    }

    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Pictures from now on, for one control loop.
    pub fn listen(&self) -> Receiver<PoseFrame> {
        self.feed.listen()
    }

    /// Age of the newest picture.
    pub fn age_us(&self) -> Option<i64> {
        self.seen()
            .newest_exposure_us
            .map(|exposure_us| monotonic_us() - exposure_us)
    }

    /// Newest pose of a robot and its age.
    pub fn pose(&self, robot: u8) -> Option<(SeenPose, i64)> {
        self.seen()
            .robots
            .get(&robot)
            .map(|(pose, exposure_us)| (*pose, monotonic_us() - exposure_us))
    }

    /// State of every camera; empty with a tracker.
    pub fn cameras(&self) -> Vec<CameraStatus> {
        self.fuser()
            .map(|fuser| fuser.status(monotonic_us()))
            .unwrap_or_default()
    }

    /// Counters of the fusion since the start; none with a tracker.
    pub fn counts(&self) -> Option<FusionCounts> {
        self.fuser().map(|fuser| fuser.counts())
    }

    fn fuser(&self) -> Option<MutexGuard<'_, Fuser>> {
        let fuser = self.fuser.as_ref()?;
        Some(fuser.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, frame: PoseFrame) {
        {
            let mut seen = self.seen();
            seen.newest_exposure_us = seen.newest_exposure_us.max(Some(frame.exposure_us));
            for pose in &frame.poses {
                let newest = seen.robots.entry(pose.number).or_insert((*pose, i64::MIN));
                // Two cameras need not arrive in the order of their exposures.
                if frame.exposure_us > newest.1 {
                    *newest = (*pose, frame.exposure_us);
                }
            }
        }
        self.feed.send(frame);
    }
}
