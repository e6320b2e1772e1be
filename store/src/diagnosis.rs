//! Diagnoses as people see them: asking for one, looking, cancelling, and the run that a report proposes.

use crate::LIST_LIMIT;
use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::identity::user_id;
use crate::outcome::{DiagnosisCancelled, DiagnosisSubmitted, FileRecord, NewDiagnosis};
use api::diagnosis::{DiagnosisOrigin, DiagnosisProblem, DiagnosisState, DiagnosisView};
use chrono::{DateTime, Utc};
use sqlx::PgConnection;
use uuid::Uuid;

/// Most diagnoses of a robot that wait or run at a time.
pub const DIAGNOSES_OPEN_MOST: i64 = 8;

#[derive(sqlx::FromRow)]
struct DiagnosisRow {
    id: Uuid,
    robot: String,
    arena: String,
    floor: String,
    requested_by: String,
    origin: String,
    follows: Option<Uuid>,
    reference_runs: Vec<Uuid>,
    changed_runs: Vec<Uuid>,
    locked_runs: Vec<Uuid>,
    parent_model: Option<String>,
    state: String,
    cancel_requested: bool,
    progress: f64,
    stage: String,
    verdict: Option<String>,
    sentence: Option<String>,
    model: Option<String>,
    model_is_current: bool,
    problem_code: Option<String>,
    problem_message: Option<String>,
    next_why: Option<String>,
    next_run: Option<Uuid>,
    follow_up: Option<Uuid>,
    created_at: DateTime<Utc>,
    started_at: Option<DateTime<Utc>>,
    ended_at: Option<DateTime<Utc>>,
}

macro_rules! diagnosis_select {
    ($tail:literal) => {
        concat!(
            "SELECT d.id, d.robot, d.arena, d.floor, u.name AS requested_by, d.origin, d.follows,
                ARRAY(SELECT run_id FROM diagnosis_runs x WHERE x.diagnosis_id = d.id AND role = 'reference' ORDER BY place) AS reference_runs,
                ARRAY(SELECT run_id FROM diagnosis_runs x WHERE x.diagnosis_id = d.id AND role = 'changed' ORDER BY place) AS changed_runs,
                ARRAY(SELECT run_id FROM diagnosis_runs x WHERE x.diagnosis_id = d.id AND role = 'locked' ORDER BY place) AS locked_runs,
                p.version AS parent_model, d.state, d.cancel_requested, d.progress, d.stage, d.verdict, d.sentence,
                m.version AS model, coalesce(current_model(d.robot, d.floor) = d.model_id, false) AS model_is_current,
                d.problem_code, d.problem_message, d.next_why, d.next_run,
                (SELECT f.id FROM diagnoses f WHERE f.follows = d.id AND f.origin = 'follow_up') AS follow_up,
                d.created_at, d.started_at, d.ended_at
             FROM diagnoses d JOIN users u ON u.id = d.user_id
             LEFT JOIN models p ON p.id = d.parent_model LEFT JOIN models m ON m.id = d.model_id ",
            $tail
        )
    };
}

impl Store {
    /// Stores a diagnosis that waits for a worker. The caller has checked the runs.
    pub async fn diagnosis_submit(&self, new: NewDiagnosis) -> Result<DiagnosisSubmitted> {
        let mut transaction = self.pool.begin().await?;
        let user = user_id(&mut transaction, &new.user).await?;
        let id = Uuid::now_v7();
        if let Some(key) = &new.idempotency_key {
            match reserve_key(&mut transaction, user, key, &new.request_hash, id).await? {
                Reserved::New => {}
                Reserved::Before(before) => {
                    let view = diagnosis_view(&mut transaction, before).await?;
                    return view
                        .map(DiagnosisSubmitted::Replayed)
                        .ok_or(StoreError::Constraint("diagnosis_keys_diagnosis".to_owned()));
                }
                Reserved::OtherBody => return Ok(DiagnosisSubmitted::Conflict),
            }
        }
        let open: i64 = sqlx::query_scalar(
            "SELECT count(*) FROM diagnoses WHERE robot = $1 AND floor = $2 AND state IN ('queued', 'running')",
        )
        .bind(&new.robot)
        .bind(&new.floor)
        .fetch_one(&mut *transaction)
        .await?;
        if open >= DIAGNOSES_OPEN_MOST {
            return Ok(DiagnosisSubmitted::TooMany { open });
        }
        insert_diagnosis(&mut transaction, id, user, &new).await?;
        let view = diagnosis_view(&mut transaction, id).await?;
        transaction.commit().await?;
        view.map(DiagnosisSubmitted::Created)
            .ok_or(StoreError::Constraint("diagnoses_user".to_owned()))
    }

