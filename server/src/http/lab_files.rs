//! `PUT /lab/runs/{id}/files/{name}`: the laboratory hands in a file of an attempt.

use super::params::{FilePath, QueryOf, bad_parameter};
use super::problem::ApiError;
use crate::app::files::{self, FILE_LIMIT_BYTES, Upload};
use crate::app::{archives, error::AppError};
use crate::archive_file;
use crate::state::AppState;
use api::problem::Problem;
use api::run::FileView;
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use serde::Deserialize;
use utoipa::IntoParams;

/// Which attempt a file belongs to.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Attempt {
    epoch: i64,
}

/// Hand in a file. Repeating it is harmless.
#[utoipa::path(put, path = "/api/v1/lab/runs/{id}/files/{name}", tag = "lab",
    params(("id" = Uuid, Path), ("name" = String, Path, description = "Path inside the archive"), Attempt,
        ("x-content-sha256" = String, Header, description = "SHA-256 of the body, hexadecimal")),
    request_body(content = String, content_type = "application/octet-stream"),
    responses((status = 200, body = FileView), (status = 409, body = Problem, content_type = "application/problem+json", description = "`stale_epoch` or `file_sealed`"),
        (status = 413, body = Problem, content_type = "application/problem+json"), (status = 422, body = Problem, content_type = "application/problem+json", description = "`hash_mismatch` or `invalid_file`")))]
pub async fn put(
    State(state): State<AppState>,
    FilePath { run, name }: FilePath,
    QueryOf(attempt): QueryOf<Attempt>,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<FileView>, ApiError> {
    let announced = headers
        .get(header::CONTENT_LENGTH)
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|bytes| bytes > FILE_LIMIT_BYTES) {
        return Err(AppError::TooLarge {
            limit_bytes: FILE_LIMIT_BYTES,
        }
        .into());
    }
    let upload = Upload {
        run,
        epoch: attempt.epoch,
        name,
        sha256: sha256(&headers)?,
    };
    let is_manifest = upload.name == archive_file::MANIFEST;
    let file = files::put(&state, upload, body.into_data_stream()).await?;
    if is_manifest {
        // After a salvage the run has ended already; the manifest comes last and completes the archive.
        archives::prepare(&state, run);
    }
    Ok(Json(archive_file::view(&file)))
}

fn sha256(headers: &HeaderMap) -> Result<String, ApiError> {
    let text = headers
        .get("x-content-sha256")
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default();
    if text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        Ok(text.to_ascii_lowercase())
    } else {
        Err(bad_parameter(
            "x-content-sha256",
            "the header is missing or not a SHA-256",
            "64 hexadecimal characters",
        ))
    }
}
