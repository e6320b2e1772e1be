//! `/experiments`.

use super::body::JsonBody;
use super::params::{Id, QueryOf, bad_parameter};
use super::problem::ApiError;
use super::runs::Page;
use crate::access::Principal;
use crate::app::experiments::{self, Accepted, Submission};
use crate::state::AppState;
use api::experiment::{ExperimentView, SubmitRequest};
use api::problem::Problem;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::{Extension, Json};
use sha2::{Digest as _, Sha256};

const KEY_LIMIT_CHARACTERS: usize = 200;

/// Submit an experiment. It is checked at once, validated in the twin, then queued.
#[utoipa::path(post, path = "/api/v1/experiments", tag = "experiments", request_body = SubmitRequest,
    params(("Idempotency-Key" = Option<String>, Header, description = "The same key and body within 24 h give the same answer and no second run")),
    responses((status = 201, body = ExperimentView), (status = 200, body = ExperimentView, description = "The same submission came before"),
        (status = 400, body = Problem, content_type = "application/problem+json"), (status = 413, body = Problem, content_type = "application/problem+json"),
        (status = 415, body = Problem, content_type = "application/problem+json"), (status = 422, body = Problem, content_type = "application/problem+json")))]
pub async fn submit(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    headers: HeaderMap,
    body: JsonBody<SubmitRequest>,
) -> Result<Response, ApiError> {
    let submission = Submission {
        request: body.value,
        idempotency_key: idempotency_key(&headers)?,
        request_hash: Sha256::digest(&body.bytes).into(),
    };
    let (status, view) = match experiments::submit(state.store(), &principal, submission).await? {
        Accepted::Created(view) => (StatusCode::CREATED, view),
        Accepted::Before(view) => (StatusCode::OK, view),
    };
    let location = AppendHeaders([(header::LOCATION, format!("/api/v1/experiments/{}", view.id))]);
    Ok((status, location, Json(view)).into_response())
}

/// Submitted experiments, newest first.
#[utoipa::path(get, path = "/api/v1/experiments", tag = "experiments", params(Page),
    responses((status = 200, body = Vec<ExperimentView>), (status = 400, body = Problem, content_type = "application/problem+json")))]
pub async fn list(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    QueryOf(page): QueryOf<Page>,
) -> Result<Json<Vec<ExperimentView>>, ApiError> {
    Ok(Json(experiments::list(state.store(), &principal, page.limit()?).await?))
}

/// One experiment.
#[utoipa::path(get, path = "/api/v1/experiments/{id}", tag = "experiments", params(("id" = Uuid, Path)),
    responses((status = 200, body = ExperimentView), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn show(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<ExperimentView>, ApiError> {
    Ok(Json(experiments::get(state.store(), &principal, id).await?))
}

pub(super) fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(value) = headers.get("idempotency-key") else {
        return Ok(None);
    };
    match value.to_str() {
        Ok(key) if !key.is_empty() && key.len() <= KEY_LIMIT_CHARACTERS => Ok(Some(key.to_owned())),
        _ => Err(bad_parameter(
            "idempotency-key",
            "the key cannot be used",
            "1 to 200 visible ASCII characters",
        )),
    }
}
