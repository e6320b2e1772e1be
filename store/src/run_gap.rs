//! Gaps of finished runs against their robots' current models, the runs that count as references, and the diagnoses
//! that large gaps ask for.

use crate::connect::Store;
use crate::diagnosis::insert_diagnosis;
use crate::error::{Result, StoreError};
use crate::outcome::{GapWork, MeasuredGap, NewDiagnosis};
use api::diagnosis::{CHANGED_RUNS_LEAST, DiagnosisOrigin};
use api::model::{HorizonGap, RobotGaps, RunGap};
use chrono::{DateTime, Utc};
use uuid::Uuid;

/// The horizon that decides, s.
pub const GAP_HORIZON_S: f64 = 2.0;
/// A run asks for a diagnosis above this multiple of the references' gap.
pub const GAP_MARGIN: f64 = 1.5;
/// Fewest references that give a floor.
pub const GAP_REFERENCES_LEAST: i64 = 2;
/// Newest runs that gaps are kept for; older ones keep what they have.
const RUNS_LOOKED_AT: i64 = 300;
/// Most runs that a diagnosis takes by itself.
const AUTOMATIC_RUNS_MOST: i64 = 8;

#[derive(sqlx::FromRow)]
struct GapRow {
    run: Uuid,
    label: String,
    submitted_by: String,
    ended_at: Option<DateTime<Utc>>,
    is_reference: bool,
    horizons: Option<String>,
    problem: Option<String>,
}

#[derive(sqlx::FromRow)]
struct LargeGaps {
    robot: String,
    floor: String,
    model: Option<Uuid>,
    runs: Vec<Uuid>,
    references: Vec<Uuid>,
}

impl Store {
    /// Finished runs whose gap to the current model is not known yet, newest first.
    pub async fn gap_work(&self, limit: i64) -> Result<Vec<GapWork>> {
        let rows: Vec<(Uuid, String, Option<Uuid>, Option<String>)> = sqlx::query_as(
            "SELECT r.id, n.robot, c.model, m.document::text
             FROM (SELECT id, experiment_id, robot_names, queue_number FROM runs WHERE state = 'done' AND side = 'physical' ORDER BY queue_number DESC LIMIT $1) r
             JOIN experiments e ON e.id = r.experiment_id
             CROSS JOIN LATERAL unnest(r.robot_names) n(robot)
             CROSS JOIN LATERAL (SELECT current_model(n.robot, e.document->>'floor') AS model) c
             LEFT JOIN models m ON m.id = c.model
             WHERE NOT EXISTS (SELECT FROM run_gaps g WHERE g.run_id = r.id AND g.robot = n.robot AND g.model_id IS NOT DISTINCT FROM c.model)
             ORDER BY r.queue_number DESC, n.robot LIMIT $2",
        )
        .bind(RUNS_LOOKED_AT)
        .bind(limit)
        .fetch_all(&self.pool)
        .await?;
        Ok(rows
            .into_iter()
            .map(|(run, robot, model, document)| GapWork {
                run,
                robot,
                model,
                document,
            })
            .collect())
    }

    /// Keeps a gap with its run; the first one stays.
    pub async fn gap_put(&self, work: &GapWork, gap: &MeasuredGap) -> Result<()> {
        let horizons = gap.as_ref().ok().map(serde_json::to_string).transpose();
        let position_m = gap.as_ref().ok().and_then(|horizons| {
            let at = horizons.iter().find(|gap| gap.horizon_s == GAP_HORIZON_S);
            at.filter(|gap| gap.samples > 0).map(|gap| gap.position_m)
        });
        sqlx::query(
            "INSERT INTO run_gaps (run_id, robot, model_id, horizons, position_m, problem) VALUES ($1, $2, $3, $4::json, $5, $6)
             ON CONFLICT DO NOTHING",
        )
        .bind(work.run)
        .bind(&work.robot)
        .bind(work.model)
        .bind(horizons.map_err(StoreError::corrupt("gap"))?)
        .bind(position_m)
        .bind(gap.as_ref().err())
        .execute(&self.pool)
        .await?;
        Ok(())
    }