    /// What came of an earlier request with this key; none when the key is new or too old.
    pub async fn diagnosis_submitted_before(
        &self,
        user: &str,
        key: &str,
        request_hash: &[u8; 32],
    ) -> Result<Option<DiagnosisSubmitted>> {
        let before: Option<(Vec<u8>, Uuid)> = sqlx::query_as(
            "SELECT k.request_hash, k.diagnosis_id FROM diagnosis_keys k JOIN users u ON u.id = k.user_id
             WHERE u.name = $1 AND k.key = $2 AND k.created_at >= clock_timestamp() - interval '24 hours'",
        )
        .bind(user)
        .bind(key)
        .fetch_optional(&self.pool)
        .await?;
        match before {
            None => Ok(None),
            Some((hash, _)) if hash != request_hash => Ok(Some(DiagnosisSubmitted::Conflict)),
            Some((_, id)) => Ok(self.diagnosis_get(id).await?.map(DiagnosisSubmitted::Replayed)),
        }
    }

    pub async fn diagnosis_get(&self, id: Uuid) -> Result<Option<DiagnosisView>> {
        diagnosis_view(&mut *self.pool.acquire().await?, id).await
    }

    /// Newest first; of one robot and of one user when given.
    pub async fn diagnosis_list(
        &self,
        limit: i64,
        robot: Option<&str>,
        user: Option<&str>,
    ) -> Result<Vec<DiagnosisView>> {
        let rows: Vec<DiagnosisRow> = sqlx::query_as(diagnosis_select!(
            "WHERE ($2::text IS NULL OR d.robot = $2) AND ($3::text IS NULL OR u.name = $3)
             ORDER BY d.created_at DESC, d.id DESC LIMIT $1"
        ))
        .bind(limit.clamp(0, LIST_LIMIT))
        .bind(robot)
        .bind(user)
        .fetch_all(&self.pool)
        .await?;
        Ok(rows.into_iter().map(DiagnosisRow::into_view).collect())
    }

    /// `report.json` as it was written; none before the diagnosis is done.
    pub async fn diagnosis_report(&self, id: Uuid) -> Result<Option<String>> {
        let text: Option<Option<String>> = sqlx::query_scalar("SELECT report::text FROM diagnoses WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?;
        Ok(text.flatten())
    }

    /// `report.html` in the object folder; none before the diagnosis is done.
    pub async fn diagnosis_page(&self, id: Uuid) -> Result<Option<FileRecord>> {
        let row: Option<(String, String, i64)> = sqlx::query_as(
            "SELECT page_path, page_sha256, page_bytes FROM diagnoses WHERE id = $1 AND page_path IS NOT NULL",
        )
        .bind(id)
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.map(|(object_path, sha256, bytes)| FileRecord {
            name: "report.html".to_owned(),
            bytes,
            sha256,
            media_type: "text/html; charset=utf-8".to_owned(),
            object_path,
        }))
    }

