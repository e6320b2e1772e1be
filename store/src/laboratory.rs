//! What laboratories register and report: arenas, robots, their health.

use crate::SILENT_S;
use crate::connect::Store;
use crate::error::{Result, StoreError};
use crate::robot_health::{HealthColumns, HealthRow};
use api::arena::{Arena, ArenaView, Contents};
use api::lab::{LabDescription, LabStatus};
use api::robot::{LabRobot, RobotView};
use sqlx::PgConnection;

#[derive(sqlx::FromRow)]
struct RobotRow {
    arena: String,
    name: String,
    document: String,
    heard: bool,
    online: bool,
    leased: bool,
    bus_v: Option<f64>,
    unfit: Option<String>,
    #[sqlx(flatten)]
    health: HealthRow,
}

#[derive(sqlx::FromRow)]
struct ArenaRow {
    name: String,
    width_m: f64,
    height_m: f64,
    floor: String,
    contents: Option<String>,
    connected: bool,
    stopped: bool,
    leased: bool,
    held_reason: Option<String>,
    stop_url: Option<String>,
}

impl Store {
    /// Takes the laboratory's description as it is now. It has just checked itself, so its arena is no longer held.
    pub async fn lab_register(&self, lab: &LabDescription) -> Result<()> {
        let mut transaction = self.pool.begin().await?;
        let arena = &lab.arena;
        let contents = arena.contents.as_ref().map(serde_json::to_string).transpose();
        let contents = contents.map_err(StoreError::corrupt("arena"))?;
        sqlx::query(
            "INSERT INTO arenas (name, lab, width_m, height_m, floor, contents, stop_url) VALUES ($1, $2, $3, $4, $5, $6::json, $7)
             ON CONFLICT (name) DO UPDATE SET lab = excluded.lab, width_m = excluded.width_m, height_m = excluded.height_m,
                floor = excluded.floor, contents = excluded.contents, stop_url = excluded.stop_url, registered_at = clock_timestamp(), held_until = NULL, held_reason = NULL",
        )
        .bind(&arena.name)
        .bind(&lab.name)
        .bind(arena.width_m)
        .bind(arena.height_m)
        .bind(&arena.floor)
        .bind(contents)
        .bind(&lab.stop_url)
        .execute(&mut *transaction)
        .await?;
        replace_robots(&mut transaction, &arena.name, &lab.robots).await?;
        sqlx::query(
            "INSERT INTO arena_status (arena, stopped, seen_at) VALUES ($1, false, clock_timestamp())
             ON CONFLICT (arena) DO UPDATE SET seen_at = clock_timestamp()",
        )
        .bind(&arena.name)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(())
    }

