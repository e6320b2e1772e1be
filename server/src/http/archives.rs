//! `/runs/{id}/archive` and `/runs/{id}/files/{name}`: Range, If-Range, HEAD.

use super::file_reply::FileReply;
use super::params::{FilePath, Id};
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::error::AppError;
use crate::app::{archives, files, runs};
use crate::state::AppState;
use api::problem::Problem;
use axum::Extension;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse as _, Response};

/// Caches may keep a copy for its owner, but ask each time.
const CACHE_CONTROL: &str = "private, no-cache";

/// Everything about a run that has ended, as a zip with a SHA-256 manifest.
#[utoipa::path(get, path = "/api/v1/runs/{id}/archive", tag = "runs",
    params(("id" = Uuid, Path), ("Range" = Option<String>, Header, description = "One range of bytes")),
    responses((status = 200, content_type = "application/zip", body = String), (status = 206, description = "Part of the archive"), (status = 416, description = "No such range"),
        (status = 404, body = Problem, content_type = "application/problem+json"), (status = 409, body = Problem, content_type = "application/problem+json", description = "`archive_not_ready`")))]
pub async fn archive(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let run = runs::get(state.store(), &principal, id).await?;
    let archive = archives::get(&state, &run).await?;
    let reply = FileReply {
        path: archive.path,
        media_type: "application/zip".to_owned(),
        etag: archive.sha256,
        save_as: Some(format!("robopheus-run-{id}.zip")),
        cache_control: CACHE_CONTROL,
        encoding: None,
    };
    send(reply, &headers).await
}

/// One file of a run.
#[utoipa::path(get, path = "/api/v1/runs/{id}/files/{name}", tag = "runs",
    params(("id" = Uuid, Path), ("name" = String, Path, description = "Name as in the run's list of files; may contain `/`"),
        ("Range" = Option<String>, Header, description = "One range of bytes")),
    responses((status = 200, content_type = "application/octet-stream", body = String), (status = 206, description = "Part of the file"), (status = 416, description = "No such range"),
        (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn file(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    FilePath { run, name }: FilePath,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let run = runs::get(state.store(), &principal, run).await?;
    let file = files::get(&state, &run, &name).await?;
    let reply = FileReply {
        path: state.objects().path_of(&file.object_path)?,
        media_type: file.media_type,
        etag: file.sha256,
        save_as: Some(name.rsplit('/').next().unwrap_or("file").to_owned()),
        cache_control: CACHE_CONTROL,
        encoding: None,
    };
    send(reply, &headers).await
}

async fn send(reply: FileReply, headers: &HeaderMap) -> Result<Response, ApiError> {
    let response = reply.send(headers).await.map_err(AppError::from)?;
    if response.status() != StatusCode::RANGE_NOT_SATISFIABLE {
        return Ok(response);
    }
    let problem = ApiError::new(
        StatusCode::RANGE_NOT_SATISFIABLE,
        "range_not_satisfiable",
        "the file is shorter than that",
    );
    let mut answer = problem.into_response();
    answer.headers_mut().extend(response.headers().clone());
    Ok(answer)
}
