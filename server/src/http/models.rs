//! `/models`, and the model and gaps of a robot.

use super::body::JsonBody;
use super::params::{Id, QueryOf, RobotName};
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::models;
use crate::state::AppState;
use api::model::{ModelChoice, ModelView, ReferencesRequest, RobotGaps, RobotModel};
use api::problem::Problem;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::IntoParams;

/// Which models are wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Wanted {
    /// Only of this robot.
    robot: Option<String>,
    /// Only of this floor.
    floor: Option<String>,
    /// Only those that robots use now.
    #[serde(default)]
    current: bool,
}

/// Published model versions, newest first.
#[utoipa::path(get, path = "/api/v1/models", tag = "models", params(Wanted), responses((status = 200, body = Vec<ModelView>)))]
pub async fn list(
    State(state): State<AppState>,
    QueryOf(wanted): QueryOf<Wanted>,
) -> Result<Json<Vec<ModelView>>, ApiError> {
    Ok(Json(
        models::list(
            state.store(),
            wanted.robot.as_deref(),
            wanted.floor.as_deref(),
            wanted.current,
        )
        .await?,
    ))
}

/// One model version.
#[utoipa::path(get, path = "/api/v1/models/{id}", tag = "models", params(("id" = Uuid, Path)),
    responses((status = 200, body = ModelView), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn show(State(state): State<AppState>, Id(id): Id) -> Result<Json<ModelView>, ApiError> {
    Ok(Json(models::get(state.store(), id).await?))
}

/// The document of a version as a file (`robopheus.model/1`), for `robopheus simulate --model` and `diagnose --model`.
#[utoipa::path(get, path = "/api/v1/models/{id}/model.json", tag = "models", params(("id" = Uuid, Path)),
    responses((status = 200, content_type = "application/json", body = Object),
        (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn document(State(state): State<AppState>, Id(id): Id) -> Result<impl IntoResponse, ApiError> {
    let (name, text) = models::document(state.store(), id).await?;
    let headers = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, text))
}

/// The learned residual of a version as an ONNX file.
#[utoipa::path(get, path = "/api/v1/models/{id}/onnx", tag = "models", params(("id" = Uuid, Path)),
    responses((status = 200, content_type = "application/octet-stream", body = Vec<u8>),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "No such version, or it carries no residual")))]
pub async fn onnx(State(state): State<AppState>, Id(id): Id) -> Result<impl IntoResponse, ApiError> {
    let (name, bytes) = models::onnx(state.store(), id).await?;
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, bytes))
}

/// Which model a robot's twin uses, and the record of who chose what when.
#[utoipa::path(get, path = "/api/v1/robots/{robot}/model", tag = "models", params(("robot" = String, Path)),
    responses((status = 200, body = RobotModel), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn of_robot(
    State(state): State<AppState>,
    RobotName(robot): RobotName,
) -> Result<Json<RobotModel>, ApiError> {
    Ok(Json(models::of_robot(state.store(), &robot).await?))
}

/// Make a version, an earlier one or `nominal`, the robot's current model.
#[utoipa::path(put, path = "/api/v1/robots/{robot}/model", tag = "models", params(("robot" = String, Path)), request_body = ModelChoice,
    responses((status = 200, body = RobotModel), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_model`")))]
pub async fn choose(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    RobotName(robot): RobotName,
    body: JsonBody<ModelChoice>,
) -> Result<Json<RobotModel>, ApiError> {
    Ok(Json(
        models::choose(state.store(), &principal, &robot, &body.value.model).await?,
    ))
}

/// Finished runs of a robot against its current model.
#[utoipa::path(get, path = "/api/v1/robots/{robot}/gaps", tag = "models", params(("robot" = String, Path)),
    responses((status = 200, body = RobotGaps), (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn gaps(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    RobotName(robot): RobotName,
) -> Result<Json<RobotGaps>, ApiError> {
    Ok(Json(models::gaps(state.store(), &principal, &robot).await?))
}

/// Say which runs had nothing changed: they give the floor that gaps are compared with.
#[utoipa::path(put, path = "/api/v1/robots/{robot}/references", tag = "models", params(("robot" = String, Path)), request_body = ReferencesRequest,
    responses((status = 200, body = RobotGaps), (status = 404, body = Problem, content_type = "application/problem+json"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "`invalid_references`")))]
pub async fn set_references(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    RobotName(robot): RobotName,
    body: JsonBody<ReferencesRequest>,
) -> Result<Json<RobotGaps>, ApiError> {
    Ok(Json(
        models::set_references(state.store(), &principal, &robot, &body.value.runs).await?,
    ))
}
