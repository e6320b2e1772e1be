//! The scheduler: rehearses submitted experiments in the twin and puts right what ran out.
//!
//! `decide` is pure policy, `claim` leases jobs and keeps their leases alive, `jobs` has one kind a file,
//! `reap` is a reconciler without input. `diagnose` is the other program of this package, `robopheus-diagnose-worker`. The process never ends because the database is away.

pub mod claim;
pub mod decide;
pub mod diagnose;
pub mod jobs;
pub mod objects;
pub mod program;
mod queue;
pub mod reap;
pub mod stop;

use std::path::PathBuf;
use std::time::Duration;
use stop::Stop;
use store::{Store, StoreOptions};

/// What the process is told at its start.
#[derive(Debug, Clone, clap::Parser)]
#[command(
    name = "robopheus-scheduler",
    about = "Rehearses experiments in the twin and reaps lost leases",
    version
)]
pub struct Config {
    /// PostgreSQL of the service.
    #[arg(long, env = "DATABASE_URL", hide_env_values = true)]
    pub database_url: String,
    /// Data folder; objects lie in `objects/` below it.
    #[arg(long, env = "ROBOPHEUS_DATA")]
    pub data: PathBuf,
    /// Rehearsals at the same time.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub workers: u8,
}

/// Runs until told to stop.
pub async fn run(config: Config, mut stop: Stop) -> anyhow::Result<()> {
    let database = Database {
        url: config.database_url.clone(),
        program: "robopheus-scheduler",
        connections: u32::from(config.workers) + 3,
    };
    let Some(store) = connect(&database, &mut stop).await else {
        return Ok(());
    };
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..config.workers {
        tasks.spawn(claim::work(store.clone(), config.data.join("objects"), stop.clone()));
    }
    tasks.spawn(reap::sweep(store.clone(), stop.clone()));
    tracing::info!(workers = config.workers, "scheduler ready");
    loop {
        let ended = tokio::select! {
            ended = tasks.join_next() => ended,
            () = stop.requested_since(STOP_LIMIT) => return Ok(()),
        };
        match ended {
            // A loop only ends when told to stop; a panic must not leave a process without workers behind.
            Some(ended) => ended?,
            None => return Ok(()),
        }
    }
}

/// Which database, as whom, with how many connections.
pub(crate) struct Database {
    pub url: String,
    pub program: &'static str,
    pub connections: u32,
}

/// Connects and migrates, for as long as it takes; `None` when told to stop meanwhile.
async fn connect(database: &Database, stop: &mut Stop) -> Option<Store> {
    let options = StoreOptions {
        application_name: database.program.to_owned(),
        max_connections: database.connections,
        ..StoreOptions::default()
    };
    let mut failures = 0;
    loop {
        let attempt = async {
            let store = Store::connect(&database.url, options.clone()).await?;
            store.migrate().await?;
            Ok::<_, store::StoreError>(store)
        };
        let error = tokio::select! {
            () = stop.requested() => return None,
            connected = attempt => match connected {
                Ok(store) => return Some(store),
                Err(error) => anyhow::Error::from(error),
            },
        };
        tracing::warn!(error = format!("{error:#}"), "no database yet");
        if stop.sleep(decide::outage_pause(failures, decide::random())).await {
            return None;
        }
        failures = failures.saturating_add(1);
    }
}

/// When told to stop, the loops have this long to give their jobs back.
pub(crate) const STOP_LIMIT: Duration = Duration::from_secs(3);
/// Longest wait for one call of the store, its own limits included.
pub(crate) const STORE_CALL_LIMIT: Duration = Duration::from_secs(10);
