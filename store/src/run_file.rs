//! Files of a run. The bytes are durable in the object folder before the row is written.

use crate::connect::Store;
use crate::error::Result;
use crate::outcome::{FilePut, FileRecord};
use crate::run::lock_run;
use api::run::RunState;
use sqlx::PgConnection;
use uuid::Uuid;

#[derive(sqlx::FromRow)]
pub(crate) struct FileRow {
    name: String,
    bytes: i64,
    sha256: String,
    media_type: String,
    object_path: String,
}

impl From<FileRow> for FileRecord {
    fn from(row: FileRow) -> Self {
        Self {
            name: row.name,
            bytes: row.bytes,
            sha256: row.sha256,
            media_type: row.media_type,
            object_path: row.object_path,
        }
    }
}

impl Store {
    /// Records a file of the run's newest attempt, also after that attempt ended. A `done` run keeps the files it has.
    pub async fn run_file_put(&self, run_id: Uuid, epoch: i64, file: &FileRecord) -> Result<FilePut> {
        let mut transaction = self.pool.begin().await?;
        let Some(run) = lock_run(&mut transaction, run_id).await? else {
            return Ok(FilePut::Stale);
        };
        let before_any_attempt =
            epoch <= 0 || matches!(run.state, RunState::Draft | RunState::Validating | RunState::Rejected);
        if run.epoch != epoch || before_any_attempt {
            return Ok(FilePut::Stale);
        }
        if run.state == RunState::Done {
            let sha256: Option<String> =
                sqlx::query_scalar("SELECT sha256 FROM run_files WHERE run_id = $1 AND epoch = $2 AND name = $3")
                    .bind(run_id)
                    .bind(epoch)
                    .bind(&file.name)
                    .fetch_optional(&mut *transaction)
                    .await?;
            if sha256.is_some_and(|sha256| sha256 != file.sha256) {
                return Ok(FilePut::Sealed);
            }
        }
        upsert_file(&mut transaction, run_id, epoch, file).await?;
        transaction.commit().await?;
        Ok(FilePut::Ok)
    }

    /// Files of the rehearsal and of the newest attempt, by name.
    pub async fn run_files(&self, run_id: Uuid) -> Result<Vec<FileRecord>> {
        let rows: Vec<FileRow> = sqlx::query_as(
            "SELECT DISTINCT ON (f.name) f.name, f.bytes, f.sha256, f.media_type, f.object_path
             FROM run_files f JOIN runs r ON r.id = f.run_id AND f.epoch IN (0, r.epoch)
             WHERE f.run_id = $1 ORDER BY f.name, f.epoch DESC",
        )
        .bind(run_id)
        .fetch_all(&self.pool)
        .await?;
        Ok(rows.into_iter().map(FileRecord::from).collect())
    }

    /// One file by its name inside the archive.
    pub async fn run_file_get(&self, run_id: Uuid, name: &str) -> Result<Option<FileRecord>> {
        let row: Option<FileRow> = sqlx::query_as(
            "SELECT f.name, f.bytes, f.sha256, f.media_type, f.object_path
             FROM run_files f JOIN runs r ON r.id = f.run_id AND f.epoch IN (0, r.epoch)
             WHERE f.run_id = $1 AND f.name = $2 ORDER BY f.epoch DESC LIMIT 1",
        )
        .bind(run_id)
        .bind(name)
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.map(FileRecord::from))
    }
}

pub(crate) async fn upsert_file(
    connection: &mut PgConnection,
    run_id: Uuid,
    epoch: i64,
    file: &FileRecord,
) -> Result<()> {
    sqlx::query(
        "INSERT INTO run_files (run_id, epoch, name, bytes, sha256, media_type, object_path) VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (run_id, epoch, name) DO UPDATE SET bytes = excluded.bytes, sha256 = excluded.sha256,
            media_type = excluded.media_type, object_path = excluded.object_path, created_at = clock_timestamp()",
    )
    .bind(run_id)
    .bind(epoch)
    .bind(&file.name)
    .bind(file.bytes)
    .bind(&file.sha256)
    .bind(&file.media_type)
    .bind(&file.object_path)
    .execute(connection)
    .await?;
    Ok(())
}
