//! A run's archive: made once when the run has ended, made again when its files changed or it is missing.

use super::error::AppError;
use crate::archive_file::{ArchiveFile, Contents};
use crate::state::AppState;
use api::run::RunView;
use uuid::Uuid;

/// Files made for the page: downloadable by themselves, not part of the archive.
const PAGE_FILES: [&str; 2] = ["replay.json", "track.json"];

/// The archive of a run that has ended, checked against its SHA-256.
pub async fn get(state: &AppState, run: &RunView) -> Result<ArchiveFile, AppError> {
    if !run.state.is_terminal() {
        return Err(AppError::Conflict {
            code: "archive_not_ready",
            detail: format!(
                "the run is `{}`; its archive is made when it has ended",
                run.state.as_str()
            ),
        });
    }
    let mut files = state.store().run_files(run.id).await?;
    files.retain(|file| !PAGE_FILES.contains(&file.name.as_str()));
    if files.is_empty() {
        return Err(AppError::NotFound {
            noun: "archive of run",
            id: run.id.to_string(),
        });
    }
    let contents = Contents {
        run: run.id,
        epoch: run.epoch,
        files,
    };
    let objects = state.objects().clone();
    let _one_at_a_time = state.archive_gate().lock().await;
    tokio::task::spawn_blocking(move || contents.archive(&objects))
        .await
        .map_err(|error| AppError::Internal(error.to_string()))?
}

/// Makes the archive ahead of the first download, in the background.
pub fn prepare(state: &AppState, id: Uuid) {
    let state = state.clone();
    tokio::spawn(async move {
        let made = match state.store().run_get(id).await {
            Ok(Some(run)) if run.state.is_terminal() && !run.files.is_empty() => get(&state, &run).await.map(Some),
            Ok(_) => Ok(None),
            Err(error) => Err(error.into()),
        };
        match made {
            Ok(Some(archive)) => tracing::info!(run.id = %id, sha256 = archive.sha256, "archive made"),
            Ok(None) => {}
            Err(error) => tracing::warn!(run.id = %id, %error, "archive not made; the first download tries again"),
        }
    });
}
