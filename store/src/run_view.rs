//! Runs as people see them: state, place in the queue, reason for waiting, files.

use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::state::{fault_from_sql, state_from_sql};
use crate::waiting::{Situation, expected_wait_s, waiting_reason};
use crate::{LIST_LIMIT, RUN_OVERHEAD_S, SILENT_S};
use api::run::{DigestComparison, FileView, RunView};
use chrono::{DateTime, TimeDelta, Utc};
use std::collections::BTreeMap;
use uuid::Uuid;

#[derive(sqlx::FromRow)]
struct RunRow {
    id: Uuid,
    experiment_id: Uuid,
    label: String,
    submitted_by: String,
    state: String,
    epoch: i64,
    created_at: DateTime<Utc>,
    queued_at: Option<DateTime<Utc>>,
    started_at: Option<DateTime<Utc>>,
    ended_at: Option<DateTime<Utc>>,
    fault_whose: Option<String>,
    fault_code: Option<String>,
    fault_message: Option<String>,
    claimed_digest: Option<String>,
    claimed_twin_version: Option<String>,
    server_digest: Option<String>,
    server_twin_version: Option<String>,
    verdict: Option<String>,
    document: String,
    models: String,
    ticks_recorded: Option<i64>,
    ticks_missed: Option<i64>,
    #[sqlx(flatten)]
    situation: SituationRow,
}

#[derive(sqlx::FromRow)]
struct SituationRow {
    arena: String,
    arena_known: bool,
    is_virtual: bool,
    lab_connected: bool,
    stopped: bool,
    held_reason: Option<String>,
    robots_missing: Vec<String>,
    robots_unfit: Vec<String>,
    ahead: i64,
    ahead_s: f64,
    busy_s: Option<f64>,
    read_at: DateTime<Utc>,
}

/// `$1` run overhead, `$2` silence after which a laboratory is offline, both in seconds.
macro_rules! run_select {
    ($tail:literal) => {
        concat!(
            "SELECT r.id, r.experiment_id, e.label, u.name AS submitted_by, r.state, r.epoch, r.created_at, r.queued_at,
                r.started_at, r.ended_at, r.fault_whose, r.fault_code, r.fault_message, e.claimed_digest, e.claimed_twin_version,
                r.server_digest, r.server_twin_version, r.verdict::text AS verdict, e.document::text AS document,
                (SELECT coalesce(json_object_agg(x.robot, m.version), '{}')::text FROM experiment_models x JOIN models m ON m.id = x.model_id
                    WHERE x.experiment_id = e.id) AS models,
                r.ticks_recorded, r.ticks_missed, r.arena, a.name IS NOT NULL AS arena_known,
                r.side = 'virtual' AS is_virtual,
                CASE WHEN r.side = 'virtual' THEN coalesce(a.simulator_seen_at > clock_timestamp() - make_interval(secs => $2 + 30), false)
                        OR EXISTS (SELECT FROM leases l WHERE l.arena = r.arena AND l.side = r.side AND l.expires_at > clock_timestamp())
                    ELSE coalesce(s.seen_at > clock_timestamp() - make_interval(secs => $2), false) END AS lab_connected,
                r.side = 'physical' AND coalesce(s.stopped, false) AS stopped,
                CASE WHEN r.side = 'physical' AND a.held_until > clock_timestamp() THEN a.held_reason END AS held_reason,
                CASE WHEN r.state = 'queued' THEN ARRAY(SELECT n FROM unnest(r.robot_names) n
                    WHERE NOT EXISTS (SELECT FROM robots x WHERE x.arena = r.arena AND x.name = n)) ELSE '{}' END AS robots_missing,
                CASE WHEN r.state = 'queued' AND r.side = 'physical' THEN ARRAY(SELECT x.name || ' ' || robot_unfit_reason(x.battery, x.stalled, x.sensor_fault)
                    FROM robot_status x WHERE x.arena = r.arena AND x.name = ANY(r.robot_names)
                      AND robot_unfit_reason(x.battery, x.stalled, x.sensor_fault) IS NOT NULL ORDER BY x.name) ELSE '{}' END AS robots_unfit,
                q.ahead, q.ahead_s, b.busy_s, clock_timestamp() AS read_at
             FROM runs r
             JOIN experiments e ON e.id = r.experiment_id
             JOIN users u ON u.id = r.user_id
             LEFT JOIN arenas a ON a.name = r.arena
             LEFT JOIN arena_status s ON s.arena = r.arena
             LEFT JOIN LATERAL (SELECT count(*) AS ahead, coalesce(sum(o.duration_s + $1), 0)::float8 AS ahead_s FROM runs o
                WHERE r.state = 'queued' AND o.state = 'queued' AND o.arena = r.arena AND o.side = r.side AND o.queue_number < r.queue_number) q ON true
             LEFT JOIN LATERAL (SELECT greatest(0, c.duration_s + $1 - extract(epoch FROM clock_timestamp() - c.claimed_at))::float8 AS busy_s
                FROM leases l JOIN runs c ON c.id = l.run_id WHERE r.state = 'queued' AND l.arena = r.arena AND l.side = r.side) b ON true ",
            $tail
        )
    };
}

