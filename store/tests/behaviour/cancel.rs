//! Cancelling in every state.

use crate::fixture::*;
use api::run::{RunState, Whose};
use store::*;
use uuid::Uuid;

#[tokio::test]
async fn a_waiting_run_is_cancelled_at_once() {
    let world = world_with_lab().await;
    for state in [RunState::Validating, RunState::Queued] {
        let fence = world.run_in(state, LONG).await;
        assert_eq!(
            world.store.run_cancel(fence.run_id, "grace").await.unwrap(),
            Cancelled::AtOnce
        );
        let run = world.store.run_get(fence.run_id).await.unwrap().unwrap();
        let fault = run.fault.unwrap();
        assert_eq!(
            (run.state, fault.whose, fault.code.as_str()),
            (RunState::Cancelled, Whose::User, "cancelled_by_user")
        );
        assert_eq!(fault.message, "Cancelled by grace.");
        assert_eq!(run.waiting_reason, None);
        assert_eq!(
            world.store.run_cancel(fence.run_id, "grace").await.unwrap(),
            Cancelled::Ended(RunState::Cancelled)
        );
    }
    assert_eq!(
        world.store.job_claim("rehearse", Uuid::now_v7(), LONG).await.unwrap(),
        None,
        "its job is dropped"
    );
    assert_eq!(world.store.run_claim(&world.claim(), LONG).await.unwrap(), None);
    assert_eq!(
        world.store.run_cancel(Uuid::now_v7(), "grace").await.unwrap(),
        Cancelled::Unknown
    );
}

#[tokio::test]
async fn a_run_in_the_laboratory_is_asked_to_stop() {
    for state in [RunState::Preparing, RunState::Running, RunState::Uploading] {
        let world = world_with_lab().await;
        let fence = world.run_in(state, LONG).await;
        assert_eq!(
            world.store.run_heartbeat(fence, LONG).await.unwrap(),
            Beat::Ok {
                cancel_requested: false
            }
        );
        assert_eq!(
            world.store.run_cancel(fence.run_id, "ada").await.unwrap(),
            Cancelled::Requested
        );
        assert_eq!(
            world.store.run_cancel(fence.run_id, "ada").await.unwrap(),
            Cancelled::Requested
        );
        assert_eq!(world.state(fence.run_id).await, state);
        assert_eq!(
            world.store.run_heartbeat(fence, LONG).await.unwrap(),
            Beat::Ok { cancel_requested: true }
        );
        assert_eq!(world.reports(fence, RunState::Cancelled).await, Reported::Ok);
        assert_eq!(
            world
                .store
                .run_get(fence.run_id)
                .await
                .unwrap()
                .unwrap()
                .fault
                .unwrap()
                .code,
            "cancelled_by_user"
        );
    }
}

#[tokio::test]
async fn a_rehearsal_that_ends_after_the_cancel_changes_nothing() {
    let world = world().await;
    let run_id = world.submit().await;
    let job = world.job(LONG).await;
    assert_eq!(world.store.run_cancel(run_id, "ada").await.unwrap(), Cancelled::AtOnce);
    assert_eq!(world.store.job_heartbeat(&job, LONG).await.unwrap(), JobWrite::Stale);
    assert_eq!(
        world.store.run_verdict_set(&job, &world.accepted()).await.unwrap(),
        JobWrite::Stale
    );
    assert_eq!(world.state(run_id).await, RunState::Cancelled);
    assert!(world.store.run_files(run_id).await.unwrap().is_empty());
}

#[tokio::test]
async fn cancel_and_claim_race_and_the_run_is_never_lost() {
    let world = world_with_lab().await;
    for _ in 0..20 {
        let run_id = world.queued().await;
        let claim = world.claim();
        let (cancelled, claimed) = tokio::join!(
            world.store.run_cancel(run_id, "ada"),
            world.store.run_claim(&claim, LONG)
        );
        match (cancelled.unwrap(), claimed.unwrap()) {
            (Cancelled::AtOnce, None) => assert_eq!(world.state(run_id).await, RunState::Cancelled),
            (Cancelled::Requested, Some(claimed)) => {
                let fence = Fence {
                    run_id,
                    epoch: claimed.epoch,
                    instance: world.instance,
                };
                assert_eq!(
                    world.store.run_heartbeat(fence, LONG).await.unwrap(),
                    Beat::Ok { cancel_requested: true }
                );
                assert_eq!(world.reports(fence, RunState::Cancelled).await, Reported::Ok);
            }
            other => panic!("{other:?}"),
        }
    }
}
