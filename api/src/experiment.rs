//! The experiment document, `robopheus.experiment/1`. Unknown fields are refused.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

pub const FORMAT: &str = "robopheus.experiment/1";

/// What a person submits. Immutable once submitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Experiment {
    /// Always `robopheus.experiment/1`.
    pub format: String,
    pub mode: Mode,
    pub arena: String,
    pub floor: String,
    pub robots: Vec<ExperimentRobot>,
    pub control: Control,
    /// Waypoints (one robot, in order) or goals (by robot name).
    pub targets: Vec<Target>,
    pub duration_s: f64,
    pub seed: u64,
    /// Model version to validate against; nominal twin when absent.
    pub model: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Mode {
    Physical,
    Virtual,
    Interactive,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ExperimentRobot {
    /// Name of a robot of the laboratory, for example `omni-01`.
    pub name: String,
    /// `omni4`, `diff2`, `diff4`, `fwd`, `rwd` or `awd`.
    pub chassis: String,
    /// On-board controller: `mega2560`, `sam3x` or `tx2`.
    pub controller: String,
    pub start: Pose,
}

/// Pose in the world frame; yaw counter-clockwise positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Pose {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Control {
    /// `waypoints` (the paper's eq. 1) or `go_to_point`.
    pub law: String,
    /// Parameters of the law; see the user guide for names, units and ranges.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub parameters: serde_json::Value,
    /// Correction of the commands by the robots' models, in the mode `interactive`; off when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interaction: Option<Interaction>,
    /// Feedback alone: the law sees robots where they were measured, without delay compensation, and nothing is learnt of them
    /// during the run. For comparisons; cannot stand beside `interaction`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub feedback_alone: bool,
}

/// Correction of the commands by the robots' models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Interaction {
    /// How far ahead the models look, s: 0.1 to 0.5.
    pub horizon_s: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Target {
    /// Which robot; the only one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    pub x_m: f64,
    pub y_m: f64,
    /// Desired yaw on arrival; free when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_rad: Option<f64>,
}

/// Body of `POST /api/v1/experiments`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SubmitRequest {
    pub experiment: Experiment,
    /// What the submitter's own twin computed; compared with the server's, bit for bit.
    #[serde(default)]
    pub claim: Option<DigestClaim>,
    /// Free text shown in lists.
    #[serde(default)]
    pub label: Option<String>,
}

/// Trace digest computed by the submitter (browser or command line).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DigestClaim {
    /// Lower-case hexadecimal trace digest.
    pub digest: String,
    /// Version of the twin that computed it.
    pub twin_version: String,
    /// `browser` or `client`.
    pub engine: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ExperimentView {
    pub id: Uuid,
    pub label: String,
    pub submitted_by: String,
    pub submitted_at: chrono::DateTime<chrono::Utc>,
    pub experiment: Experiment,
    /// The run that belongs to this submission.
    pub run_id: Uuid,
}
