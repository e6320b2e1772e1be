//! What all parts of the laboratory process share.

use crate::config::Config;
use crate::desk::{Desk, DeskPlaces};
use crate::docks::Docks;
use crate::edge::Edge;
use crate::epochs::EpochBook;
use crate::hub;
use crate::link::{Link, RobotLink};
use crate::link_statistics::LinkStatistics;
use crate::localisation::{Localisation, Source};
use crate::pose_frame::SeenPose;
use crate::robot_addresses::RobotAddresses;
use crate::stop_latch::StopLatch;
use crate::stop_port::{StateSource, StopState};
use anyhow::{Context, Result, bail};
use api::health::{LinkQuality, RobotActivity, RobotHealth};
use api::lab::{LabDescription, LabStatus, RobotStatus};
use robot::key::Key;
use robot::medium::MediumProfile;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use uuid::Uuid;

/// One laboratory process.
#[derive(Debug)]
pub struct Lab {
    pub description: LabDescription,
    /// Page of the protective stop, once it is served.
    stop_url: OnceLock<String>,
    /// `<data>/lab`: runs, epochs, stop mark.
    pub desk: Desk,
    pub latch: Arc<StopLatch>,
    pub link: Arc<Link>,
    /// What carries the frames.
    pub medium: &'static MediumProfile,
    pub localisation: Arc<Localisation>,
    /// None = people put robots on the floor by themselves.
    pub hand: Option<PathBuf>,
    pub docks: Docks,
    pub book: Arc<Mutex<EpochBook>>,
    /// The service knows this laboratory.
    pub registered: AtomicBool,
    activity: Mutex<Option<Activity>>,
    /// Numbers of the robots that are on their way home.
    homeward: Mutex<BTreeSet<u8>>,
}

/// A robot that was not seen for longer stands on no floor.
const SEEN_US: i64 = 500_000;

/// What is going on in the arena.
#[derive(Debug, Clone, Copy)]
pub struct Activity {
    pub run_id: Uuid,
    pub phase: &'static str,
}

impl Lab {
    /// Reads files, takes the folder, binds the link and starts the threads that listen.
    pub fn open(config: &Config) -> Result<Arc<Self>> {
        let folder = config.data.join("lab");
        let desk = Desk::open(&DeskPlaces {
            folder: &folder,
            server: &config.server,
            token_file: &config.token_file,
            hub_listen: config.hub_listen,
            hub_address_file: &config.data.join(hub::ADDRESS_FILE),
        })?;
        let description: LabDescription = read_json(&config.lab)?;
        if description.format != "robopheus.lab/1" {
            bail!("{} is not robopheus.lab/1", config.lab.display());
        }
        let docks = config.docks.as_deref().map(|path| Docks::read(path, &description));
        let docks = docks.transpose()?.unwrap_or_default();
        let mut book = EpochBook::open(&folder.join("epochs.json")).context("read the epochs of the robots")?;
        let (own, groups) = (&config.robot_address, config.robot_broadcast.as_ref());
        let addresses = RobotAddresses::resolve(&config.robot_host, config.robot_udp_base, own, groups)
            .context("resolve the robots' addresses")?;
        let link = Link::start(&description.robots, &read_keys(&config.keys)?, &addresses, &mut book)
            .context("start the robot link")?;
        let source = match (&config.tracker, config.camera.is_empty()) {
            (None, false) => Source::Cameras(config.camera.clone()),
            (Some(tracker), true) => Source::Tracker(tracker.clone()),
            (None, true) => bail!("no localisation: give --camera SOCKET for each camera, or --tracker SOCKET"),
            (Some(_), false) => bail!("two localisations: give --camera or --tracker, not both"),
        };
        Ok(Arc::new(Self {
            latch: Arc::new(StopLatch::open(&folder)),
            link,
            medium: MediumProfile::of(config.medium),
            localisation: Localisation::start(source).context("start the localisation")?,
            hand: config.hand.clone(),
            book: Arc::new(Mutex::new(book)),
            registered: AtomicBool::new(false),
            activity: Mutex::default(),
            homeward: Mutex::default(),
            docks,
            stop_url: OnceLock::new(),
            description,
            desk,
        }))
    }

    /// Says where the stop port listens. An address of all interfaces is none that a browser could call.
    pub fn tell_stop(&self, address: SocketAddr) {
        if !address.ip().is_unspecified() {
            // Told once, at the start.
            self.stop_url.get_or_init(|| format!("http://{address}/"));
        }
    }

