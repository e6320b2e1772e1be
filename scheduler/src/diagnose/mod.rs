//! Program `robopheus-diagnose-worker`: carries diagnoses out, keeps the gap of every finished run, and queues what follows.
//!
//! A process of its own, not a job kind of the scheduler: a diagnosis takes half a minute to some minutes of processor time,
//! and rehearsals, which people wait for, must never stand behind one. It runs at low priority (`cargo xtask up` starts it
//! under `nice`), and one that runs out of memory takes no rehearsal with it.

mod ending;
mod sweep;
mod threads;
mod work;

pub use ending::Ending;
pub use threads::Threads;

use crate::STOP_LIMIT;
use crate::stop::Stop;
use anyhow::{Context, ensure};
use bundles::BundleFile;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::time::Duration;
use store::{FileRecord, Store};

/// A worker that says nothing for this long has lost its diagnosis.
pub const LEASE: Duration = Duration::from_secs(20);
/// Time between two heartbeats; progress is seen as often.
pub const BEAT: Duration = Duration::from_secs(1);
/// Longest diagnosis.
pub const TIMEOUT: Duration = Duration::from_secs(1800);

/// What the process is told at its start.
#[derive(Debug, Clone, clap::Parser)]
#[command(
    name = "robopheus-diagnose-worker",
    about = "Finds out why runs and twin disagree, and keeps the gap of every finished run",
    version
)]
pub struct Config {
    /// PostgreSQL of the service.
    #[arg(long, env = "DATABASE_URL", hide_env_values = true)]
    pub database_url: String,
    /// Data folder; objects lie in `objects/` below it.
    #[arg(long, env = "ROBOPHEUS_DATA")]
    pub data: PathBuf,
    /// Threads of a diagnosis; its result does not depend on them.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub threads: u8,
}

/// Runs until told to stop.
pub async fn run(config: Config, mut stop: Stop) -> anyhow::Result<()> {
    let database = crate::Database {
        url: config.database_url.clone(),
        program: "robopheus-diagnose-worker",
        connections: 4,
    };
    let Some(store) = crate::connect(&database, &mut stop).await else {
        return Ok(());
    };
    let objects = config.data.join("objects");
    let mut tasks = tokio::task::JoinSet::new();
    tasks.spawn(work::work(
        store.clone(),
        objects.clone(),
        usize::from(config.threads),
        stop.clone(),
    ));
    tasks.spawn(sweep::sweep(store.clone(), objects, stop.clone()));
    tracing::info!(threads = config.threads, "diagnose worker ready");
    loop {
        let ended = tokio::select! {
            ended = tasks.join_next() => ended,
            () = stop.requested_since(STOP_LIMIT) => return Ok(()),
        };
        match ended {
            Some(ended) => ended?,
            None => return Ok(()),
        }
    }
}

/// A robot's bundle in a run, its bytes checked against the database.
///
/// - Errors: words for a person, when the run holds no readable bundle of this robot.
async fn bundle_of(store: &Store, objects: &Path, run: uuid::Uuid, robot: &str) -> anyhow::Result<BundleFile> {
    let files = store
        .run_bundle_files(run, robot)
        .await
        .context("the database does not answer")?;
    let (objects, robot) = (objects.to_owned(), robot.to_owned());
    let reading = tokio::task::spawn_blocking(move || read(&objects, run, &robot, &files));
    reading.await.context("reading the bundle panicked")?
}

fn read(objects: &Path, run: uuid::Uuid, robot: &str, files: &[FileRecord]) -> anyhow::Result<BundleFile> {
    bundles::of_run(format!("run {run}"), robot, |name| {
        let file = files.iter().find(|file| file.name == name);
        file.map(|file| bytes_of(objects, file)).transpose()
    })
}

fn bytes_of(objects: &Path, file: &FileRecord) -> anyhow::Result<Vec<u8>> {
    let bytes =
        std::fs::read(objects.join(&file.object_path)).with_context(|| format!("{} cannot be read", file.name))?;
    let sha256: String = Sha256::digest(&bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    ensure!(sha256 == file.sha256, "{} is damaged in the store", file.name);
    Ok(bytes)
}
