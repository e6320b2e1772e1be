//! Handing a run in: its state, its files, its end.

use crate::archive::{self, Manifest, manifest};
use crate::backoff::Backoff;
use crate::clock::monotonic_us;
use crate::desk::Desk;
use crate::durable;
use crate::lease::Lease;
use crate::run::Conclusion;
use crate::safety::LEASE_MARGIN_US;
use crate::service::{ServiceError, Upload};
use anyhow::{Context, Result};
use api::lab::StateReport;
use api::run::RunState;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::task::spawn_blocking;
use tokio::time::Instant;
use uuid::Uuid;

/// Marks a folder whose files are with the service, or never will be.
pub const DELIVERED_MARK: &str = "uploaded";
/// After a wish to end the process, handing in may go on for this long; the rest is salvaged at the next start.
const SHUTDOWN_GRACE: Duration = Duration::from_secs(8);

/// An attempt and its folder.
#[derive(Debug, Clone)]
pub struct Attempt {
    pub run_id: Uuid,
    pub epoch: i64,
    pub folder: PathBuf,
}

/// Archive, upload, end. Errors leave the folder for the salvage.
pub async fn deliver(desk: &Desk, attempt: &Attempt, conclusion: &Conclusion, lease: &Lease) {
    if let Err(error) = try_deliver(desk, attempt, conclusion, lease).await {
        tracing::warn!(run.id = %attempt.run_id, error = format!("{error:#}"), "not handed in; the salvage will try again");
    }
}

async fn try_deliver(desk: &Desk, attempt: &Attempt, conclusion: &Conclusion, lease: &Lease) -> Result<()> {
    let give_up = give_up(desk, lease);
    let uploading = StateReport {
        epoch: attempt.epoch,
        instance: desk.instance,
        state: RunState::Uploading,
        fault: None,
        ticks_recorded: None,
        ticks_missed: None,
    };
    report(desk, attempt.run_id, &uploading, &give_up)
        .await
        .context("report `uploading`")?;
    let manifest = build_archive(&attempt.folder).await?;
    upload_all(desk, attempt, &manifest, &give_up).await?;
    let sent = report_end(desk, attempt.run_id, attempt.epoch, conclusion, Some(&manifest), lease).await;
    if sent {
        mark_delivered(&attempt.folder, conclusion.state.as_str()).context("mark the folder")?;
    }
    Ok(())
}

/// Builds the archive of an attempt beside its journal.
pub async fn build_archive(folder: &Path) -> Result<Manifest> {
    let folder = folder.to_owned();
    spawn_blocking(move || archive::build(&folder, &folder.join("archive")))
        .await?
        .context("build the archive")
}

/// Sends all files, the page's track among them, the manifest last.
pub async fn upload_all(desk: &Desk, attempt: &Attempt, manifest: &Manifest, give_up: impl Fn() -> bool) -> Result<()> {
    let folder = attempt.folder.join("archive");
    let own = folder.clone();
    let describe = move || [archive::track::FILE_NAME, manifest::FILE_NAME].map(|name| manifest::describe(&own, name));
    let [track, last] = spawn_blocking(describe).await?;
    for file in manifest.files.iter().chain([&track?, &last?]) {
        let path = folder.join(&file.name);
        let upload = Upload {
            run_id: attempt.run_id,
            epoch: attempt.epoch,
            name: &file.name,
            path: &path,
            sha256: &file.sha256,
        };
        retry(|| desk.service.upload(upload), &give_up)
            .await
            .with_context(|| format!("send {}", file.name))?;
    }
    Ok(())
}

/// Reports the end of a run; false when it did not get through.
pub async fn report_end(
    desk: &Desk,
    run_id: Uuid,
    epoch: i64,
    conclusion: &Conclusion,
    manifest: Option<&Manifest>,
    lease: &Lease,
) -> bool {
    let end = StateReport {
        epoch,
        instance: desk.instance,
        state: conclusion.state,
        fault: conclusion.fault.clone(),
        ticks_recorded: manifest.map(|manifest| manifest.ticks_recorded),
        ticks_missed: manifest.map(|manifest| manifest.ticks_missed),
    };
    match report(desk, run_id, &end, give_up(desk, lease)).await {
        Ok(()) => true,
        Err(error) => {
            tracing::warn!(run.id = %run_id, %error, "the end of the run was not reported");
            false
        }
    }
}

/// Reports a state, again and again while the service is away and `give_up` says no.
pub async fn report(
    desk: &Desk,
    run_id: Uuid,
    report: &StateReport,
    give_up: impl Fn() -> bool,
) -> Result<(), ServiceError> {
    retry(|| desk.service.report(run_id, report), give_up).await
}

/// Marks a folder as done with.
pub fn mark_delivered(folder: &Path, how: &str) -> std::io::Result<()> {
    durable::write(&folder.join(DELIVERED_MARK), format!("{how}\n").as_bytes())
}

/// True when handing in under this lease makes no sense any more.
fn give_up<'a>(desk: &'a Desk, lease: &'a Lease) -> impl Fn() -> bool + 'a {
    let asked_to_end = std::sync::OnceLock::new();
    move || {
        let grace_over =
            desk.shutdown.is_requested() && asked_to_end.get_or_init(Instant::now).elapsed() > SHUTDOWN_GRACE;
        lease.is_stale() || grace_over || monotonic_us() > lease.until_us() + LEASE_MARGIN_US
    }
}

async fn retry<F: Future<Output = Result<(), ServiceError>>>(
    request: impl Fn() -> F,
    give_up: impl Fn() -> bool,
) -> Result<(), ServiceError> {
    let mut backoff = Backoff::default();
    loop {
        match request().await {
            Err(error) if error.is_temporary() && !give_up() => {
                tracing::debug!(%error, "trying again");
                tokio::time::sleep(backoff.next_wait()).await;
            }
            result => return result,
        }
    }
}
