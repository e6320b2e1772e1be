//! Observations of all cameras' processes, fused into one world frame.

use super::{Localisation, line};
use crate::camera::sighting::Sighting;
use crate::clock::monotonic_us;
use crate::pose_frame::{PoseFrame, SeenPose};
use crate::record::CameraName;
use localise::{Admission, CameraHealth, Fusion, FusionCounts, FusionSettings, TagOutcome};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Robot numbers on the link go up to 255; so do the tags.
const ROBOTS: u16 = 256;

/// The fusion, shared by the cameras' threads.
#[derive(Debug)]
pub(super) struct Cameras {
    shared: Mutex<Shared>,
}

#[derive(Debug)]
struct Shared {
    fusion: Fusion,
    outcomes: Vec<TagOutcome>,
    names: Vec<Option<CameraName>>,
    /// What was last said of each camera, so that the log tells changes only.
    told: Vec<Option<CameraHealth>>,
}

/// State of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraStatus {
    /// `None` before its first picture.
    pub name: Option<CameraName>,
    pub health: CameraHealth,
}

impl Cameras {
    pub(super) fn new(cameras: usize) -> Result<Self, localise::Problem> {
        let settings = FusionSettings {
            cameras: u16::try_from(cameras).unwrap_or(u16::MAX),
            robots: ROBOTS,
            ..FusionSettings::default()
        };
        Ok(Self {
            shared: Mutex::new(Shared {
                fusion: Fusion::new(settings)?,
                outcomes: Vec::new(),
                names: vec![None; cameras],
                told: vec![None; cameras],
            }),
        })
    }

    pub(super) fn status(&self, now_us: i64) -> Vec<CameraStatus> {
        let shared = self.lock();
        let status = |(number, name): (usize, &Option<CameraName>)| CameraStatus {
            name: name.clone(),
            health: shared
                .fusion
                .camera(number as u16, now_us)
                .unwrap_or(CameraHealth::Silent),
        };
        shared.names.iter().enumerate().map(status).collect()
    }

    /// Counters since the start.
    pub(super) fn counts(&self) -> FusionCounts {
        self.lock().fusion.counts()
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fuses what a camera saw; `None` when the picture is not used.
    fn take(&self, camera: u16, sighting: &Sighting) -> Option<PoseFrame> {
        let shared = &mut *self.lock();
        let (number, observation) = (usize::from(camera), &sighting.observation);
        let now_us = monotonic_us();
        let name = shared.names.get_mut(number)?;
        if name.as_deref() != Some(sighting.camera.as_str()) {
            *name = Some(sighting.camera.as_str().into());
        }
        let name = name.clone()?;
        let admission = shared.fusion.observe(camera, observation, now_us, &mut shared.outcomes);
        shared.tell(camera, &name, now_us);
        if admission != Admission::Used {
            return None;
        }
        let used = observation.poses.iter().zip(&shared.outcomes);
        let used = used.filter(|(_, outcome)| **outcome == TagOutcome::Used);
        let poses = used.filter_map(|(pose, _)| {
            let fused = shared.fusion.pose(pose.robot, observation.exposure_us);
            Some(SeenPose {
                number: u8::try_from(pose.robot).ok()?,
                x_m: pose.x_m,
                y_m: pose.y_m,
                yaw_rad: pose.yaw_rad,
                velocity: fused.map(|fused| [fused.vx_m_per_s, fused.vy_m_per_s, fused.yaw_rate_rad_per_s]),
            })
        });
        Some(PoseFrame {
            frame: observation.sequence,
            camera: name,
            exposure_us: observation.exposure_us,
            received_us: sighting.received_us,
            located_us: sighting.located_us,
            arrival_us: now_us,
            poses: poses.collect(),
        })
    }
}

impl Shared {
    /// A line in the log when a camera freezes or is itself again.
    fn tell(&mut self, camera: u16, name: &CameraName, now_us: i64) {
        let health = self.fusion.camera(camera, now_us);
        let Some(told) = self.told.get_mut(usize::from(camera)) else {
            return;
        };
        let kind = |health: &Option<CameraHealth>| health.as_ref().map(std::mem::discriminant);
        if kind(told) != kind(&health) {
            match health {
                Some(CameraHealth::Frozen { .. }) => {
                    tracing::warn!(camera = %name, "the camera repeats its picture; not used")
                }
                _ => tracing::info!(camera = %name, ?health, "camera"),
            }
            *told = health;
        }
    }
}

/// Reads one camera's process on a thread of its own until this process ends.
pub(super) fn start(localisation: Arc<Localisation>, camera: u16, socket: PathBuf) -> io::Result<()> {
    std::thread::Builder::new()
        .name(format!("camera-{camera}"))
        .spawn(move || {
            line::read_for_ever(&format!("camera {camera}"), &socket, |bytes| {
                let sighting: Sighting = serde_json::from_slice(bytes)?;
                let cameras = localisation.cameras.as_ref();
                if let Some(frame) = cameras.and_then(|cameras| cameras.take(camera, &sighting)) {
                    localisation.take(frame);
                }
                Ok(())
            });
        })?;
    Ok(())
}
