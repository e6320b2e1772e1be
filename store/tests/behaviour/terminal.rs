//! Terminal is terminal, for the functions and for plain SQL.

use crate::fixture::*;
use api::run::RunState;
use store::*;

const STATES: [RunState; 11] = [
    RunState::Draft,
    RunState::Validating,
    RunState::Rejected,
    RunState::Queued,
    RunState::Preparing,
    RunState::Running,
    RunState::Uploading,
    RunState::Done,
    RunState::Failed,
    RunState::Cancelled,
    RunState::Interrupted,
];

#[tokio::test]
async fn no_terminal_state_is_ever_left() {
    let world = world_with_lab().await;
    for state in STATES.into_iter().filter(|state| state.is_terminal()) {
        let fence = world.run_in(state, LONG).await;
        let before = world.store.run_get(fence.run_id).await.unwrap().unwrap();
        assert_eq!(before.state, state);
        assert!(before.ended_at.is_some());
        for to in STATES.into_iter().filter(|to| *to != state) {
            // Whatever the other rules want is given, so that only the guard can refuse.
            let sql = format!(
                "UPDATE runs SET state = '{}', motion_begun = true, epoch = epoch + 1, ended_at = {} WHERE id = '{}'",
                to.as_str(),
                if to.is_terminal() { "ended_at" } else { "NULL" },
                fence.run_id
            );
            let refused = world.database.try_execute(&sql).await.unwrap_err();
            let constraint = refused
                .as_database_error()
                .and_then(|error| error.constraint())
                .map(str::to_owned);
            assert_eq!(
                constraint.as_deref(),
                Some("runs_terminal_is_terminal"),
                "{state:?} -> {to:?}"
            );
        }
        let touched = format!(
            "UPDATE runs SET fault_message = 'x', fault_code = 'x', fault_whose = 'user' WHERE id = '{}'",
            fence.run_id
        );
        assert!(
            world.database.try_execute(&touched).await.is_err(),
            "{state:?}: the reason stays"
        );
        assert_eq!(
            world.store.run_cancel(fence.run_id, "ada").await.unwrap(),
            Cancelled::Ended(state)
        );
        for to in STATES.into_iter().filter(|to| *to != state) {
            assert_eq!(world.reports(fence, to).await, Reported::Stale, "{state:?} -> {to:?}");
        }
        assert_eq!(world.store.run_get(fence.run_id).await.unwrap().unwrap(), before);
    }
}

#[tokio::test]
async fn plain_sql_follows_the_edges_too() {
    let world = world_with_lab().await;
    let run_id = world.queued().await;
    for sql in [
        "state = 'running'",
        "state = 'done', ended_at = clock_timestamp()",
        "state = 'preparing'",
        "epoch = -1",
    ] {
        let refused = world
            .database
            .try_execute(&format!("UPDATE runs SET {sql} WHERE id = '{run_id}'"))
            .await;
        assert!(refused.is_err(), "{sql}");
    }
    let fence = world.preparing(LONG).await;
    world.reports(fence, RunState::Running).await;
    let again = world
        .database
        .try_execute(&format!("UPDATE runs SET state = 'queued' WHERE id = '{run_id}'"))
        .await;
    assert!(again.is_err(), "a run that moved is not queued again");
}

#[tokio::test]
async fn an_ended_run_without_a_reason_is_refused() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Running, LONG).await;
    let sql = format!(
        "UPDATE runs SET state = 'failed', ended_at = clock_timestamp() WHERE id = '{}'",
        fence.run_id
    );
    assert!(world.database.try_execute(&sql).await.is_err());
    assert_eq!(world.reports(fence, RunState::Failed).await, Reported::Ok);
    let run = world.store.run_get(fence.run_id).await.unwrap().unwrap();
    assert_eq!(run.fault.unwrap().code, "reason_not_reported");
}

#[tokio::test]
async fn two_ends_race_and_one_wins() {
    let world = world_with_lab().await;
    for _ in 0..20 {
        let fence = world.run_in(RunState::Uploading, LONG).await;
        let (done, failed) = (
            world.report(fence, RunState::Done),
            world.report(fence, RunState::Failed),
        );
        let (a, b, cancelled) = tokio::join!(
            world.store.run_state_report(fence.run_id, &done),
            world.store.run_state_report(fence.run_id, &failed),
            world.store.run_cancel(fence.run_id, "ada"),
        );
        let won = [a.unwrap(), b.unwrap()]
            .into_iter()
            .filter(|reported| *reported == Reported::Ok)
            .count();
        assert_eq!(won, 1);
        assert_ne!(cancelled.unwrap(), Cancelled::AtOnce);
    }
}
