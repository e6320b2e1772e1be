//! `robopheus-quick-lab`: a laboratory of emulated robots that needs no time. See `drills/src/quick/mod.rs`.

use anyhow::{Context, Result};
use api::lab::{ClaimRequest, LabDescription, LabStatus, RobotStatus, Side};
use clap::Parser;
use drills::quick::run;
use drills::quick::shelf::Shelf;
use emulator::hidden::Hidden;
use emulator::keys::Keys;
use lab::backoff::Backoff;
use lab::begin::begin;
use lab::desk::{Desk, DeskPlaces};
use lab::ending::run_until_signal;
use lab::hub::ADDRESS_FILE;
use lab::service::ServiceError;
use lab::{salvage, stream};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// How long the service may hold a claim.
const WAIT_S: f64 = 20.0;
/// An empty answer that came sooner than this was not a long poll: the service is ending.
const SHORT_POLL: Duration = Duration::from_secs(1);
/// Between two status reports.
const STATUS_PERIOD: Duration = Duration::from_secs(1);
/// After a wish to end, the process ends within this time whatever is left to do.
const EXIT_LIMIT: Duration = Duration::from_secs(5);

/// Carries runs out on emulated robots in virtual time, as fast as the machine can.
#[derive(Debug, Parser)]
#[command(name = "robopheus-quick-lab", version)]
struct Settings {
    /// Address of the service.
    #[arg(long, env = "ROBOPHEUS_SERVER")]
    server: String,
    /// File with the bearer token of the role `lab`.
    #[arg(long, env = "ROBOPHEUS_LAB_TOKEN_FILE")]
    token_file: PathBuf,
    /// Data folder; journals lie in `<data>/lab`.
    #[arg(long, env = "ROBOPHEUS_DATA", default_value = "data")]
    data: PathBuf,
    /// Description of the laboratory, `robopheus.lab/1`.
    #[arg(long, env = "ROBOPHEUS_LAB")]
    lab: PathBuf,
    /// Link keys, one per robot.
    #[arg(long, env = "ROBOPHEUS_KEYS")]
    keys: PathBuf,
    /// Socket of the hand that changes robots and floor between runs.
    #[arg(long, env = "ROBOPHEUS_HAND")]
    hand: PathBuf,
    /// Hidden configuration of robots and floors; the built-in one when left out.
    #[arg(long)]
    plant: Option<PathBuf>,
    /// Seed of the first run's noise and variation; every run has the next one.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where others follow runs; port 0 takes any.
    #[arg(long, default_value = "127.0.0.1:0")]
    hub_listen: SocketAddr,
}

fn main() -> Result<()> {
    let settings: Settings = begin()?;
    let text = std::fs::read(&settings.lab).with_context(|| format!("read {}", settings.lab.display()))?;
    let description: LabDescription =
        serde_json::from_slice(&text).with_context(|| format!("understand {}", settings.lab.display()))?;
    let keys = Keys::read(&settings.keys).with_context(|| format!("use {}", settings.keys.display()))?;
    let hidden = settings.plant.as_deref().map_or_else(Hidden::reference, Hidden::read)?;
    let desk = Arc::new(Desk::open(&DeskPlaces {
        folder: &settings.data.join("lab"),
        server: &settings.server,
        token_file: &settings.token_file,
        hub_listen: settings.hub_listen,
        hub_address_file: &settings.data.join(ADDRESS_FILE),
    })?);
    let shelf = Shelf::open(&description, hidden, &keys, settings.seed, &settings.hand)?;
    tracing::info!(lab = description.name, "quick laboratory ready: runs take virtual time");
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?;
    let result = runtime.block_on(live(desk, Arc::new(description), shelf, settings.seed));
    runtime.shutdown_timeout(Duration::from_secs(1));
    // The hand's thread never ends by itself, and its socket's file must not outlive the process.
    std::fs::remove_file(&settings.hand).ok();
    result
}

async fn live(desk: Arc<Desk>, description: Arc<LabDescription>, shelf: Shelf, seed: u64) -> Result<()> {
    tokio::spawn(stream::keep(desk.service.clone(), desk.watchers.subscribe()));
    let (status_desk, status_lab) = (desk.clone(), description.clone());
    tokio::spawn(async move {
        loop {
            // Told again a second later; a laboratory that the service lost is registered with the next claim.
            if let Err(error) = status_desk.service.status(&status(&status_lab)).await {
                tracing::debug!(%error, "status");
            }
            tokio::time::sleep(STATUS_PERIOD).await;
        }
    });
    let claiming = tokio::spawn(keep_claiming(desk.clone(), description, shelf, seed));
    run_until_signal(&desk, claiming, EXIT_LIMIT).await
}

/// All robots are fit: what is wrong with them is in the plant, where nobody looks.
fn status(description: &LabDescription) -> LabStatus {
    let robot = |robot: &api::robot::LabRobot| RobotStatus {
        name: robot.description.name.clone(),
        online: true,
        bus_v: robot.description.motor.as_ref().map(|motor| motor.supply_v),
        health: None,
        link: None,
        stop_acknowledged: false,
        activity: None,
    };
    LabStatus {
        lab: description.name.clone(),
        arena: description.arena.name.clone(),
        stopped: false,
        robots: description.robots.iter().map(robot).collect(),
    }
}

async fn keep_claiming(desk: Arc<Desk>, description: Arc<LabDescription>, shelf: Shelf, mut seed: u64) {
    let (mut backoff, mut registered) = (Backoff::default(), false);
    while !desk.shutdown.is_requested() {
        let asked = tokio::time::Instant::now();
        let next = tokio::select! {
            biased;
            () = desk.shutdown.requested() => return,
            next = next_run(&desk, &description, &mut registered) => next,
        };
        match next {
            Ok(Some(assignment)) => {
                backoff.reset();
                run::run(&desk, &description, &shelf, assignment, seed).await;
                seed = seed.wrapping_add(1);
            }
            Ok(None) => {
                backoff.reset();
                if asked.elapsed() < SHORT_POLL {
                    tokio::time::sleep(SHORT_POLL).await;
                }
            }
            Err(error) => {
                registered = false;
                let wait = backoff.next_wait();
                tracing::warn!(%error, ?wait, "no claim");
                tokio::select! {
                    () = desk.shutdown.requested() => return,
                    () = tokio::time::sleep(wait) => {}
                }
            }
        }
    }
}

async fn next_run(
    desk: &Desk,
    description: &LabDescription,
    registered: &mut bool,
) -> Result<Option<api::lab::Assignment>, ServiceError> {
    if !std::mem::replace(registered, true) {
        desk.service.register(description).await?;
        tracing::info!(lab = description.name, "registered");
    }
    salvage::sweep(desk).await?;
    desk.service.status(&status(description)).await?;
    let request = ClaimRequest {
        lab: description.name.clone(),
        arena: description.arena.name.clone(),
        instance: desk.instance,
        wait_s: WAIT_S,
        side: Side::Physical,
    };
    desk.service.claim(&request).await
}
