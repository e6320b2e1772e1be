//! Diagnoses: leased to one worker, fenced, taken again, ended for good; models that are only added to.

use crate::fixture::*;
use api::diagnosis::{DiagnosisOrigin, DiagnosisProblem, DiagnosisState};
use api::model::HorizonGap;
use api::run::RunState;
use serde_json::json;
use store::*;
use uuid::Uuid;

impl World {
    async fn done(&self) -> Uuid {
        self.run_in(RunState::Done, LONG).await.run_id
    }

    async fn diagnosis(&self, runs: &[Uuid]) -> Uuid {
        let new = NewDiagnosis {
            user: "ada".to_owned(),
            robot: "omni-01".to_owned(),
            arena: "reference".to_owned(),
            floor: "lab-floor".to_owned(),
            origin: DiagnosisOrigin::Person,
            parent_model: None,
            reference_runs: vec![runs[0]],
            changed_runs: runs[1..].to_vec(),
            locked_runs: Vec::new(),
            idempotency_key: None,
            request_hash: [0; 32],
        };
        match self.store.diagnosis_submit(new).await.unwrap() {
            DiagnosisSubmitted::Created(view) => view.id,
            other => panic!("not stored: {other:?}"),
        }
    }

    async fn lease(&self, duration: std::time::Duration) -> DiagnosisLease {
        let lease = self.store.diagnosis_claim(Uuid::now_v7(), duration).await.unwrap();
        lease.expect("a diagnosis waits")
    }

