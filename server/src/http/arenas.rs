//! `/arenas`.

use super::problem::ApiError;
use crate::app::error::AppError;
use crate::state::AppState;
use api::arena::ArenaView;
use axum::Json;
use axum::extract::State;

/// Arenas and what they are doing.
#[utoipa::path(get, path = "/api/v1/arenas", tag = "laboratory", responses((status = 200, body = Vec<ArenaView>)))]
pub async fn list(State(state): State<AppState>) -> Result<Json<Vec<ArenaView>>, ApiError> {
    Ok(Json(state.store().arena_list().await.map_err(AppError::from)?))
}
