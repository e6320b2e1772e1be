//! The scheduler on a real PostgreSQL: rehearsals, reaping, stopping, outages.

use api::experiment::{DigestClaim, Experiment};
use api::lab::{LabDescription, Side, StateReport};
use api::run::{RunState, RunView, Whose};
use scheduler::stop::{Stop, StopHandle, stop_pair};
use scheduler::{Config, run};
use sha2::{Digest, Sha256};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use store::testing::TestDatabase;
use store::*;
use tokio::task::JoinHandle;
use uuid::Uuid;

/// Far more than anything here takes, also beside a full build.
const LIMIT: Duration = Duration::from_secs(60);

struct World {
    store: Store,
    data: PathBuf,
    database: TestDatabase,
}

impl Drop for World {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.data);
    }
}

/// A scheduler inside the test process; stops when dropped.
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
    async fn new(database: TestDatabase) -> Self {
        let options = StoreOptions {
            acquire_timeout: Duration::from_secs(2),
            ..StoreOptions::default()
        };
        let store = Store::connect(&database.url, options).await.unwrap();
        store.migrate().await.unwrap();
        let data = std::env::temp_dir().join(format!("robopheus-scheduler-{}", Uuid::now_v7().simple()));
        std::fs::create_dir(&data).unwrap();
        Self { store, data, database }
    }

    async fn with_lab() -> Self {
        let world = Self::new(TestDatabase::new().await).await;
        world.store.lab_register(&lab()).await.unwrap();
        world
    }

    fn config(&self) -> Config {
        Config {
            database_url: self.database.url.clone(),
            data: self.data.clone(),
            workers: 2,
        }
    }

    fn start(&self) -> Running {
        let (handle, stop): (StopHandle, Stop) = stop_pair();
        Running {
            handle,
            task: tokio::spawn(run(self.config(), stop)),
        }
    }

    /// The program itself.
    fn spawn(&self) -> Child {
        Command::new(env!("CARGO_BIN_EXE_robopheus-scheduler"))
            .args(["--database-url", &self.database.url, "--workers", "1", "--data"])
            .arg(&self.data)
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }

    async fn submit(&self, experiment: Experiment, claim: Option<DigestClaim>) -> Uuid {
        let submission = NewSubmission {
            user: "ada".to_owned(),
            label: String::new(),
            experiment,
            claim,
            idempotency_key: None,
            request_hash: [0; 32],
        };
        match self.store.experiment_submit(submission).await.unwrap() {
            Submitted::Created(view) => view.run_id,
            other => panic!("not stored: {other:?}"),
        }
    }

    /// Waits until the run is in one of the states.
    async fn until(&self, run_id: Uuid, states: &[RunState]) -> RunView {
        let begun = Instant::now();
        loop {
            // Some tests take the database away meanwhile.
            if let Ok(Some(run)) = self.store.run_get(run_id).await {
                if states.contains(&run.state) {
                    return run;
                }
                assert!(
                    begun.elapsed() < LIMIT,
                    "the run stays {:?}, {:?}",
                    run.state,
                    run.fault
                );
            }
            assert!(begun.elapsed() < LIMIT, "the run cannot be read");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    async fn until_sql(&self, condition: &str) {
        let begun = Instant::now();
        while !self.database.scalar::<bool>(&format!("SELECT {condition}")).await {
            assert!(begun.elapsed() < LIMIT, "never true: {condition}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

fn lab() -> LabDescription {
    serde_json::from_str(include_str!("../../examples/lab/reference.json")).unwrap()
}

fn experiment() -> Experiment {
    let mut experiment: Experiment =
        serde_json::from_str(include_str!("../../examples/experiments/swap-corners.json")).unwrap();
    // One robot suffices here.
    experiment.robots.truncate(1);
    experiment.targets.truncate(1);
    experiment
}

/// Takes the twin longer than a test waits: up and down for ten minutes.
fn endless_experiment() -> Experiment {
    let mut experiment: Experiment =
        serde_json::from_str(include_str!("../../examples/experiments/rectangle-omni4.json")).unwrap();
    experiment.duration_s = 600.0;
    experiment.targets = experiment.targets[..2].iter().cycle().take(800).cloned().collect();
    experiment
}

/// What the submitter's own twin says.
fn own_digest(experiment: &Experiment) -> DigestClaim {
    let robots: Vec<_> = experiment
        .robots
        .iter()
        .map(|robot| {
            lab()
                .robots
                .into_iter()
                .find(|of_lab| of_lab.description.name == robot.name)
                .unwrap()
        })
        .collect();
    let scenario = serde_json::json!({"experiment": experiment, "robots": robots, "arena": lab().arena}).to_string();
    let outcome = control::rehearsal::rehearse_json(&scenario).unwrap();
    DigestClaim {
        digest: outcome.verdict.digest,
        twin_version: twin::VERSION.to_owned(),
        engine: "client".to_owned(),
    }
}

const REHEARSED: [RunState; 3] = [RunState::Queued, RunState::Rejected, RunState::Failed];

#[tokio::test(flavor = "multi_thread")]
async fn an_experiment_is_rehearsed_and_queued_with_the_submitters_digest() {
    let world = World::with_lab().await;
    let scheduler = world.start();
    let claim = own_digest(&experiment());
    let run_id = world.submit(experiment(), Some(claim.clone())).await;
    let run = world.until(run_id, &REHEARSED).await;
    assert_eq!(run.state, RunState::Queued, "{:?}", run.fault);
    assert_eq!(
        (run.digest.equal, run.digest.server.as_ref()),
        (Some(true), Some(&claim.digest))
    );
    assert!(run.verdict.unwrap().accepted);
    let record = world.store.run_file_get(run_id, "replay.json").await.unwrap().unwrap();
    assert_eq!(record.object_path, format!("runs/{run_id}/0/replay.json"));
    let bytes = std::fs::read(world.data.join("objects").join(&record.object_path)).unwrap();
    let sha256: String = Sha256::digest(&bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    assert_eq!((record.bytes, record.sha256), (bytes.len() as i64, sha256));
    let replay: api::verdict::Replay = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(replay.robots[0].name, "omni-01");
    assert!(replay.robots[0].poses.len() > 10);
    let folder = world.data.join("objects").join(format!("runs/{run_id}/0"));
    assert_eq!(
        std::fs::read_dir(folder).unwrap().count(),
        1,
        "nothing half-written is left"
    );
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn another_digest_is_rejected_and_stays_visible() {
    let world = World::with_lab().await;
    let scheduler = world.start();
    let right = own_digest(&experiment());
    let wrong = DigestClaim {
        digest: "f".repeat(32),
        twin_version: "twin-0.0.1/9".to_owned(),
        engine: "browser".to_owned(),
    };
    let run_id = world.submit(experiment(), Some(wrong.clone())).await;
    let run = world.until(run_id, &REHEARSED).await;
    let fault = run.fault.unwrap();
    assert_eq!(
        (run.state, fault.whose, fault.code.as_str()),
        (RunState::Rejected, Whose::Platform, "digest_mismatch")
    );
    for part in [&wrong.digest, &wrong.twin_version, &right.digest, &right.twin_version] {
        assert!(
            fault.message.contains(part.as_str()),
            "{part} is missing in: {}",
            fault.message
        );
    }
    assert_eq!(
        (run.digest.equal, run.digest.claimed),
        (Some(false), Some(wrong.digest))
    );
    assert!(run.verdict.is_some() && run.files.iter().any(|file| file.name == "replay.json"));
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_twin_cannot_start_is_the_users_fault() {
    let world = World::with_lab().await;
    let scheduler = world.start();
    let mut outside = experiment();
    outside.robots[0].start.x_m = 9.0;
    let mut unknown = experiment();
    unknown.robots[0].name = "omni-99".to_owned();
    for (experiment, code, word) in [
        (outside, "invalid_experiment", "start"),
        (unknown, "unknown_robot", "omni-99"),
    ] {
        let run = world.until(world.submit(experiment, None).await, &REHEARSED).await;
        let fault = run.fault.unwrap();
        assert_eq!(
            (run.state, fault.whose, fault.code.as_str()),
            (RunState::Rejected, Whose::User, code)
        );
        assert!(fault.message.contains(word), "{}", fault.message);
    }
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_waits_for_a_laboratory_that_is_just_starting() {
    let world = World::new(TestDatabase::new().await).await;
    let scheduler = world.start();
    let run_id = world.submit(experiment(), None).await;
    world
        .until_sql("EXISTS (SELECT FROM jobs WHERE error LIKE 'No laboratory%')")
        .await;
    assert_eq!(
        world.store.run_get(run_id).await.unwrap().unwrap().state,
        RunState::Validating
    );
    world.store.lab_register(&lab()).await.unwrap();
    assert_eq!(world.until(run_id, &REHEARSED).await.state, RunState::Queued);
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_job_of_a_lost_worker_is_done_by_another() {
    let world = World::with_lab().await;
    let run_id = world.submit(experiment(), None).await;
    let lost = world
        .store
        .job_claim("rehearse", Uuid::now_v7(), Duration::from_millis(50))
        .await
        .unwrap()
        .unwrap();
    let scheduler = world.start();
    assert_eq!(world.until(run_id, &REHEARSED).await.state, RunState::Queued);
    assert_eq!(world.store.job_complete(&lost).await.unwrap(), JobWrite::Stale);
    assert_eq!(world.database.scalar::<i32>("SELECT attempt FROM jobs").await, 2);
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_laboratory_is_reaped_within_two_sweeps() {
    let world = World::with_lab().await;
    let scheduler = world.start();
    let run_id = world.submit(experiment(), None).await;
    world.until(run_id, &[RunState::Queued]).await;
    let claim = Claim {
        lab: "reference-lab".to_owned(),
        arena: "reference".to_owned(),
        instance: Uuid::now_v7(),
        side: Side::Physical,
    };
    let lease = Duration::from_secs(2);
    let claimed = world.store.run_claim(&claim, lease).await.unwrap().unwrap();
    let report = StateReport {
        epoch: claimed.epoch,
        instance: claim.instance,
        state: RunState::Running,
        fault: None,
        ticks_recorded: None,
        ticks_missed: None,
    };
    assert_eq!(
        world.store.run_state_report(run_id, &report).await.unwrap(),
        Reported::Ok
    );
    let run = world.until(run_id, &[RunState::Interrupted]).await;
    assert_eq!(run.fault.unwrap().code, "lease_lost");
    let late_s: f64 = world
        .database
        .scalar("SELECT extract(epoch FROM r.ended_at - r.claimed_at)::float8 - 2.0 FROM runs r")
        .await;
    println!("reaped {late_s:.2} s after the lease ran out (bound: sweep period 1 s, 10 s under load)");
    assert!((0.0..10.0).contains(&late_s), "{late_s} s");
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn told_to_stop_it_ends_at_once_and_the_job_is_free() {
    let world = World::with_lab().await;
    let run_id = world.submit(endless_experiment(), None).await;
    for round in 1..=4 {
        let mut program = world.spawn();
        world
            .until_sql("EXISTS (SELECT FROM jobs WHERE state = 'leased')")
            .await;
        let begun = Instant::now();
        assert!(
            Command::new("kill")
                .arg("-TERM")
                .arg(program.id().to_string())
                .status()
                .unwrap()
                .success()
        );
        let status = tokio::task::spawn_blocking(move || program.wait())
            .await
            .unwrap()
            .unwrap();
        println!("round {round}: ended {} ms after SIGTERM", begun.elapsed().as_millis());
        assert!(status.success(), "{status}");
        assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
        assert!(
            world
                .database
                .scalar::<bool>("SELECT state = 'ready' AND attempt - released = 0 FROM jobs")
                .await
        );
    }
    assert_eq!(
        world.store.run_get(run_id).await.unwrap().unwrap().state,
        RunState::Validating
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_program_loses_no_job() {
    let world = World::with_lab().await;
    let run_id = world.submit(experiment(), None).await;
    let mut program = world.spawn();
    world.until_sql("EXISTS (SELECT FROM jobs WHERE attempt >= 1)").await;
    program.kill().unwrap();
    program.wait().unwrap();
    // Instead of waiting for the lease.
    world
        .database
        .execute("UPDATE jobs SET leased_until = clock_timestamp() WHERE state = 'leased'")
        .await;
    let scheduler = world.start();
    assert_eq!(world.until(run_id, &REHEARSED).await.state, RunState::Queued);
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_database_may_go_away_and_come_back() {
    let mut world = World::new(TestDatabase::private().await).await;
    world.store.lab_register(&lab()).await.unwrap();
    let scheduler = world.start();
    world
        .until(world.submit(experiment(), None).await, &[RunState::Queued])
        .await;
    for cycle in 1..=3 {
        let cluster = world.database.cluster.as_mut().unwrap();
        cluster.kill();
        // Long enough for every loop to meet the outage.
        tokio::time::sleep(Duration::from_millis(1500)).await;
        assert!(
            !scheduler.task.is_finished(),
            "the scheduler ended because the database was away"
        );
        world.database.cluster.as_mut().unwrap().resume();
        world.database.cluster.as_ref().unwrap().wait_until_ready().await;
        let back = Instant::now();
        let run_id = world.submit(experiment(), None).await;
        assert_eq!(world.until(run_id, &REHEARSED).await.state, RunState::Queued);
        println!(
            "cycle {cycle}: rehearsed {} ms after the database was back",
            back.elapsed().as_millis()
        );
        assert!(back.elapsed() < Duration::from_secs(15));
    }
    scheduler.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn it_starts_before_the_database_and_stops_without_it() {
    let mut world = World::new(TestDatabase::private().await).await;
    world.store.lab_register(&lab()).await.unwrap();
    world.database.cluster.as_mut().unwrap().kill();
    let scheduler = world.start();
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert!(!scheduler.task.is_finished());
    world.database.cluster.as_mut().unwrap().resume();
    world.database.cluster.as_ref().unwrap().wait_until_ready().await;
    let run_id = world.submit(experiment(), None).await;
    assert_eq!(world.until(run_id, &REHEARSED).await.state, RunState::Queued);
    world.database.cluster.as_mut().unwrap().kill();
    let begun = Instant::now();
    scheduler.stop().await;
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
}
