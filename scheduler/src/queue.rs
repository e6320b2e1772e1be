//! What workers of both queues do between two jobs.

use crate::STORE_CALL_LIMIT;
use crate::stop::Stop;
use std::time::Duration;
use store::{Change, StoreError};
use tokio::sync::broadcast::{self, error::RecvError};
use tokio::time::timeout;

/// A call of the store that may not hang.
pub async fn limited<T>(call: impl Future<Output = Result<T, StoreError>>) -> anyhow::Result<T> {
    Ok(timeout(STORE_CALL_LIMIT, call).await??)
}

/// Until there may be work: a hint, or `poll_period` without one.
pub async fn wait_for_work(hints: &mut broadcast::Receiver<Change>, poll_period: Duration, stop: &mut Stop) {
    let hinted = async {
        loop {
            match hints.recv().await {
                Ok(Change::Run(_)) => {}
                Ok(Change::Jobs | Change::Reconnected) | Err(RecvError::Lagged(_)) => return,
                Err(RecvError::Closed) => std::future::pending::<()>().await,
            }
        }
    };
    tokio::select! {
        () = stop.requested() => {}
        () = hinted => {}
        () = tokio::time::sleep(poll_period) => {}
    }
}
