//! Leases: who commands an arena, for how long, and what it may write meanwhile.

use crate::connect::Store;
use crate::error::{Result, StoreError, seconds};
use crate::job::models_of;
use crate::laboratory::{contents_of, hold_arena};
use crate::outcome::{Beat, Claim, ClaimedRun, Fence, Reported, Salvaged};
use crate::run::{LockedRun, lock_run, move_run};
use crate::state::{LostAttempt, after_lost_attempt, fault, fault_of_cancel};
use crate::{ARENA_HOLD, RUN_ATTEMPTS};
use api::arena::Arena;
use api::lab::{SalvageReport, StateReport};
use api::run::{Fault, RunState, Whose};
use sqlx::PgConnection;
use std::time::Duration;
use uuid::Uuid;

#[derive(sqlx::FromRow)]
struct ArenaRow {
    name: String,
    width_m: f64,
    height_m: f64,
    floor: String,
    contents: Option<String>,
}

#[derive(sqlx::FromRow)]
struct TakenRow {
    id: Uuid,
    epoch: i64,
    document: String,
    verdict: Option<String>,
    robot_names: Vec<String>,
}

impl Store {
    /// Leases the arena to the oldest queued run whose robots are there and fit to drive; `None` when nothing is to do.
    pub async fn run_claim(&self, claim: &Claim, lease: Duration) -> Result<Option<ClaimedRun>> {
        let lease_s = seconds("lease", lease)?;
        if !self.claim_worthwhile(claim).await? {
            return Ok(None);
        }
        let mut transaction = self.pool.begin().await?;
        let Some(arena) = lock_free_arena(&mut transaction, claim).await? else {
            return Ok(None);
        };
        let Some(taken) = take_next_run(&mut transaction, claim).await? else {
            return Ok(None);
        };
        insert_lease(&mut transaction, claim, &taken, lease_s).await?;
        let robots: Vec<String> = sqlx::query_scalar(
            "SELECT r.document::text FROM unnest($2::text[]) WITH ORDINALITY n(name, place)
             JOIN robots r ON r.arena = $1 AND r.name = n.name ORDER BY n.place",
        )
        .bind(&claim.arena)
        .bind(&taken.robot_names)
        .fetch_all(&mut *transaction)
        .await?;
        let models = models_of(&mut transaction, taken.id).await?;
        let claimed = ClaimedRun {
            models,
            run_id: taken.id,
            epoch: taken.epoch,
            experiment: serde_json::from_str(&taken.document).map_err(StoreError::corrupt("experiment"))?,
            arena: Arena {
                name: arena.name,
                width_m: arena.width_m,
                height_m: arena.height_m,
                floor: arena.floor,
                contents: contents_of(arena.contents.as_deref())?,
            },
            robots: robots
                .iter()
                .map(|text| serde_json::from_str(text))
                .collect::<std::result::Result<_, _>>()
                .map_err(StoreError::corrupt("robot"))?,
            verdict: serde_json::from_str(taken.verdict.as_deref().unwrap_or("null"))
                .map_err(StoreError::corrupt("verdict"))?,
            lease_s,
        };
        transaction.commit().await?;
        Ok(Some(claimed))
    }

    /// The simulation server asks for runs of this arena: it is there.
    pub async fn simulator_seen(&self, lab: &str, arena: &str) -> Result<()> {
        sqlx::query("UPDATE arenas SET simulator_seen_at = clock_timestamp() WHERE name = $1 AND lab = $2")
            .bind(arena)
            .bind(lab)
            .execute(&self.pool)
            .await?;
        Ok(())
    }

    /// Cheap look before any row is locked; long polls ask often.
    async fn claim_worthwhile(&self, claim: &Claim) -> Result<bool> {
        let worthwhile = sqlx::query_scalar(
            "SELECT EXISTS (SELECT FROM runs WHERE state = 'queued' AND arena = $1 AND side = $2)
                AND NOT EXISTS (SELECT FROM leases WHERE arena = $1 AND side = $2)",
        )
        .bind(&claim.arena)
        .bind(claim.side.as_str())
        .fetch_one(&self.pool)
        .await?;
        Ok(worthwhile)
    }

