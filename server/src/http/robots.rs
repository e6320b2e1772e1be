//! `/robots`.

use super::problem::ApiError;
use crate::app::error::AppError;
use crate::state::AppState;
use api::robot::RobotView;
use axum::Json;
use axum::extract::State;

/// The laboratory's robots and what they are doing.
#[utoipa::path(get, path = "/api/v1/robots", tag = "laboratory", responses((status = 200, body = Vec<RobotView>)))]
pub async fn list(State(state): State<AppState>) -> Result<Json<Vec<RobotView>>, ApiError> {
    Ok(Json(state.store().robot_list().await.map_err(AppError::from)?))
}
