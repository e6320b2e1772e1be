//! A run's state outside of a lease: locked reads, the one way to end a run, and cancelling.

use crate::connect::Store;
use crate::error::Result;
use crate::outcome::Cancelled;
use crate::state::{fault_of_cancel, state_from_sql, whose_to_sql};
use api::run::{Fault, RunState};
use sqlx::PgConnection;
use uuid::Uuid;

/// A run whose row is locked until the transaction ends.
pub(crate) struct LockedRun {
    pub id: Uuid,
    pub state: RunState,
    pub epoch: i64,
    pub attempts: i32,
    pub motion_begun: bool,
    pub cancel_requested: bool,
    pub cancelled_by: Option<String>,
}

pub(crate) async fn lock_run(connection: &mut PgConnection, id: Uuid) -> Result<Option<LockedRun>> {
    let row: Option<(String, i64, i32, bool, bool, Option<String>)> = sqlx::query_as(
        "SELECT state, epoch, attempts, motion_begun, cancel_requested, cancel_requested_by FROM runs WHERE id = $1 FOR UPDATE",
    )
    .bind(id)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(
        |(state, epoch, attempts, motion_begun, cancel_requested, cancelled_by)| LockedRun {
            id,
            state: state_from_sql(&state),
            epoch,
            attempts,
            motion_begun,
            cancel_requested,
            cancelled_by,
        },
    ))
}

/// Moves a locked run on; a terminal state is dated. The schema refuses what is not allowed.
pub(crate) async fn move_run(
    connection: &mut PgConnection,
    run: &LockedRun,
    to: RunState,
    fault: Option<&Fault>,
) -> Result<()> {
    sqlx::query(
        "UPDATE runs SET state = $3,
            fault_whose = coalesce($4, fault_whose), fault_code = coalesce($5, fault_code), fault_message = coalesce($6, fault_message),
            motion_begun = motion_begun OR $3 = 'running',
            queued_at  = CASE WHEN $3 = 'queued' THEN coalesce(queued_at, clock_timestamp()) ELSE queued_at END,
            started_at = CASE WHEN $3 = 'running' THEN clock_timestamp() ELSE started_at END,
            ended_at   = CASE WHEN $7 THEN clock_timestamp() END
         WHERE id = $1 AND epoch = $2",
    )
    .bind(run.id)
    .bind(run.epoch)
    .bind(to.as_str())
    .bind(fault.map(|fault| whose_to_sql(fault.whose)))
    .bind(fault.map(|fault| fault.code.as_str()))
    .bind(fault.map(|fault| fault.message.as_str()))
    .bind(to.is_terminal())
    .execute(connection)
    .await?;
    Ok(())
}

impl Store {
    /// Ends a run that waits, asks the laboratory to stop one that it has.
    pub async fn run_cancel(&self, id: Uuid, by: &str) -> Result<Cancelled> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, id).await? else {
            return Ok(Cancelled::Unknown);
        };
        if run.state.is_terminal() {
            return Ok(Cancelled::Ended(run.state));
        }
        sqlx::query("UPDATE runs SET cancel_requested = true, cancel_requested_by = coalesce(cancel_requested_by, $2) WHERE id = $1")
            .bind(id)
            .bind(by)
            .execute(&mut *transaction)
            .await?;
        let waits = matches!(run.state, RunState::Draft | RunState::Validating | RunState::Queued);
        if waits {
            move_run(
                &mut transaction,
                &run,
                RunState::Cancelled,
                Some(&fault_of_cancel(Some(by))),
            )
            .await?;
            sqlx::query(
                "UPDATE jobs SET state = 'dropped', leased_until = NULL, ended_at = clock_timestamp()
                 WHERE run_id = $1 AND state IN ('ready', 'leased')",
            )
            .bind(id)
            .execute(&mut *transaction)
            .await?;
        }
        transaction.commit().await?;
        Ok(if waits { Cancelled::AtOnce } else { Cancelled::Requested })
    }
}
