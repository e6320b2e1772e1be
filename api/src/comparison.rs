//! Two model versions on one stored run: which predicts it better.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Body of `POST /api/v1/models/compare`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparisonRequest {
    /// Robot whose records of the run are predicted.
    pub robot: String,
    /// A run of this robot that is done, on any floor.
    pub run: Uuid,
    /// Version or id of a model of a robot of this kind, or `nominal`.
    pub first: String,
    pub second: String,
}

/// One of the two.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparedModel {
    /// Its version, or `nominal`.
    pub version: String,
    /// Absent for the nominal twin.
    pub id: Option<Uuid>,
    /// Robot and floor that it was made for; for the nominal twin those of the run.
    pub robot: String,
    pub floor: String,
}

/// RMS error of both in one channel at one horizon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparisonRow {
    /// `pose`, `yaw`, `wheel`, `gyro`, `accel`, `current`, `bus` or `steering`.
    pub channel: String,
    pub horizon_s: f64,
    /// Of the errors: `m`, `rad`, `rad/s`, `m/s2`, `A` or `V`.
    pub unit: String,
    pub first: f64,
    pub second: f64,
    /// Predictions, or windows, that were compared.
    pub samples: u32,
}

/// Distance of both predictions, made 2 s before, from the measured position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparisonMoment {
    /// In the run's records.
    pub time_s: f64,
    pub first_m: f64,
    pub second_m: f64,
}

/// Which model is nearer to the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum NearerModel {
    First,
    Second,
    /// No difference beyond chance, or one of less than 2 %.
    Alike,
    /// The run is too short to tell.
    Unknown,
}

/// RMS position gap 2 s ahead of the second model over that of the first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparisonRatio {
    pub value: f64,
    /// 95 % interval, from blocks of 5 s drawn with replacement.
    pub low: f64,
    pub high: f64,
}

/// Two model versions on one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ComparisonView {
    pub robot: String,
    pub run: Uuid,
    /// Of the run.
    pub label: String,
    pub floor: String,
    pub first: ComparedModel,
    pub second: ComparedModel,
    pub nearer: NearerModel,
    /// The result in a sentence.
    pub sentence: String,
    /// Absent when the run is too short to tell.
    pub ratio: Option<ComparisonRatio>,
    /// Position first, then yaw, then on-board channels; horizons growing.
    pub rows: Vec<ComparisonRow>,
    /// In order of time, every half second.
    pub course: Vec<ComparisonMoment>,
}
