//! The diagnose worker on a real PostgreSQL: results, cancelling, lost workers, gaps and what follows from them.

#[path = "support/recorded.rs"]
mod recorded;

use api::diagnosis::{DiagnosisOrigin, DiagnosisState, DiagnosisView};
use api::model::RobotGaps;
use recorded::{Recipe, done_run, lab};
use scheduler::diagnose::{Config, run};
use scheduler::stop::{StopHandle, stop_pair};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use store::testing::TestDatabase;
use store::{DiagnosisSubmitted, JobWrite, NewDiagnosis, Store, StoreOptions};
use tokio::task::JoinHandle;
use uuid::Uuid;

/// Longest wait for anything; a diagnosis of these runs takes a few seconds on an idle machine.
const LIMIT: Duration = Duration::from_secs(240);
const NOTHING: &str = "[]";
/// Larger wheels than the description says.
const WHEELS: &str = r#"[{"name": "wheel_radius", "index": null, "parameters": {"relative": 0.04}}]"#;

struct World {
    store: Store,
    data: PathBuf,
    database: TestDatabase,
}

struct Running {
    handle: StopHandle,
    task: JoinHandle<anyhow::Result<()>>,
}

impl Running {
    async fn stop(self) {
        self.handle.stop();
        self.task.await.unwrap().unwrap();
    }
}

impl World {
    async fn new() -> Self {
        let database = TestDatabase::new().await;
        let store = Store::connect(&database.url, StoreOptions::default()).await.unwrap();
        store.migrate().await.unwrap();
        store.lab_register(&lab()).await.unwrap();
        let data = std::env::temp_dir().join(format!("robopheus-diagnose-{}", Uuid::now_v7().simple()));
        std::fs::create_dir(&data).unwrap();
        Self { store, data, database }
    }

    fn start(&self) -> Running {
        let (handle, stop) = stop_pair();
        let config = Config {
            database_url: self.database.url.clone(),
            data: self.data.clone(),
            threads: 2,
        };
        Running {
            handle,
            task: tokio::spawn(run(config, stop)),
        }
    }

    /// The program itself.
    fn spawn(&self) -> Child {
        Command::new(env!("CARGO_BIN_EXE_robopheus-diagnose-worker"))
            .args(["--database-url", &self.database.url, "--data"])
            .arg(&self.data)
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }

    async fn runs(&self, label: &str, effects: &str, count: u64, duration_s: f64) -> Vec<Uuid> {
        let mut runs = Vec::new();
        for k in 0..count {
            let recipe = Recipe {
                robot: "omni-03",
                label,
                effects,
                duration_s,
                seed: 100 * effects.len() as u64 + k,
            };
            runs.push(done_run(&self.store, &self.data, &recipe).await);
        }
        runs
    }

    async fn ask(&self, references: &[Uuid], changed: &[Uuid]) -> Uuid {
        let new = NewDiagnosis {
            user: "ada".to_owned(),
            robot: "omni-03".to_owned(),
            arena: "reference".to_owned(),
            floor: "lab-floor".to_owned(),
            origin: DiagnosisOrigin::Person,
            parent_model: None,
            reference_runs: references.to_vec(),
            changed_runs: changed.to_vec(),
            locked_runs: Vec::new(),
            idempotency_key: None,
            request_hash: [0; 32],
        };
        match self.store.diagnosis_submit(new).await.unwrap() {
            DiagnosisSubmitted::Created(view) => view.id,
            other => panic!("not stored: {other:?}"),
        }
    }

