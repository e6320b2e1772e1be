//! `/runs`.

use super::params::{Id, QueryOf, bad_parameter};
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::runs;
use crate::state::AppState;
use api::problem::Problem;
use api::run::{RunList, RunView};
use axum::extract::State;
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::IntoParams;

const LIMIT_DEFAULT: i64 = 100;
const LIMIT_MOST: i64 = 500;

/// How much of a list is wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Page {
    /// At most so many entries, 1 to 500; 100 when left out.
    limit: Option<i64>,
}

impl Page {
    pub fn limit(&self) -> Result<i64, ApiError> {
        match self.limit.unwrap_or(LIMIT_DEFAULT) {
            limit @ 1..=LIMIT_MOST => Ok(limit),
            other => Err(bad_parameter(
                "limit",
                format!("{other} is outside the range"),
                "1 to 500",
            )),
        }
    }
}

/// Runs, newest first.
#[utoipa::path(get, path = "/api/v1/runs", tag = "runs", params(Page),
    responses((status = 200, body = RunList), (status = 400, body = Problem, content_type = "application/problem+json")))]
pub async fn list(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    QueryOf(page): QueryOf<Page>,
) -> Result<Json<RunList>, ApiError> {
    Ok(Json(RunList {
        runs: runs::list(state.store(), &principal, page.limit()?).await?,
    }))
}

/// One run: state, place in the queue, verdict, files.
#[utoipa::path(get, path = "/api/v1/runs/{id}", tag = "runs", params(("id" = Uuid, Path)),
    responses((status = 200, body = RunView), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn show(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<RunView>, ApiError> {
    Ok(Json(runs::get(state.store(), &principal, id).await?))
}

/// Cancel a run: at once while it waits, through the laboratory while robots move.
#[utoipa::path(post, path = "/api/v1/runs/{id}/cancel", tag = "runs", params(("id" = Uuid, Path)),
    responses((status = 200, body = RunView), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`run_ended`")))]
pub async fn cancel(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Json<RunView>, ApiError> {
    Ok(Json(runs::cancel(state.store(), &principal, id).await?))
}
