//! What the store takes and what it answers, apart from the wire views of `api`.

use api::arena::Arena;
use api::diagnosis::{DiagnosisOrigin, DiagnosisState, DiagnosisView};
use api::experiment::{DigestClaim, Experiment, ExperimentView};
use api::lab::Side;
use api::model::HorizonGap;
use api::robot::LabRobot;
use api::run::{Fault, RunState};
use api::verdict::Verdict;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use uuid::Uuid;

/// What a token allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    User,
    Operator,
    Lab,
    Scheduler,
}

impl Role {
    /// Every role, in the order of the first-start token files.
    pub const ALL: [Self; 4] = [Self::User, Self::Operator, Self::Lab, Self::Scheduler];

    /// Name in SQL, files and on the wire.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::User => "user",
            Self::Operator => "operator",
            Self::Lab => "lab",
            Self::Scheduler => "scheduler",
        }
    }

    /// Role of a name; `None` when there is no such role.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.as_str() == name)
    }
}

/// Who a token belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Principal {
    pub user: String,
    pub role: Role,
}

/// A submission as the server received and checked it.
#[derive(Debug, Clone)]
pub struct NewSubmission {
    /// Name of the submitter; made when unknown.
    pub user: String,
    pub label: String,
    pub experiment: Experiment,
    pub claim: Option<DigestClaim>,
    /// `Idempotency-Key` of the submitter; unique per user for 24 h.
    pub idempotency_key: Option<String>,
    /// SHA-256 of the request body; a key used again with another body is a conflict.
    pub request_hash: [u8; 32],
}

/// Answer to a submission.
#[derive(Debug, Clone, PartialEq)]
pub enum Submitted {
    /// Stored now; its run is `validating`.
    Created(ExperimentView),
    /// The same request was stored before; this is that experiment.
    Replayed(ExperimentView),
    /// The key was used with another body in the last 24 h.
    Conflict,
}

/// Answer to a request to cancel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cancelled {
    /// The run ended as `cancelled` now.
    AtOnce,
    /// The laboratory has it and was asked to stop; asking again is harmless.
    Requested,
    /// The run had ended before.
    Ended(RunState),
    /// No such run.
    Unknown,
}

/// A laboratory asks for work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    pub lab: String,
    pub arena: String,
    /// One per process start; the lease belongs to it.
    pub instance: Uuid,
    pub side: Side,
}

/// What a laboratory needs to carry a run out.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimedRun {
    pub run_id: Uuid,
    pub epoch: i64,
    pub experiment: Experiment,
    pub arena: Arena,
    /// In the order of `experiment.robots`.
    pub robots: Vec<LabRobot>,
    /// Model versions that it was rehearsed with, by robot.
    pub models: BTreeMap<String, serde_json::Value>,
    pub verdict: serde_json::Value,
    pub lease_s: f64,
}

/// The lease under which a laboratory writes: compared in every statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fence {
    pub run_id: Uuid,
    pub epoch: i64,
    pub instance: Uuid,
}

/// Answer to a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beat {
    /// The lease holds for its full length again.
    Ok { cancel_requested: bool },
    /// The lease is gone or belongs to a newer attempt: stop the robots.
    Stale,
}

/// Answer to a laboratory that moves its run on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reported {
    /// Done, or done before by the same report.
    Ok,
    /// Not this attempt's run any more; nothing was written.
    Stale,
    /// The run's state does not allow this step; nothing was written.
    NotAllowed { from: RunState },
}

/// Answer to a laboratory that came back after a crash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Salvaged {
    /// The attempt is closed; the run is in this state now. Files of the attempt are still accepted.
    Ok { state: RunState },
    /// A newer attempt owns the run, or there was never such an attempt.
    Stale,
}

/// A file of a run. The bytes lie in the object folder before this row is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileRecord {
    /// Path inside the archive, for example `robots/omni-01/telemetry.parquet`.
    pub name: String,
    pub bytes: i64,
    /// Lower-case hexadecimal.
    pub sha256: String,
    pub media_type: String,
    /// Relative to the object folder.
    pub object_path: String,
}

/// Answer to a file put.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilePut {
    /// Recorded, or the very same file was recorded before.
    Ok,
    /// Not this attempt's run any more; nothing was written.
    Stale,
    /// The run is `done` and has another file under this name; nothing was written.
    Sealed,
}

/// A job of the scheduler, leased to one worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobLease {
    pub id: Uuid,
    /// For example `rehearse`.
    pub kind: String,
    pub run_id: Uuid,
    /// Fences every write of the worker; grows with every claim.
    pub attempt: i32,
    /// 1 for the first try; attempts that a worker gave back in good order do not count.
    pub tries: i32,
    pub worker: Uuid,
}

/// Answer to a worker's write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobWrite {
    Ok,
    /// The lease ran out, another attempt owns the job, or its run was cancelled; nothing was written.
    Stale,
}