    /// Takes a laboratory's health report; false when it has not registered that arena.
    pub async fn lab_status_put(&self, status: &LabStatus) -> Result<bool> {
        let mut transaction = self.pool.begin().await?;
        let known = sqlx::query(
            "INSERT INTO arena_status (arena, stopped, seen_at) SELECT name, $3, clock_timestamp() FROM arenas WHERE name = $1 AND lab = $2
             ON CONFLICT (arena) DO UPDATE SET stopped = excluded.stopped, seen_at = excluded.seen_at",
        )
        .bind(&status.arena)
        .bind(&status.lab)
        .bind(status.stopped)
        .execute(&mut *transaction)
        .await?;
        if known.rows_affected() == 0 {
            return Ok(false);
        }
        let names: Vec<&str> = status.robots.iter().map(|robot| robot.name.as_str()).collect();
        let online: Vec<bool> = status.robots.iter().map(|robot| robot.online).collect();
        let bus_v: Vec<Option<f64>> = status.robots.iter().map(|robot| robot.bus_v).collect();
        let columns = HealthColumns::of(&status.robots);
        sqlx::query(
            "INSERT INTO robot_status (arena, name, online, bus_v, battery, rest_v, stalled, sensor_fault, bounded_estimate,
                loss_share, delay_p50_ms, delay_p95_ms, jitter_ms, activity, seen_at)
             SELECT DISTINCT ON (r.name) $1, r.name, n.online, n.bus_v, n.battery, n.rest_v, n.stalled, n.sensor_fault, n.bounded_estimate,
                n.loss_share, n.delay_p50_ms, n.delay_p95_ms, n.jitter_ms, n.activity, clock_timestamp()
             FROM unnest($2::text[], $3::bool[], $4::float8[], $5::text[], $6::float8[], $7::bool[], $8::bool[], $9::bool[],
                $10::float8[], $11::float8[], $12::float8[], $13::float8[], $14::text[])
                n(name, online, bus_v, battery, rest_v, stalled, sensor_fault, bounded_estimate, loss_share, delay_p50_ms, delay_p95_ms, jitter_ms, activity)
             JOIN robots r ON r.arena = $1 AND r.name = n.name ORDER BY r.name
             ON CONFLICT (arena, name) DO UPDATE SET online = excluded.online, bus_v = excluded.bus_v, battery = excluded.battery,
                rest_v = excluded.rest_v, stalled = excluded.stalled, sensor_fault = excluded.sensor_fault,
                bounded_estimate = excluded.bounded_estimate, loss_share = excluded.loss_share, delay_p50_ms = excluded.delay_p50_ms,
                delay_p95_ms = excluded.delay_p95_ms, jitter_ms = excluded.jitter_ms, activity = excluded.activity, seen_at = excluded.seen_at",
        )
        .bind(&status.arena)
        .bind(names)
        .bind(online)
        .bind(bus_v)
        .bind(columns.battery)
        .bind(columns.rest_v)
        .bind(columns.stalled)
        .bind(columns.sensor_fault)
        .bind(columns.bounded_estimate)
        .bind(columns.loss_share)
        .bind(columns.delay_p50_ms)
        .bind(columns.delay_p95_ms)
        .bind(columns.jitter_ms)
        .bind(columns.activity)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(true)
    }

    /// Every robot of every arena.
    pub async fn robot_list(&self) -> Result<Vec<RobotView>> {
        let rows: Vec<RobotRow> = sqlx::query_as(
            "SELECT r.arena, r.name, r.document::text AS document,
                coalesce(s.seen_at > clock_timestamp() - make_interval(secs => $1), false) AS heard,
                coalesce(s.online, false) AS online, s.bus_v, s.battery, s.rest_v, s.stalled, s.sensor_fault, s.bounded_estimate,
                s.loss_share, s.delay_p50_ms, s.delay_p95_ms, s.jitter_ms, s.activity,
                robot_unfit_reason(s.battery, s.stalled, s.sensor_fault) AS unfit,
                EXISTS (SELECT FROM leases l JOIN runs c ON c.id = l.run_id WHERE l.arena = r.arena AND l.side = 'physical' AND r.name = ANY(c.robot_names)) AS leased
             FROM robots r LEFT JOIN robot_status s ON s.arena = r.arena AND s.name = r.name ORDER BY r.arena, r.number",
        )
        .bind(SILENT_S)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter().map(RobotRow::into_view).collect()
    }

    /// Pages of the laboratories' protective stops.
    pub async fn stop_urls(&self) -> Result<Vec<String>> {
        let all =
            sqlx::query_scalar("SELECT DISTINCT stop_url FROM arenas WHERE stop_url IS NOT NULL ORDER BY stop_url");
        Ok(all.fetch_all(&self.pool).await?)
    }

    /// Every arena and what it is doing.
    pub async fn arena_list(&self) -> Result<Vec<ArenaView>> {
        let rows: Vec<ArenaRow> = sqlx::query_as(
            "SELECT a.name, a.width_m, a.height_m, a.floor, a.contents::text AS contents,
                coalesce(s.seen_at > clock_timestamp() - make_interval(secs => $1), false) AS connected,
                coalesce(s.stopped, false) AS stopped,
                EXISTS (SELECT FROM leases l WHERE l.arena = a.name AND l.side = 'physical') AS leased,
                CASE WHEN a.held_until > clock_timestamp() THEN a.held_reason END AS held_reason, a.stop_url
             FROM arenas a LEFT JOIN arena_status s ON s.arena = a.name ORDER BY a.name",
        )
        .bind(SILENT_S)
        .fetch_all(&self.pool)
        .await?;
        rows.into_iter().map(ArenaRow::into_view).collect()
    }
}

