//! What a laboratory and the service say to each other. The laboratory dials out only.

use crate::arena::Arena;
use crate::experiment::Experiment;
use crate::health::{LinkQuality, RobotActivity, RobotHealth};
use crate::robot::LabRobot;
use crate::run::{Fault, RunState};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use uuid::Uuid;

/// The laboratory's own file, `robopheus.lab/1`, and the body of `POST /api/v1/lab/register`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LabDescription {
    /// Always `robopheus.lab/1`.
    pub format: String,
    pub name: String,
    pub arena: Arena,
    pub robots: Vec<LabRobot>,
    /// Page of the protective stop as browsers reach it, for example `https://stop.lab.example/`; the dashboard's button
    /// calls it. Absent: the address that the laboratory's process listens on, where that is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_url: Option<String>,
}

/// Body of `POST /api/v1/lab/claim` (long poll).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ClaimRequest {
    pub lab: String,
    pub arena: String,
    /// One per process start; the lease belongs to it.
    pub instance: Uuid,
    /// How long the service may hold the request, at most 30.
    pub wait_s: f64,
    /// Which runs are asked for.
    #[serde(default)]
    pub side: Side,
}

/// What carries runs out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Side {
    /// Robots, for the modes `physical` and `interactive`.
    #[default]
    Physical,
    /// The twin, for the mode `virtual`.
    Virtual,
}

impl Side {
    /// Name in the database and on the wire.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Physical => "physical",
            Self::Virtual => "virtual",
        }
    }
}

/// Answer to a claim; `204 No Content` when nothing is to do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Assignment {
    pub run_id: Uuid,
    pub epoch: i64,
    pub experiment: Experiment,
    pub arena: Arena,
    /// In the order of `experiment.robots`.
    pub robots: Vec<LabRobot>,
    /// Model versions (`robopheus.model/1`) that the experiment was rehearsed with, by robot; the nominal twin without.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub models: BTreeMap<String, serde_json::Value>,
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub verdict: serde_json::Value,
    /// The lease holds for this long from the moment the request was sent.
    pub lease_s: f64,
}

/// Body of `POST /api/v1/lab/runs/{id}/heartbeat`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Heartbeat {
    pub epoch: i64,
    pub instance: Uuid,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HeartbeatReply {
    pub lease_s: f64,
    /// Someone wants this run to stop.
    pub cancel_requested: bool,
}

/// Body of `POST /api/v1/lab/runs/{id}/state`: the laboratory moves its run on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StateReport {
    pub epoch: i64,
    pub instance: Uuid,
    /// `running`, `uploading`, `done`, `failed`, `cancelled` or `interrupted`.
    pub state: RunState,
    #[serde(default)]
    pub fault: Option<Fault>,
    #[serde(default)]
    pub ticks_recorded: Option<i64>,
    #[serde(default)]
    pub ticks_missed: Option<i64>,
}

/// A laboratory that came back after a crash closes the attempt it found in its journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SalvageReport {
    pub epoch: i64,
    pub fault: Fault,
    /// What the journal holds; absent when it was cut off before the motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks_recorded: Option<i64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks_missed: Option<i64>,
}

/// Body of `POST /api/v1/lab/runs/{id}/models`: a version that was learned in a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LearnedModel {
    pub robot: String,
    /// `robopheus.model/1`; its parent is a version of this robot and floor, or null.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub document: serde_json::Value,
}

/// Body of `POST /api/v1/lab/status`: robots' health, about once a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LabStatus {
    pub lab: String,
    pub arena: String,
    /// Protective stop pressed and not cleared.
    pub stopped: bool,
    pub robots: Vec<RobotStatus>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotStatus {
    pub name: String,
    pub online: bool,
    pub bus_v: Option<f64>,
    /// Absent from robots that do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub health: Option<RobotHealth>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkQuality>,
    /// The robot says that it obeys a stop.
    #[serde(default)]
    pub stop_acknowledged: bool,
    /// Absent in a run, and where there are no docks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activity: Option<RobotActivity>,
}
