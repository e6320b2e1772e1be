//! Diagnoses as their worker sees them: leased, fenced by attempt, taken again when a worker is lost.

use crate::connect::Store;
use crate::error::{Result, StoreError, seconds};
use crate::model::{insert_model, model_document};
use crate::outcome::{DiagnosisBeat, DiagnosisLease, DiagnosisRecord, DiagnosisRun, JobWrite};
use crate::run_file::FileRow;
use api::diagnosis::DiagnosisProblem;
use std::time::Duration;
use uuid::Uuid;

/// Tries of a diagnosis before it fails.
pub const DIAGNOSIS_ATTEMPTS: i32 = 3;

impl Store {
    /// Leases the oldest diagnosis that waits.
    pub async fn diagnosis_claim(&self, worker: Uuid, lease: Duration) -> Result<Option<DiagnosisLease>> {
        let row: Option<(Uuid, i32, i32, String, String, Option<Uuid>)> = sqlx::query_as(
            "WITH next AS (
                SELECT id FROM diagnoses WHERE state = 'queued' AND ready_at <= clock_timestamp()
                ORDER BY ready_at, created_at LIMIT 1 FOR UPDATE SKIP LOCKED)
             UPDATE diagnoses d SET state = 'running', attempt = d.attempt + 1, worker = $1,
                leased_until = clock_timestamp() + make_interval(secs => $2),
                started_at = coalesce(d.started_at, clock_timestamp()), progress = 0, stage = 'read'
             FROM next WHERE d.id = next.id
             RETURNING d.id, d.attempt, d.attempt - d.released, d.robot, d.floor, d.parent_model",
        )
        .bind(worker)
        .bind(seconds("lease", lease)?)
        .fetch_optional(&self.pool)
        .await?;
        let Some((id, attempt, tries, robot, floor, parent_model)) = row else {
            return Ok(None);
        };
        let parent = match parent_model {
            Some(model) => Some(model_document(&mut *self.pool.acquire().await?, model).await?),
            None => None,
        };
        let runs: Vec<(Uuid, String)> =
            sqlx::query_as("SELECT run_id, role FROM diagnosis_runs WHERE diagnosis_id = $1 ORDER BY role, place")
                .bind(id)
                .fetch_all(&self.pool)
                .await?;
        Ok(Some(DiagnosisLease {
            id,
            attempt,
            tries,
            worker,
            robot,
            floor,
            parent_model: parent,
            runs: runs.into_iter().map(|(run, role)| DiagnosisRun { run, role }).collect(),
        }))
    }

    /// Extends the lease that still holds, writes progress down, and tells whether the diagnosis is still wanted.
    pub async fn diagnosis_heartbeat(
        &self,
        job: &DiagnosisLease,
        lease: Duration,
        stage: &str,
        progress: f64,
    ) -> Result<DiagnosisBeat> {
        let cancel: Option<bool> = sqlx::query_scalar(
            "UPDATE diagnoses SET leased_until = clock_timestamp() + make_interval(secs => $4), stage = $5,
                progress = greatest(progress, $6)
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'running' AND leased_until > clock_timestamp()
             RETURNING cancel_requested",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .bind(seconds("lease", lease)?)
        .bind(stage)
        .bind(progress.clamp(0.0, 1.0))
        .fetch_optional(&self.pool)
        .await?;
        Ok(match cancel {
            Some(cancel_requested) => DiagnosisBeat::Ok { cancel_requested },
            None => DiagnosisBeat::Stale,
        })
    }

    /// Gives a diagnosis back in good order (the worker was asked to stop); another may take it at once.
    pub async fn diagnosis_release(&self, job: &DiagnosisLease) -> Result<JobWrite> {
        self.diagnosis_again(job, Duration::ZERO, true).await
    }

    /// Puts a diagnosis back after a failure that may pass.
    pub async fn diagnosis_retry(&self, job: &DiagnosisLease, after: Duration) -> Result<JobWrite> {
        self.diagnosis_again(job, after, false).await
    }

    async fn diagnosis_again(&self, job: &DiagnosisLease, after: Duration, released: bool) -> Result<JobWrite> {
        let written = sqlx::query(
            "UPDATE diagnoses SET state = 'queued', leased_until = NULL, progress = 0, stage = '',
                released = released + CASE WHEN $5 THEN 1 ELSE 0 END,
                ready_at = clock_timestamp() + make_interval(secs => $4)
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'running' AND leased_until > clock_timestamp()",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .bind(after.as_secs_f64())
        .bind(released)
        .execute(&self.pool)
        .await?;
        Ok(write_of(written.rows_affected()))
    }

    /// Stores report, page and model version, all or nothing.
    pub async fn diagnosis_complete(&self, job: &DiagnosisLease, record: &DiagnosisRecord) -> Result<JobWrite> {
        let mut transaction = self.pool.begin().await?;
        let holds: Option<(Option<Uuid>,)> = sqlx::query_as(
            "SELECT parent_model FROM diagnoses
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'running' AND leased_until > clock_timestamp() FOR UPDATE",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some((parent,)) = holds else {
            return Ok(JobWrite::Stale);
        };
        let model = insert_model(&mut transaction, &job.robot, &job.floor, parent, &record.model).await?;
        sqlx::query(
            "UPDATE diagnoses SET state = 'done', leased_until = NULL, progress = 1, stage = '', ended_at = clock_timestamp(),
                verdict = $2, sentence = $3, next_why = $4, report = $5::json, page_path = $6, page_sha256 = $7, page_bytes = $8,
                model_id = $9
             WHERE id = $1",
        )
        .bind(job.id)
        .bind(&record.verdict)
        .bind(&record.sentence)
        .bind(&record.next_why)
        .bind(&record.report)
        .bind(&record.page.object_path)
        .bind(&record.page.sha256)
        .bind(record.page.bytes)
        .bind(model)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(JobWrite::Ok)
    }

    /// Ends a diagnosis without a result: `cancelled` when that was asked for, else `failed`.
    pub async fn diagnosis_fail(&self, job: &DiagnosisLease, problem: &DiagnosisProblem) -> Result<JobWrite> {
        let written = sqlx::query(
            "UPDATE diagnoses SET leased_until = NULL, ended_at = clock_timestamp(),
                state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'failed' END,
                problem_code = CASE WHEN cancel_requested THEN 'cancelled_by_user' ELSE $4 END,
                problem_message = CASE WHEN cancel_requested THEN 'Cancelled by ' || cancel_requested_by || '.' ELSE $5 END
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'running' AND leased_until > clock_timestamp()",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .bind(&problem.code)
        .bind(&problem.message)
        .execute(&self.pool)
        .await?;
        Ok(write_of(written.rows_affected()))
    }

    /// Puts diagnoses of lost workers back, or ends them when that happened too often; their ids.
    pub async fn diagnoses_reap(&self) -> Result<Vec<Uuid>> {
        let reaped: Vec<Uuid> = sqlx::query_scalar(
            "UPDATE diagnoses SET leased_until = NULL, progress = 0, stage = '', ready_at = clock_timestamp(),
                state = CASE WHEN cancel_requested THEN 'cancelled' WHEN attempt - released >= $1 THEN 'failed' ELSE 'queued' END,
                problem_code = CASE WHEN cancel_requested THEN 'cancelled_by_user' WHEN attempt - released >= $1 THEN 'worker_lost' END,
                problem_message = CASE WHEN cancel_requested THEN 'Cancelled by ' || cancel_requested_by || '.'
                    WHEN attempt - released >= $1 THEN 'The program that computes diagnoses was lost ' || (attempt - released)
                        || ' times and this one is not tried again.' END,
                ended_at = CASE WHEN cancel_requested OR attempt - released >= $1 THEN clock_timestamp() END
             WHERE id IN (SELECT id FROM diagnoses WHERE state = 'running' AND leased_until <= clock_timestamp()
                LIMIT 64 FOR UPDATE SKIP LOCKED)
             RETURNING id",
        )
        .bind(DIAGNOSIS_ATTEMPTS)
        .fetch_all(&self.pool)
        .await?;
        sqlx::query("DELETE FROM diagnosis_keys WHERE created_at < clock_timestamp() - interval '24 hours'")
            .execute(&self.pool)
            .await?;
        Ok(reaped)
    }

    /// Files of a robot's bundle in the newest attempt of a run: `run.json` and telemetry.
    pub async fn run_bundle_files(&self, run: Uuid, robot: &str) -> Result<Vec<crate::FileRecord>> {
        let rows: Vec<FileRow> = sqlx::query_as(
            "SELECT f.name, f.bytes, f.sha256, f.media_type, f.object_path
             FROM run_files f JOIN runs r ON r.id = f.run_id AND f.epoch = r.epoch
             WHERE f.run_id = $1 AND starts_with(f.name, 'robots/' || $2 || '/') ORDER BY f.name",
        )
        .bind(run)
        .bind(robot)
        .fetch_all(&self.pool)
        .await?;
        Ok(rows.into_iter().map(crate::FileRecord::from).collect())
    }
}

const fn write_of(rows: u64) -> JobWrite {
    if rows == 1 { JobWrite::Ok } else { JobWrite::Stale }
}

impl DiagnosisRecord {
    /// Reads the document's own id.
    ///
    /// - Errors: [`StoreError::OutOfRange`] when the document has none.
    pub(crate) fn document_id(document: &serde_json::Value) -> Result<&str> {
        let id = document.get("id").and_then(serde_json::Value::as_str);
        id.filter(|id| id.len() == 64).ok_or(StoreError::OutOfRange {
            field: "model.id",
            limit: "64 hexadecimal characters",
        })
    }
}
