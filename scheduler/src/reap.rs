//! The reconciler's loop: one sweep a second, whatever happens.

use crate::stop::Stop;
use crate::{STORE_CALL_LIMIT, decide, jobs};
use std::time::Duration;
use store::{ReapLimits, Reaped, Store};
use tokio::time::timeout;

/// Time between two sweeps.
pub const SWEEP_PERIOD: Duration = Duration::from_secs(1);

/// The limits that this process reaps by.
pub const LIMITS: ReapLimits = ReapLimits {
    run_attempts: store::RUN_ATTEMPTS,
    job_attempts: jobs::rehearse::ATTEMPTS,
    arena_hold: store::ARENA_HOLD,
};

/// Sweeps until told to stop.
pub async fn sweep(store: Store, mut stop: Stop) {
    let mut failures = 0;
    loop {
        let swept = tokio::select! {
            () = stop.requested() => return,
            swept = timeout(STORE_CALL_LIMIT, store.reap(&LIMITS)) => swept,
        };
        let pause = match swept {
            Ok(Ok(reaped)) => {
                failures = 0;
                reaped.iter().for_each(log);
                SWEEP_PERIOD
            }
            Ok(Err(error)) => {
                tracing::warn!(error = format!("{:#}", anyhow::Error::from(error)), "the sweep failed");
                failures += 1;
                decide::outage_pause(failures, decide::random())
            }
            Err(_) => {
                tracing::warn!("the sweep took too long");
                SWEEP_PERIOD
            }
        };
        if stop.sleep(pause).await {
            return;
        }
    }
}

fn log(reaped: &Reaped) {
    match reaped {
        Reaped::Run { run_id, epoch, state } => {
            tracing::warn!(run.id = %run_id, epoch, state = state.as_str(), "a laboratory lost its lease");
        }
        Reaped::Job {
            job_id,
            run_id,
            attempt,
            failed,
        } => {
            tracing::warn!(job.id = %job_id, run.id = %run_id, attempt, failed, "a worker lost its lease");
        }
    }
}
