//! What a process that carries runs out shares with the service and the disk, whatever drives: robots or the twin.

use crate::hub::Hub;
use crate::service::Service;
use anyhow::{Context, Result, bail};
use api::live::LiveFrame;
use std::fs::{File, TryLockError};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::{broadcast, watch};
use uuid::Uuid;

/// Live frames kept for a slow connection before the oldest are dropped: 1.6 s.
const LIVE_FRAMES: usize = 32;

/// See the module.
#[derive(Debug)]
pub struct Desk {
    pub service: Service,
    /// New with every process: leases belong to it.
    pub instance: Uuid,
    /// Journals of the runs, and what else must survive a restart.
    pub folder: PathBuf,
    pub watchers: broadcast::Sender<LiveFrame>,
    pub hub: Arc<Hub>,
    pub shutdown: Shutdown,
    /// Held for as long as the process lives: two processes must not share journals.
    _lock: File,
}

/// Where a desk finds its things.
#[derive(Debug, Clone, Copy)]
pub struct DeskPlaces<'a> {
    /// Created when it is not there.
    pub folder: &'a Path,
    /// Address of the service.
    pub server: &'a str,
    /// File with the bearer token of the role `lab`.
    pub token_file: &'a Path,
    /// Where others follow the runs; port 0 takes any.
    pub hub_listen: SocketAddr,
    /// File with the hub's real address.
    pub hub_address_file: &'a Path,
}

impl Desk {
    /// Takes the folder, reads the token and opens the hub.
    ///
    /// - Errors: another process has the folder; no token; no hub.
    pub fn open(places: &DeskPlaces) -> Result<Self> {
        let folder = places.folder;
        std::fs::create_dir_all(folder).with_context(|| format!("create {}", folder.display()))?;
        let lock = lock(folder)?;
        let token = std::fs::read_to_string(places.token_file)
            .with_context(|| format!("read the token {}", places.token_file.display()))?;
        Ok(Self {
            service: Service::new(places.server, &token)?,
            instance: Uuid::now_v7(),
            folder: folder.to_owned(),
            watchers: broadcast::Sender::new(LIVE_FRAMES),
            hub: Hub::start(places.hub_listen, places.hub_address_file).context("start the hub")?,
            shutdown: Shutdown::default(),
            _lock: lock,
        })
    }
}

fn lock(folder: &Path) -> Result<File> {
    let file = File::create(folder.join("lock")).context("open the lock file")?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => bail!("another process uses {}", folder.display()),
        Err(TryLockError::Error(error)) => Err(error).context("lock the folder"),
    }
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