impl Store {
    /// One run with its place in the queue, expected start and reason for waiting.
    pub async fn run_get(&self, id: Uuid) -> Result<Option<RunView>> {
        let row: Option<RunRow> = sqlx::query_as(run_select!("WHERE r.id = $3"))
            .bind(RUN_OVERHEAD_S)
            .bind(SILENT_S)
            .bind(id)
            .fetch_optional(&self.pool)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let mut files = self.file_views(&[id]).await?;
        row.into_view(files.remove(&id).unwrap_or_default()).map(Some)
    }

    /// Newest first; of one user when given.
    pub async fn run_list(&self, limit: i64, user: Option<&str>) -> Result<Vec<RunView>> {
        let rows: Vec<RunRow> = sqlx::query_as(run_select!(
            "WHERE $4::text IS NULL OR u.name = $4 ORDER BY r.queue_number DESC LIMIT $3"
        ))
        .bind(RUN_OVERHEAD_S)
        .bind(SILENT_S)
        .bind(limit.clamp(0, LIST_LIMIT))
        .bind(user)
        .fetch_all(&self.pool)
        .await?;
        let ids: Vec<Uuid> = rows.iter().map(|row| row.id).collect();
        let mut files = self.file_views(&ids).await?;
        rows.into_iter()
            .map(|row| {
                let of_run = files.remove(&row.id).unwrap_or_default();
                row.into_view(of_run)
            })
            .collect()
    }

    /// Files of the rehearsal and of the newest attempt, by run.
    async fn file_views(&self, ids: &[Uuid]) -> Result<BTreeMap<Uuid, Vec<FileView>>> {
        let rows: Vec<(Uuid, String, i64, String, String)> = sqlx::query_as(
            "SELECT DISTINCT ON (f.run_id, f.name) f.run_id, f.name, f.bytes, f.sha256, f.media_type
             FROM run_files f JOIN runs r ON r.id = f.run_id AND f.epoch IN (0, r.epoch)
             WHERE f.run_id = ANY($1) ORDER BY f.run_id, f.name, f.epoch DESC",
        )
        .bind(ids)
        .fetch_all(&self.pool)
        .await?;
        let mut files: BTreeMap<Uuid, Vec<FileView>> = BTreeMap::new();
        for (run_id, name, bytes, sha256, media_type) in rows {
            files.entry(run_id).or_default().push(FileView {
                name,
                bytes,
                sha256,
                media_type,
            });
        }
        Ok(files)
    }
}

impl RunRow {
    fn into_view(self, files: Vec<FileView>) -> Result<RunView> {
        let state = state_from_sql(&self.state);
        let read_at = self.situation.read_at;
        let situation = self.situation.into_situation();
        let queued = state == api::run::RunState::Queued;
        let equal = self
            .claimed_digest
            .as_ref()
            .zip(self.server_digest.as_ref())
            .map(|(claimed, server)| claimed == server);
        let wait = expected_wait_s(state, &situation).map(|wait_s| TimeDelta::milliseconds((wait_s * 1e3) as i64));
        Ok(RunView {
            id: self.id,
            experiment_id: self.experiment_id,
            label: self.label,
            submitted_by: self.submitted_by,
            state,
            epoch: self.epoch,
            queue_position: queued.then_some(situation.ahead + 1),
            expected_start: wait.and_then(|wait| read_at.checked_add_signed(wait)),
            waiting_reason: waiting_reason(state, &situation),
            created_at: self.created_at,
            queued_at: self.queued_at,
            started_at: self.started_at,
            ended_at: self.ended_at,
            fault: fault_from_sql(self.fault_whose, self.fault_code, self.fault_message),
            digest: DigestComparison {
                claimed: self.claimed_digest,
                claimed_twin_version: self.claimed_twin_version,
                server: self.server_digest,
                server_twin_version: self.server_twin_version,
                equal,
            },
            verdict: self
                .verdict
                .map(|text| serde_json::from_str(&text))
                .transpose()
                .map_err(StoreError::corrupt("verdict"))?,
            experiment: serde_json::from_str(&self.document).map_err(StoreError::corrupt("experiment"))?,
            models: serde_json::from_str(&self.models).map_err(StoreError::corrupt("models"))?,
            files,
            ticks_recorded: self.ticks_recorded,
            ticks_missed: self.ticks_missed,
        })
    }
}

impl SituationRow {
    fn into_situation(self) -> Situation {
        Situation {
            arena: self.arena,
            arena_known: self.arena_known,
            is_virtual: self.is_virtual,
            lab_connected: self.lab_connected,
            stopped: self.stopped,
            held_reason: self.held_reason,
            robots_missing: self.robots_missing,
            robots_unfit: self.robots_unfit,
            ahead: self.ahead,
            ahead_s: self.ahead_s,
            busy_s: self.busy_s,
        }
    }
}
