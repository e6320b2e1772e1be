//! A stale attempt cannot write anything.

use crate::fixture::*;
use api::run::{RunState, Whose};
use store::*;
use uuid::Uuid;

/// An attempt whose lease ran out while it prepared, and the attempt after it.
async fn two_attempts(world: &World) -> (Fence, Fence) {
    let old = world.run_in(RunState::Preparing, SHORT).await;
    world.reap_something().await;
    world.free_arena().await;
    let new = world.preparing(LONG).await;
    assert_eq!(new.run_id, old.run_id);
    assert!(new.epoch > old.epoch);
    (old, new)
}

#[tokio::test]
async fn every_write_of_an_old_epoch_is_refused() {
    let world = world_with_lab().await;
    let (old, new) = two_attempts(&world).await;
    let before = world.store.run_get(new.run_id).await.unwrap();
    assert_eq!(world.store.run_heartbeat(old, LONG).await.unwrap(), Beat::Stale);
    for state in [
        RunState::Running,
        RunState::Uploading,
        RunState::Done,
        RunState::Failed,
        RunState::Cancelled,
        RunState::Interrupted,
    ] {
        assert_eq!(world.reports(old, state).await, Reported::Stale, "{state:?}");
    }
    let file = file("run.mcap", 'b');
    assert_eq!(
        world.store.run_file_put(old.run_id, old.epoch, &file).await.unwrap(),
        FilePut::Stale
    );
    let crash = fault(Whose::Platform, "lab_restarted");
    assert_eq!(
        world
            .store
            .run_salvage(old.run_id, &salvage(old.epoch, &crash))
            .await
            .unwrap(),
        Salvaged::Stale
    );
    assert_eq!(
        world.store.run_get(new.run_id).await.unwrap(),
        before,
        "nothing was written"
    );
    assert!(matches!(
        world.store.run_heartbeat(new, LONG).await.unwrap(),
        Beat::Ok { .. }
    ));
}

#[tokio::test]
async fn stale_and_fresh_writes_race_without_a_stale_one_getting_through() {
    let world = world_with_lab().await;
    let (old, new) = two_attempts(&world).await;
    let mut tasks = tokio::task::JoinSet::new();
    for round in 0..400 {
        let (store, report) = (world.store.clone(), world.report(old, RunState::Running));
        tasks.spawn(async move {
            match round % 4 {
                0 => store.run_heartbeat(old, LONG).await.unwrap() == Beat::Stale,
                1 => store.run_state_report(old.run_id, &report).await.unwrap() == Reported::Stale,
                2 => {
                    store
                        .run_file_put(old.run_id, old.epoch, &file("log.txt", 'c'))
                        .await
                        .unwrap()
                        == FilePut::Stale
                }
                _ => matches!(store.run_heartbeat(new, LONG).await.unwrap(), Beat::Ok { .. }),
            }
        });
    }
    let outcomes = tasks.join_all().await;
    assert_eq!(outcomes.iter().filter(|as_expected| **as_expected).count(), 400);
    assert_eq!(world.state(new.run_id).await, RunState::Preparing);
}

#[tokio::test]
async fn an_expired_lease_writes_nothing_even_before_the_sweep() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Preparing, LONG).await;
    world
        .database
        .execute("UPDATE leases SET expires_at = clock_timestamp()")
        .await;
    assert_eq!(world.store.run_heartbeat(fence, LONG).await.unwrap(), Beat::Stale);
    assert_eq!(world.reports(fence, RunState::Running).await, Reported::Stale);
    assert_eq!(world.state(fence.run_id).await, RunState::Preparing);
}

#[tokio::test]
async fn another_process_with_the_right_epoch_is_refused() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Preparing, LONG).await;
    let impostor = Fence {
        instance: Uuid::now_v7(),
        ..fence
    };
    assert_eq!(world.store.run_heartbeat(impostor, LONG).await.unwrap(), Beat::Stale);
    assert_eq!(world.reports(impostor, RunState::Running).await, Reported::Stale);
}

#[tokio::test]
async fn reports_are_idempotent_and_follow_the_edges() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Preparing, LONG).await;
    for state in [
        RunState::Done,
        RunState::Queued,
        RunState::Validating,
        RunState::Rejected,
    ] {
        assert_eq!(
            world.reports(fence, state).await,
            Reported::NotAllowed {
                from: RunState::Preparing
            },
            "{state:?}"
        );
    }
    for state in [
        RunState::Running,
        RunState::Running,
        RunState::Uploading,
        RunState::Done,
        RunState::Done,
    ] {
        assert_eq!(world.reports(fence, state).await, Reported::Ok, "{state:?}");
    }
    assert_eq!(world.reports(fence, RunState::Failed).await, Reported::Stale);
    assert_eq!(world.store.run_heartbeat(fence, LONG).await.unwrap(), Beat::Stale);
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "free");
}

#[tokio::test]
async fn files_follow_their_attempt_and_a_done_run_is_sealed() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Running, LONG).await;
    let put = |file: FileRecord| {
        let store = world.store.clone();
        async move { store.run_file_put(fence.run_id, fence.epoch, &file).await.unwrap() }
    };
    assert_eq!(put(file("log.txt", 'b')).await, FilePut::Ok);
    assert_eq!(put(file("log.txt", 'c')).await, FilePut::Ok);
    for state in [RunState::Uploading, RunState::Done] {
        world.reports(fence, state).await;
    }
    assert_eq!(put(file("log.txt", 'c')).await, FilePut::Ok, "the same again");
    assert_eq!(put(file("log.txt", 'd')).await, FilePut::Sealed);
    assert_eq!(put(file("archive.zip", 'e')).await, FilePut::Ok);
    let names: Vec<_> = world
        .store
        .run_files(fence.run_id)
        .await
        .unwrap()
        .into_iter()
        .map(|file| file.name)
        .collect();
    assert_eq!(names, ["archive.zip", "log.txt", "replay.json"]);
    let log = world
        .store
        .run_file_get(fence.run_id, "log.txt")
        .await
        .unwrap()
        .unwrap();
    assert_eq!(log, file("log.txt", 'c'));
    assert_eq!(world.store.run_get(fence.run_id).await.unwrap().unwrap().files.len(), 3);
}
