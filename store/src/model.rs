//! Model versions of robots on floors, and the record of which one is used from when.

use crate::LIST_LIMIT;
use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::outcome::DiagnosisRecord;
use crate::run_gap::GAP_HORIZON_S;
use api::model::{ModelGap, ModelUse, ModelView, RobotModel};
use chrono::{DateTime, Utc};
use sqlx::PgConnection;
use uuid::Uuid;

/// Lines of the record that are told.
const HISTORY_MOST: i64 = 50;

#[derive(sqlx::FromRow)]
struct ModelRow {
    id: Uuid,
    version: String,
    robot: String,
    floor: String,
    parent: Option<String>,
    diagnosis: Option<Uuid>,
    is_current: bool,
    created_at: DateTime<Utc>,
    document: String,
    /// Of the diagnosis that made it: before and after, positions two seconds ahead.
    gap_before_m: Option<f64>,
    gap_after_m: Option<f64>,
}

#[derive(sqlx::FromRow)]
struct UseRow {
    model: Option<Uuid>,
    version: Option<String>,
    since: DateTime<Utc>,
    chosen_by: String,
    diagnosis: Option<Uuid>,
}

impl ModelRow {
    fn into_view(self) -> Result<ModelView> {
        Ok(ModelView {
            document: serde_json::from_str(&self.document).map_err(StoreError::corrupt("model"))?,
            id: self.id,
            version: self.version,
            robot: self.robot,
            floor: self.floor,
            parent: self.parent,
            diagnosis: self.diagnosis,
            is_current: self.is_current,
            created_at: self.created_at,
            effects: Vec::new(),
            residual: None,
            gap: self
                .gap_before_m
                .zip(self.gap_after_m)
                .map(|(before_m, after_m)| ModelGap {
                    horizon_s: GAP_HORIZON_S,
                    before_m,
                    after_m,
                }),
        })
    }
}

macro_rules! model_select {
    ($tail:literal) => {
        concat!(
            "SELECT m.id, m.version, m.robot, m.floor, p.version AS parent, m.created_at, m.document::text AS document,
                d.id AS diagnosis, (g.gap->>'before')::double precision AS gap_before_m, (g.gap->>'after')::double precision AS gap_after_m,
                coalesce(current_model(m.robot, m.floor) = m.id, false) AS is_current
             FROM models m LEFT JOIN models p ON p.id = m.parent
             LEFT JOIN LATERAL (SELECT d.id, d.report FROM diagnoses d WHERE d.model_id = m.id ORDER BY d.created_at LIMIT 1) d ON true
             LEFT JOIN LATERAL (SELECT jsonb_path_query_first(d.report::jsonb, '$.gap[*] ? (@.channel == \"pose\" && @.horizon_s == 2)') AS gap) g ON true ",
            $tail
        )
    };
}

impl Store {
    /// Newest first; of one robot when given.
    pub async fn model_list(&self, robot: Option<&str>) -> Result<Vec<ModelView>> {
        let rows: Vec<ModelRow> = sqlx::query_as(model_select!(
            "WHERE $2::text IS NULL OR m.robot = $2 ORDER BY m.created_at DESC, m.id LIMIT $1"
        ))
        .bind(LIST_LIMIT)
        .bind(robot)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter().map(ModelRow::into_view).collect()
    }

    pub async fn model_get(&self, id: Uuid) -> Result<Option<ModelView>> {
        let row: Option<ModelRow> = sqlx::query_as(model_select!("WHERE m.id = $1"))
            .bind(id)
            .fetch_optional(&self.pool)
            .await?;
        row.map(ModelRow::into_view).transpose()
    }

    /// A model by its version, its id or the id of its document.
    pub async fn model_find(&self, name: &str) -> Result<Option<ModelView>> {
        let row: Option<ModelRow> = sqlx::query_as(model_select!(
            "WHERE m.version = $1 OR m.id::text = lower($1) OR m.document_id = $1"
        ))
        .bind(name)
        .fetch_optional(&self.pool)
        .await?;
        row.map(ModelRow::into_view).transpose()
    }

    /// Stores a version, or finds the same document again; its id.
    pub async fn model_put(
        &self,
        robot: &str,
        floor: &str,
        parent: Option<Uuid>,
        document: &serde_json::Value,
    ) -> Result<Uuid> {
        let mut transaction = self.pool.begin().await?;
        let id = insert_model(&mut transaction, robot, floor, parent, document).await?;
        transaction.commit().await?;
        Ok(id)
    }