    async fn until(&self, id: Uuid, wanted: impl Fn(&DiagnosisView) -> bool) -> DiagnosisView {
        let begun = Instant::now();
        loop {
            let view = self.store.diagnosis_get(id).await.unwrap().unwrap();
            if wanted(&view) {
                return view;
            }
            assert!(begun.elapsed() < LIMIT, "waited in vain: {view:?}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    async fn until_gaps(&self, wanted: impl Fn(&RobotGaps) -> bool) -> RobotGaps {
        let begun = Instant::now();
        loop {
            let gaps = self.store.robot_gaps("omni-03", "lab-floor", None).await.unwrap();
            if wanted(&gaps) {
                return gaps;
            }
            assert!(begun.elapsed() < LIMIT, "waited in vain: {gaps:?}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_missing_effect_is_named_and_its_model_can_be_accepted() {
    let world = World::new().await;
    let references = world.runs("reference", NOTHING, 2, 10.0).await;
    let changed = world.runs("larger wheels", WHEELS, 4, 10.0).await;
    let id = world.ask(&references, &changed).await;
    let worker = world.start();
    let view = world.until(id, |view| view.state.is_terminal()).await;
    assert_eq!(view.state, DiagnosisState::Done, "{:?}", view.problem);
    assert_eq!((view.progress, view.stage.as_str()), (1.0, ""));
    let text = world.store.diagnosis_report(id).await.unwrap().unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["effects"][0]["name"], "wheel_radius", "{}", report["sentence"]);
    let value = report["effects"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((value - 0.04).abs() < 0.01, "0.04 was driven, {value} is told");
    let page = world.store.diagnosis_page(id).await.unwrap().unwrap();
    let html = std::fs::read_to_string(world.data.join("objects").join(&page.object_path)).unwrap();
    assert!(html.contains("<svg") && html.len() as i64 == page.bytes);
    let version = view.model.unwrap();
    let model = world.store.model_find(&version).await.unwrap().unwrap();
    assert_eq!(
        (version.as_str(), model.is_current, model.diagnosis),
        ("omni-03/1", false, Some(id))
    );
    let document = twin::model_document::ModelDocument::parse(&model.document.to_string()).unwrap();
    assert_eq!(document.id, report["model"]["id"].as_str().unwrap());

    let before = world
        .until_gaps(|gaps| gaps.runs.iter().all(|run| !run.horizons.is_empty()))
        .await;
    world
        .store
        .robot_model_set("omni-03", "lab-floor", Some(model.id), Some(id), "ada")
        .await
        .unwrap();
    let after = world
        .until_gaps(|gaps| gaps.model == Some(model.id) && gaps.runs.iter().all(|run| !run.horizons.is_empty()))
        .await;
    let gap_m = |gaps: &RobotGaps| {
        let run = gaps.runs.iter().find(|run| run.run == changed[0]).unwrap();
        run.horizons.iter().find(|gap| gap.horizon_s == 2.0).unwrap().position_m
    };
    let (nominal_m, accepted_m) = (gap_m(&before), gap_m(&after));
    println!("pose gap 2 s ahead: {nominal_m:.4} m nominal, {accepted_m:.4} m with the accepted model");
    assert!(accepted_m < 0.4 * nominal_m, "{nominal_m} {accepted_m}");
    worker.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_running_diagnosis_is_cancelled_and_nothing_is_kept() {
    let world = World::new().await;
    let changed = world.runs("changed", WHEELS, 6, 40.0).await;
    let id = world.ask(&[], &changed).await;
    let worker = world.start();
    let running = world
        .until(id, |view| view.state == DiagnosisState::Running && view.progress > 0.0)
        .await;
    assert!(!running.stage.is_empty());
    world.store.diagnosis_cancel(id, "ada").await.unwrap();
    let begun = Instant::now();
    let view = world.until(id, |view| view.state.is_terminal()).await;
    println!("cancelled {} ms after it was asked for", begun.elapsed().as_millis());
    assert_eq!(view.state, DiagnosisState::Cancelled);
    assert_eq!(view.problem.unwrap().message, "Cancelled by ada.");
    assert!(world.store.model_list(None).await.unwrap().is_empty());
    worker.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_diagnosis_of_a_killed_program_is_taken_again() {
    let world = World::new().await;
    let changed = world.runs("changed", NOTHING, 2, 6.0).await;
    let id = world.ask(&[], &changed).await;
    let mut program = world.spawn();
    world.until(id, |view| view.state == DiagnosisState::Running).await;
    program.kill().unwrap();
    program.wait().unwrap();
    let lost = world.database.scalar::<i32>("SELECT attempt FROM diagnoses").await;
    // Instead of waiting for the lease.
    world
        .database
        .execute("UPDATE diagnoses SET leased_until = clock_timestamp() WHERE state = 'running'")
        .await;
    let worker = world.start();
    let view = world.until(id, |view| view.state.is_terminal()).await;
    assert_eq!(view.state, DiagnosisState::Done, "{:?}", view.problem);
    assert_eq!(
        world.database.scalar::<i32>("SELECT attempt FROM diagnoses").await,
        lost + 1
    );
    worker.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn told_to_stop_the_program_gives_its_diagnosis_back() {
    let world = World::new().await;
    let changed = world.runs("changed", WHEELS, 4, 40.0).await;
    let id = world.ask(&[], &changed).await;
    let mut program = world.spawn();
    world.until(id, |view| view.state == DiagnosisState::Running).await;
    let begun = Instant::now();
    let pid = program.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    let status = tokio::task::spawn_blocking(move || program.wait())
        .await
        .unwrap()
        .unwrap();
    assert!(
        status.success() && begun.elapsed() < Duration::from_secs(5),
        "{status} {:?}",
        begun.elapsed()
    );
    let view = world.store.diagnosis_get(id).await.unwrap().unwrap();
    assert_eq!(view.state, DiagnosisState::Queued);
    let counted = world
        .database
        .scalar::<i32>("SELECT attempt - released FROM diagnoses")
        .await;
    assert_eq!(counted, 0, "a stop does not count as a try");
    assert_eq!(
        world.store.diagnosis_release(&lease(id)).await.unwrap(),
        JobWrite::Stale
    );
}

fn lease(id: Uuid) -> store::DiagnosisLease {
    store::DiagnosisLease {
        id,
        attempt: 1,
        tries: 1,
        worker: Uuid::nil(),
        robot: String::new(),
        floor: String::new(),
        parent_model: None,
        runs: Vec::new(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_without_records_ends_its_diagnosis_with_words() {
    let world = World::new().await;
    let changed = world.runs("changed", NOTHING, 2, 6.0).await;
    world
        .database
        .execute("DELETE FROM run_files WHERE name LIKE '%telemetry.csv'")
        .await;
    let id = world.ask(&[], &changed).await;
    let worker = world.start();
    let view = world.until(id, |view| view.state.is_terminal()).await;
    let problem = view.problem.unwrap();
    assert_eq!(
        (view.state, problem.code.as_str()),
        (DiagnosisState::Failed, "run_unreadable")
    );
    assert!(
        problem.message.contains("no telemetry of the robot omni-03"),
        "{}",
        problem.message
    );
    let gaps = world
        .until_gaps(|gaps| gaps.runs.iter().all(|run| run.problem.is_some()))
        .await;
    assert!(gaps.runs.iter().all(|run| run.horizons.is_empty()));
    worker.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn gaps_above_the_references_queue_one_diagnosis() {
    let world = World::new().await;
    let references = world.runs("reference", NOTHING, 3, 8.0).await;
    world
        .store
        .robot_references_set("omni-03", "lab-floor", &references, "ada")
        .await
        .unwrap();
    let worker = world.start();
    let gaps = world.until_gaps(|gaps| gaps.limit_position_m.is_some()).await;
    let (floor_m, limit_m) = (gaps.floor_position_m.unwrap(), gaps.limit_position_m.unwrap());
    assert!((limit_m / floor_m - store::GAP_MARGIN).abs() < 1e-9);
    let calm = world.runs("again", NOTHING, 1, 8.0).await;
    world
        .until_gaps(|gaps| {
            gaps.runs
                .iter()
                .any(|run| run.run == calm[0] && !run.horizons.is_empty())
        })
        .await;
    assert!(world.store.diagnosis_list(10, None, None).await.unwrap().is_empty());
    let changed = world.runs("changed", WHEELS, 2, 8.0).await;
    let begun = Instant::now();
    let queued = loop {
        let list = world.store.diagnosis_list(10, Some("omni-03"), None).await.unwrap();
        if let [one] = list.as_slice() {
            break one.clone();
        }
        assert!(begun.elapsed() < LIMIT, "no diagnosis, {list:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!(queued.origin, DiagnosisOrigin::Gap);
    assert_eq!(queued.changed_runs, changed);
    assert_eq!(queued.reference_runs.len(), 3);
    assert_eq!(queued.requested_by, "local", "it belongs to whoever drove the run");
    world.until(queued.id, |view| view.state.is_terminal()).await;
    tokio::time::sleep(Duration::from_secs(3)).await;
    let list = world.store.diagnosis_list(10, None, None).await.unwrap();
    assert_eq!(list.len(), 1, "the same runs ask once: {list:?}");
    worker.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_proposed_run_is_taken_in_when_it_is_done() {
    let world = World::new().await;
    let changed = world.runs("changed", NOTHING, 2, 6.0).await;
    let id = world.ask(&[], &changed).await;
    let worker = world.start();
    world.until(id, |view| view.state == DiagnosisState::Done).await;
    let proposed = world.runs("proposed", NOTHING, 1, 6.0).await[0];
    assert!(world.store.diagnosis_next_run_set(id, None, proposed).await.unwrap());
    assert!(
        !world.store.diagnosis_next_run_set(id, None, changed[0]).await.unwrap(),
        "the first stays"
    );
    let view = world.until(id, |view| view.follow_up.is_some()).await;
    let next = world
        .until(view.follow_up.unwrap(), |view| view.state.is_terminal())
        .await;
    assert_eq!((next.origin, next.follows), (DiagnosisOrigin::FollowUp, Some(id)));
    assert_eq!(next.changed_runs, [changed, vec![proposed]].concat());
    assert_eq!(next.state, DiagnosisState::Done, "{:?}", next.problem);
    worker.stop().await;
}
