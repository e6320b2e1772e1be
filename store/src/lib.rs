//! All SQL of the service.
//!
//! One noun a file; every function is one short transaction. Rows are private, what comes out are the
//! views of `api` or the types of [`outcome`]. Expiry is decided by the database's `clock_timestamp()` only,
//! and every write of a laboratory or worker is fenced by its epoch or attempt.

mod error;
mod outcome;

pub use error::{Result, StoreError};
pub use outcome::*;

use api::arena::ArenaView;
use api::experiment::ExperimentView;
use api::lab::{LabDescription, LabStatus, StateReport};
use api::robot::RobotView;
use api::run::{Fault, RunView};
use std::time::Duration;
use uuid::Uuid;
#[derive(Debug, Clone)]
pub struct StoreOptions {
    pub application_name: String,
    pub max_connections: u32,
    pub acquire_timeout: Duration,
    pub statement_timeout: Duration,
}
impl Default for StoreOptions {
    fn default() -> Self {
        Self { application_name: "robopheus".into(), max_connections: 8, acquire_timeout: Duration::from_secs(5), statement_timeout: Duration::from_secs(5) }
    }
}
#[derive(Clone)]
pub struct Store {}
#[allow(unused_variables)]
impl Store {
    pub async fn connect(url: &str, options: StoreOptions) -> Result<Self> { todo!() }
    pub async fn migrate(&self) -> Result<()> { todo!() }
    pub async fn ping(&self) -> Result<()> { todo!() }
    pub async fn user_ensure(&self, name: &str) -> Result<()> { todo!() }
    pub async fn token_create(&self, role: Role, user: &str) -> Result<String> { todo!() }
    pub async fn token_lookup(&self, plain: &str) -> Result<Option<Principal>> { todo!() }
    pub async fn token_revoke(&self, plain: &str) -> Result<bool> { todo!() }
    pub async fn experiment_submit(&self, submission: NewSubmission) -> Result<Submitted> { todo!() }
    pub async fn experiment_get(&self, id: Uuid) -> Result<Option<ExperimentView>> { todo!() }
    pub async fn experiment_list(&self, limit: i64, user: Option<&str>) -> Result<Vec<ExperimentView>> { todo!() }
    pub async fn run_get(&self, id: Uuid) -> Result<Option<RunView>> { todo!() }
    pub async fn run_list(&self, limit: i64, user: Option<&str>) -> Result<Vec<RunView>> { todo!() }
    pub async fn run_cancel(&self, id: Uuid, by: &str) -> Result<Cancelled> { todo!() }
    pub async fn run_claim(&self, claim: &Claim, lease: Duration) -> Result<Option<ClaimedRun>> { todo!() }
    pub async fn run_heartbeat(&self, fence: Fence, lease: Duration) -> Result<Beat> { todo!() }
    pub async fn run_state_report(&self, run_id: Uuid, report: &StateReport) -> Result<Reported> { todo!() }
    pub async fn run_salvage(&self, run_id: Uuid, epoch: i64, fault: &Fault) -> Result<Salvaged> { todo!() }
    pub async fn run_file_put(&self, run_id: Uuid, epoch: i64, file: &FileRecord) -> Result<FilePut> { todo!() }
    pub async fn run_files(&self, run_id: Uuid) -> Result<Vec<FileRecord>> { todo!() }
    pub async fn run_file_get(&self, run_id: Uuid, name: &str) -> Result<Option<FileRecord>> { todo!() }
    pub async fn lab_register(&self, lab: &LabDescription) -> Result<()> { todo!() }
    pub async fn lab_status_put(&self, status: &LabStatus) -> Result<bool> { todo!() }
    pub async fn robot_list(&self) -> Result<Vec<RobotView>> { todo!() }
    pub async fn arena_list(&self) -> Result<Vec<ArenaView>> { todo!() }
    pub async fn model_list(&self) -> Result<Vec<Model>> { todo!() }
    pub async fn job_claim(&self, kind: &str, worker: Uuid, lease: Duration) -> Result<Option<JobLease>> { todo!() }
    pub async fn job_heartbeat(&self, job: &JobLease, lease: Duration) -> Result<JobWrite> { todo!() }
    pub async fn job_complete(&self, job: &JobLease) -> Result<JobWrite> { todo!() }
    pub async fn job_fail(&self, job: &JobLease, error: &str, then: &JobFailure) -> Result<JobWrite> { todo!() }
    pub async fn rehearsal_input(&self, run_id: Uuid) -> Result<Option<RehearsalInput>> { todo!() }
    pub async fn run_verdict_set(&self, job: &JobLease, record: &VerdictRecord) -> Result<JobWrite> { todo!() }
    pub async fn reap(&self, limits: &ReapLimits) -> Result<Vec<Reaped>> { todo!() }
    pub fn listen(&self) -> tokio::sync::broadcast::Receiver<Change> { todo!() }
    pub async fn close(&self) { todo!() }
}
