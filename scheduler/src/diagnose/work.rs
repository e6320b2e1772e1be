//! Claims diagnoses one after the other, keeps their leases alive, writes how they ended.

use super::{BEAT, Ending, LEASE, TIMEOUT, Threads, bundle_of};
use crate::decide;
use crate::objects::{self, NewObject};
use crate::queue::{limited, wait_for_work};
use crate::stop::Stop;
use identify::diagnose::{DiagnoseError, Input, Run, diagnose};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use store::{DIAGNOSIS_ATTEMPTS, DiagnosisBeat, DiagnosisLease, DiagnosisRecord, JobWrite, Store, StoreError};
use tokio::time::{MissedTickBehavior, interval, timeout};
use twin::model_document::ModelDocument;
use uuid::Uuid;

/// Diagnoses are looked for this often even when no hint came.
const POLL_PERIOD: Duration = Duration::from_secs(2);
/// When told to stop, a claim under way has this long to come back, and a diagnosis to be given back.
const CLAIM_GRACE: Duration = Duration::from_millis(500);
const RELEASE_LIMIT: Duration = Duration::from_secs(2);

/// Works until told to stop.
pub async fn work(store: Store, objects: PathBuf, threads: usize, mut stop: Stop) {
    let worker = Uuid::now_v7();
    let mut hints = store.listen();
    let mut failures = 0;
    while !stop.is_requested() {
        let claimed = tokio::select! {
            claimed = limited(store.diagnosis_claim(worker, LEASE)) => claimed,
            () = stop.requested_since(CLAIM_GRACE) => return,
        };
        match claimed {
            Ok(Some(job)) => {
                failures = 0;
                carry_out(&store, &objects, threads, &job, &mut stop).await;
            }
            Ok(None) => {
                failures = 0;
                wait_for_work(&mut hints, POLL_PERIOD, &mut stop).await;
            }
            Err(error) => {
                tracing::warn!(error = format!("{error:#}"), "cannot look for diagnoses");
                stop.sleep(decide::outage_pause(failures, decide::random())).await;
                failures = failures.saturating_add(1);
            }
        }
    }
}

/// Runs a leased diagnosis while its lease holds and nobody asks for its end.
async fn carry_out(store: &Store, objects: &Path, threads: usize, job: &DiagnosisLease, stop: &mut Stop) {
    let threads = Arc::new(Threads::new(threads));
    let begun = Instant::now();
    tracing::info!(diagnosis.id = %job.id, robot = job.robot, attempt = job.attempt, "diagnosis begins");
    let mut ending = std::pin::pin!(diagnosed(store, objects, job, Arc::clone(&threads)));
    let mut beat = interval(BEAT);
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut too_long = false;
    let ending = loop {
        tokio::select! {
            ending = &mut ending => break ending,
            () = stop.requested() => {
                threads.cancel();
                break Ending::Stopped;
            }
            _ = beat.tick() => {
                too_long |= begun.elapsed() > TIMEOUT;
                let (stage, share) = threads.so_far();
                // Away is not lost: the lease decides, and every write is fenced.
                match limited(store.diagnosis_heartbeat(job, LEASE, &stage, share)).await {
                    Ok(DiagnosisBeat::Stale) => {
                        tracing::warn!(diagnosis.id = %job.id, "the diagnosis is no longer ours");
                        threads.cancel();
                        return;
                    }
                    Ok(DiagnosisBeat::Ok { cancel_requested }) if cancel_requested || too_long => threads.cancel(),
                    _ => {}
                }
            }
        }
    };
    let ending = match ending {
        Ending::Problem(problem) if too_long && problem.code == CANCELLED => Ending::problem(
            "diagnosis_timeout",
            format!("The diagnosis did not finish within {} s.", TIMEOUT.as_secs()),
        ),
        other => other,
    };
    tracing::info!(diagnosis.id = %job.id, elapsed_ms = begun.elapsed().as_millis() as u64, "diagnosis ended");
    write(store, job, &ending, stop).await;
}

/// Code of an end that was asked for.
const CANCELLED: &str = "cancelled_by_user";

async fn diagnosed(store: &Store, objects: &Path, job: &DiagnosisLease, threads: Arc<Threads>) -> Ending {
    let input = match input_of(store, objects, job).await {
        Ok(input) => input,
        Err(ending) => return ending,
    };
    let (objects, job) = (objects.to_owned(), job.clone());
    let working = tokio::task::spawn_blocking(move || {
        let found = match diagnose(&*threads, &input) {
            Ok(found) => found,
            Err(DiagnoseError::Cancelled(_)) => return Ending::problem(CANCELLED, "Cancelled."),
            Err(error) => return Ending::problem("not_diagnosable", format!("{error}.")),
        };
        match record(&objects, &job, &found) {
            Ok(record) => Ending::Found(Box::new(record)),
            Err(error) => Ending::Failed(format!("{error:#}")),
        }
    });
    working
        .await
        .unwrap_or_else(|panic| Ending::Failed(format!("the diagnosis panicked: {panic}")))
}

