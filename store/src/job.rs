//! Jobs of the scheduler: leased, fenced by attempt, retried.

use crate::connect::Store;
use crate::error::{Result, StoreError, seconds};
use crate::laboratory::contents_of;
use crate::outcome::{JobFailure, JobLease, JobWrite, RehearsalInput, VerdictRecord};
use crate::run::{LockedRun, lock_run, move_run};
use crate::run_file::upsert_file;
use api::arena::Arena;
use api::experiment::{DigestClaim, Experiment};
use api::robot::LabRobot;
use api::run::{Fault, RunState, Whose};
use sqlx::PgConnection;
use std::collections::BTreeMap;
use std::time::Duration;
use uuid::Uuid;

#[derive(sqlx::FromRow)]
struct RehearsalRow {
    document: String,
    claimed_digest: Option<String>,
    claimed_twin_version: Option<String>,
    claimed_engine: Option<String>,
    arena: Option<String>,
    width_m: Option<f64>,
    height_m: Option<f64>,
    floor: Option<String>,
    contents: Option<String>,
}

/// Model versions that the run's experiment was rehearsed with, by robot.
pub(crate) async fn models_of(
    connection: &mut PgConnection,
    run_id: Uuid,
) -> Result<BTreeMap<String, serde_json::Value>> {
    let models: Vec<(String, String)> = sqlx::query_as(
        "SELECT x.robot, m.document::text FROM experiment_models x JOIN models m ON m.id = x.model_id
         JOIN runs r ON r.experiment_id = x.experiment_id WHERE r.id = $1",
    )
    .bind(run_id)
    .fetch_all(connection)
    .await?;
    let read = |(robot, text): (String, String)| {
        let document = serde_json::from_str(&text).map_err(StoreError::corrupt("model"))?;
        Ok((robot, document))
    };
    models.into_iter().map(read).collect()
}

impl Store {
    /// Leases the oldest job of a kind that is ready.
    pub async fn job_claim(&self, kind: &str, worker: Uuid, lease: Duration) -> Result<Option<JobLease>> {
        let row: Option<(Uuid, Uuid, i32, i32)> = sqlx::query_as(
            "WITH next AS (
                SELECT id FROM jobs WHERE kind = $1 AND state = 'ready' AND ready_at <= clock_timestamp()
                ORDER BY ready_at, created_at LIMIT 1 FOR UPDATE SKIP LOCKED)
             UPDATE jobs j SET state = 'leased', attempt = j.attempt + 1, worker = $2,
                leased_until = clock_timestamp() + make_interval(secs => $3)
             FROM next WHERE j.id = next.id RETURNING j.id, j.run_id, j.attempt, j.attempt - j.released",
        )
        .bind(kind)
        .bind(worker)
        .bind(seconds("lease", lease)?)
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.map(|(id, run_id, attempt, tries)| JobLease {
            id,
            kind: kind.to_owned(),
            run_id,
            attempt,
            tries,
            worker,
        }))
    }

    /// Extends a worker's lease that still holds.
    pub async fn job_heartbeat(&self, job: &JobLease, lease: Duration) -> Result<JobWrite> {
        let beat = sqlx::query(
            "UPDATE jobs SET leased_until = clock_timestamp() + make_interval(secs => $4)
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'leased' AND leased_until > clock_timestamp()",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .bind(seconds("lease", lease)?)
        .execute(&self.pool)
        .await?;
        Ok(if beat.rows_affected() == 1 {
            JobWrite::Ok
        } else {
            JobWrite::Stale
        })
    }

    /// Gives a job back in good order (the worker was asked to stop); another may take it at once.
    pub async fn job_release(&self, job: &JobLease) -> Result<JobWrite> {
        let released = sqlx::query(
            "UPDATE jobs SET state = 'ready', released = released + 1, leased_until = NULL, ready_at = clock_timestamp()
             WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'leased' AND leased_until > clock_timestamp()",
        )
        .bind(job.id)
        .bind(job.attempt)
        .bind(job.worker)
        .execute(&self.pool)
        .await?;
        Ok(if released.rows_affected() == 1 {
            JobWrite::Ok
        } else {
            JobWrite::Stale
        })
    }

    /// Ends a job that changes nothing but itself.
    pub async fn job_complete(&self, job: &JobLease) -> Result<JobWrite> {
        end_job(&mut *self.pool.acquire().await?, job, "done", None).await
    }

    /// Records a failure: another try later, or the end of the job and of its run.
    pub async fn job_fail(&self, job: &JobLease, error: &str, then: &JobFailure) -> Result<JobWrite> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, job.run_id).await? else {
            return Ok(JobWrite::Stale);
        };
        let written = match then {
            JobFailure::Retry { after } => retry_job(&mut transaction, job, error, *after).await?,
            JobFailure::Final { .. } => end_job(&mut transaction, job, "failed", Some(error)).await?,
        };
        if let (JobWrite::Ok, JobFailure::Final { fault }) = (written, then) {
            end_run_of_job(&mut transaction, &run, fault).await?;
        }
        transaction.commit().await?;
        Ok(written)
    }

    /// What the twin needs to rehearse a run; `None` when there is no such run.
    pub async fn rehearsal_input(&self, run_id: Uuid) -> Result<Option<RehearsalInput>> {
        let row: Option<RehearsalRow> = sqlx::query_as(
            "SELECT e.document::text AS document, e.claimed_digest, e.claimed_twin_version, e.claimed_engine,
                a.name AS arena, a.width_m, a.height_m, a.floor, a.contents::text AS contents
             FROM runs r JOIN experiments e ON e.id = r.experiment_id LEFT JOIN arenas a ON a.name = r.arena WHERE r.id = $1",
        )
        .bind(run_id)
        .fetch_optional(&self.pool)
        .await?;
        let Some(row) = row else { return Ok(None) };
        let experiment: Experiment = serde_json::from_str(&row.document).map_err(StoreError::corrupt("experiment"))?;
        let (robots, robots_missing) = self.robots_of(&experiment).await?;
        let models = models_of(&mut *self.pool.acquire().await?, run_id).await?;
        Ok(Some(RehearsalInput {
            run_id,
            arena: row.arena()?,
            claim: row.claim(),
            experiment,
            robots,
            robots_missing,
            models,
        }))
    }

    async fn robots_of(&self, experiment: &Experiment) -> Result<(Vec<LabRobot>, Vec<String>)> {
        let rows: Vec<(String, String)> = sqlx::query_as("SELECT name, document::text FROM robots WHERE arena = $1")
            .bind(&experiment.arena)
            .fetch_all(&self.pool)
            .await?;
        let documents: BTreeMap<String, String> = rows.into_iter().collect();
        let (mut found, mut missing) = (Vec::new(), Vec::new());
        for robot in &experiment.robots {
            match documents.get(&robot.name) {
                Some(text) => found.push(serde_json::from_str(text).map_err(StoreError::corrupt("robot"))?),
                None => missing.push(robot.name.clone()),
            }
        }
        Ok((found, missing))
    }

    /// Ends a rehearsal: verdict, replay file, and the run to `queued` or `rejected`, all or nothing.
    pub async fn run_verdict_set(&self, job: &JobLease, record: &VerdictRecord) -> Result<JobWrite> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, job.run_id).await? else {
            return Ok(JobWrite::Stale);
        };
        if run.state != RunState::Validating || end_job(&mut transaction, job, "done", None).await? == JobWrite::Stale {
            return Ok(JobWrite::Stale);
        }
        let verdict = serde_json::to_string(&record.verdict).map_err(StoreError::corrupt("verdict"))?;
        sqlx::query("UPDATE runs SET verdict = $2::json, server_digest = $3, server_twin_version = $4 WHERE id = $1")
            .bind(run.id)
            .bind(verdict)
            .bind(&record.verdict.digest)
            .bind(&record.verdict.twin_version)
            .execute(&mut *transaction)
            .await?;
        upsert_file(&mut transaction, run.id, 0, &record.replay).await?;
        let to = if record.accepted {
            RunState::Queued
        } else {
            RunState::Rejected
        };
        move_run(&mut transaction, &run, to, record.fault.as_ref()).await?;
        transaction.commit().await?;
        Ok(JobWrite::Ok)
    }
}

