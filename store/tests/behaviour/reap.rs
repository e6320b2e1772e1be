//! The reconciler puts right what ran out.

use crate::fixture::*;
use api::run::{RunState, Whose};
use store::*;

#[tokio::test]
async fn a_run_that_never_moved_is_queued_again_and_fails_the_third_time() {
    let world = world_with_lab().await;
    let run_id = world.queued().await;
    for attempt in 1..=3 {
        let fence = world.preparing(SHORT).await;
        assert_eq!(fence.run_id, run_id);
        let state = if attempt < 3 {
            RunState::Queued
        } else {
            RunState::Failed
        };
        assert_eq!(
            world.reap_something().await,
            [Reaped::Run {
                run_id,
                epoch: fence.epoch,
                state
            }],
            "attempt {attempt}"
        );
        world.free_arena().await;
    }
    let run = world.store.run_get(run_id).await.unwrap().unwrap();
    let fault = run.fault.unwrap();
    assert_eq!(
        (run.state, fault.whose, fault.code.as_str()),
        (RunState::Failed, Whose::Platform, "attempts_used_up")
    );
    assert_eq!(
        world
            .database
            .scalar::<i64>("SELECT count(*) FROM attempts WHERE ended_at IS NOT NULL")
            .await,
        3
    );
}

#[tokio::test]
async fn a_run_interrupted_by_its_own_laboratory_holds_the_arena_until_the_next_registration() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Interrupted, LONG).await;
    world.queued().await;
    world.report_status(false).await;
    let arena = world.store.arena_list().await.unwrap().remove(0);
    assert_eq!(arena.state, "held");
    assert!(arena.message.unwrap().contains("interrupted"));
    assert_eq!(world.store.run_claim(&world.claim(), LONG).await.unwrap(), None);
    world.store.lab_register(&lab()).await.unwrap();
    let next = world.store.run_claim(&world.claim(), LONG).await.unwrap();
    assert!(next.is_some_and(|next| next.run_id != fence.run_id));
}

#[tokio::test]
async fn a_run_that_moved_is_interrupted_and_holds_the_arena() {
    for state in [RunState::Running, RunState::Uploading] {
        let world = world_with_lab().await;
        let fence = world.run_in(state, SHORT).await;
        world.queued().await;
        world.reap_something().await;
        let run = world.store.run_get(fence.run_id).await.unwrap().unwrap();
        let fault = run.fault.unwrap();
        assert_eq!(
            (run.state, fault.whose, fault.code.as_str()),
            (RunState::Interrupted, Whose::Platform, "lease_lost")
        );
        world.report_status(false).await;
        let arena = world.store.arena_list().await.unwrap().remove(0);
        assert_eq!(arena.state, "held");
        assert!(arena.message.unwrap().contains("lost during a run"));
        assert_eq!(world.store.run_claim(&world.claim(), LONG).await.unwrap(), None);
        world.store.lab_register(&lab()).await.unwrap();
        assert!(world.store.run_claim(&world.claim(), LONG).await.unwrap().is_some());
    }
}

#[tokio::test]
async fn the_hold_ends_by_itself() {
    let world = world_with_lab().await;
    world.run_in(RunState::Running, SHORT).await;
    world.queued().await;
    let limits = ReapLimits {
        arena_hold: std::time::Duration::from_millis(200),
        ..LIMITS
    };
    let limit = tokio::time::Instant::now() + std::time::Duration::from_secs(20);
    loop {
        world.store.reap(&limits).await.unwrap();
        if world.store.run_claim(&world.claim(), LONG).await.unwrap().is_some() {
            break;
        }
        assert!(tokio::time::Instant::now() < limit, "the arena stays held");
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    let gap_ms: f64 = world
        .database
        .scalar("SELECT (extract(epoch FROM max(a.claimed_at) - min(a.ended_at)) * 1000)::float8 FROM attempts a")
        .await;
    assert!(gap_ms >= 200.0, "handed over after {gap_ms} ms");
}

#[tokio::test]
async fn a_cancelled_run_is_not_queued_again() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Preparing, SHORT).await;
    world.store.run_cancel(fence.run_id, "ada").await.unwrap();
    world.reap_something().await;
    assert_eq!(world.state(fence.run_id).await, RunState::Cancelled);
}

#[tokio::test]
async fn a_lease_that_beats_is_left_alone() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Running, LONG).await;
    assert_eq!(world.store.reap(&LIMITS).await.unwrap(), []);
    assert_eq!(world.state(fence.run_id).await, RunState::Running);
    // A beat and a sweep at the same moment: one of them wins, and both agree who.
    for _ in 0..20 {
        let beaten = world.store.run_heartbeat(fence, LONG).await.unwrap();
        assert!(matches!(beaten, Beat::Ok { .. }));
        assert_eq!(world.store.reap(&LIMITS).await.unwrap(), []);
    }
}

#[tokio::test]
async fn eight_reapers_change_a_run_once() {
    let world = world_with_lab().await;
    let fence = world.run_in(RunState::Running, LONG).await;
    world
        .database
        .execute("UPDATE leases SET expires_at = clock_timestamp()")
        .await;
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..8 {
        let store = world.store.clone();
        tasks.spawn(async move { store.reap(&LIMITS).await.unwrap() });
    }
    let reaped = tasks.join_all().await.concat();
    assert_eq!(
        reaped,
        [Reaped::Run {
            run_id: fence.run_id,
            epoch: fence.epoch,
            state: RunState::Interrupted
        }]
    );
}

#[tokio::test]
async fn salvage_closes_the_attempt_and_takes_its_files() {
    let world = world_with_lab().await;
    let crash = fault(Whose::Platform, "lab_restarted");
    let fence = world.run_in(RunState::Running, LONG).await;
    let salvaged = world
        .store
        .run_salvage(fence.run_id, &salvage(fence.epoch, &crash))
        .await
        .unwrap();
    assert_eq!(
        salvaged,
        Salvaged::Ok {
            state: RunState::Interrupted
        }
    );
    assert_eq!(
        world
            .store
            .run_salvage(fence.run_id, &salvage(fence.epoch, &crash))
            .await
            .unwrap(),
        salvaged,
        "again"
    );
    assert_eq!(
        world
            .store
            .run_salvage(fence.run_id, &salvage(fence.epoch + 1, &crash))
            .await
            .unwrap(),
        Salvaged::Stale
    );
    assert_eq!(
        world
            .store
            .run_file_put(fence.run_id, fence.epoch, &file("log.txt", 'b'))
            .await
            .unwrap(),
        FilePut::Ok
    );
    let run = world.store.run_get(fence.run_id).await.unwrap().unwrap();
    assert_eq!(run.fault, Some(crash.clone()));
    assert_eq!((run.ticks_recorded, run.ticks_missed), (Some(100), Some(2)));
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "free");

    let prepared = world.run_in(RunState::Preparing, LONG).await;
    let salvaged = world
        .store
        .run_salvage(prepared.run_id, &salvage(prepared.epoch, &crash))
        .await
        .unwrap();
    assert_eq!(
        salvaged,
        Salvaged::Ok {
            state: RunState::Queued
        },
        "nothing moved"
    );
}