/// Reads all bundles and the model that should explain them.
async fn input_of(store: &Store, objects: &Path, job: &DiagnosisLease) -> Result<Input, Ending> {
    let model = job.parent_model.as_deref().map(ModelDocument::parse).transpose();
    let mut input = Input {
        references: Vec::new(),
        runs: Vec::new(),
        locked: Vec::new(),
        model: model
            .map_err(|error| Ending::problem("not_diagnosable", format!("The model cannot be read: {error}.")))?,
        seed: 1,
    };
    for of_role in &job.runs {
        let file = bundle_of(store, objects, of_role.run, &job.robot)
            .await
            .map_err(|error| {
                if error.chain().any(|cause| cause.is::<StoreError>()) {
                    Ending::Failed(format!("{error:#}"))
                } else {
                    Ending::problem("run_unreadable", format!("{error:#}."))
                }
            })?;
        let run = Run {
            path: file.path,
            sha256: file.sha256,
            bundle: file.bundle,
        };
        match of_role.role.as_str() {
            "reference" => input.references.push(run),
            "locked" => input.locked.push(run),
            _ => input.runs.push(run),
        }
    }
    Ok(input)
}

/// Report, page and model version; the page's file is written here.
fn record(
    objects: &Path,
    job: &DiagnosisLease,
    found: &identify::diagnose::Diagnosis,
) -> anyhow::Result<DiagnosisRecord> {
    let report = &found.report;
    let verdict = serde_json::to_value(report.verdict)?;
    let page = identify::report::page(report);
    let page = objects::write(
        objects,
        &NewObject {
            name: "report.html",
            media_type: "text/html; charset=utf-8",
            object_path: &format!("diagnoses/{}/{}/report.html", job.id, job.attempt),
            bytes: page.as_bytes(),
        },
    )?;
    Ok(DiagnosisRecord {
        verdict: verdict.as_str().unwrap_or_default().to_owned(),
        sentence: report.sentence.clone(),
        next_why: report.next_experiment.as_ref().map(|next| next.why.clone()),
        report: report.text(),
        page,
        model: serde_json::to_value(&found.model)?,
    })
}

/// Writes the ending; tries again while the database is away, until the lease is over for certain.
async fn write(store: &Store, job: &DiagnosisLease, ending: &Ending, stop: &mut Stop) {
    if matches!(ending, Ending::Stopped) {
        if !matches!(timeout(RELEASE_LIMIT, store.diagnosis_release(job)).await, Ok(Ok(_))) {
            tracing::info!(diagnosis.id = %job.id, "not given back; it is free when its lease runs out");
        }
        return;
    }
    let begun = Instant::now();
    let mut failures = 0;
    loop {
        match limited(write_once(store, job, ending)).await {
            Ok(JobWrite::Ok) => return,
            Ok(JobWrite::Stale) => {
                tracing::warn!(diagnosis.id = %job.id, "the diagnosis ended too late and was not written");
                return;
            }
            Err(error) if begun.elapsed() > LEASE => {
                tracing::warn!(diagnosis.id = %job.id, error = format!("{error:#}"), "the ending could not be written in time");
                return;
            }
            Err(error) => {
                tracing::warn!(diagnosis.id = %job.id, error = format!("{error:#}"), "the ending is not written yet");
                if stop.sleep(decide::outage_pause(failures, decide::random())).await {
                    return;
                }
                failures = failures.saturating_add(1);
            }
        }
    }
}

async fn write_once(store: &Store, job: &DiagnosisLease, ending: &Ending) -> Result<JobWrite, StoreError> {
    match ending {
        Ending::Found(record) => store.diagnosis_complete(job, record).await,
        Ending::Problem(problem) => store.diagnosis_fail(job, problem).await,
        Ending::Failed(error) if job.tries < DIAGNOSIS_ATTEMPTS => {
            tracing::warn!(diagnosis.id = %job.id, error, "the diagnosis failed and is tried again");
            let pause = decide::retry_pause(u32::try_from(job.tries).unwrap_or(0), decide::random());
            store.diagnosis_retry(job, pause).await
        }
        Ending::Failed(error) => {
            tracing::error!(diagnosis.id = %job.id, error, "the diagnosis failed");
            let Ending::Problem(problem) = Ending::problem(
                "diagnosis_failed",
                "The diagnosis failed inside the service; its log says why.",
            ) else {
                return Ok(JobWrite::Stale);
            };
            store.diagnosis_fail(job, &problem).await
        }
        Ending::Stopped => store.diagnosis_release(job).await,
    }
}