    /// The model that a robot's twin uses on a floor, and the record of it.
    pub async fn robot_model(&self, robot: &str, floor: &str) -> Result<RobotModel> {
        let rows: Vec<UseRow> = sqlx::query_as(
            "SELECT u.model_id AS model, m.version, u.since, u.chosen_by, u.diagnosis_id AS diagnosis
             FROM model_uses u LEFT JOIN models m ON m.id = u.model_id
             WHERE u.robot = $1 AND u.floor = $2 ORDER BY u.number DESC LIMIT $3",
        )
        .bind(robot)
        .bind(floor)
        .bind(HISTORY_MOST)
        .fetch_all(&self.pool)
        .await?;
        let newest = rows.first();
        Ok(RobotModel {
            robot: robot.to_owned(),
            floor: floor.to_owned(),
            model: newest.and_then(|line| line.model),
            version: newest.and_then(|line| line.version.clone()),
            history: rows
                .into_iter()
                .map(|row| ModelUse {
                    model: row.model,
                    version: row.version,
                    since: row.since,
                    chosen_by: row.chosen_by,
                    diagnosis: row.diagnosis,
                })
                .collect(),
        })
    }

    /// The model of every robot that does not use the nominal twin, by robot.
    pub async fn models_current(&self) -> Result<Vec<ModelView>> {
        let rows: Vec<ModelRow> = sqlx::query_as(model_select!(
            "WHERE m.id IN (SELECT current_model(u.robot, u.floor) FROM (SELECT DISTINCT robot, floor FROM model_uses) u)
             ORDER BY m.robot, m.floor LIMIT $1"
        ))
        .bind(LIST_LIMIT)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter().map(ModelRow::into_view).collect()
    }

    /// Adds a line to the record: from now on the robot's twin uses this model, or the nominal one. A model that is
    /// current already adds nothing.
    pub async fn robot_model_set(
        &self,
        robot: &str,
        floor: &str,
        model: Option<Uuid>,
        diagnosis: Option<Uuid>,
        by: &str,
    ) -> Result<RobotModel> {
        let mut transaction = self.pool.begin().await?;
        // Two choices at the same moment are two lines, one after the other.
        sqlx::query("SELECT pg_advisory_xact_lock(hashtextextended('model_uses ' || $1 || ' ' || $2, 0))")
            .bind(robot)
            .bind(floor)
            .execute(&mut *transaction)
            .await?;
        sqlx::query(
            "INSERT INTO model_uses (robot, floor, model_id, diagnosis_id, chosen_by)
             SELECT $1, $2, $3, $4, $5 WHERE current_model($1, $2) IS DISTINCT FROM $3",
        )
        .bind(robot)
        .bind(floor)
        .bind(model)
        .bind(diagnosis)
        .bind(by)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        self.robot_model(robot, floor).await
    }

    /// Arena and floor of a robot that a laboratory has registered.
    pub async fn robot_place(&self, robot: &str) -> Result<Option<(String, String)>> {
        let place = sqlx::query_as(
            "SELECT a.name, a.floor FROM robots r JOIN arenas a ON a.name = r.arena WHERE r.name = $1 ORDER BY a.name LIMIT 1",
        )
        .bind(robot)
        .fetch_optional(&self.pool)
        .await?;
        Ok(place)
    }
}

/// Stores a version, or finds the same document again.
pub(crate) async fn insert_model(
    connection: &mut PgConnection,
    robot: &str,
    floor: &str,
    parent: Option<Uuid>,
    document: &serde_json::Value,
) -> Result<Uuid> {
    let document_id = DiagnosisRecord::document_id(document)?;
    // Numbers of a robot's versions have no holes and no doubles.
    sqlx::query("SELECT pg_advisory_xact_lock(hashtextextended('models ' || $1, 0))")
        .bind(robot)
        .execute(&mut *connection)
        .await?;
    let before: Option<Uuid> = sqlx::query_scalar("SELECT id FROM models WHERE document_id = $1")
        .bind(document_id)
        .fetch_optional(&mut *connection)
        .await?;
    if let Some(id) = before {
        return Ok(id);
    }
    let text = serde_json::to_string(document).map_err(StoreError::corrupt("model"))?;
    let id = sqlx::query_scalar(
        "INSERT INTO models (version, robot, floor, document, document_id, parent)
         SELECT $1 || '/' || count(*) + 1, $1, $2, $3::json, $4, $5 FROM models WHERE robot = $1 RETURNING id",
    )
    .bind(robot)
    .bind(floor)
    .bind(text)
    .bind(document_id)
    .bind(parent)
    .fetch_one(connection)
    .await?;
    Ok(id)
}

pub(crate) async fn model_document(connection: &mut PgConnection, id: Uuid) -> Result<String> {
    let text = sqlx::query_scalar("SELECT document::text FROM models WHERE id = $1")
        .bind(id)
        .fetch_one(connection)
        .await?;
    Ok(text)
}