/// What becomes of a job that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum JobFailure {
    /// Try again after this time.
    Retry { after: std::time::Duration },
    /// Give up: the run ends as `rejected` (fault of the user) or `failed` (any other).
    Final { fault: Fault },
}

/// What the scheduler's twin said about a run.
#[derive(Debug, Clone, PartialEq)]
pub struct VerdictRecord {
    pub verdict: Verdict,
    /// The run moves to `queued` when true, to `rejected` when false.
    pub accepted: bool,
    /// Required when not accepted.
    pub fault: Option<Fault>,
    /// `replay.json`, already durable in the object folder.
    pub replay: FileRecord,
}

/// Everything a rehearsal needs: the submitted texts, bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct RehearsalInput {
    pub run_id: Uuid,
    pub experiment: Experiment,
    /// `None` when no laboratory has registered the arena.
    pub arena: Option<Arena>,
    /// In the order of `experiment.robots`, without those that the arena does not have.
    pub robots: Vec<LabRobot>,
    /// Names that the arena does not have.
    pub robots_missing: Vec<String>,
    pub claim: Option<DigestClaim>,
    /// `robopheus.model/1` of the robots that are not nominal.
    pub models: BTreeMap<String, serde_json::Value>,
}

/// Limits of the reconciler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReapLimits {
    /// Attempts of a run before it fails.
    pub run_attempts: i32,
    /// Attempts of a job before it fails.
    pub job_attempts: i32,
    /// How long an arena stays held after a lease was lost, unless the laboratory registers again.
    pub arena_hold: std::time::Duration,
}

/// What the reconciler changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reaped {
    /// A lease ran out; the run is in this state now.
    Run { run_id: Uuid, epoch: i64, state: RunState },
    /// A worker's lease ran out; the job waits for another worker, or has failed for good.
    Job {
        job_id: Uuid,
        run_id: Uuid,
        attempt: i32,
        failed: bool,
    },
}

/// A diagnosis as the server received and checked it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewDiagnosis {
    /// Name of the person; made when unknown.
    pub user: String,
    pub robot: String,
    pub arena: String,
    pub floor: String,
    pub origin: DiagnosisOrigin,
    /// The nominal twin when absent.
    pub parent_model: Option<Uuid>,
    pub reference_runs: Vec<Uuid>,
    pub changed_runs: Vec<Uuid>,
    pub locked_runs: Vec<Uuid>,
    pub idempotency_key: Option<String>,
    /// SHA-256 of the request body.
    pub request_hash: [u8; 32],
}

/// Answer to a request for a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub enum DiagnosisSubmitted {
    Created(DiagnosisView),
    /// The same request was stored before; this is that diagnosis.
    Replayed(DiagnosisView),
    /// The key was used with another body in the last 24 h.
    Conflict,
    /// So many of this robot wait or run that no more is taken.
    TooMany {
        open: i64,
    },
}

/// Answer to a request to cancel a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiagnosisCancelled {
    AtOnce,
    /// The worker was asked to stop; asking again is harmless.
    Requested,
    Ended(DiagnosisState),
    Unknown,
}

/// A diagnosis, leased to one worker.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisLease {
    pub id: Uuid,
    /// Fences every write of the worker; grows with every claim.
    pub attempt: i32,
    /// 1 for the first try.
    pub tries: i32,
    pub worker: Uuid,
    pub robot: String,
    pub floor: String,
    /// Document of the model that should explain the runs; the nominal twin when absent.
    pub parent_model: Option<String>,
    /// By role, in the order in which they were named.
    pub runs: Vec<DiagnosisRun>,
}

/// A run of a diagnosis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DiagnosisRun {
    pub run: Uuid,
    /// `reference`, `changed` or `locked`.
    pub role: String,
}

/// Answer to a diagnosis' heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiagnosisBeat {
    Ok {
        cancel_requested: bool,
    },
    /// The lease is gone: stop, nothing will be written.
    Stale,
}

/// What a diagnosis found.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisRecord {
    pub verdict: String,
    pub sentence: String,
    pub next_why: Option<String>,
    /// `report.json`.
    pub report: String,
    /// `report.html`, already durable in the object folder.
    pub page: FileRecord,
    /// `robopheus.model/1`, with its id.
    pub model: serde_json::Value,
}

/// A finished run whose gap is not known yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GapWork {
    pub run: Uuid,
    pub robot: String,
    /// The nominal twin when absent.
    pub model: Option<Uuid>,
    pub document: Option<String>,
}

/// The gap of a run at its horizons, or why there is none.
pub type MeasuredGap = std::result::Result<Vec<HorizonGap>, String>;

/// Something changed; a hint only, the truth is in the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// This run changed its state or was asked to stop.
    Run(Uuid),
    /// There may be a new job.
    Jobs,
    /// The connection was lost for a while: read again whatever matters.
    Reconnected,
}
