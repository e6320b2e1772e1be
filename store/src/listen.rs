//! Hints that something changed, from one LISTEN connection per process.

use crate::connect::Store;
use crate::outcome::Change;
use sqlx::Executor;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPoolOptions};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Changes a slow reader may be behind before it loses the oldest.
const BACKLOG: usize = 1024;
/// After this much silence the connection is asked whether it still lives.
const PROBE_AFTER: Duration = Duration::from_secs(5);
const PROBE_ANSWER: Duration = Duration::from_secs(3);
const RETRY_FIRST: Duration = Duration::from_millis(100);
const RETRY_LAST: Duration = Duration::from_secs(5);

pub(crate) struct Listener {
    changes: broadcast::Sender<Change>,
    task: JoinHandle<()>,
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Store {
    /// Changes from now on. A hint only: notifications are lost while the connection is down (`Reconnected`
    /// follows) and when the reader lags (`RecvError::Lagged`), so callers poll as well. Call inside a tokio runtime.
    pub fn listen(&self) -> broadcast::Receiver<Change> {
        let listener = self.listener.get_or_init(|| {
            let (changes, _) = broadcast::channel(BACKLOG);
            let task = tokio::spawn(keep_listening(Arc::clone(&self.patient), changes.clone()));
            Listener { changes, task }
        });
        listener.changes.subscribe()
    }
}

async fn keep_listening(options: Arc<PgConnectOptions>, changes: broadcast::Sender<Change>) {
    let mut retry = RETRY_FIRST;
    loop {
        match connect(&options).await {
            Ok(listener) => {
                retry = RETRY_FIRST;
                // Nobody may be subscribed at the moment; that is no error.
                let _ = changes.send(Change::Reconnected);
                let lost = forward(listener, &changes).await;
                tracing::warn!(error = %lost, "listening to the database was interrupted");
            }
            Err(error) => tracing::debug!(%error, "cannot listen to the database yet"),
        }
        tokio::time::sleep(retry).await;
        retry = (retry * 2).min(RETRY_LAST);
    }
}

async fn connect(options: &PgConnectOptions) -> Result<PgListener, sqlx::Error> {
    let pool = PgPoolOptions::new()
        .max_connections(1)
        .max_lifetime(None)
        .idle_timeout(None)
        .acquire_timeout(PROBE_ANSWER)
        .connect_with(options.clone())
        .await?;
    let mut listener = PgListener::connect_with(&pool).await?;
    listener.listen_all(["robopheus_runs", "robopheus_jobs"]).await?;
    Ok(listener)
}

/// Hands notifications on until the connection is lost.
async fn forward(mut listener: PgListener, changes: &broadcast::Sender<Change>) -> sqlx::Error {
    loop {
        let change = match timeout(PROBE_AFTER, listener.try_recv()).await {
            Ok(Ok(Some(notification))) if notification.channel() == "robopheus_jobs" => Change::Jobs,
            Ok(Ok(Some(notification))) => match notification.payload().parse() {
                Ok(run_id) => Change::Run(run_id),
                Err(_) => continue,
            },
            Ok(Ok(None)) => Change::Reconnected,
            Ok(Err(error)) => return error,
            Err(_) => match timeout(PROBE_ANSWER, listener.execute("SELECT 1")).await {
                Ok(Ok(_)) => continue,
                Ok(Err(error)) => return error,
                Err(_) => return sqlx::Error::PoolTimedOut,
            },
        };
        let _ = changes.send(change);
    }
}
