//! Program `robopheus-lab`.

use anyhow::{Context, Result};
use lab::begin::begin;
use lab::config::Config;
use lab::ending::run_until_signal;
use lab::lab::Lab;
use lab::{claim, idle, stop_port, stream};
use std::time::Duration;

/// After a wish to end, the process ends within this time whatever is left to do.
const EXIT_LIMIT: Duration = Duration::from_secs(12);

fn main() -> Result<()> {
    let config: Config = begin()?;
    let lab = Lab::open(&config)?;
    let address = stop_port::start(config.stop_listen, &config.data, lab.latch.clone(), lab.clone())
        .with_context(|| format!("open the stop port {}", config.stop_listen))?;
    lab.tell_stop(address);
    idle::start(lab.link.clone(), lab.latch.clone(), lab.book.clone()).context("start the idle robots' thread")?;
    tracing::info!(lab = lab.description.name, stop = %address, stopped = lab.latch.is_pressed(), "laboratory ready");
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let result = runtime.block_on(live(lab));
    runtime.shutdown_timeout(Duration::from_secs(1));
    result
}

async fn live(lab: std::sync::Arc<Lab>) -> Result<()> {
    tokio::spawn(claim::keep_status(lab.clone()));
    tokio::spawn(stream::keep(lab.desk.service.clone(), lab.desk.watchers.subscribe()));
    let claiming = tokio::spawn(claim::keep_claiming(lab.clone()));
    run_until_signal(&lab.desk, claiming, EXIT_LIMIT).await
}
