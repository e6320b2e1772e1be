//! `/lab/...`: what a laboratory calls.

use super::body::JsonBody;
use super::params::Id;
use super::problem::ApiError;
use crate::app::{lab, models};
use crate::state::AppState;
use api::lab::{
    Assignment, ClaimRequest, Heartbeat, HeartbeatReply, LabDescription, LabStatus, LearnedModel, SalvageReport,
    StateReport,
};
use api::model::ModelView;
use api::problem::Problem;
use api::run::RunView;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse as _, Response};

/// A laboratory introduces itself: arena and robots.
#[utoipa::path(post, path = "/api/v1/lab/register", tag = "lab", request_body = LabDescription,
    responses((status = 204, description = "Registered"), (status = 422, body = Problem, content_type = "application/problem+json")))]
pub async fn register(State(state): State<AppState>, body: JsonBody<LabDescription>) -> Result<StatusCode, ApiError> {
    lab::register(&state, &body.value).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The next run for the laboratory; waits for one up to `wait_s`.
#[utoipa::path(post, path = "/api/v1/lab/claim", tag = "lab", request_body = ClaimRequest,
    responses((status = 200, body = Assignment), (status = 204, description = "Nothing to do"), (status = 422, body = Problem, content_type = "application/problem+json")))]
pub async fn claim(State(state): State<AppState>, body: JsonBody<ClaimRequest>) -> Result<Response, ApiError> {
    Ok(match lab::claim(&state, &body.value).await? {
        Some(assignment) => Json(assignment).into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    })
}

/// Health of robots, about once a second.
#[utoipa::path(post, path = "/api/v1/lab/status", tag = "lab", request_body = LabStatus,
    responses((status = 204, description = "Noted"), (status = 404, body = Problem, content_type = "application/problem+json", description = "Register first")))]
pub async fn status(State(state): State<AppState>, body: JsonBody<LabStatus>) -> Result<StatusCode, ApiError> {
    lab::status(&state, &body.value).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Keeps the lease of an attempt.
#[utoipa::path(post, path = "/api/v1/lab/runs/{id}/heartbeat", tag = "lab", params(("id" = Uuid, Path)), request_body = Heartbeat,
    responses((status = 200, body = HeartbeatReply), (status = 409, body = Problem, content_type = "application/problem+json", description = "`stale_epoch`: stop the robots")))]
pub async fn heartbeat(
    State(state): State<AppState>,
    Id(id): Id,
    body: JsonBody<Heartbeat>,
) -> Result<Json<HeartbeatReply>, ApiError> {
    Ok(Json(lab::heartbeat(&state, id, &body.value).await?))
}

/// Moves a run on.
#[utoipa::path(post, path = "/api/v1/lab/runs/{id}/state", tag = "lab", params(("id" = Uuid, Path)), request_body = StateReport,
    responses((status = 200, body = RunView), (status = 409, body = Problem, content_type = "application/problem+json", description = "`stale_epoch` or `transition_refused`")))]
pub async fn state(
    State(state): State<AppState>,
    Id(id): Id,
    body: JsonBody<StateReport>,
) -> Result<Json<RunView>, ApiError> {
    Ok(Json(lab::report(&state, id, &body.value).await?))
}

/// Closes an attempt that a crashed laboratory left behind; its files are still accepted.
#[utoipa::path(post, path = "/api/v1/lab/runs/{id}/salvage", tag = "lab", params(("id" = Uuid, Path)), request_body = SalvageReport,
    responses((status = 200, body = RunView), (status = 409, body = Problem, content_type = "application/problem+json", description = "`stale_epoch`")))]
pub async fn salvage(
    State(state): State<AppState>,
    Id(id): Id,
    body: JsonBody<SalvageReport>,
) -> Result<Json<RunView>, ApiError> {
    Ok(Json(lab::salvage(&state, id, &body.value).await?))
}

/// Stores a version that was learned in a run of this robot. It is not used until an operator chooses it.
#[utoipa::path(post, path = "/api/v1/lab/runs/{id}/models", tag = "lab", params(("id" = Uuid, Path)), request_body = LearnedModel,
    responses((status = 200, body = ModelView), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_model`")))]
pub async fn learned(
    State(state): State<AppState>,
    Id(id): Id,
    body: JsonBody<LearnedModel>,
) -> Result<Json<ModelView>, ApiError> {
    Ok(Json(models::learned(state.store(), id, &body.value).await?))
}
