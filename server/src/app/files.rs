//! Files of an attempt: bytes first, row last, nothing of a replaced attempt.

use super::error::AppError;
use crate::objects::{self, ObjectFolder};
use crate::state::AppState;
use api::problem::FieldProblem;
use api::run::{RunState, RunView};
use bytes::Bytes;
use futures_util::{Stream, StreamExt as _};
use sha2::{Digest as _, Sha256};
use std::path::Path;
use std::time::Duration;
use store::{FilePut, FileRecord};
use tokio::io::AsyncWriteExt as _;
use uuid::Uuid;

/// Largest file of a run.
pub const FILE_LIMIT_BYTES: u64 = 512 * 1024 * 1024;
/// A sender that is silent for so long is given up.
const SILENCE_LIMIT: Duration = Duration::from_secs(30);

/// What a laboratory says about the file that it sends.
#[derive(Debug, Clone)]
pub struct Upload {
    pub run: Uuid,
    pub epoch: i64,
    pub name: String,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

/// Takes a file in. The row is written when the bytes have been checked and are on disk.
pub async fn put<S, E>(state: &AppState, upload: Upload, body: S) -> Result<FileRecord, AppError>
where
    S: Stream<Item = Result<Bytes, E>> + Unpin,
{
    objects::check_name(&upload.name).map_err(|limit| bad("name", &format!("`{}` is refused", upload.name), limit))?;
    let run = state
        .store()
        .run_get(upload.run)
        .await?
        .ok_or_else(|| AppError::not_found("run", upload.run))?;
    fence(&run, upload.epoch)?;
    let temporary = state.objects().temporary();
    let received = receive(&temporary, body).await;
    let kept = match received {
        Ok(received) => keep(state.objects(), &temporary, &upload, received).await,
        Err(error) => Err(error),
    };
    let file = match kept {
        Ok(file) => file,
        Err(error) => {
            let _best_effort = tokio::fs::remove_file(&temporary).await;
            return Err(error);
        }
    };
    match state.store().run_file_put(upload.run, upload.epoch, &file).await? {
        FilePut::Ok => Ok(file),
        FilePut::Stale => Err(stale_epoch()),
        FilePut::Sealed => Err(AppError::Conflict {
            code: "file_sealed",
            detail: format!("the run has ended and has another `{}`", upload.name),
        }),
    }
}

/// A file's record, whole on disk: its bytes are checked against the database on every request.
pub async fn get(state: &AppState, run: &RunView, name: &str) -> Result<FileRecord, AppError> {
    let file = state
        .store()
        .run_file_get(run.id, name)
        .await?
        .ok_or_else(|| AppError::not_found("file", name))?;
    objects::verify(
        state.objects().path_of(&file.object_path)?,
        file.bytes,
        file.sha256.clone(),
    )
    .await?;
    Ok(file)
}

/// The laboratory holds an attempt that has been replaced.
pub fn stale_epoch() -> AppError {
    AppError::Conflict {
        code: "stale_epoch",
        detail: "this attempt has been replaced; nothing was written".to_owned(),
    }
}

/// Spares a stale sender the upload; the store decides again when the row is written.
fn fence(run: &RunView, epoch: i64) -> Result<(), AppError> {
    let has_lab = matches!(
        run.state,
        RunState::Preparing
            | RunState::Running
            | RunState::Uploading
            | RunState::Done
            | RunState::Failed
            | RunState::Cancelled
            | RunState::Interrupted
    );
    if epoch == run.epoch && epoch > 0 && has_lab {
        Ok(())
    } else {
        Err(stale_epoch())
    }
}

struct Received {
    bytes: u64,
    sha256: String,
}

async fn receive<S, E>(temporary: &Path, mut body: S) -> Result<Received, AppError>
where
    S: Stream<Item = Result<Bytes, E>> + Unpin,
{
    let mut file = tokio::fs::File::create_new(temporary).await?;
    let mut hasher = Sha256::new();
    let mut bytes: u64 = 0;
    loop {
        let chunk = match tokio::time::timeout(SILENCE_LIMIT, body.next()).await {
            Ok(Some(Ok(chunk))) => chunk,
            Ok(None) => break,
            Ok(Some(Err(_))) | Err(_) => return Err(AppError::Interrupted),
        };
        bytes += chunk.len() as u64;
        if bytes > FILE_LIMIT_BYTES {
            return Err(AppError::TooLarge {
                limit_bytes: FILE_LIMIT_BYTES,
            });
        }
        hasher.update(&chunk);
        file.write_all(&chunk).await?;
    }
    file.flush().await?;
    Ok(Received {
        bytes,
        sha256: objects::hex(&hasher.finalize()),
    })
}

async fn keep(
    objects: &ObjectFolder,
    temporary: &Path,
    upload: &Upload,
    received: Received,
) -> Result<FileRecord, AppError> {
    if received.sha256 != upload.sha256 {
        let message = format!("the body's SHA-256 is {}", received.sha256);
        return Err(AppError::Invalid {
            code: "hash_mismatch",
            detail: "the bytes that arrived are not those that were announced; send the file again".to_owned(),
            errors: vec![problem("x-content-sha256", &message, "the SHA-256 of the body")],
        });
    }
    let object_path = ObjectFolder::object_path(upload.run, upload.epoch, &upload.name, &received.sha256);
    let (folder, temporary, target) = (objects.clone(), temporary.to_owned(), objects.path_of(&object_path)?);
    tokio::task::spawn_blocking(move || folder.publish(&temporary, &target))
        .await
        .map_err(|error| AppError::Internal(error.to_string()))??;
    Ok(FileRecord {
        name: upload.name.clone(),
        bytes: i64::try_from(received.bytes).map_err(|error| AppError::Internal(error.to_string()))?,
        sha256: received.sha256,
        media_type: objects::media_type(&upload.name).to_owned(),
        object_path,
    })
}

fn bad(field: &str, message: &str, limit: &str) -> AppError {
    AppError::Invalid {
        code: "invalid_file",
        detail: format!("{field}: {message}"),
        errors: vec![problem(field, message, limit)],
    }
}

fn problem(field: &str, message: &str, limit: &str) -> FieldProblem {
    FieldProblem {
        field: field.to_owned(),
        message: message.to_owned(),
        limit: limit.to_owned(),
        remedy: format!("correct `{field}` and send the file again"),
    }
}