impl RehearsalRow {
    fn arena(&self) -> Result<Option<Arena>> {
        let (Some(name), Some(width_m), Some(height_m), Some(floor)) =
            (self.arena.clone(), self.width_m, self.height_m, self.floor.clone())
        else {
            return Ok(None);
        };
        Ok(Some(Arena {
            name,
            width_m,
            height_m,
            floor,
            contents: contents_of(self.contents.as_deref())?,
        }))
    }

    fn claim(&self) -> Option<DigestClaim> {
        Some(DigestClaim {
            digest: self.claimed_digest.clone()?,
            twin_version: self.claimed_twin_version.clone()?,
            engine: self.claimed_engine.clone()?,
        })
    }
}

async fn end_job(connection: &mut PgConnection, job: &JobLease, state: &str, error: Option<&str>) -> Result<JobWrite> {
    let ended = sqlx::query(
        "UPDATE jobs SET state = $4, error = $5, leased_until = NULL, ended_at = clock_timestamp()
         WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'leased' AND leased_until > clock_timestamp()",
    )
    .bind(job.id)
    .bind(job.attempt)
    .bind(job.worker)
    .bind(state)
    .bind(error)
    .execute(connection)
    .await?;
    Ok(if ended.rows_affected() == 1 {
        JobWrite::Ok
    } else {
        JobWrite::Stale
    })
}

async fn retry_job(connection: &mut PgConnection, job: &JobLease, error: &str, after: Duration) -> Result<JobWrite> {
    let retried = sqlx::query(
        "UPDATE jobs SET state = 'ready', error = $4, leased_until = NULL, ready_at = clock_timestamp() + make_interval(secs => $5)
         WHERE id = $1 AND attempt = $2 AND worker = $3 AND state = 'leased' AND leased_until > clock_timestamp()",
    )
    .bind(job.id)
    .bind(job.attempt)
    .bind(job.worker)
    .bind(error)
    .bind(after.as_secs_f64())
    .execute(connection)
    .await?;
    Ok(if retried.rows_affected() == 1 {
        JobWrite::Ok
    } else {
        JobWrite::Stale
    })
}

/// The run of a job that is given up: the user's fault rejects it, any other fails it.
pub(crate) async fn end_run_of_job(connection: &mut PgConnection, run: &LockedRun, fault: &Fault) -> Result<()> {
    if run.state != RunState::Validating {
        return Ok(());
    }
    let to = if fault.whose == Whose::User {
        RunState::Rejected
    } else {
        RunState::Failed
    };
    move_run(connection, run, to, Some(fault)).await
}
