//! What the cameras' processes see, fused into one world frame; without sockets and clock.

use crate::camera::refusals::{PictureRefusals, RefusalLine};
use crate::camera::sighting::Sighting;
use crate::pose_frame::{PoseFrame, SeenPose};
use crate::record::CameraName;
use localise::{Admission, CameraHealth, Fusion, FusionCounts, FusionSettings, Problem, TagOutcome};

/// Robot numbers on the link go up to 255; so do the tags.
const ROBOTS: u16 = 256;

/// State of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraStatus {
    /// `None` before its first picture.
    pub name: Option<CameraName>,
    pub health: CameraHealth,
    /// Pictures that its process could not use.
    pub refused: PictureRefusals,
}

/// See the module.
#[derive(Debug)]
pub struct Fuser {
    fusion: Fusion,
    outcomes: Vec<TagOutcome>,
    names: Vec<Option<CameraName>>,
    refused: Vec<PictureRefusals>,
    /// What was last said of each camera, so that the log tells changes only.
    told: Vec<Option<CameraHealth>>,
}

impl Fuser {
    /// - `cameras`: how many; they are numbered from 0.
    pub fn new(cameras: usize) -> Result<Self, Problem> {
        let settings = FusionSettings {
            cameras: u16::try_from(cameras).unwrap_or(u16::MAX),
            robots: ROBOTS,
            ..FusionSettings::default()
        };
        Ok(Self {
            fusion: Fusion::new(settings)?,
            outcomes: Vec::new(),
            names: vec![None; cameras],
            refused: vec![PictureRefusals::default(); cameras],
            told: vec![None; cameras],
        })
    }

    /// State of every camera.
    pub fn status(&self, now_us: i64) -> Vec<CameraStatus> {
        let status = |(number, name): (usize, &Option<CameraName>)| CameraStatus {
            name: name.clone(),
            health: self
                .fusion
                .camera(number as u16, now_us)
                .unwrap_or(CameraHealth::Silent),
            refused: self.refused.get(number).copied().unwrap_or_default(),
        };
        self.names.iter().enumerate().map(status).collect()
    }

    /// Counters since the start.
    pub fn counts(&self) -> FusionCounts {
        self.fusion.counts()
    }

    /// A camera's process could not use pictures.
    pub fn note_refusals(&mut self, camera: u16, line: &RefusalLine) {
        let number = usize::from(camera);
        if let Some(name) = self.names.get_mut(number)
            && name.is_none()
        {
            *name = Some(line.camera.as_str().into());
        }
        if let Some(refused) = self.refused.get_mut(number) {
            *refused = line.refused;
        }
    }

    /// Fuses what a camera saw; `None` when the picture is not used.
    ///
    /// - `now_us`: when it arrived, on the clock of the exposures.
    pub fn take(&mut self, camera: u16, sighting: &Sighting, now_us: i64) -> Option<PoseFrame> {
        let (number, observation) = (usize::from(camera), &sighting.observation);
        let name = self.names.get_mut(number)?;
        if name.as_deref() != Some(sighting.camera.as_str()) {
            *name = Some(sighting.camera.as_str().into());
        }
        let name = name.clone()?;
        let admission = self.fusion.observe(camera, observation, now_us, &mut self.outcomes);
        self.tell(camera, &name, now_us);
        if admission != Admission::Used {
            return None;
        }
        let seen = |wanted: TagOutcome| -> Vec<SeenPose> {
            let poses = observation.poses.iter().zip(&self.outcomes);
            let poses = poses.filter(|(_, outcome)| **outcome == wanted);
            let seen = poses.filter_map(|(pose, _)| {
                let fused = self.fusion.pose(pose.robot, observation.exposure_us);
                let fused = fused.filter(|_| wanted == TagOutcome::Used);
                Some(SeenPose {
                    number: u8::try_from(pose.robot).ok()?,
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                    velocity: fused
                        .as_ref()
                        .map(|fused| [fused.vx_m_per_s, fused.vy_m_per_s, fused.yaw_rate_rad_per_s]),
                    spread: fused.map(|fused| fused.spread()),
                })
            });
            seen.collect()
        };
        let (poses, refused) = (seen(TagOutcome::Used), seen(TagOutcome::Jump));
        Some(PoseFrame {
            frame: observation.sequence,
            camera: name,
            exposure_us: observation.exposure_us,
            received_us: sighting.received_us,
            located_us: sighting.located_us,
            arrival_us: now_us,
            poses,
            refused,
        })
    }

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
