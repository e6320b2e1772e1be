//! Diagnoses: finding out why runs and twin disagree, as a job of the service.

use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Name that stands for the nominal twin where a model is named.
pub const NOMINAL: &str = "nominal";
/// Fewest runs that a diagnosis has to explain.
pub const CHANGED_RUNS_LEAST: usize = 2;
/// Most runs of a role in one diagnosis.
pub const RUNS_MOST: usize = 24;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum DiagnosisState {
    Queued,
    Running,
    Done,
    Failed,
    Cancelled,
}

impl DiagnosisState {
    pub const ALL: [Self; 5] = [Self::Queued, Self::Running, Self::Done, Self::Failed, Self::Cancelled];

    /// True for states that are never left.
    pub const fn is_terminal(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }

    /// Name on the wire and in SQL.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Who wanted a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum DiagnosisOrigin {
    Person,
    /// A run's gap was above that of the references.
    Gap,
    /// The run that an earlier diagnosis proposed is done.
    FollowUp,
}

impl DiagnosisOrigin {
    pub const ALL: [Self; 3] = [Self::Person, Self::Gap, Self::FollowUp];

    /// Name on the wire and in SQL.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Person => "person",
            Self::Gap => "gap",
            Self::FollowUp => "follow_up",
        }
    }
}

/// Body of `POST /api/v1/diagnoses`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DiagnosisRequest {
    /// Name of the robot whose bundles are compared.
    pub robot: String,
    /// Runs in which nothing was changed: they calibrate the twin and show what noise does. May be empty.
    #[serde(default)]
    pub reference_runs: Vec<Uuid>,
    /// Runs whose disagreement is to be explained; at least 2.
    pub changed_runs: Vec<Uuid>,
    /// Runs that are opened once, for the figures of the end; when empty some of the changed runs are held back.
    #[serde(default)]
    pub locked_runs: Vec<Uuid>,
    /// Version or id of the model that should explain the runs, or `nominal`; the robot's current model when absent.
    #[serde(default)]
    pub model: Option<String>,
}

/// Why a diagnosis ended without a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DiagnosisProblem {
    /// Stable: `cancelled_by_user`, `run_unreadable`, `not_diagnosable`, `worker_lost`, `diagnosis_failed`, `diagnosis_timeout`.
    pub code: String,
    /// One sentence for a person.
    pub message: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DiagnosisView {
    pub id: Uuid,
    pub robot: String,
    pub arena: String,
    pub floor: String,
    pub requested_by: String,
    pub origin: DiagnosisOrigin,
    /// The diagnosis whose proposed run this one takes in.
    pub follows: Option<Uuid>,
    pub reference_runs: Vec<Uuid>,
    pub changed_runs: Vec<Uuid>,
    pub locked_runs: Vec<Uuid>,
    /// Version of the model that should explain the runs; the nominal twin when absent.
    pub parent_model: Option<String>,
    pub state: DiagnosisState,
    pub cancel_requested: bool,
    /// Share of the work that is behind, 0 to 1.
    pub progress: f64,
    /// What is being done, in a word or two.
    pub stage: String,
    /// `confirmed`, `partial`, `ambiguous`, `unexplained` or `no_discrepancy`; once done.
    pub verdict: Option<String>,
    pub sentence: Option<String>,
    /// Version of the model that came out.
    pub model: Option<String>,
    /// The robot's twin uses this model now.
    pub model_is_current: bool,
    pub problem: Option<DiagnosisProblem>,
    /// Why the report proposes another run; absent when it proposes none.
    pub next_why: Option<String>,
    /// The run of the proposed experiment, once it was submitted.
    pub next_run: Option<Uuid>,
    /// The diagnosis that takes this run in.
    pub follow_up: Option<Uuid>,
    pub created_at: DateTime<Utc>,
    pub started_at: Option<DateTime<Utc>>,
    pub ended_at: Option<DateTime<Utc>>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DiagnosisList {
    /// Newest first.
    pub diagnoses: Vec<DiagnosisView>,
}
