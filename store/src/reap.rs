//! The reconciler: looks at what ran out and puts it right. It needs no input and may run in several copies.

use crate::connect::Store;
use crate::error::Result;
use crate::job::end_run_of_job;
use crate::laboratory::hold_arena;
use crate::lease::lose_attempt;
use crate::outcome::{ReapLimits, Reaped};
use crate::run::lock_run;
use crate::state::fault;
use api::lab::Side;
use api::run::Whose;
use uuid::Uuid;

/// Most rows of a kind that one sweep looks at.
const SWEEP_LIMIT: i64 = 200;

impl Store {
    /// One sweep; what it changed. Expiry is compared by the database's clock.
    pub async fn reap(&self, limits: &ReapLimits) -> Result<Vec<Reaped>> {
        let mut reaped = Vec::new();
        let leases: Vec<(Uuid, i64)> =
            sqlx::query_as("SELECT run_id, epoch FROM leases WHERE expires_at <= clock_timestamp() LIMIT $1")
                .bind(SWEEP_LIMIT)
                .fetch_all(&self.pool)
                .await?;
        for (run_id, epoch) in leases {
            reaped.extend(self.reap_lease(run_id, epoch, limits).await?);
        }
        let jobs: Vec<(Uuid, Uuid, i32)> =
            sqlx::query_as("SELECT id, run_id, attempt FROM jobs WHERE state = 'leased' AND leased_until <= clock_timestamp() LIMIT $1")
                .bind(SWEEP_LIMIT)
                .fetch_all(&self.pool)
                .await?;
        for (job_id, run_id, attempt) in jobs {
            reaped.extend(self.reap_job(job_id, run_id, attempt, limits).await?);
        }
        sqlx::query("DELETE FROM idempotency_keys WHERE created_at < clock_timestamp() - interval '24 hours'")
            .execute(&self.pool)
            .await?;
        Ok(reaped)
    }

    async fn reap_lease(&self, run_id: Uuid, epoch: i64, limits: &ReapLimits) -> Result<Option<Reaped>> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, run_id).await? else {
            return Ok(None);
        };
        // Looked at again under the lock: a heartbeat may have come meanwhile.
        let lost: Option<(String, String)> = sqlx::query_as(
            "DELETE FROM leases WHERE run_id = $1 AND epoch = $2 AND expires_at <= clock_timestamp() RETURNING arena, side",
        )
        .bind(run_id)
        .bind(epoch)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some((arena, side)) = lost else { return Ok(None) };
        let robots = side == Side::Physical.as_str();
        let who = if robots { "laboratory" } else { "simulation server" };
        let cause = fault(
            Whose::Platform,
            "lease_lost",
            format!("The {who} stopped answering during this run."),
        );
        let state = lose_attempt(&mut transaction, &run, &cause, limits.run_attempts).await?;
        if robots {
            let reason = "the laboratory was lost during a run and its robots have to come to rest";
            hold_arena(&mut transaction, &arena, limits.arena_hold, reason).await?;
        }
        transaction.commit().await?;
        Ok(Some(Reaped::Run { run_id, epoch, state }))
    }

    async fn reap_job(&self, job_id: Uuid, run_id: Uuid, attempt: i32, limits: &ReapLimits) -> Result<Option<Reaped>> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, run_id).await? else {
            return Ok(None);
        };
        let failed: Option<bool> = sqlx::query_scalar(
            "UPDATE jobs SET leased_until = NULL, error = 'the worker was lost', ready_at = clock_timestamp(),
                state = CASE WHEN attempt - released >= $3 THEN 'failed' ELSE 'ready' END,
                ended_at = CASE WHEN attempt - released >= $3 THEN clock_timestamp() END
             WHERE id = $1 AND attempt = $2 AND state = 'leased' AND leased_until <= clock_timestamp()
             RETURNING state = 'failed'",
        )
        .bind(job_id)
        .bind(attempt)
        .bind(limits.job_attempts)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some(failed) = failed else { return Ok(None) };
        if failed {
            let message = format!("The check by the twin was lost {attempt} times and is not tried again.");
            end_run_of_job(
                &mut transaction,
                &run,
                &fault(Whose::Platform, "rehearsal_lost", message),
            )
            .await?;
        }
        transaction.commit().await?;
        Ok(Some(Reaped::Job {
            job_id,
            run_id,
            attempt,
            failed,
        }))
    }
}
