//! `robopheus-simulate`: the virtual simulation server. It carries virtual runs out in the twin, and stands beside the
//! laboratory's runs as a live shadow.

use anyhow::{Context, Result};
use api::lab::{ClaimRequest, LabDescription, Side};
use clap::Parser;
use lab::backoff::Backoff;
use lab::begin::begin;
use lab::desk::{Desk, DeskPlaces};
use lab::ending::run_until_signal;
use lab::hub::VIRTUAL_ADDRESS_FILE;
use lab::record::Record;
use lab::shadow::ShadowRun;
use lab::{stream, subscription, virtual_loop};
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// How long the service may hold a claim.
const WAIT_S: f64 = 20.0;
/// An empty answer that came sooner than this was not a long poll: the service is ending.
const SHORT_POLL: Duration = Duration::from_secs(1);
/// After a wish to end, the process ends within this time whatever is left to do.
const EXIT_LIMIT: Duration = Duration::from_secs(5);

/// Carries virtual runs out in the twin, and drives it beside the laboratory's robots.
#[derive(Debug, Parser)]
#[command(name = "robopheus-simulate", version)]
struct Settings {
    /// Address of the laboratory's hub; what `<data>/lab-hub.addr` says when left out.
    #[arg(long)]
    hub: Option<String>,
    /// Data folder of the laboratory; journals of virtual runs lie in `<data>/virtual`.
    #[arg(long, env = "ROBOPHEUS_DATA", default_value = "data")]
    data: PathBuf,
    /// Address of the service. Without it there are no virtual runs, only the shadow.
    #[arg(long, env = "ROBOPHEUS_SERVER", requires_all = ["token_file", "lab"])]
    server: Option<String>,
    /// File with the bearer token of the role `lab`.
    #[arg(long, env = "ROBOPHEUS_LAB_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// Description of the laboratory, `robopheus.lab/1`: whose virtual runs these are.
    #[arg(long, env = "ROBOPHEUS_LAB")]
    lab: Option<PathBuf>,
    /// Where others follow virtual runs; port 0 takes any, the real one stands in `<data>/simulate-hub.addr`.
    #[arg(long, default_value = "127.0.0.1:0")]
    hub_listen: SocketAddr,
}

fn main() -> Result<()> {
    let settings: Settings = begin()?;
    let (hub, data) = (settings.hub.clone(), settings.data.clone());
    let shadow = std::thread::Builder::new()
        .name("shadow".to_owned())
        .spawn(move || subscription::keep(hub.as_deref(), &data, follow))?;
    match (&settings.server, &settings.token_file, &settings.lab) {
        (Some(server), Some(token_file), Some(lab)) => serve(&settings, server, token_file, lab),
        _ => {
            tracing::info!("no --server: no virtual runs, only the shadow");
            shadow.join().map_err(|_| anyhow::anyhow!("the shadow's thread failed"))
        }
    }
}

/// Takes and carries out virtual runs until the process is to end.
fn serve(settings: &Settings, server: &str, token_file: &Path, lab: &Path) -> Result<()> {
    let text = std::fs::read(lab).with_context(|| format!("read {}", lab.display()))?;
    let description: LabDescription =
        serde_json::from_slice(&text).with_context(|| format!("understand {}", lab.display()))?;
    let desk = Arc::new(Desk::open(&DeskPlaces {
        folder: &settings.data.join("virtual"),
        server,
        token_file,
        hub_listen: settings.hub_listen,
        hub_address_file: &settings.data.join(VIRTUAL_ADDRESS_FILE),
    })?);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?;
    let result = runtime.block_on(live(desk, description));
    runtime.shutdown_timeout(Duration::from_secs(1));
    result
}

async fn live(desk: Arc<Desk>, description: LabDescription) -> Result<()> {
    tokio::spawn(stream::keep(desk.service.clone(), desk.watchers.subscribe()));
    let claiming = tokio::spawn(keep_claiming(desk.clone(), description));
    run_until_signal(&desk, claiming, EXIT_LIMIT).await
}

async fn keep_claiming(desk: Arc<Desk>, description: LabDescription) {
    let mut backoff = Backoff::default();
    while !desk.shutdown.is_requested() {
        let request = ClaimRequest {
            lab: description.name.clone(),
            arena: description.arena.name.clone(),
            instance: desk.instance,
            wait_s: WAIT_S,
            side: Side::Virtual,
        };
        let asked = tokio::time::Instant::now();
        let next = tokio::select! {
            biased;
            () = desk.shutdown.requested() => return,
            next = virtual_loop::next_run(&desk, &request) => next,
        };
        match next {
            Ok(Some(assignment)) => {
                backoff.reset();
                virtual_loop::run(&desk, assignment).await;
            }
            Ok(None) => {
                backoff.reset();
                if asked.elapsed() < SHORT_POLL {
                    tokio::time::sleep(SHORT_POLL).await;
                }
            }
            Err(error) => {
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

/// Run after run, until the hub is gone.
fn follow(mut stream: TcpStream) -> Result<()> {
    let reader = BufReader::new(stream.try_clone()?);
    let mut shadow = ShadowRun::default();
    for line in reader.lines() {
        let line = line?;
        // Words about lost lines are no records.
        let Ok(record) = serde_json::from_str::<Record>(&line) else {
            tracing::warn!(line, "not a record");
            continue;
        };
        if let (Record::End(_), Some(gaps)) = (&record, shadow.gaps()) {
            let [median_mm, largest_mm] = [gaps.median_m, gaps.largest_m].map(|gap_m| 1e3 * gap_m);
            tracing::info!(
                samples = gaps.samples,
                "followed: gap 0.5 s ahead {median_mm:.1} mm median, {largest_mm:.1} mm largest"
            );
        }
        match shadow.take(&record) {
            Ok(Some(picture)) => {
                let mut line = serde_json::to_vec(&Record::Shadow(picture))?;
                line.push(b'\n');
                stream.write_all(&line)?;
            }
            Ok(None) => {}
            Err(problem) => tracing::warn!(problem, "this run has no shadow"),
        }
    }
    Ok(())
}