    /// Finished runs of a robot on a floor against its current model, newest first; of one user when given.
    pub async fn robot_gaps(&self, robot: &str, floor: &str, user: Option<&str>) -> Result<RobotGaps> {
        let current = self.robot_model(robot, floor).await?;
        let rows: Vec<GapRow> = sqlx::query_as(
            "SELECT r.id AS run, e.label, u.name AS submitted_by, r.ended_at, f.run_id IS NOT NULL AS is_reference,
                g.horizons::text AS horizons, g.problem
             FROM runs r JOIN experiments e ON e.id = r.experiment_id JOIN users u ON u.id = r.user_id
             LEFT JOIN robot_references f ON f.run_id = r.id AND f.robot = $1 AND f.floor = $2
             LEFT JOIN run_gaps g ON g.run_id = r.id AND g.robot = $1 AND g.model_id IS NOT DISTINCT FROM $3
             WHERE r.state = 'done' AND r.side = 'physical' AND $1 = ANY(r.robot_names) AND e.document->>'floor' = $2 AND ($4::text IS NULL OR u.name = $4)
             ORDER BY r.queue_number DESC LIMIT $5",
        )
        .bind(robot)
        .bind(floor)
        .bind(current.model)
        .bind(user)
        .bind(RUNS_LOOKED_AT)
        .fetch_all(&self.pool)
        .await?;
        let floor_m: Option<f64> = sqlx::query_scalar(
            "SELECT CASE WHEN count(*) >= $4 THEN sqrt(avg(g.position_m * g.position_m)) END FROM robot_references f
             JOIN run_gaps g ON g.run_id = f.run_id AND g.robot = f.robot AND g.model_id IS NOT DISTINCT FROM $3
             WHERE f.robot = $1 AND f.floor = $2 AND g.position_m IS NOT NULL",
        )
        .bind(robot)
        .bind(floor)
        .bind(current.model)
        .bind(GAP_REFERENCES_LEAST)
        .fetch_one(&self.pool)
        .await?;
        let runs = rows.into_iter().map(GapRow::into_view).collect::<Result<_>>()?;
        Ok(RobotGaps {
            robot: current.robot,
            floor: current.floor,
            model: current.model,
            version: current.version,
            horizon_s: GAP_HORIZON_S,
            floor_position_m: floor_m,
            limit_position_m: floor_m.map(|floor_m| GAP_MARGIN * floor_m),
            drift: None,
            runs,
        })
    }

    /// Replaces the set of runs in which nothing was changed.
    pub async fn robot_references_set(&self, robot: &str, floor: &str, runs: &[Uuid], by: &str) -> Result<()> {
        let mut transaction = self.pool.begin().await?;
        sqlx::query("DELETE FROM robot_references WHERE robot = $1 AND floor = $2 AND run_id <> ALL($3)")
            .bind(robot)
            .bind(floor)
            .bind(runs)
            .execute(&mut *transaction)
            .await?;
        sqlx::query(
            "INSERT INTO robot_references (robot, floor, run_id, set_by) SELECT $1, $2, n.run, $4 FROM unnest($3::uuid[]) n(run)
             ON CONFLICT DO NOTHING",
        )
        .bind(robot)
        .bind(floor)
        .bind(runs)
        .bind(by)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(())
    }

