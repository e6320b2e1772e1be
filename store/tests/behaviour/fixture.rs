//! A store on its own database, with the reference laboratory and ways to bring a run into each state.

use crate::support::TestDatabase;
use api::experiment::{Experiment, Mode};
use api::lab::{LabDescription, LabStatus, RobotStatus, SalvageReport, Side, StateReport};
use api::run::{Fault, RunState, Whose};
use api::verdict::Verdict;
use std::time::Duration;
use store::*;
use uuid::Uuid;

/// Long enough never to run out in a test.
pub const LONG: Duration = Duration::from_secs(60);
/// Runs out while a test waits for it.
pub const SHORT: Duration = Duration::from_millis(60);
pub const LIMITS: ReapLimits = ReapLimits {
    run_attempts: RUN_ATTEMPTS,
    job_attempts: 3,
    arena_hold: Duration::from_secs(60),
};

pub struct World {
    pub store: Store,
    pub database: TestDatabase,
    pub instance: Uuid,
}

pub async fn world() -> World {
    let database = TestDatabase::new().await;
    let options = StoreOptions {
        max_connections: 16,
        acquire_timeout: Duration::from_secs(30),
        ..StoreOptions::default()
    };
    let store = Store::connect(&database.url, options).await.unwrap();
    store.migrate().await.unwrap();
    World {
        store,
        database,
        instance: Uuid::now_v7(),
    }
}

/// With the reference laboratory registered and its robots online.
pub async fn world_with_lab() -> World {
    let world = world().await;
    world.store.lab_register(&lab()).await.unwrap();
    world.report_status(false).await;
    world
}

pub fn lab() -> LabDescription {
    serde_json::from_str(include_str!("../../../examples/lab/reference.json")).unwrap()
}

pub fn experiment() -> Experiment {
    serde_json::from_str(include_str!("../../../examples/experiments/swap-corners.json")).unwrap()
}

pub fn submission(user: &str) -> NewSubmission {
    NewSubmission {
        user: user.to_owned(),
        label: "swap".to_owned(),
        experiment: experiment(),
        claim: None,
        idempotency_key: None,
        request_hash: [7; 32],
    }
}

pub fn verdict() -> Verdict {
    Verdict {
        format: "robopheus.verdict/1".to_owned(),
        accepted: true,
        sentence: "Nothing stands in the way.".to_owned(),
        findings: Vec::new(),
        digest: "0123456789abcdef0123456789abcdef".to_owned(),
        twin_version: "twin-test/1".to_owned(),
        ticks: 3600,
        smallest_separation_m: Some(0.3),
        smallest_wall_distance_m: 0.4,
        largest_path_error_m: None,
    }
}

pub fn file(name: &str, byte: char) -> FileRecord {
    FileRecord {
        name: name.to_owned(),
        bytes: 3,
        sha256: byte.to_string().repeat(64),
        media_type: "application/json".to_owned(),
        object_path: format!("objects/{byte}/{name}"),
    }
}

pub fn fault(whose: Whose, code: &str) -> Fault {
    Fault {
        whose,
        code: code.to_owned(),
        message: "For a test.".to_owned(),
    }
}

/// What a laboratory says of an attempt that a crash cut off.
pub fn salvage(epoch: i64, fault: &Fault) -> SalvageReport {
    SalvageReport {
        epoch,
        fault: fault.clone(),
        ticks_recorded: Some(100),
        ticks_missed: Some(2),
    }
}

impl World {
    pub async fn report_status(&self, stopped: bool) {
        let lab = lab();
        let robots = lab
            .robots
            .iter()
            .map(|robot| RobotStatus {
                name: robot.description.name.clone(),
                online: true,
                bus_v: Some(24.0),
                health: None,
                link: None,
                stop_acknowledged: false,
                activity: None,
            })
            .collect();
        self.report_robots(stopped, robots).await;
    }

    pub async fn report_robots(&self, stopped: bool, robots: Vec<RobotStatus>) {
        let lab = lab();
        let status = LabStatus {
            lab: lab.name,
            arena: lab.arena.name,
            stopped,
            robots,
        };
        assert!(self.store.lab_status_put(&status).await.unwrap());
    }

    /// Submits; the run is `validating`.
    pub async fn submit(&self) -> Uuid {
        match self.store.experiment_submit(submission("ada")).await.unwrap() {
            Submitted::Created(view) => view.run_id,
            other => panic!("not stored: {other:?}"),
        }
    }

    pub async fn job(&self, lease: Duration) -> JobLease {
        self.store
            .job_claim("rehearse", Uuid::now_v7(), lease)
            .await
            .unwrap()
            .expect("a job is ready")
    }

