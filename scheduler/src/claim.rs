//! A worker: claims a job, keeps its lease alive, writes how it ended. Nothing is awaited inside a transaction.

use crate::decide;
use crate::jobs::{Ending, rehearse};
use crate::queue::{limited, wait_for_work};
use crate::stop::Stop;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use store::{JobLease, JobWrite, Store};
use tokio::time::{MissedTickBehavior, interval, timeout};
use uuid::Uuid;

/// Jobs are looked for this often even when no hint came.
pub const POLL_PERIOD: Duration = Duration::from_secs(1);
/// Longest wait, when told to stop, for a job to be given back; its lease runs out anyway.
const RELEASE_LIMIT: Duration = Duration::from_secs(2);

/// When told to stop, a claim under way has this long to come back.
const CLAIM_GRACE: Duration = Duration::from_millis(500);

/// Works until told to stop.
pub async fn work(store: Store, objects: PathBuf, mut stop: Stop) {
    let worker = Uuid::now_v7();
    let mut hints = store.listen();
    let mut failures = 0;
    while !stop.is_requested() {
        let claimed = tokio::select! {
            claimed = limited(store.job_claim(rehearse::KIND, worker, rehearse::LEASE)) => claimed,
            // Not cut off at once: a claim that was already made would be lost for a whole lease.
            () = stop.requested_since(CLAIM_GRACE) => return,
        };
        match claimed {
            Ok(Some(job)) => {
                failures = 0;
                carry_out(&store, objects.clone(), &job, &mut stop).await;
            }
            Ok(None) => {
                failures = 0;
                wait_for_work(&mut hints, POLL_PERIOD, &mut stop).await;
            }
            Err(error) => {
                tracing::warn!(error = format!("{error:#}"), "cannot look for jobs");
                stop.sleep(decide::outage_pause(failures, decide::random())).await;
                failures = failures.saturating_add(1);
            }
        }
    }
}

/// Runs a leased job while its lease holds and nobody asks to stop.
async fn carry_out(store: &Store, objects: PathBuf, job: &JobLease, stop: &mut Stop) {
    let abandon = Arc::new(AtomicBool::new(false));
    let begun = Instant::now();
    let mut ending = std::pin::pin!(rehearse::run(store, objects, job, Arc::clone(&abandon)));
    let mut beat = interval(rehearse::BEAT);
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let ending = loop {
        tokio::select! {
            ending = &mut ending => break ending,
            () = stop.requested() => {
                abandon.store(true, Ordering::Relaxed);
                break Ending::Stopped;
            }
            _ = beat.tick() => {
                // Away is not lost: the lease decides, and every write is fenced.
                if let Ok(JobWrite::Stale) = limited(store.job_heartbeat(job, rehearse::LEASE)).await {
                    tracing::warn!(job.id = %job.id, run.id = %job.run_id, "the job is no longer ours");
                    abandon.store(true, Ordering::Relaxed);
                    return;
                }
            }
        }
    };
    tracing::debug!(job.id = %job.id, run.id = %job.run_id, elapsed_ms = begun.elapsed().as_millis() as u64, "job ended");
    write(store, job, &ending, stop).await;
}

/// Writes the ending; tries again while the database is away, until the lease is over for certain.
async fn write(store: &Store, job: &JobLease, ending: &Ending, stop: &mut Stop) {
    if matches!(ending, Ending::Stopped) {
        if !matches!(timeout(RELEASE_LIMIT, store.job_release(job)).await, Ok(Ok(_))) {
            tracing::info!(job.id = %job.id, "the job could not be given back; it is free when its lease runs out");
        }
        return;
    }
    let begun = Instant::now();
    let mut failures = 0;
    loop {
        let written = limited(async {
            match ending {
                Ending::Verdict(record) => store.run_verdict_set(job, record).await,
                Ending::Failed { error, then } => store.job_fail(job, error, then).await,
                Ending::Nothing | Ending::Stopped => store.job_complete(job).await,
            }
        })
        .await;
        match written {
            Ok(JobWrite::Ok) => return log_ending(job, ending),
            Ok(JobWrite::Stale) => {
                tracing::warn!(job.id = %job.id, run.id = %job.run_id, "the job ended too late and was not written");
                return;
            }
            Err(error) if begun.elapsed() > rehearse::LEASE => {
                tracing::warn!(job.id = %job.id, error = format!("{error:#}"), "the ending could not be written in time");
                return;
            }
            Err(error) => {
                tracing::warn!(job.id = %job.id, error = format!("{error:#}"), "the ending is not written yet");
                if stop.sleep(decide::outage_pause(failures, decide::random())).await {
                    return;
                }
                failures = failures.saturating_add(1);
            }
        }
    }
}

fn log_ending(job: &JobLease, ending: &Ending) {
    match ending {
        Ending::Verdict(record) => {
            let (accepted, digest) = (record.accepted, record.verdict.digest.as_str());
            tracing::info!(run.id = %job.run_id, accepted, digest, "rehearsed");
        }
        Ending::Failed { error, .. } => {
            tracing::warn!(run.id = %job.run_id, attempt = job.attempt, error, "rehearsal failed")
        }
        Ending::Nothing | Ending::Stopped => {}
    }
}
