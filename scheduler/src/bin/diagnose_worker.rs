//! Program `robopheus-diagnose-worker`.

use clap::Parser;
use scheduler::diagnose::{Config, run};
use scheduler::stop;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;

fn main() -> anyhow::Result<()> {
    let config = Config::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let result = runtime.block_on(async {
        let (handle, stop) = stop::stop_pair();
        let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
        tokio::spawn(async move {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            tracing::info!("stopping");
            handle.stop();
            // Keeps the handle until the process ends.
            std::future::pending::<()>().await;
        });
        run(config, stop).await
    });
    // A diagnosis looks at its end flag between two work items; nothing is waited for.
    runtime.shutdown_background();
    result
}
