//! Jobs: a lost worker's job is retried, a poison job ends, a late worker writes nothing.

use crate::fixture::*;
use api::run::{RunState, Whose};
use std::time::Duration;
use store::*;
use uuid::Uuid;

#[tokio::test]
async fn a_lost_workers_job_goes_to_another_and_the_late_one_writes_nothing() {
    let world = world_with_lab().await;
    let run_id = world.submit().await;
    let lost = world.job(SHORT).await;
    assert_eq!(
        world.reap_something().await,
        [Reaped::Job {
            job_id: lost.id,
            run_id,
            attempt: 1,
            failed: false
        }]
    );
    let next = world.job(LONG).await;
    assert_eq!((next.id, next.attempt, next.tries), (lost.id, 2, 2));
    assert_eq!(world.store.job_heartbeat(&lost, LONG).await.unwrap(), JobWrite::Stale);
    assert_eq!(
        world.store.run_verdict_set(&lost, &world.accepted()).await.unwrap(),
        JobWrite::Stale
    );
    assert_eq!(world.store.job_release(&lost).await.unwrap(), JobWrite::Stale);
    assert_eq!(world.store.job_complete(&lost).await.unwrap(), JobWrite::Stale);
    let end = JobFailure::Final {
        fault: fault(Whose::User, "x"),
    };
    assert_eq!(
        world.store.job_fail(&lost, "late", &end).await.unwrap(),
        JobWrite::Stale
    );
    assert_eq!(world.state(run_id).await, RunState::Validating);
    assert_eq!(
        world.store.run_verdict_set(&next, &world.accepted()).await.unwrap(),
        JobWrite::Ok
    );
    assert_eq!(
        world.store.run_verdict_set(&next, &world.accepted()).await.unwrap(),
        JobWrite::Stale,
        "once"
    );
    assert_eq!(world.state(run_id).await, RunState::Queued);
}

#[tokio::test]
async fn a_job_that_kills_its_workers_ends_after_three() {
    let world = world().await;
    let run_id = world.submit().await;
    for attempt in 1..=3 {
        let job = world.job(SHORT).await;
        assert_eq!(
            world.reap_something().await,
            [Reaped::Job {
                job_id: job.id,
                run_id,
                attempt,
                failed: attempt == 3
            }]
        );
    }
    let run = world.store.run_get(run_id).await.unwrap().unwrap();
    assert_eq!(
        (run.state, run.fault.unwrap().code.as_str()),
        (RunState::Failed, "rehearsal_lost")
    );
    assert_eq!(
        world.store.job_claim("rehearse", Uuid::now_v7(), LONG).await.unwrap(),
        None
    );
}

#[tokio::test]
async fn a_job_given_back_in_good_order_costs_no_try() {
    let world = world().await;
    world.submit().await;
    for attempt in 1..=10 {
        let job = world.job(LONG).await;
        assert_eq!((job.attempt, job.tries), (attempt, 1));
        assert_eq!(world.store.job_release(&job).await.unwrap(), JobWrite::Ok);
    }
}

#[tokio::test]
async fn a_failed_try_waits_and_a_final_failure_ends_the_run() {
    let world = world().await;
    let run_id = world.submit().await;
    let job = world.job(LONG).await;
    let later = JobFailure::Retry {
        after: Duration::from_secs(3600),
    };
    assert_eq!(
        world.store.job_fail(&job, "no disk", &later).await.unwrap(),
        JobWrite::Ok
    );
    assert_eq!(
        world.store.job_claim("rehearse", Uuid::now_v7(), LONG).await.unwrap(),
        None,
        "not yet"
    );
    world
        .database
        .execute("UPDATE jobs SET ready_at = clock_timestamp()")
        .await;
    let job = world.job(LONG).await;
    let end = JobFailure::Final {
        fault: fault(Whose::User, "unknown_robot"),
    };
    assert_eq!(
        world.store.job_fail(&job, "no robot", &end).await.unwrap(),
        JobWrite::Ok
    );
    let run = world.store.run_get(run_id).await.unwrap().unwrap();
    assert_eq!(
        (run.state, run.fault.unwrap().code.as_str()),
        (RunState::Rejected, "unknown_robot")
    );
}

#[tokio::test]
async fn a_verdict_shows_in_the_run() {
    let world = world_with_lab().await;
    let claim = api::experiment::DigestClaim {
        digest: verdict().digest,
        twin_version: "twin-test/1".to_owned(),
        engine: "client".to_owned(),
    };
    let claimed = NewSubmission {
        claim: Some(claim.clone()),
        ..submission("ada")
    };
    let Submitted::Created(view) = world.store.experiment_submit(claimed).await.unwrap() else {
        panic!("not stored")
    };
    assert_eq!(
        world.store.run_get(view.run_id).await.unwrap().unwrap().digest.equal,
        None
    );
    let job = world.job(LONG).await;
    assert_eq!(
        world.store.rehearsal_input(job.run_id).await.unwrap().unwrap().claim,
        Some(claim)
    );
    world.store.run_verdict_set(&job, &world.accepted()).await.unwrap();
    let run = world.store.run_get(view.run_id).await.unwrap().unwrap();
    assert_eq!((run.verdict.clone(), run.digest.equal), (Some(verdict()), Some(true)));
    assert_eq!(run.files[0].name, "replay.json");
    assert!(run.queued_at.is_some());
}
