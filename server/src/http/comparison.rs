//! `POST /models/compare`.

use super::body::JsonBody;
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::comparison;
use crate::state::AppState;
use api::comparison::{ComparisonRequest, ComparisonView};
use api::problem::Problem;
use axum::extract::State;
use axum::{Extension, Json};

/// Which of two model versions predicts a stored run better. Stores nothing; takes up to some seconds.
#[utoipa::path(post, path = "/api/v1/models/compare", tag = "models", request_body = ComparisonRequest,
    responses((status = 200, body = ComparisonView),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "`comparison_busy`: others are being computed"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_comparison`")))]
pub async fn compare(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    body: JsonBody<ComparisonRequest>,
) -> Result<Json<ComparisonView>, ApiError> {
    Ok(Json(comparison::compare(&state, &principal, body.value).await?))
}