    /// Ends a diagnosis that waits at once; asks the worker of one that runs to stop.
    pub async fn diagnosis_cancel(&self, id: Uuid, by: &str) -> Result<DiagnosisCancelled> {
        let mut transaction = self.pool.begin().await?;
        let state: Option<String> = sqlx::query_scalar("SELECT state FROM diagnoses WHERE id = $1 FOR UPDATE")
            .bind(id)
            .fetch_optional(&mut *transaction)
            .await?;
        let Some(state) = state.map(|name| state_of(&name)) else {
            return Ok(DiagnosisCancelled::Unknown);
        };
        if state.is_terminal() {
            return Ok(DiagnosisCancelled::Ended(state));
        }
        let waits = state == DiagnosisState::Queued;
        sqlx::query(
            "UPDATE diagnoses SET cancel_requested = true, cancel_requested_by = coalesce(cancel_requested_by, $2),
                state = CASE WHEN $3 THEN 'cancelled' ELSE state END,
                problem_code = CASE WHEN $3 THEN 'cancelled_by_user' END,
                problem_message = CASE WHEN $3 THEN 'Cancelled by ' || $2 || '.' END,
                ended_at = CASE WHEN $3 THEN clock_timestamp() END
             WHERE id = $1",
        )
        .bind(id)
        .bind(by)
        .bind(waits)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(if waits {
            DiagnosisCancelled::AtOnce
        } else {
            DiagnosisCancelled::Requested
        })
    }

    /// Links the run of the proposed experiment unless another was linked meanwhile; false then.
    ///
    /// - `before`: the run that was linked when the caller looked.
    pub async fn diagnosis_next_run_set(&self, id: Uuid, before: Option<Uuid>, run: Uuid) -> Result<bool> {
        let linked =
            sqlx::query("UPDATE diagnoses SET next_run = $3 WHERE id = $1 AND next_run IS NOT DISTINCT FROM $2")
                .bind(id)
                .bind(before)
                .bind(run)
                .execute(&self.pool)
                .await?;
        Ok(linked.rows_affected() == 1)
    }

    /// Queues a diagnosis for every proposed run that is done and has none: the same runs and this one.
    pub async fn diagnoses_follow_up(&self) -> Result<Vec<Uuid>> {
        let waiting: Vec<Uuid> = sqlx::query_scalar(
            "SELECT d.id FROM diagnoses d JOIN runs r ON r.id = d.next_run
             WHERE r.state = 'done' AND NOT EXISTS (SELECT FROM diagnoses f WHERE f.follows = d.id AND f.origin = 'follow_up')
             ORDER BY d.created_at LIMIT 16",
        )
        .fetch_all(&self.pool)
        .await?;
        let mut made = Vec::new();
        for earlier in waiting {
            made.extend(self.follow_up(earlier).await?);
        }
        Ok(made)
    }

    async fn follow_up(&self, earlier: Uuid) -> Result<Option<Uuid>> {
        let mut transaction = self.pool.begin().await?;
        let id = Uuid::now_v7();
        let made = sqlx::query(
            "INSERT INTO diagnoses (id, user_id, robot, arena, floor, origin, follows, parent_model)
             SELECT $2, user_id, robot, arena, floor, 'follow_up', id, parent_model FROM diagnoses WHERE id = $1
             ON CONFLICT DO NOTHING",
        )
        .bind(earlier)
        .bind(id)
        .execute(&mut *transaction)
        .await?;
        if made.rows_affected() == 0 {
            return Ok(None);
        }
        sqlx::query(
            "INSERT INTO diagnosis_runs (diagnosis_id, run_id, role, place)
             SELECT $2, run_id, role, place FROM diagnosis_runs WHERE diagnosis_id = $1
             UNION ALL SELECT $2, next_run, 'changed', 1000 FROM diagnoses WHERE id = $1
             ON CONFLICT DO NOTHING",
        )
        .bind(earlier)
        .bind(id)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(Some(id))
    }
}

