//! Experiments: submitted once, never changed.

use crate::LIST_LIMIT;
use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::identity::user_id;
use crate::outcome::{NewSubmission, Submitted};
use api::experiment::{Experiment, ExperimentView, Mode};
use api::lab::Side;
use chrono::{DateTime, Utc};
use sqlx::PgConnection;
use uuid::Uuid;

#[derive(sqlx::FromRow)]
struct ExperimentRow {
    id: Uuid,
    label: String,
    submitted_by: String,
    submitted_at: DateTime<Utc>,
    document: String,
    run_id: Uuid,
}

impl ExperimentRow {
    fn into_view(self) -> Result<ExperimentView> {
        Ok(ExperimentView {
            id: self.id,
            label: self.label,
            submitted_by: self.submitted_by,
            submitted_at: self.submitted_at,
            experiment: serde_json::from_str(&self.document).map_err(StoreError::corrupt("experiment"))?,
            run_id: self.run_id,
        })
    }
}

macro_rules! experiment_select {
    ($tail:literal) => {
        concat!(
            "SELECT e.id, e.label, u.name AS submitted_by, e.submitted_at, e.document::text AS document, r.id AS run_id ",
            "FROM experiments e JOIN users u ON u.id = e.user_id JOIN runs r ON r.experiment_id = e.id ",
            $tail
        )
    };
}

impl Store {
    /// Stores the experiment, its run (`validating`) and the rehearsal job, or none of them.
    pub async fn experiment_submit(&self, submission: NewSubmission) -> Result<Submitted> {
        let mut transaction = self.pool.begin().await?;
        let user = user_id(&mut transaction, &submission.user).await?;
        let experiment_id = Uuid::now_v7();
        if let Some(key) = &submission.idempotency_key {
            match reserve_key(&mut transaction, user, key, &submission.request_hash, experiment_id).await? {
                Reserved::New => {}
                Reserved::Before { experiment_id } => {
                    let view = experiment_view(&mut transaction, experiment_id).await?;
                    return view
                        .map(Submitted::Replayed)
                        .ok_or(StoreError::Constraint("idempotency_keys_experiment".to_owned()));
                }
                Reserved::OtherBody => return Ok(Submitted::Conflict),
            }
        }
        insert_experiment(&mut transaction, experiment_id, user, &submission).await?;
        insert_models(&mut transaction, experiment_id, &submission.experiment).await?;
        let run_id = Uuid::now_v7();
        insert_run(&mut transaction, run_id, experiment_id, user, &submission.experiment).await?;
        sqlx::query("INSERT INTO jobs (id, kind, run_id) VALUES ($1, 'rehearse', $2)")
            .bind(Uuid::now_v7())
            .bind(run_id)
            .execute(&mut *transaction)
            .await?;
        let view = experiment_view(&mut transaction, experiment_id).await?;
        transaction.commit().await?;
        view.map(Submitted::Created)
            .ok_or(StoreError::Constraint("experiments_run".to_owned()))
    }

    /// What came of an earlier submission with this key; none when the key is new or too old.
    pub async fn experiment_submitted_before(
        &self,
        user: &str,
        key: &str,
        request_hash: &[u8; 32],
    ) -> Result<Option<Submitted>> {
        let before: Option<(Vec<u8>, Uuid)> = sqlx::query_as(
            "SELECT k.request_hash, k.experiment_id FROM idempotency_keys k JOIN users u ON u.id = k.user_id
             WHERE u.name = $1 AND k.key = $2 AND k.created_at >= clock_timestamp() - interval '24 hours'",
        )
        .bind(user)
        .bind(key)
        .fetch_optional(&self.pool)
        .await?;
        let Some((hash, experiment_id)) = before else {
            return Ok(None);
        };
        if hash != request_hash {
            return Ok(Some(Submitted::Conflict));
        }
        Ok(self.experiment_get(experiment_id).await?.map(Submitted::Replayed))
    }

    /// One experiment.
    pub async fn experiment_get(&self, id: Uuid) -> Result<Option<ExperimentView>> {
        experiment_view(&mut *self.pool.acquire().await?, id).await
    }

    /// Newest first; of one user when given.
    pub async fn experiment_list(&self, limit: i64, user: Option<&str>) -> Result<Vec<ExperimentView>> {
        let rows: Vec<ExperimentRow> = sqlx::query_as(experiment_select!(
            "WHERE $2::text IS NULL OR u.name = $2 ORDER BY e.submitted_at DESC, e.id DESC LIMIT $1"
        ))
        .bind(limit.clamp(0, LIST_LIMIT))
        .bind(user)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter().map(ExperimentRow::into_view).collect()
    }
}

