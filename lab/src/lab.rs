//! What all parts of the laboratory process share.

use crate::config::Config;
use crate::epochs::EpochBook;
use crate::hub::Hub;
use crate::link::{Link, RobotLink};
use crate::link_statistics::LinkStatistics;
use crate::localisation::{Localisation, Source};
use crate::service::Service;
use crate::stop_latch::StopLatch;
use crate::stop_port::{StateSource, StopState};
use anyhow::{Context, Result, bail};
use api::health::{LinkQuality, RobotHealth};
use api::lab::{LabDescription, LabStatus, RobotStatus};
use api::live::LiveFrame;
use robot::key::Key;
use robot::medium::MediumProfile;
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::net::ToSocketAddrs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{broadcast, watch};
use uuid::Uuid;

/// Live frames kept for a slow connection before the oldest are dropped: 1.6 s.
const LIVE_FRAMES: usize = 32;

/// One laboratory process.
#[derive(Debug)]
pub struct Lab {
    pub description: LabDescription,
    pub service: Service,
    /// New with every process: leases belong to it.
    pub instance: Uuid,
    pub latch: Arc<StopLatch>,
    pub link: Arc<Link>,
    /// What carries the frames.
    pub medium: &'static MediumProfile,
    pub localisation: Arc<Localisation>,
    pub hand: PathBuf,
    /// `<data>/lab`: runs, epochs, stop mark.
    pub folder: PathBuf,
    pub book: Arc<Mutex<EpochBook>>,
    pub watchers: broadcast::Sender<LiveFrame>,
    pub hub: Arc<Hub>,
    pub shutdown: Shutdown,
    /// The service knows this laboratory.
    pub registered: AtomicBool,
    activity: Mutex<Option<Activity>>,
    /// Held for as long as the process lives: two processes must not share robots and journals.
    _lock: File,
}

/// What is going on in the arena.
#[derive(Debug, Clone, Copy)]
pub struct Activity {
    pub run_id: Uuid,
    pub phase: &'static str,
}

/// The wish to end the process.
#[derive(Debug, Clone)]
pub struct Shutdown {
    requested: Arc<AtomicBool>,
    changed: watch::Sender<bool>,
}

impl Default for Shutdown {
    fn default() -> Self {
        Self {
            requested: Arc::default(),
            changed: watch::Sender::new(false),
        }
    }
}

impl Shutdown {
    /// Asks everything to end.
    pub fn request(&self) {
        self.requested.store(true, Ordering::Release);
        self.changed.send_replace(true);
    }

    /// For the control loop.
    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Acquire)
    }

    /// Returns once the end is wished for.
    pub async fn requested(&self) {
        let mut changed = self.changed.subscribe();
        // The sender lives in self: waiting cannot fail.
        let _requested = changed.wait_for(|requested| *requested).await;
    }
}

impl Lab {
    /// Reads files, takes the folder, binds the link and starts the threads that listen.
    pub fn open(config: &Config) -> Result<Arc<Self>> {
        let folder = config.data.join("lab");
        std::fs::create_dir_all(&folder).with_context(|| format!("create {}", folder.display()))?;
        let lock = lock(&folder)?;
        let description: LabDescription = read_json(&config.lab)?;
        if description.format != "robopheus.lab/1" {
            bail!("{} is not robopheus.lab/1", config.lab.display());
        }
        let token = std::fs::read_to_string(&config.token_file)
            .with_context(|| format!("read the token {}", config.token_file.display()))?;
        let mut book = EpochBook::open(&folder.join("epochs.json")).context("read the epochs of the robots")?;
        let host = (config.robot_host.as_str(), config.robot_udp_base);
        let base = host
            .to_socket_addrs()
            .context("resolve the robot host")?
            .next()
            .context("the robot host has no address")?;
        let link = Link::start(&description.robots, &read_keys(&config.keys)?, base, &mut book)
            .context("start the robot link")?;
        let source = match (&config.tracker, config.camera.is_empty()) {
            (None, false) => Source::Cameras(config.camera.clone()),
            (Some(tracker), true) => Source::Tracker(tracker.clone()),
            (None, true) => bail!("no localisation: give --camera SOCKET for each camera, or --tracker SOCKET"),
            (Some(_), false) => bail!("two localisations: give --camera or --tracker, not both"),
        };
        Ok(Arc::new(Self {
            service: Service::new(&config.server, &token)?,
            instance: Uuid::now_v7(),
            latch: Arc::new(StopLatch::open(&folder)),
            link,
            medium: MediumProfile::of(config.medium),
            localisation: Localisation::start(source).context("start the localisation")?,
            hand: config.hand.clone(),
            book: Arc::new(Mutex::new(book)),
            watchers: broadcast::Sender::new(LIVE_FRAMES),
            hub: Hub::start(config.hub_listen, &config.data).context("start the hub")?,
            shutdown: Shutdown::default(),
            registered: AtomicBool::new(false),
            activity: Mutex::default(),
            description,
            folder,
            _lock: lock,
        }))
    }

    /// Says what is going on; `None` = nothing.
    pub fn set_activity(&self, activity: Option<Activity>) {
        *self.activity.lock().unwrap_or_else(PoisonError::into_inner) = activity;
    }

    /// What is going on.
    pub fn activity(&self) -> Option<Activity> {
        *self.activity.lock().unwrap_or_else(PoisonError::into_inner)
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

fn lock(folder: &Path) -> Result<File> {
    let file = File::create(folder.join("lock")).context("open the lock file")?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => bail!("another laboratory process uses {}", folder.display()),
        Err(TryLockError::Error(error)) => Err(error).context("lock the folder"),
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
