//! Published models of robots on floors.

use crate::LIST_LIMIT;
use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::outcome::Model;
use chrono::{DateTime, Utc};
use uuid::Uuid;

#[derive(sqlx::FromRow)]
struct ModelRow {
    id: Uuid,
    version: String,
    robot: String,
    floor: String,
    created_at: DateTime<Utc>,
    document: String,
}

impl Store {
    /// Newest first.
    pub async fn model_list(&self) -> Result<Vec<Model>> {
        let rows: Vec<ModelRow> = sqlx::query_as(
            "SELECT id, version, robot, floor, created_at, document::text AS document FROM models ORDER BY created_at DESC, id LIMIT $1",
        )
        .bind(LIST_LIMIT)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter()
            .map(|row| {
                Ok(Model {
                    document: serde_json::from_str(&row.document).map_err(StoreError::corrupt("model"))?,
                    id: row.id,
                    version: row.version,
                    robot: row.robot,
                    floor: row.floor,
                    created_at: row.created_at,
                })
            })
            .collect()
    }
}
