//! What both programs of this package do around their work: log, runtime, signals.

use crate::stop::{self, Stop};
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;

/// Runs until the work ends by itself or by SIGTERM or SIGINT. Nothing is waited for then: work looks at its stop flag.
///
/// - `threads`: of the runtime; processor time is spent on blocking threads beside it.
pub fn carry_on<F: Future<Output = anyhow::Result<()>>>(
    threads: usize,
    work: impl FnOnce(Stop) -> F,
) -> anyhow::Result<()> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads)
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
        work(stop).await
    });
    runtime.shutdown_background();
    result
}