/// Obstacles, floor regions and tilt as they were registered.
pub(crate) fn contents_of(text: Option<&str>) -> Result<Option<Contents>> {
    let contents = text.map(serde_json::from_str).transpose();
    contents.map_err(StoreError::corrupt("arena"))
}

/// Keeps runs off an arena for a while; the laboratory's next registration ends it earlier.
pub(crate) async fn hold_arena(
    connection: &mut PgConnection,
    arena: &str,
    hold: std::time::Duration,
    reason: &str,
) -> Result<()> {
    sqlx::query(
        "UPDATE arenas SET held_until = clock_timestamp() + make_interval(secs => $2), held_reason = $3 WHERE name = $1",
    )
    .bind(arena)
    .bind(hold.as_secs_f64())
    .bind(reason)
    .execute(connection)
    .await?;
    Ok(())
}

async fn replace_robots(connection: &mut PgConnection, arena: &str, robots: &[LabRobot]) -> Result<()> {
    let names: Vec<&str> = robots.iter().map(|robot| robot.description.name.as_str()).collect();
    let numbers: Vec<i16> = robots.iter().map(|robot| i16::from(robot.number)).collect();
    let documents: Vec<String> = robots
        .iter()
        .map(serde_json::to_string)
        .collect::<std::result::Result<_, _>>()
        .map_err(StoreError::corrupt("robot"))?;
    sqlx::query("DELETE FROM robots WHERE arena = $1 AND name <> ALL($2)")
        .bind(arena)
        .bind(&names)
        .execute(&mut *connection)
        .await?;
    sqlx::query(
        "INSERT INTO robots (arena, name, number, document)
         SELECT $1, n.name, n.number, n.document::json FROM unnest($2::text[], $3::int2[], $4::text[]) n(name, number, document)
         ON CONFLICT (arena, name) DO UPDATE SET number = excluded.number, document = excluded.document",
    )
    .bind(arena)
    .bind(&names)
    .bind(&numbers)
    .bind(&documents)
    .execute(connection)
    .await?;
    Ok(())
}

impl RobotRow {
    fn into_view(self) -> Result<RobotView> {
        let (state, message) = match (self.heard, self.online, self.leased) {
            (false, _, _) => ("offline", Some("the laboratory has not reported it for 5 s")),
            (true, false, _) => ("offline", Some("the laboratory does not hear it")),
            (true, true, true) => ("leased", Some("part of the run in this arena")),
            (true, true, false) => ("idle", self.unfit.as_deref()),
        };
        Ok(RobotView {
            name: self.name,
            arena: self.arena,
            robot: serde_json::from_str(&self.document).map_err(StoreError::corrupt("robot"))?,
            state: state.to_owned(),
            message: message.map(str::to_owned),
            health: self.health.health(),
            link: self.health.link(),
            activity: self
                .health
                .activity()
                .filter(|_| self.heard && self.online && !self.leased),
            bus_v: self.bus_v,
        })
    }
}

impl ArenaRow {
    fn into_view(self) -> Result<ArenaView> {
        let (state, message) = if !self.connected {
            ("offline", Some("the laboratory is not connected".to_owned()))
        } else if self.stopped {
            ("held", Some("the protective stop is pressed".to_owned()))
        } else if self.leased {
            ("leased", Some("a run has this arena".to_owned()))
        } else if let Some(reason) = self.held_reason {
            ("held", Some(reason))
        } else {
            ("free", None)
        };
        let arena = Arena {
            name: self.name,
            width_m: self.width_m,
            height_m: self.height_m,
            floor: self.floor,
            contents: contents_of(self.contents.as_deref())?,
        };
        Ok(ArenaView {
            arena,
            state: state.to_owned(),
            message,
            stopped: self.connected && self.stopped,
            stop_url: self.stop_url,
        })
    }
}