async fn experiment_view(connection: &mut PgConnection, id: Uuid) -> Result<Option<ExperimentView>> {
    let row: Option<ExperimentRow> = sqlx::query_as(experiment_select!("WHERE e.id = $1"))
        .bind(id)
        .fetch_optional(connection)
        .await?;
    row.map(ExperimentRow::into_view).transpose()
}

enum Reserved {
    New,
    Before { experiment_id: Uuid },
    OtherBody,
}

/// Waits for a parallel submission with the same key and then sees what it stored.
async fn reserve_key(
    connection: &mut PgConnection,
    user: Uuid,
    key: &str,
    hash: &[u8; 32],
    experiment_id: Uuid,
) -> Result<Reserved> {
    let reserved = sqlx::query(
        "INSERT INTO idempotency_keys AS k (user_id, key, request_hash, experiment_id) VALUES ($1, $2, $3, $4)
         ON CONFLICT (user_id, key) DO UPDATE
            SET request_hash = excluded.request_hash, experiment_id = excluded.experiment_id, created_at = clock_timestamp()
            WHERE k.created_at < clock_timestamp() - interval '24 hours'",
    )
    .bind(user)
    .bind(key)
    .bind(&hash[..])
    .bind(experiment_id)
    .execute(&mut *connection)
    .await?;
    if reserved.rows_affected() == 1 {
        return Ok(Reserved::New);
    }
    let (before, experiment_id): (Vec<u8>, Uuid) =
        sqlx::query_as("SELECT request_hash, experiment_id FROM idempotency_keys WHERE user_id = $1 AND key = $2")
            .bind(user)
            .bind(key)
            .fetch_one(connection)
            .await?;
    Ok(if before == hash {
        Reserved::Before { experiment_id }
    } else {
        Reserved::OtherBody
    })
}

async fn insert_experiment(
    connection: &mut PgConnection,
    id: Uuid,
    user: Uuid,
    submission: &NewSubmission,
) -> Result<()> {
    let document = serde_json::to_string(&submission.experiment).map_err(StoreError::corrupt("experiment"))?;
    let claim = submission.claim.as_ref();
    sqlx::query(
        "INSERT INTO experiments (id, user_id, label, document, claimed_digest, claimed_twin_version, claimed_engine)
         VALUES ($1, $2, $3, $4::json, $5, $6, $7)",
    )
    .bind(id)
    .bind(user)
    .bind(&submission.label)
    .bind(document)
    .bind(claim.map(|claim| claim.digest.as_str()))
    .bind(claim.map(|claim| claim.twin_version.as_str()))
    .bind(claim.map(|claim| claim.engine.as_str()))
    .execute(connection)
    .await?;
    Ok(())
}

/// What carries out an experiment of this mode.
const fn side_of(mode: Mode) -> Side {
    match mode {
        Mode::Physical | Mode::Interactive => Side::Physical,
        Mode::Virtual => Side::Virtual,
    }
}

/// Fixes the models that the experiment is rehearsed with: those named, else those that are current.
async fn insert_models(connection: &mut PgConnection, id: Uuid, experiment: &Experiment) -> Result<()> {
    let robot_names: Vec<&str> = experiment.robots.iter().map(|robot| robot.name.as_str()).collect();
    sqlx::query(
        "INSERT INTO experiment_models (experiment_id, robot, model_id)
         SELECT $1, n.robot, coalesce(m.id, current_model(n.robot, $3)) FROM (SELECT DISTINCT unnest($2::text[]) AS robot) n
         LEFT JOIN models m ON m.robot = n.robot AND (m.version = $4 OR m.id::text = $4)
         WHERE $4::text IS DISTINCT FROM $5 AND coalesce(m.id, current_model(n.robot, $3)) IS NOT NULL",
    )
    .bind(id)
    .bind(robot_names)
    .bind(&experiment.floor)
    .bind(&experiment.model)
    .bind(api::diagnosis::NOMINAL)
    .execute(connection)
    .await?;
    Ok(())
}

async fn insert_run(
    connection: &mut PgConnection,
    id: Uuid,
    experiment_id: Uuid,
    user: Uuid,
    experiment: &Experiment,
) -> Result<()> {
    let robot_names: Vec<&str> = experiment.robots.iter().map(|robot| robot.name.as_str()).collect();
    sqlx::query(
        "INSERT INTO runs (id, experiment_id, user_id, arena, robot_names, duration_s, side) VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(id)
    .bind(experiment_id)
    .bind(user)
    .bind(&experiment.arena)
    .bind(robot_names)
    .bind(experiment.duration_s)
    .bind(side_of(experiment.mode).as_str())
    .execute(connection)
    .await?;
    Ok(())
}
