//! `GET /health`.

use crate::app::health::{self, HealthView};
use crate::state::AppState;
use axum::Json;
use axum::extract::State;

/// Version, twin version, database, laboratory.
#[utoipa::path(get, path = "/api/v1/health", tag = "service", responses((status = 200, body = HealthView)))]
pub async fn show(State(state): State<AppState>) -> Json<HealthView> {
    Json(health::look(&state).await)
}