    /// Queues a diagnosis for every robot that has a run above the limit which no diagnosis has looked at; at most one
    /// open per robot and floor. Their ids.
    pub async fn diagnoses_of_gaps(&self) -> Result<Vec<Uuid>> {
        let found: Vec<LargeGaps> = sqlx::query_as(
            "WITH sets AS (
                SELECT s.robot, s.floor, current_model(s.robot, s.floor) AS model
                FROM (SELECT DISTINCT robot, floor FROM robot_references) s
                WHERE NOT EXISTS (SELECT FROM diagnoses d WHERE d.robot = s.robot AND d.floor = s.floor AND d.state IN ('queued', 'running'))),
             floors AS (
                SELECT s.robot, s.floor, s.model, $1 * sqrt(avg(g.position_m * g.position_m)) AS limit_m, array_agg(f.run_id ORDER BY f.run_id) AS refs
                FROM sets s JOIN robot_references f ON f.robot = s.robot AND f.floor = s.floor
                JOIN run_gaps g ON g.run_id = f.run_id AND g.robot = s.robot AND g.model_id IS NOT DISTINCT FROM s.model AND g.position_m IS NOT NULL
                GROUP BY s.robot, s.floor, s.model HAVING count(*) >= $2)
             SELECT l.robot, l.floor, l.model, l.refs AS references,
                ARRAY(SELECT r.id FROM run_gaps g JOIN runs r ON r.id = g.run_id JOIN experiments e ON e.id = r.experiment_id
                    WHERE g.robot = l.robot AND g.model_id IS NOT DISTINCT FROM l.model AND g.position_m > l.limit_m AND r.state = 'done'
                      AND e.document->>'floor' = l.floor
                      AND NOT EXISTS (SELECT FROM robot_references f WHERE f.robot = l.robot AND f.floor = l.floor AND f.run_id = r.id)
                    ORDER BY r.queue_number DESC LIMIT $3) AS runs
             FROM floors l",
        )
        .bind(GAP_MARGIN)
        .bind(GAP_REFERENCES_LEAST)
        .bind(AUTOMATIC_RUNS_MOST)
        .fetch_all(&self.pool)
        .await?;
        let mut made = Vec::new();
        for large in found.iter().filter(|large| large.runs.len() >= CHANGED_RUNS_LEAST) {
            made.extend(self.diagnosis_of_gap(large).await?);
        }
        Ok(made)
    }

    async fn diagnosis_of_gap(&self, large: &LargeGaps) -> Result<Option<Uuid>> {
        let mut transaction = self.pool.begin().await?;
        let newest: Option<(Uuid, Uuid, String)> = sqlx::query_as(
            "SELECT r.id, r.user_id, r.arena FROM runs r
             WHERE r.id = ANY($1) AND NOT EXISTS (SELECT FROM diagnosis_runs x JOIN diagnoses d ON d.id = x.diagnosis_id
                WHERE x.run_id = r.id AND d.robot = $2)
             ORDER BY r.queue_number DESC LIMIT 1",
        )
        .bind(&large.runs)
        .bind(&large.robot)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some((_, user, arena)) = newest else {
            return Ok(None);
        };
        let id = Uuid::now_v7();
        let new = NewDiagnosis {
            user: String::new(),
            robot: large.robot.clone(),
            arena,
            floor: large.floor.clone(),
            origin: DiagnosisOrigin::Gap,
            parent_model: large.model,
            reference_runs: large.references.clone(),
            changed_runs: large.runs.iter().rev().copied().collect(),
            locked_runs: Vec::new(),
            idempotency_key: None,
            request_hash: [0; 32],
        };
        match insert_diagnosis(&mut transaction, id, user, &new).await {
            // Another sweep was faster.
            Err(StoreError::Constraint(name)) if name == "diagnoses_one_of_gap" => return Ok(None),
            inserted => inserted?,
        }
        transaction.commit().await?;
        Ok(Some(id))
    }
}

impl GapRow {
    fn into_view(self) -> Result<RunGap> {
        let horizons: Option<Vec<HorizonGap>> = self
            .horizons
            .map(|text| serde_json::from_str(&text))
            .transpose()
            .map_err(StoreError::corrupt("gap"))?;
        Ok(RunGap {
            run: self.run,
            label: self.label,
            submitted_by: self.submitted_by,
            ended_at: self.ended_at,
            is_reference: self.is_reference,
            horizons: horizons.unwrap_or_default(),
            problem: self.problem,
        })
    }
}