pub(crate) async fn insert_diagnosis(
    connection: &mut PgConnection,
    id: Uuid,
    user: Uuid,
    new: &NewDiagnosis,
) -> Result<()> {
    sqlx::query(
        "INSERT INTO diagnoses (id, user_id, robot, arena, floor, origin, parent_model) VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(id)
    .bind(user)
    .bind(&new.robot)
    .bind(&new.arena)
    .bind(&new.floor)
    .bind(new.origin.as_str())
    .bind(new.parent_model)
    .execute(&mut *connection)
    .await?;
    for (role, runs) in [
        ("reference", &new.reference_runs),
        ("changed", &new.changed_runs),
        ("locked", &new.locked_runs),
    ] {
        sqlx::query(
            "INSERT INTO diagnosis_runs (diagnosis_id, run_id, role, place)
             SELECT $1, n.run, $2, n.place::int FROM unnest($3::uuid[]) WITH ORDINALITY n(run, place)",
        )
        .bind(id)
        .bind(role)
        .bind(runs)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

async fn diagnosis_view(connection: &mut PgConnection, id: Uuid) -> Result<Option<DiagnosisView>> {
    let row: Option<DiagnosisRow> = sqlx::query_as(diagnosis_select!("WHERE d.id = $1"))
        .bind(id)
        .fetch_optional(connection)
        .await?;
    Ok(row.map(DiagnosisRow::into_view))
}

enum Reserved {
    New,
    Before(Uuid),
    OtherBody,
}

/// Waits for a parallel request with the same key and then sees what it stored.
async fn reserve_key(
    connection: &mut PgConnection,
    user: Uuid,
    key: &str,
    hash: &[u8; 32],
    id: Uuid,
) -> Result<Reserved> {
    let reserved = sqlx::query(
        "INSERT INTO diagnosis_keys AS k (user_id, key, request_hash, diagnosis_id) VALUES ($1, $2, $3, $4)
         ON CONFLICT (user_id, key) DO UPDATE
            SET request_hash = excluded.request_hash, diagnosis_id = excluded.diagnosis_id, created_at = clock_timestamp()
            WHERE k.created_at < clock_timestamp() - interval '24 hours'",
    )
    .bind(user)
    .bind(key)
    .bind(&hash[..])
    .bind(id)
    .execute(&mut *connection)
    .await?;
    if reserved.rows_affected() == 1 {
        return Ok(Reserved::New);
    }
    let (before, id): (Vec<u8>, Uuid) =
        sqlx::query_as("SELECT request_hash, diagnosis_id FROM diagnosis_keys WHERE user_id = $1 AND key = $2")
            .bind(user)
            .bind(key)
            .fetch_one(connection)
            .await?;
    Ok(if before == hash {
        Reserved::Before(id)
    } else {
        Reserved::OtherBody
    })
}

/// State of a name that a CHECK constraint has let in.
pub(crate) fn state_of(name: &str) -> DiagnosisState {
    match DiagnosisState::ALL.into_iter().find(|state| state.as_str() == name) {
        Some(state) => state,
        None => unreachable!("the constraint diagnoses_state_known let `{name}` in"),
    }
}

impl DiagnosisRow {
    fn into_view(self) -> DiagnosisView {
        let origin = DiagnosisOrigin::ALL.into_iter().find(|one| one.as_str() == self.origin);
        DiagnosisView {
            id: self.id,
            robot: self.robot,
            arena: self.arena,
            floor: self.floor,
            requested_by: self.requested_by,
            origin: origin.unwrap_or(DiagnosisOrigin::Person),
            follows: self.follows,
            reference_runs: self.reference_runs,
            changed_runs: self.changed_runs,
            locked_runs: self.locked_runs,
            parent_model: self.parent_model,
            state: state_of(&self.state),
            cancel_requested: self.cancel_requested,
            progress: self.progress,
            stage: self.stage,
            verdict: self.verdict,
            sentence: self.sentence,
            model: self.model,
            model_is_current: self.model_is_current,
            problem: self
                .problem_code
                .zip(self.problem_message)
                .map(|(code, message)| DiagnosisProblem { code, message }),
            next_why: self.next_why,
            next_run: self.next_run,
            follow_up: self.follow_up,
            created_at: self.created_at,
            started_at: self.started_at,
            ended_at: self.ended_at,
        }
    }
}