    /// Body of `POST /lab/register`.
    pub fn registration(&self) -> LabDescription {
        let mut description = self.description.clone();
        description.stop_url = description.stop_url.or_else(|| self.stop_url.get().cloned());
        description
    }

    /// Says what is going on; `None` = nothing.
    pub fn set_activity(&self, activity: Option<Activity>) {
        *self.activity.lock().unwrap_or_else(PoisonError::into_inner) = activity;
    }

    /// What is going on.
    pub fn activity(&self) -> Option<Activity> {
        *self.activity.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says which robots are on their way home.
    pub(crate) fn set_homeward(&self, robots: BTreeSet<u8>) {
        *self.homeward.lock().unwrap_or_else(PoisonError::into_inner) = robots;
    }

    /// The robot is on its way home.
    pub fn is_homeward(&self, number: u8) -> bool {
        let homeward = self.homeward.lock().unwrap_or_else(PoisonError::into_inner);
        homeward.contains(&number)
    }

    /// Where the robot stands on the floor; none when nobody sees it.
    pub(crate) fn seen(&self, number: u8) -> Option<SeenPose> {
        let (pose, age_us) = self.localisation.pose(number)?;
        (age_us < SEEN_US).then_some(pose)
    }

    /// The robot stands at its dock.
    pub fn is_docked(&self, number: u8) -> bool {
        self.seen(number).is_some_and(|pose| self.docks.is_home(number, &pose))
    }

    fn robot_activity(&self, robot: &RobotLink) -> Option<RobotActivity> {
        if self.is_homeward(robot.number) {
            Some(RobotActivity::DrivingHome)
        } else if !robot.is_held() && self.is_docked(robot.number) {
            Some(RobotActivity::Charging)
        } else {
            None
        }
    }

    /// Robots' health, by number.
    pub fn robots(&self) -> Vec<RobotStatus> {
        let status = |robot: &Arc<RobotLink>| RobotStatus {
            name: robot.name.clone(),
            online: robot.is_online(),
            bus_v: robot.newest().map(|telemetry| telemetry.bus_v),
            health: robot_health(robot),
            link: robot.health().map(|_| link_quality(&robot.statistics())),
            stop_acknowledged: robot.has_stopped(),
            activity: self.robot_activity(robot),
        };
        self.link.robots().map(status).collect()
    }

    /// Body of `POST /lab/status`.
    pub fn status(&self) -> LabStatus {
        LabStatus {
            lab: self.description.name.clone(),
            arena: self.description.arena.name.clone(),
            stopped: self.latch.is_pressed(),
            robots: self.robots(),
        }
    }
}

impl StateSource for Lab {
    fn state(&self) -> StopState {
        let activity = self.activity();
        StopState {
            stopped: self.latch.is_pressed(),
            lab: self.description.name.clone(),
            run: activity.map(|activity| activity.run_id.to_string()),
            phase: activity.map(|activity| activity.phase.to_owned()),
            robots: self.robots(),
            edge: Edge::of(self),
        }
    }
}

/// What the robot says about itself, findings as the laboratory holds them.
fn robot_health(robot: &RobotLink) -> Option<RobotHealth> {
    let ((health, _), held) = robot.health().zip(robot.held())?;
    Some(RobotHealth {
        battery: held.battery,
        rest_v: health.rest_v,
        stalled: held.stalled,
        sensor_fault: held.sensor_fault,
        bounded_estimate: health.bounded,
    })
}

fn link_quality(statistics: &LinkStatistics) -> LinkQuality {
    LinkQuality {
        loss_share: statistics.loss(),
        delay_p50_ms: statistics.delay_p50_ms,
        delay_p95_ms: statistics.delay_p95_ms,
        jitter_ms: statistics.jitter_ms,
    }
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path).with_context(|| format!("read {}", path.display()))?;
    serde_json::from_slice(&bytes).with_context(|| format!("understand {}", path.display()))
}

/// Link keys by robot number; the text of a key never gets into an error.
fn read_keys(path: &Path) -> Result<BTreeMap<u8, Key>> {
    let texts: BTreeMap<u8, String> = read_json(path)?;
    let key = |(number, text): (u8, String)| {
        let key =
            Key::from_hex(&text).with_context(|| format!("the key of robot {number} is not 32 hexadecimal digits"))?;
        Ok((number, key))
    };
    texts.into_iter().map(key).collect()
}
