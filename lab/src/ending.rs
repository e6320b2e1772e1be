//! How the process of a laboratory ends.

use crate::desk::Desk;
use anyhow::{Context, Result};
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio::task::JoinHandle;

/// Lets the claim loop run until the process is asked to end; then the loop has `limit` for what it is doing.
///
/// - Errors: the claim loop failed, or signals cannot be listened for.
pub async fn run_until_signal(desk: &Desk, mut claiming: JoinHandle<()>, limit: Duration) -> Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
        ended = &mut claiming => return ended.context("the claim loop failed"),
    }
    tracing::info!("ending");
    desk.shutdown.request();
    match tokio::time::timeout(limit, claiming).await {
        Ok(ended) => ended.context("the claim loop failed"),
        Err(_) => {
            tracing::warn!("ending with work left; it is salvaged at the next start");
            Ok(())
        }
    }
}
