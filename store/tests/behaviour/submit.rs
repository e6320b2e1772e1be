//! Submitting: all or nothing, once per key, bit for bit.

use crate::fixture::*;
use api::run::RunState;
use store::*;

#[tokio::test]
async fn a_submission_has_a_validating_run_and_a_job() {
    let world = world().await;
    let run_id = world.submit().await;
    let run = world.store.run_get(run_id).await.unwrap().unwrap();
    assert_eq!(
        (run.state, run.epoch, run.submitted_by.as_str()),
        (RunState::Validating, 0, "ada")
    );
    assert_eq!(
        run.waiting_reason.as_deref(),
        Some("the twin is checking the experiment")
    );
    assert_eq!(run.experiment, experiment());
    assert_eq!(world.job(LONG).await.run_id, run_id);
    let of_others = world.store.experiment_list(10, Some("grace")).await.unwrap();
    assert!(of_others.is_empty());
    assert_eq!(world.store.experiment_list(10, Some("ada")).await.unwrap().len(), 1);
}

#[tokio::test]
async fn numbers_come_back_bit_for_bit() {
    let world = world_with_lab().await;
    let mut odd = submission("ada");
    odd.experiment.robots[0].start.yaw_rad = -0.0;
    odd.experiment.robots[1].start.x_m = 0.1 + 0.2;
    odd.experiment.targets[0].x_m = 5e-324;
    odd.experiment.control.parameters = serde_json::json!({"gain": -0.0, "huge": 1.797_693_134_862_315_7e308});
    let Submitted::Created(view) = world.store.experiment_submit(odd.clone()).await.unwrap() else {
        panic!("not stored")
    };
    let read = world.store.rehearsal_input(view.run_id).await.unwrap().unwrap();
    let bits = |experiment: &api::experiment::Experiment| {
        let starts = experiment
            .robots
            .iter()
            .flat_map(|robot| [robot.start.x_m, robot.start.yaw_rad]);
        starts
            .chain(experiment.targets.iter().map(|target| target.x_m))
            .map(f64::to_bits)
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(&read.experiment), bits(&odd.experiment));
    assert_eq!(
        read.experiment.control.parameters.to_string(),
        odd.experiment.control.parameters.to_string()
    );
    assert_eq!(
        serde_json::to_string(&read.robots).unwrap(),
        serde_json::to_string(&lab().robots[..4]).unwrap()
    );
}

#[tokio::test]
async fn fifty_parallel_retries_store_one_experiment() {
    let world = world().await;
    for key in ["k-1", "k-2", "k-3", "k-4"] {
        let mut tasks = tokio::task::JoinSet::new();
        for _ in 0..50 {
            let (store, request) = (
                world.store.clone(),
                NewSubmission {
                    idempotency_key: Some(key.to_owned()),
                    ..submission("ada")
                },
            );
            tasks.spawn(async move { store.experiment_submit(request).await.unwrap() });
        }
        let answers = tasks.join_all().await;
        let created = answers
            .iter()
            .filter(|answer| matches!(answer, Submitted::Created(_)))
            .count();
        let mut ids: Vec<_> = answers
            .iter()
            .map(|answer| match answer {
                Submitted::Created(view) | Submitted::Replayed(view) => view.id,
                Submitted::Conflict => panic!("the same body was called a conflict"),
            })
            .collect();
        ids.dedup();
        assert_eq!((created, ids.len()), (1, 1), "key {key}");
    }
    assert_eq!(
        world.database.scalar::<i64>("SELECT count(*) FROM experiments").await,
        4
    );
    assert_eq!(world.database.scalar::<i64>("SELECT count(*) FROM runs").await, 4);
    assert_eq!(world.database.scalar::<i64>("SELECT count(*) FROM jobs").await, 4);
}

#[tokio::test]
async fn another_body_under_the_same_key_is_a_conflict_for_a_day() {
    let world = world().await;
    let keyed = |hash: u8, user: &str| NewSubmission {
        idempotency_key: Some("k".to_owned()),
        request_hash: [hash; 32],
        ..submission(user)
    };
    assert!(matches!(
        world.store.experiment_submit(keyed(1, "ada")).await.unwrap(),
        Submitted::Created(_)
    ));
    assert_eq!(
        world.store.experiment_submit(keyed(2, "ada")).await.unwrap(),
        Submitted::Conflict
    );
    assert!(
        matches!(
            world.store.experiment_submit(keyed(2, "grace")).await.unwrap(),
            Submitted::Created(_)
        ),
        "keys belong to a user"
    );
    world
        .database
        .execute("UPDATE idempotency_keys SET created_at = created_at - interval '24 hours 1 second'")
        .await;
    assert!(matches!(
        world.store.experiment_submit(keyed(2, "ada")).await.unwrap(),
        Submitted::Created(_)
    ));
    assert_eq!(
        world.database.scalar::<i64>("SELECT count(*) FROM experiments").await,
        3
    );
}

#[tokio::test]
async fn an_experiment_never_changes() {
    let world = world().await;
    world.submit().await;
    for sql in [
        "UPDATE experiments SET label = 'other'",
        "DELETE FROM experiments",
        "DELETE FROM runs",
    ] {
        assert!(world.database.try_execute(sql).await.is_err(), "{sql}");
    }
}
