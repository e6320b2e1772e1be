//! Whether the service can do its work.

use crate::state::AppState;
use serde::Serialize;
use utoipa::ToSchema;

#[derive(Debug, Serialize, ToSchema)]
pub struct HealthView {
    /// `ok`, or `degraded` when the database does not answer.
    pub status: &'static str,
    /// Version of the service.
    pub version: &'static str,
    /// Version of the twin; digests are comparable within one version.
    pub twin_version: &'static str,
    pub database_reachable: bool,
    /// Whether at least one laboratory is connected; unknown without a database.
    pub lab_connected: Option<bool>,
}

pub async fn look(state: &AppState) -> HealthView {
    let arenas = state.store().arena_list().await;
    HealthView {
        status: if arenas.is_ok() { "ok" } else { "degraded" },
        version: env!("CARGO_PKG_VERSION"),
        twin_version: twin::VERSION,
        database_reachable: arenas.is_ok(),
        lab_connected: arenas
            .ok()
            .map(|arenas| arenas.iter().any(|arena| arena.state != "offline")),
    }
}