    /// Extends a lease that still holds.
    pub async fn run_heartbeat(&self, fence: Fence, lease: Duration) -> Result<Beat> {
        let cancel_requested: Option<bool> = sqlx::query_scalar(
            "WITH beat AS (
                UPDATE leases SET beat_at = clock_timestamp(), expires_at = clock_timestamp() + make_interval(secs => $4)
                WHERE run_id = $1 AND epoch = $2 AND instance = $3 AND expires_at > clock_timestamp() RETURNING run_id)
             SELECT r.cancel_requested FROM beat JOIN runs r ON r.id = beat.run_id",
        )
        .bind(fence.run_id)
        .bind(fence.epoch)
        .bind(fence.instance)
        .bind(seconds("lease", lease)?)
        .fetch_optional(&self.pool)
        .await?;
        Ok(cancel_requested.map_or(Beat::Stale, |cancel_requested| Beat::Ok { cancel_requested }))
    }

    /// The laboratory moves its run on. A report that arrives twice is answered `Ok` twice.
    pub async fn run_state_report(&self, run_id: Uuid, report: &StateReport) -> Result<Reported> {
        let fence = Fence {
            run_id,
            epoch: report.epoch,
            instance: report.instance,
        };
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, run_id).await? else {
            return Ok(Reported::Stale);
        };
        if run.epoch != fence.epoch || !attempt_is_of(&mut transaction, fence).await? {
            return Ok(Reported::Stale);
        }
        if run.state.is_terminal() {
            return Ok(if run.state == report.state {
                Reported::Ok
            } else {
                Reported::Stale
            });
        }
        if !lease_holds(&mut transaction, fence).await? {
            return Ok(Reported::Stale);
        }
        if run.state == report.state {
            return Ok(Reported::Ok);
        }
        if !lab_may_move(&mut transaction, &run, report.state).await? {
            return Ok(Reported::NotAllowed { from: run.state });
        }
        let cause = fault_of_report(&run, report);
        sqlx::query("UPDATE runs SET ticks_recorded = coalesce($2, ticks_recorded), ticks_missed = coalesce($3, ticks_missed) WHERE id = $1")
            .bind(run_id)
            .bind(report.ticks_recorded)
            .bind(report.ticks_missed)
            .execute(&mut *transaction)
            .await?;
        move_run(&mut transaction, &run, report.state, cause.as_ref()).await?;
        if report.state == RunState::Interrupted {
            let arena: Option<String> =
                sqlx::query_scalar("SELECT arena FROM leases WHERE run_id = $1 AND epoch = $2 AND side = 'physical'")
                    .bind(run_id)
                    .bind(run.epoch)
                    .fetch_optional(&mut *transaction)
                    .await?;
            if let Some(arena) = arena {
                let reason = "a run was interrupted and its robots have to come to rest";
                hold_arena(&mut transaction, &arena, ARENA_HOLD, reason).await?;
            }
        }
        if report.state.is_terminal() {
            end_attempt(&mut transaction, run_id, run.epoch, report.state).await?;
        }
        transaction.commit().await?;
        Ok(Reported::Ok)
    }

    /// A laboratory that came back after a crash closes the attempt it found in its journal.
    pub async fn run_salvage(&self, run_id: Uuid, report: &SalvageReport) -> Result<Salvaged> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, run_id).await? else {
            return Ok(Salvaged::Stale);
        };
        if run.epoch != report.epoch || report.epoch == 0 {
            return Ok(Salvaged::Stale);
        }
        sqlx::query("UPDATE runs SET ticks_recorded = coalesce(ticks_recorded, $2), ticks_missed = coalesce(ticks_missed, $3) WHERE id = $1")
            .bind(run_id)
            .bind(report.ticks_recorded)
            .bind(report.ticks_missed)
            .execute(&mut *transaction)
            .await?;
        let leased = matches!(run.state, RunState::Preparing | RunState::Running | RunState::Uploading);
        if !leased {
            return Ok(Salvaged::Ok { state: run.state });
        }
        let state = lose_attempt(&mut transaction, &run, &report.fault, RUN_ATTEMPTS).await?;
        transaction.commit().await?;
        Ok(Salvaged::Ok { state })
    }
}

/// Locks the arena against other claims; none when it is unknown or someone else's, or stopped or held while robots are to move.
async fn lock_free_arena(connection: &mut PgConnection, claim: &Claim) -> Result<Option<ArenaRow>> {
    let row = sqlx::query_as(
        "SELECT a.name, a.width_m, a.height_m, a.floor, a.contents::text AS contents FROM arenas a
         WHERE a.name = $1 AND a.lab = $2 AND ($3 = 'virtual' OR (
            (a.held_until IS NULL OR a.held_until <= clock_timestamp())
            AND NOT EXISTS (SELECT FROM arena_status s WHERE s.arena = a.name AND s.stopped)))
         FOR UPDATE OF a",
    )
    .bind(&claim.arena)
    .bind(&claim.lab)
    .bind(claim.side.as_str())
    .fetch_optional(connection)
    .await?;
    Ok(row)
}

/// A statement of its own, so that it sees the lease of a claim that held the arena's lock before.
async fn take_next_run(connection: &mut PgConnection, claim: &Claim) -> Result<Option<TakenRow>> {
    let row = sqlx::query_as(
        "WITH next AS (
            SELECT r.id FROM runs r
            WHERE r.state = 'queued' AND r.arena = $1 AND r.side = $2
              AND r.robot_names <@ ARRAY(SELECT x.name FROM robots x LEFT JOIN robot_status s ON s.arena = x.arena AND s.name = x.name
                    WHERE x.arena = $1 AND ($2 = 'virtual' OR robot_unfit_reason(s.battery, s.stalled, s.sensor_fault) IS NULL))
              AND NOT EXISTS (SELECT FROM leases WHERE arena = $1 AND side = $2)
            ORDER BY r.queue_number LIMIT 1 FOR UPDATE SKIP LOCKED)
         UPDATE runs r SET state = 'preparing', epoch = nextval('epochs'), attempts = r.attempts + 1, claimed_at = clock_timestamp()
         FROM next, experiments e WHERE r.id = next.id AND e.id = r.experiment_id
         RETURNING r.id, r.epoch, e.document::text AS document, r.verdict::text AS verdict, r.robot_names",
    )
    .bind(&claim.arena)
    .bind(claim.side.as_str())
    .fetch_optional(connection)
    .await?;
    Ok(row)
}