    pub fn accepted(&self) -> VerdictRecord {
        VerdictRecord {
            verdict: verdict(),
            accepted: true,
            fault: None,
            replay: file("replay.json", 'a'),
        }
    }

    pub async fn queued(&self) -> Uuid {
        let run_id = self.submit().await;
        self.admitted(run_id).await
    }

    /// Like [`Self::queued`], for the twin.
    pub async fn queued_virtual(&self) -> Uuid {
        let mut wanted = submission("ada");
        wanted.experiment.mode = Mode::Virtual;
        let Submitted::Created(view) = self.store.experiment_submit(wanted).await.unwrap() else {
            panic!("not stored");
        };
        self.admitted(view.run_id).await
    }

    async fn admitted(&self, run_id: Uuid) -> Uuid {
        let job = self.job(LONG).await;
        assert_eq!(job.run_id, run_id);
        assert_eq!(
            self.store.run_verdict_set(&job, &self.accepted()).await.unwrap(),
            JobWrite::Ok
        );
        run_id
    }

    pub fn claim(&self) -> Claim {
        Claim {
            lab: "reference-lab".to_owned(),
            arena: "reference".to_owned(),
            instance: self.instance,
            side: Side::Physical,
        }
    }

    /// Claims the next run; it is `preparing`.
    pub async fn preparing(&self, lease: Duration) -> Fence {
        let claimed = self
            .store
            .run_claim(&self.claim(), lease)
            .await
            .unwrap()
            .expect("a run is queued and the arena is free");
        Fence {
            run_id: claimed.run_id,
            epoch: claimed.epoch,
            instance: self.instance,
        }
    }

    pub fn report(&self, fence: Fence, state: RunState) -> StateReport {
        StateReport {
            epoch: fence.epoch,
            instance: fence.instance,
            state,
            fault: None,
            ticks_recorded: None,
            ticks_missed: None,
        }
    }

    pub async fn reports(&self, fence: Fence, state: RunState) -> Reported {
        self.store
            .run_state_report(fence.run_id, &self.report(fence, state))
            .await
            .unwrap()
    }

    /// Submits, queues, claims and moves a run as far as `state`.
    pub async fn run_in(&self, state: RunState, lease: Duration) -> Fence {
        let nobody = Fence {
            run_id: Uuid::nil(),
            epoch: 0,
            instance: self.instance,
        };
        match state {
            RunState::Validating => {
                return Fence {
                    run_id: self.submit().await,
                    ..nobody
                };
            }
            RunState::Rejected => {
                let run_id = self.submit().await;
                let refused = VerdictRecord {
                    accepted: false,
                    fault: Some(fault(Whose::User, "rejected_by_twin")),
                    ..self.accepted()
                };
                assert_eq!(
                    self.store
                        .run_verdict_set(&self.job(LONG).await, &refused)
                        .await
                        .unwrap(),
                    JobWrite::Ok
                );
                return Fence { run_id, ..nobody };
            }
            RunState::Queued => {
                return Fence {
                    run_id: self.queued().await,
                    ..nobody
                };
            }
            _ => {}
        }
        self.queued().await;
        let path: &[RunState] = match state {
            RunState::Preparing => &[],
            RunState::Running => &[RunState::Running],
            RunState::Uploading => &[RunState::Running, RunState::Uploading],
            RunState::Done => &[RunState::Running, RunState::Uploading, RunState::Done],
            RunState::Failed => &[RunState::Failed],
            RunState::Cancelled => &[RunState::Running, RunState::Cancelled],
            _ => &[RunState::Running, RunState::Interrupted],
        };
        let fence = self.preparing(if path.is_empty() { lease } else { LONG }).await;
        for step in path {
            assert_eq!(self.reports(fence, *step).await, Reported::Ok, "{step:?}");
        }
        if !path.is_empty() && !state.is_terminal() {
            assert!(matches!(
                self.store.run_heartbeat(fence, lease).await.unwrap(),
                Beat::Ok { .. }
            ));
        }
        fence
    }

    pub async fn state(&self, run_id: Uuid) -> RunState {
        self.store.run_get(run_id).await.unwrap().unwrap().state
    }

    /// Sweeps until something ran out; the database's clock decides when.
    pub async fn reap_something(&self) -> Vec<Reaped> {
        let limit = tokio::time::Instant::now() + Duration::from_secs(20);
        loop {
            let reaped = self.store.reap(&LIMITS).await.unwrap();
            if !reaped.is_empty() {
                return reaped;
            }
            assert!(tokio::time::Instant::now() < limit, "nothing ran out");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    pub async fn free_arena(&self) {
        self.database.execute("UPDATE arenas SET held_until = NULL").await;
    }
}
