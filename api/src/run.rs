//! A run: one submission on its way through the laboratory.

use crate::experiment::Experiment;
use crate::verdict::Verdict;
use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use uuid::Uuid;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum RunState {
    Draft,
    Validating,
    Rejected,
    Queued,
    Preparing,
    Running,
    Uploading,
    Done,
    Failed,
    Cancelled,
    Interrupted,
}

impl RunState {
    /// True for states that are never left.
    pub const fn is_terminal(self) -> bool {
        matches!(
            self,
            Self::Rejected | Self::Done | Self::Failed | Self::Cancelled | Self::Interrupted
        )
    }

    /// Name on the wire and in SQL.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Validating => "validating",
            Self::Rejected => "rejected",
            Self::Queued => "queued",
            Self::Preparing => "preparing",
            Self::Running => "running",
            Self::Uploading => "uploading",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Why a run did not end as `done`, and whose fault that is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Fault {
    pub whose: Whose,
    /// Stable code, for example `robot_silent`, `lease_lost`, `lab_restarted`, `cancelled_by_user`.
    pub code: String,
    /// One sentence for a person.
    pub message: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Whose {
    User,
    Platform,
    Robot,
    Operator,
}

/// Whether the submitter's twin and the server's twin agree bit for bit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DigestComparison {
    pub claimed: Option<String>,
    pub claimed_twin_version: Option<String>,
    pub server: Option<String>,
    pub server_twin_version: Option<String>,
    /// `None` until both are known.
    pub equal: Option<bool>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunView {
    pub id: Uuid,
    pub experiment_id: Uuid,
    pub label: String,
    pub submitted_by: String,
    pub state: RunState,
    /// Attempt number used for fencing; 0 before the first attempt.
    pub epoch: i64,
    /// Place in the queue, 1 = next; only while queued.
    pub queue_position: Option<i64>,
    pub expected_start: Option<DateTime<Utc>>,
    /// Why it is not running yet, in words.
    pub waiting_reason: Option<String>,
    pub created_at: DateTime<Utc>,
    pub queued_at: Option<DateTime<Utc>>,
    pub started_at: Option<DateTime<Utc>>,
    pub ended_at: Option<DateTime<Utc>>,
    pub fault: Option<Fault>,
    pub digest: DigestComparison,
    pub verdict: Option<Verdict>,
    pub experiment: Experiment,
    /// By robot: the model version that the experiment was rehearsed with, its twin drove with and that corrected its commands
    /// where the experiment asks for it; robots that are missing have the nominal one.
    #[serde(default)]
    pub models: BTreeMap<String, String>,
    pub files: Vec<FileView>,
    /// Control ticks recorded and missed, once the laboratory reported them.
    pub ticks_recorded: Option<i64>,
    pub ticks_missed: Option<i64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunList {
    pub runs: Vec<RunView>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FileView {
    /// Path inside the archive, for example `robots/omni-01/telemetry.parquet`.
    pub name: String,
    pub bytes: i64,
    /// Lower-case hexadecimal SHA-256.
    pub sha256: String,
    pub media_type: String,
}
