//! `/diagnoses`.

use super::body::JsonBody;
use super::experiments::idempotency_key;
use super::file_reply::FileReply;
use super::params::{Id, QueryOf, bad_parameter};
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::diagnoses::{self, Asked, Taken};
use crate::app::error::AppError;
use crate::objects;
use crate::state::AppState;
use api::diagnosis::{DiagnosisList, DiagnosisRequest, DiagnosisView};
use api::problem::Problem;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;
use sha2::{Digest as _, Sha256};
use utoipa::IntoParams;

const LIMIT_MOST: i64 = 500;

/// Which diagnoses are wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Wanted {
    /// Only of this robot.
    robot: Option<String>,
    /// At most so many entries, 1 to 500; 100 when left out.
    limit: Option<i64>,
}

/// Ask why runs and twin disagree. The answer takes half a minute to some minutes; poll the diagnosis.
#[utoipa::path(post, path = "/api/v1/diagnoses", tag = "diagnoses", request_body = DiagnosisRequest,
    params(("Idempotency-Key" = Option<String>, Header, description = "The same key and body within 24 h give the same answer and no second diagnosis")),
    responses((status = 201, body = DiagnosisView), (status = 200, body = DiagnosisView, description = "The same request came before"),
        (status = 400, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`too_many_diagnoses`"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_diagnosis`, `invalid_model`, `idempotency_conflict`")))]
pub async fn submit(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    headers: HeaderMap,
    body: JsonBody<DiagnosisRequest>,
) -> Result<Response, ApiError> {
    let asked = Asked {
        request: body.value,
        idempotency_key: idempotency_key(&headers)?,
        request_hash: Sha256::digest(&body.bytes).into(),
    };
    Ok(reply(diagnoses::submit(state.store(), &principal, asked).await?))
}

/// Diagnoses, newest first.
#[utoipa::path(get, path = "/api/v1/diagnoses", tag = "diagnoses", params(Wanted),
    responses((status = 200, body = DiagnosisList), (status = 400, body = Problem, content_type = "application/problem+json")))]
pub async fn list(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    QueryOf(wanted): QueryOf<Wanted>,
) -> Result<Json<DiagnosisList>, ApiError> {
    let limit = wanted.limit.unwrap_or(100);
    if !(1..=LIMIT_MOST).contains(&limit) {
        return Err(bad_parameter(
            "limit",
            format!("{limit} is outside the range"),
            "1 to 500",
        ));
    }
    let diagnoses = diagnoses::list(state.store(), &principal, limit, wanted.robot.as_deref()).await?;
    Ok(Json(DiagnosisList { diagnoses }))
}

/// One diagnosis: state, progress, verdict.
#[utoipa::path(get, path = "/api/v1/diagnoses/{id}", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 200, body = DiagnosisView), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn show(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<DiagnosisView>, ApiError> {
    Ok(Json(diagnoses::get(state.store(), &principal, id).await?))
}

/// The report of a diagnosis that is done, `robopheus.diagnosis/1`.
#[utoipa::path(get, path = "/api/v1/diagnoses/{id}/report.json", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 200, content_type = "application/json", body = Object), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`diagnosis_not_done`")))]
pub async fn report(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Response, ApiError> {
    let text = diagnoses::report(state.store(), &principal, id).await?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

/// The same report as a page with plots.
#[utoipa::path(get, path = "/api/v1/diagnoses/{id}/report.html", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 200, content_type = "text/html", body = String), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`diagnosis_not_done`")))]
pub async fn page(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let page = diagnoses::page(state.store(), &principal, id).await?;
    let path = state.objects().path_of(&page.object_path)?;
    objects::verify(path.clone(), page.bytes, page.sha256.clone()).await?;
    let reply = FileReply {
        path,
        media_type: page.media_type,
        etag: page.sha256,
        save_as: None,
        cache_control: "private, no-cache",
        encoding: None,
    };
    Ok(reply.send(&headers).await.map_err(AppError::from)?)
}

/// Cancel a diagnosis that waits or runs.
#[utoipa::path(post, path = "/api/v1/diagnoses/{id}/cancel", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 200, body = DiagnosisView), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`diagnosis_ended`")))]
pub async fn cancel(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<DiagnosisView>, ApiError> {
    Ok(Json(diagnoses::cancel(state.store(), &principal, id).await?))
}

/// Make the model that came out the robot's current one. To go back: `PUT /api/v1/robots/{robot}/model`.
#[utoipa::path(post, path = "/api/v1/diagnoses/{id}/accept", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 200, body = DiagnosisView), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`diagnosis_not_done`")))]
pub async fn accept(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<DiagnosisView>, ApiError> {
    Ok(Json(diagnoses::accept(state.store(), &principal, id).await?))
}

/// Submit the experiment that the report proposes; when its run is done, a follow-up diagnosis is queued by itself.
#[utoipa::path(post, path = "/api/v1/diagnoses/{id}/next-experiment", tag = "diagnoses", params(("id" = Uuid, Path)),
    responses((status = 201, body = DiagnosisView), (status = 200, body = DiagnosisView, description = "Its run is under way or done already"),
        (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`diagnosis_not_done`, `no_next_experiment`, `robot_not_registered`"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_experiment`")))]
pub async fn next_experiment(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Response, ApiError> {
    Ok(reply(diagnoses::next_experiment(state.store(), &principal, id).await?))
}

fn reply(taken: Taken) -> Response {
    let (status, view) = match taken {
        Taken::Created(view) => (StatusCode::CREATED, view),
        Taken::Before(view) => (StatusCode::OK, view),
    };
    let location = AppendHeaders([(header::LOCATION, format!("/api/v1/diagnoses/{}", view.id))]);
    (status, location, Json(view)).into_response()
}