async fn insert_lease(connection: &mut PgConnection, claim: &Claim, taken: &TakenRow, lease_s: f64) -> Result<()> {
    sqlx::query(
        "INSERT INTO leases (run_id, epoch, arena, instance, expires_at, beat_at, side)
         VALUES ($1, $2, $3, $4, clock_timestamp() + make_interval(secs => $5), clock_timestamp(), $6)",
    )
    .bind(taken.id)
    .bind(taken.epoch)
    .bind(&claim.arena)
    .bind(claim.instance)
    .bind(lease_s)
    .bind(claim.side.as_str())
    .execute(&mut *connection)
    .await?;
    sqlx::query("INSERT INTO attempts (run_id, epoch, lab, instance) VALUES ($1, $2, $3, $4)")
        .bind(taken.id)
        .bind(taken.epoch)
        .bind(&claim.lab)
        .bind(claim.instance)
        .execute(connection)
        .await?;
    Ok(())
}

async fn attempt_is_of(connection: &mut PgConnection, fence: Fence) -> Result<bool> {
    let known =
        sqlx::query_scalar("SELECT EXISTS (SELECT FROM attempts WHERE run_id = $1 AND epoch = $2 AND instance = $3)")
            .bind(fence.run_id)
            .bind(fence.epoch)
            .bind(fence.instance)
            .fetch_one(connection)
            .await?;
    Ok(known)
}

async fn lease_holds(connection: &mut PgConnection, fence: Fence) -> Result<bool> {
    let held: Option<i32> = sqlx::query_scalar(
        "SELECT 1 FROM leases WHERE run_id = $1 AND epoch = $2 AND instance = $3 AND expires_at > clock_timestamp() FOR UPDATE",
    )
    .bind(fence.run_id)
    .bind(fence.epoch)
    .bind(fence.instance)
    .fetch_optional(connection)
    .await?;
    Ok(held.is_some())
}

async fn lab_may_move(connection: &mut PgConnection, run: &LockedRun, to: RunState) -> Result<bool> {
    let labs_own =
        matches!(to, RunState::Running | RunState::Uploading) || (to.is_terminal() && to != RunState::Rejected);
    if !labs_own || (to == RunState::Done && !run.motion_begun) {
        return Ok(false);
    }
    let allowed = sqlx::query_scalar("SELECT run_transition_allowed($1, $2)")
        .bind(run.state.as_str())
        .bind(to.as_str())
        .fetch_one(connection)
        .await?;
    Ok(allowed)
}

/// Every end but `done` has a fault, so that nobody finds a failed run without a reason.
fn fault_of_report(run: &LockedRun, report: &StateReport) -> Option<Fault> {
    let given = report.fault.clone();
    match report.state {
        RunState::Cancelled => given.or_else(|| Some(fault_of_cancel(run.cancelled_by.as_deref()))),
        RunState::Failed | RunState::Interrupted => given.or_else(|| {
            Some(fault(
                Whose::Platform,
                "reason_not_reported",
                "The laboratory ended the run without giving a reason.",
            ))
        }),
        _ => given,
    }
}

/// The lease goes, so that the arena is free; the attempt stays as a record.
async fn end_attempt(connection: &mut PgConnection, run_id: Uuid, epoch: i64, outcome: RunState) -> Result<()> {
    sqlx::query("DELETE FROM leases WHERE run_id = $1 AND epoch = $2")
        .bind(run_id)
        .bind(epoch)
        .execute(&mut *connection)
        .await?;
    let outcome = if outcome == RunState::Queued {
        "lost"
    } else {
        outcome.as_str()
    };
    sqlx::query("UPDATE attempts SET ended_at = clock_timestamp(), outcome = $3 WHERE run_id = $1 AND epoch = $2")
        .bind(run_id)
        .bind(epoch)
        .bind(outcome)
        .execute(connection)
        .await?;
    Ok(())
}

/// Moves a locked run on after its attempt was lost and ends the attempt.
pub(crate) async fn lose_attempt(
    connection: &mut PgConnection,
    run: &LockedRun,
    cause: &Fault,
    attempts_limit: i32,
) -> Result<RunState> {
    let (state, fault) = after_lost_attempt(LostAttempt {
        state: run.state,
        attempts: run.attempts,
        attempts_limit,
        cancel_requested: run.cancel_requested,
        cancelled_by: run.cancelled_by.as_deref(),
        cause,
    });
    move_run(connection, run, state, fault.as_ref()).await?;
    end_attempt(connection, run.id, run.epoch, state).await?;
    Ok(state)
}
