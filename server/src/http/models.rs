//! `/models`.

use super::problem::ApiError;
use crate::app::error::AppError;
use crate::state::AppState;
use axum::Json;
use axum::extract::State;
use chrono::{DateTime, Utc};
use serde::Serialize;
use utoipa::ToSchema;
use uuid::Uuid;

/// A published model version of a robot on a floor.
#[derive(Debug, Serialize, ToSchema)]
pub struct ModelView {
    pub id: Uuid,
    pub version: String,
    pub robot: String,
    pub floor: String,
    pub created_at: DateTime<Utc>,
    /// `robopheus.model/1`.
    #[schema(value_type = Object)]
    pub document: serde_json::Value,
}

/// Published model versions.
#[utoipa::path(get, path = "/api/v1/models", tag = "laboratory", responses((status = 200, body = Vec<ModelView>)))]
pub async fn list(State(state): State<AppState>) -> Result<Json<Vec<ModelView>>, ApiError> {
    let models = state.store().model_list().await.map_err(AppError::from)?;
    let view = |model: store::Model| ModelView {
        id: model.id,
        version: model.version,
        robot: model.robot,
        floor: model.floor,
        created_at: model.created_at,
        document: model.document,
    };
    Ok(Json(models.into_iter().map(view).collect()))
}