    async fn reap_diagnosis(&self) -> Vec<Uuid> {
        loop {
            let reaped = self.store.diagnoses_reap().await.unwrap();
            if !reaped.is_empty() {
                return reaped;
            }
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    }

    async fn gap(&self, run: Uuid, robot: &str, position_m: f64) {
        let work = GapWork {
            run,
            robot: robot.to_owned(),
            model: None,
            document: None,
        };
        let gap = HorizonGap {
            horizon_s: GAP_HORIZON_S,
            position_m,
            yaw_rad: 0.0,
            samples: 5,
        };
        self.store.gap_put(&work, &Ok(vec![gap])).await.unwrap();
    }
}

fn record(number: u32) -> DiagnosisRecord {
    DiagnosisRecord {
        verdict: "confirmed".to_owned(),
        sentence: "Missing in the twin: floor friction.".to_owned(),
        next_why: None,
        report: r#"{"format":"robopheus.diagnosis/1","gap":-0.0}"#.to_owned(),
        page: file("report.html", 'c'),
        model: json!({"format": "robopheus.model/1", "id": format!("{number:064x}")}),
    }
}

#[tokio::test]
async fn a_lost_workers_diagnosis_goes_to_another_and_the_late_one_writes_nothing() {
    let world = world_with_lab().await;
    let runs = [world.done().await, world.done().await, world.done().await];
    let id = world.diagnosis(&runs).await;
    let lost = world.lease(SHORT).await;
    let roles: Vec<_> = lost.runs.iter().map(|run| (run.run, run.role.as_str())).collect();
    assert_eq!(
        roles,
        [(runs[1], "changed"), (runs[2], "changed"), (runs[0], "reference")]
    );
    assert_eq!(world.reap_diagnosis().await, [id]);
    let next = world.lease(LONG).await;
    assert_eq!((next.id, next.attempt, next.tries), (id, 2, 2));
    let late = world.store.diagnosis_heartbeat(&lost, LONG, "fit", 0.5).await.unwrap();
    assert_eq!(late, DiagnosisBeat::Stale);
    assert_eq!(
        world.store.diagnosis_complete(&lost, &record(1)).await.unwrap(),
        JobWrite::Stale
    );
    let problem = DiagnosisProblem {
        code: "x".to_owned(),
        message: "x".to_owned(),
    };
    assert_eq!(
        world.store.diagnosis_fail(&lost, &problem).await.unwrap(),
        JobWrite::Stale
    );
    assert_eq!(world.store.diagnosis_release(&lost).await.unwrap(), JobWrite::Stale);
    world.store.diagnosis_heartbeat(&next, LONG, "fit", 0.5).await.unwrap();
    world
        .store
        .diagnosis_heartbeat(&next, LONG, "select", 0.4)
        .await
        .unwrap();
    let view = world.store.diagnosis_get(id).await.unwrap().unwrap();
    assert_eq!(
        (view.stage.as_str(), view.progress),
        ("select", 0.5),
        "progress does not go back"
    );
    assert_eq!(
        world.store.diagnosis_complete(&next, &record(1)).await.unwrap(),
        JobWrite::Ok
    );
    assert_eq!(
        world.store.diagnosis_complete(&next, &record(1)).await.unwrap(),
        JobWrite::Stale,
        "once"
    );
    let text = world.store.diagnosis_report(id).await.unwrap().unwrap();
    assert_eq!(text, record(1).report, "as it was written");
    let changed = world
        .database
        .try_execute("UPDATE diagnoses SET report = '{}'::json")
        .await;
    assert!(changed.is_err(), "a result stays");
}

#[tokio::test]
async fn a_diagnosis_that_kills_its_workers_ends_after_three() {
    let world = world_with_lab().await;
    let runs = [world.done().await, world.done().await, world.done().await];
    let id = world.diagnosis(&runs).await;
    for _ in 0..DIAGNOSIS_ATTEMPTS {
        world.lease(SHORT).await;
        assert_eq!(world.reap_diagnosis().await, [id]);
    }
    assert!(
        world
            .store
            .diagnosis_claim(Uuid::now_v7(), LONG)
            .await
            .unwrap()
            .is_none()
    );
    let view = world.store.diagnosis_get(id).await.unwrap().unwrap();
    let problem = view.problem.unwrap();
    assert_eq!(
        (view.state, problem.code.as_str()),
        (DiagnosisState::Failed, "worker_lost")
    );
    assert!(problem.message.contains("3 times"), "{}", problem.message);
}

#[tokio::test]
async fn a_cancelled_diagnosis_of_a_lost_worker_is_not_taken_again() {
    let world = world_with_lab().await;
    let runs = [world.done().await, world.done().await, world.done().await];
    let id = world.diagnosis(&runs).await;
    world.lease(SHORT).await;
    assert_eq!(
        world.store.diagnosis_cancel(id, "ada").await.unwrap(),
        DiagnosisCancelled::Requested
    );
    assert_eq!(world.reap_diagnosis().await, [id]);
    let view = world.store.diagnosis_get(id).await.unwrap().unwrap();
    assert_eq!(view.state, DiagnosisState::Cancelled);
    let again = world.store.diagnosis_cancel(id, "ada").await.unwrap();
    assert_eq!(again, DiagnosisCancelled::Ended(DiagnosisState::Cancelled));
}

#[tokio::test]
async fn the_same_document_is_one_version_and_submissions_keep_the_model_of_their_time() {
    let world = world_with_lab().await;
    let runs = [world.done().await, world.done().await, world.done().await];
    for (number, version) in [(1, "omni-01/1"), (1, "omni-01/1"), (2, "omni-01/2")] {
        let id = world.diagnosis(&runs).await;
        let lease = world.lease(LONG).await;
        assert_eq!(
            world.store.diagnosis_complete(&lease, &record(number)).await.unwrap(),
            JobWrite::Ok
        );
        let view = world.store.diagnosis_get(id).await.unwrap().unwrap();
        assert_eq!(view.model.as_deref(), Some(version));
    }
    let before = world.submit().await;
    let model = world.store.model_find("omni-01/2").await.unwrap().unwrap();
    let set = async |model| {
        world
            .store
            .robot_model_set("omni-01", "lab-floor", model, None, "ada")
            .await
            .unwrap()
    };
    set(Some(model.id)).await;
    let after = world.submit().await;
    let reverted = set(None).await;
    assert_eq!((reverted.model, reverted.history.len()), (None, 2));
    assert_eq!(set(None).await.history.len(), 2, "no line for what is so already");
    let models = async |run| world.store.rehearsal_input(run).await.unwrap().unwrap().models;
    assert!(models(before).await.is_empty());
    let kept = models(after).await;
    assert_eq!(kept.keys().collect::<Vec<_>>(), ["omni-01"]);
    assert_eq!(
        kept["omni-01"], model.document,
        "the model of its time, although it was taken back since"
    );
    let shown = async |run| world.store.run_get(run).await.unwrap().unwrap().models;
    assert!(shown(before).await.is_empty());
    assert_eq!(
        shown(after).await["omni-01"],
        "omni-01/2",
        "a run says by which version"
    );
    let mut named = submission("ada");
    named.experiment.model = Some("omni-01/1".to_owned());
    let Submitted::Created(view) = world.store.experiment_submit(named).await.unwrap() else {
        panic!("not stored")
    };
    assert_eq!(models(view.run_id).await["omni-01"]["id"], json!(format!("{:064x}", 1)));
    let listed = world.store.run_list(1, None).await.unwrap();
    assert_eq!(listed[0].models["omni-01"], "omni-01/1");
}

#[tokio::test]
async fn gaps_ask_for_one_diagnosis_and_not_again_for_the_same_runs() {
    let world = world_with_lab().await;
    let mut runs = Vec::new();
    for _ in 0..5 {
        runs.push(world.done().await);
    }
    let work = world.store.gap_work(100).await.unwrap();
    assert_eq!(work.len(), 20, "four robots in each of five runs");
    let robot = "omni-01";
    for (run, position_m) in runs.iter().zip([0.010, 0.010, 0.0149, 0.016, 0.030]) {
        world.gap(*run, robot, position_m).await;
    }
    assert_eq!(world.store.gap_work(100).await.unwrap().len(), 15);
    assert!(
        world.store.diagnoses_of_gaps().await.unwrap().is_empty(),
        "no references, no floor"
    );
    world
        .store
        .robot_references_set(robot, "lab-floor", &runs[..2], "ada")
        .await
        .unwrap();
    let gaps = world.store.robot_gaps(robot, "lab-floor", None).await.unwrap();
    assert!((gaps.limit_position_m.unwrap() - 0.015).abs() < 1e-12);
    let (first, second) = tokio::join!(world.store.diagnoses_of_gaps(), world.store.diagnoses_of_gaps());
    let made = [first.unwrap(), second.unwrap()].concat();
    assert_eq!(made.len(), 1, "two sweeps at once, one diagnosis");
    let view = world.store.diagnosis_get(made[0]).await.unwrap().unwrap();
    assert_eq!(
        (view.origin, &view.changed_runs),
        (DiagnosisOrigin::Gap, &runs[3..].to_vec())
    );
    assert_eq!(
        world.store.diagnosis_cancel(made[0], "ada").await.unwrap(),
        DiagnosisCancelled::AtOnce
    );
    assert!(
        world.store.diagnoses_of_gaps().await.unwrap().is_empty(),
        "these runs have been asked about"
    );
    let newer = world.done().await;
    world.gap(newer, robot, 0.02).await;
    let made = world.store.diagnoses_of_gaps().await.unwrap();
    let view = world.store.diagnosis_get(made[0]).await.unwrap().unwrap();
    assert_eq!(view.changed_runs, [runs[3], runs[4], newer]);
}
