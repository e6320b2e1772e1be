//! Hints: one per change, and a new connection after a loss.

use crate::fixture::*;
use api::run::RunState;
use std::time::Duration;
use store::*;
use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;

async fn next(changes: &mut Receiver<Change>) -> Change {
    timeout(Duration::from_secs(20), changes.recv())
        .await
        .expect("a hint comes")
        .unwrap()
}

#[tokio::test]
async fn every_change_of_state_is_hinted_once() {
    let world = world_with_lab().await;
    let mut changes = world.store.listen();
    assert_eq!(next(&mut changes).await, Change::Reconnected);
    let fence = world.run_in(RunState::Preparing, LONG).await;
    let run = Change::Run(fence.run_id);
    let mut seen = Vec::new();
    for _ in 0..4 {
        seen.push(next(&mut changes).await);
    }
    assert_eq!(
        seen,
        [run, Change::Jobs, run, run],
        "submitted with its job, queued, preparing"
    );
    // Heartbeats, status reports and files are silent.
    world.store.run_heartbeat(fence, LONG).await.unwrap();
    world.report_status(false).await;
    world
        .store
        .run_file_put(fence.run_id, fence.epoch, &file("log.txt", 'b'))
        .await
        .unwrap();
    world.store.run_cancel(fence.run_id, "ada").await.unwrap();
    assert_eq!(next(&mut changes).await, run);
    assert!(changes.try_recv().is_err());
}

#[tokio::test]
async fn a_lost_connection_comes_back() {
    let world = world().await;
    let mut changes = world.store.listen();
    assert_eq!(next(&mut changes).await, Change::Reconnected);
    world.database.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE 'LISTEN%' AND datname = current_database()").await;
    assert_eq!(next(&mut changes).await, Change::Reconnected);
    let run_id = world.submit().await;
    assert_eq!(next(&mut changes).await, Change::Run(run_id));
}
