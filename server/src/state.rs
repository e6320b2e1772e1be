//! What every request can reach.

use crate::access::{Principal, Role};
use crate::app::error::AppError;
use crate::live::LiveHub;
use crate::objects::ObjectFolder;
use crate::stop_pages::StopPages;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use store::Store;
use tokio::sync::{Mutex, OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;

/// Open WebSockets and event streams of watchers, together.
pub const WATCHERS_LIMIT: usize = 1024;
/// Comparisons of models that are computed at the same time.
pub const COMPARISONS_AT_ONCE: usize = 1;
/// Name of the person at this machine.
pub const LOCAL_USER: &str = "local";

/// Cheap to clone; one per process.
#[derive(Clone)]
pub struct AppState(Arc<Inner>);

struct Inner {
    store: Store,
    objects: ObjectFolder,
    live: LiveHub,
    static_dir: PathBuf,
    /// `None` when other machines can reach the service: then everybody needs a token.
    local_user: Option<Principal>,
    own_hosts: Vec<String>,
    watchers: Arc<Semaphore>,
    stop_pages: StopPages,
    archive_gate: Mutex<()>,
    comparison_gate: Arc<Semaphore>,
    shutdown: CancellationToken,
}

/// What the state is made of.
pub struct StateParts {
    pub store: Store,
    pub objects: ObjectFolder,
    pub static_dir: PathBuf,
    /// Whether callers on this machine need no token.
    pub trust_loopback: bool,
    pub port: u16,
    pub shutdown: CancellationToken,
}

impl AppState {
    pub fn new(parts: StateParts) -> Self {
        let local = Principal {
            name: LOCAL_USER.to_owned(),
            roles: vec![Role::User, Role::Operator],
        };
        let mut own_hosts: Vec<_> = ["127.0.0.1", "localhost", "[::1]"]
            .iter()
            .map(|name| format!("{name}:{}", parts.port))
            .collect();
        if parts.port == 80 {
            own_hosts.extend(["127.0.0.1", "localhost", "[::1]"].map(str::to_owned));
        }
        Self(Arc::new(Inner {
            store: parts.store,
            objects: parts.objects,
            live: LiveHub::default(),
            static_dir: parts.static_dir,
            local_user: parts.trust_loopback.then_some(local),
            own_hosts,
            watchers: Arc::new(Semaphore::new(WATCHERS_LIMIT)),
            stop_pages: StopPages::default(),
            archive_gate: Mutex::new(()),
            comparison_gate: Arc::new(Semaphore::new(COMPARISONS_AT_ONCE)),
            shutdown: parts.shutdown,
        }))
    }

    pub fn store(&self) -> &Store {
        &self.0.store
    }

    pub fn objects(&self) -> &ObjectFolder {
        &self.0.objects
    }

    pub fn live(&self) -> &LiveHub {
        &self.0.live
    }

    /// Origins of the laboratories' protective stops.
    pub async fn stop_origins(&self) -> Vec<String> {
        self.0.stop_pages.origins(&self.0.store).await
    }

    pub fn static_dir(&self) -> &Path {
        &self.0.static_dir
    }

    /// Who a caller on this machine without a token is.
    pub fn local_user(&self) -> Option<&Principal> {
        self.0.local_user.as_ref()
    }

    /// Whether a `host:port` is this service on this machine. Keeps foreign pages out that rebind their name to loopback.
    pub fn is_own_host(&self, host: &str) -> bool {
        self.0.own_hosts.iter().any(|own| own.eq_ignore_ascii_case(host))
    }

    pub async fn principal_of_token(&self, token: &str) -> Result<Option<Principal>, AppError> {
        let found = self.0.store.token_lookup(token).await?;
        Ok(found.map(|found| Principal {
            name: found.user,
            roles: vec![found.role],
        }))
    }

    /// A place among the watchers, or nothing when all are taken.
    pub fn watcher(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.0.watchers).try_acquire_owned().ok()
    }

    /// Archives are built one at a time: building is disk and processor work only.
    pub fn archive_gate(&self) -> &Mutex<()> {
        &self.0.archive_gate
    }

    /// Places of comparisons of models: processor work that nobody else should have to wait for.
    pub fn comparison_gate(&self) -> &Arc<Semaphore> {
        &self.0.comparison_gate
    }

    /// Cancelled when the process is asked to end.
    pub fn shutdown(&self) -> &CancellationToken {
        &self.0.shutdown
    }
}
