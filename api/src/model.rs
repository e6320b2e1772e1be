//! Model versions of robots: which there are, which one a robot's twin uses, and how far runs are from it.

use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// A published model version of a robot on a floor. It never changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelView {
    pub id: Uuid,
    /// For people: the robot's name and a number that grows, for example `omni-03/2`.
    pub version: String,
    pub robot: String,
    pub floor: String,
    /// Version that it was made from; the nominal twin when absent.
    #[serde(default)]
    pub parent: Option<String>,
    /// The diagnosis that made it.
    #[serde(default)]
    pub diagnosis: Option<Uuid>,
    /// The robot's twin uses it now.
    #[serde(default)]
    pub is_current: bool,
    pub created_at: DateTime<Utc>,
    /// Its effects with the units that the document leaves out, in the order in which they act.
    #[serde(default)]
    pub effects: Vec<ModelEffect>,
    /// Learned residual; absent where the version carries none.
    #[serde(default)]
    pub residual: Option<ModelResidual>,
    /// Position gap of the version that it was made from and its own, where they were measured when it was made.
    #[serde(default)]
    pub gap: Option<ModelGap>,
    /// `robopheus.model/1`.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub document: serde_json::Value,
}

/// An effect of a version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelEffect {
    /// As in the effect library, for example `floor_friction`.
    pub name: String,
    /// Position of the wheel, for effects of one wheel.
    pub index: Option<usize>,
    pub parameters: Vec<ModelParameter>,
}

/// A number of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelParameter {
    pub name: String,
    /// Absent: a limit that is not there.
    pub value: Option<f64>,
    /// `1` for ratios, empty where the library does not know the parameter.
    pub unit: String,
}

/// What a learned residual reads and says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelResidual {
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    /// Numbers that were learned.
    pub weights: usize,
}

/// RMS position gap before and after, on data that did not make the version.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelGap {
    pub horizon_s: f64,
    pub before_m: f64,
    pub after_m: f64,
}

/// Body of `PUT /api/v1/robots/{robot}/model`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelChoice {
    /// Version or id of a model of this robot, or `nominal`.
    pub model: String,
}

/// One line of the record of which model was used from when; the record only grows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelUse {
    /// The nominal twin when absent.
    pub model: Option<Uuid>,
    pub version: Option<String>,
    pub since: DateTime<Utc>,
    pub chosen_by: String,
    /// The diagnosis whose result was accepted.
    pub diagnosis: Option<Uuid>,
}

/// Which model a robot's twin uses on its floor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotModel {
    pub robot: String,
    pub floor: String,
    /// The nominal twin when absent.
    pub model: Option<Uuid>,
    pub version: Option<String>,
    /// Newest first.
    pub history: Vec<ModelUse>,
}

/// Body of `PUT /api/v1/robots/{robot}/references`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReferencesRequest {
    /// Runs in which nothing was changed; replaces the set, may be empty.
    pub runs: Vec<Uuid>,
}

/// Prediction gap of a run at one horizon: the twin driven by the recorded commands against the measured poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HorizonGap {
    pub horizon_s: f64,
    /// RMS.
    pub position_m: f64,
    /// RMS.
    pub yaw_rad: f64,
    /// Predictions that were compared.
    pub samples: u32,
}

/// A finished run of a robot and its gap to the robot's current model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunGap {
    pub run: Uuid,
    pub label: String,
    pub submitted_by: String,
    pub ended_at: Option<DateTime<Utc>>,
    pub is_reference: bool,
    /// Empty until it is computed, and when there is a problem.
    pub horizons: Vec<HorizonGap>,
    /// Why this run has no gap.
    pub problem: Option<String>,
}

/// Finished runs of a robot against its current model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotGaps {
    pub robot: String,
    pub floor: String,
    /// The nominal twin when absent.
    pub model: Option<Uuid>,
    pub version: Option<String>,
    /// Horizon that decides, in seconds.
    pub horizon_s: f64,
    /// RMS position gap of the references; absent with fewer than two that have one.
    pub floor_position_m: Option<f64>,
    /// A run above this asks for a diagnosis by itself.
    pub limit_position_m: Option<f64>,
    /// The newest runs are much further from the model than those before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// Newest first.
    pub runs: Vec<RunGap>,
}

/// A robot has moved away from its model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Drift {
    /// End of the first of the newest runs in a row that are that far off.
    pub since: Option<DateTime<Utc>>,
    /// Median gaps of the newest runs and of those before.
    pub newest_m: f64,
    pub before_m: f64,
    /// The one over the other; at least 2.
    pub factor: f64,
}
