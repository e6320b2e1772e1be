//! Claiming: one commander per arena, no run twice.

use crate::fixture::*;
use api::run::RunState;
use std::collections::BTreeSet;
use store::*;
use uuid::Uuid;

#[tokio::test]
async fn eight_laboratories_never_hold_one_arena_together() {
    let world = world_with_lab().await;
    let rounds = 20;
    for _ in 0..rounds {
        world.queued().await;
    }
    let mut runs = BTreeSet::new();
    let mut epochs = Vec::new();
    for _ in 0..rounds {
        let mut tasks = tokio::task::JoinSet::new();
        for _ in 0..8 {
            let (store, claim) = (
                world.store.clone(),
                Claim {
                    instance: Uuid::now_v7(),
                    ..world.claim()
                },
            );
            tasks.spawn(async move {
                store
                    .run_claim(&claim, LONG)
                    .await
                    .unwrap()
                    .map(|claimed| (claimed, claim.instance))
            });
        }
        let claimed: Vec<_> = tasks.join_all().await.into_iter().flatten().collect();
        assert_eq!(claimed.len(), 1, "exactly one of eight gets the arena");
        let (claimed, instance) = &claimed[0];
        assert!(runs.insert(claimed.run_id), "a run was claimed twice");
        epochs.push(claimed.epoch);
        let fence = Fence {
            run_id: claimed.run_id,
            epoch: claimed.epoch,
            instance: *instance,
        };
        for state in [RunState::Running, RunState::Uploading, RunState::Done] {
            assert_eq!(world.reports(fence, state).await, Reported::Ok);
        }
    }
    assert!(
        epochs.is_sorted_by(|a, b| a < b),
        "epochs grow over all runs: {epochs:?}"
    );
    assert_eq!(world.store.run_claim(&world.claim(), LONG).await.unwrap(), None);
}

#[tokio::test]
async fn eight_workers_share_the_jobs_without_doubles() {
    let world = world().await;
    for _ in 0..40 {
        world.submit().await;
    }
    let mut tasks = tokio::task::JoinSet::new();
    for _ in 0..8 {
        let store = world.store.clone();
        tasks.spawn(async move {
            let (worker, mut mine) = (Uuid::now_v7(), Vec::new());
            while let Some(job) = store.job_claim("rehearse", worker, LONG).await.unwrap() {
                mine.push(job.id);
            }
            mine
        });
    }
    let all: Vec<Uuid> = tasks.join_all().await.concat();
    assert_eq!((all.len(), all.iter().collect::<BTreeSet<_>>().len()), (40, 40));
}

#[tokio::test]
async fn an_assignment_has_everything_in_order() {
    let world = world_with_lab().await;
    let run_id = world.queued().await;
    let claimed = world.store.run_claim(&world.claim(), LONG).await.unwrap().unwrap();
    assert_eq!(
        (claimed.run_id, claimed.arena, claimed.experiment.clone()),
        (run_id, lab().arena, experiment())
    );
    let names: Vec<_> = claimed
        .robots
        .iter()
        .map(|robot| robot.description.name.clone())
        .collect();
    assert_eq!(names, ["omni-01", "omni-02", "omni-03", "omni-04"]);
    assert_eq!(claimed.verdict["digest"], verdict().digest.as_str());
    let robots = world.store.robot_list().await.unwrap();
    let leased = robots.iter().filter(|robot| robot.state == "leased").count();
    assert_eq!((leased, robots.len()), (4, lab().robots.len()));
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "leased");
}

#[tokio::test]
async fn an_arena_is_claimed_only_by_its_laboratory_and_only_when_free() {
    let world = world_with_lab().await;
    world.queued().await;
    let none = |claim: Claim| {
        let store = world.store.clone();
        async move { store.run_claim(&claim, LONG).await.unwrap().is_none() }
    };
    assert!(
        none(Claim {
            lab: "another".to_owned(),
            ..world.claim()
        })
        .await
    );
    assert!(
        none(Claim {
            arena: "another".to_owned(),
            ..world.claim()
        })
        .await
    );
    world.report_status(true).await;
    assert!(none(world.claim()).await, "the protective stop holds the arena");
    world.report_status(false).await;
    world
        .database
        .execute("UPDATE arenas SET held_until = clock_timestamp() + interval '1 hour', held_reason = 'x'")
        .await;
    assert!(none(world.claim()).await);
    world.store.lab_register(&lab()).await.unwrap();
    assert!(!none(world.claim()).await, "registering again frees the arena");
}

#[tokio::test]
async fn a_run_without_its_robots_does_not_block_the_next() {
    let world = world_with_lab().await;
    let first = world.queued().await;
    let mut fewer = lab();
    fewer.robots.remove(0);
    world.store.lab_register(&fewer).await.unwrap();
    let mut other = submission("grace");
    other.experiment.robots = vec![other.experiment.robots[1].clone()];
    let Submitted::Created(view) = world.store.experiment_submit(other).await.unwrap() else {
        panic!("not stored")
    };
    world
        .store
        .run_verdict_set(&world.job(LONG).await, &world.accepted())
        .await
        .unwrap();
    assert_eq!(world.preparing(LONG).await.run_id, view.run_id);
    let reason = world
        .store
        .run_get(first)
        .await
        .unwrap()
        .unwrap()
        .waiting_reason
        .unwrap();
    assert_eq!(reason, "omni-01 is not in the arena reference");
}
