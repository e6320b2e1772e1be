//! Connection pool and schema.

use crate::error::{Result, StoreError};
use crate::listen::Listener;
use sqlx::ConnectOptions;
use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};
use std::str::FromStr;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Limits of one process' use of the database.
#[derive(Debug, Clone)]
pub struct StoreOptions {
    /// Shown in `pg_stat_activity`.
    pub application_name: String,
    pub max_connections: u32,
    /// Longest wait for a free connection, the making of one included.
    pub acquire_timeout: Duration,
    /// Longest statement, and longest idle transaction.
    pub statement_timeout: Duration,
}

impl Default for StoreOptions {
    fn default() -> Self {
        Self {
            application_name: "robopheus".to_owned(),
            max_connections: 8,
            acquire_timeout: Duration::from_secs(5),
            statement_timeout: Duration::from_secs(5),
        }
    }
}

/// The database of the service; cheap to clone.
#[derive(Clone)]
pub struct Store {
    pub(crate) pool: PgPool,
    /// Without time limits; for migrations and LISTEN.
    pub(crate) patient: Arc<PgConnectOptions>,
    pub(crate) listener: Arc<OnceLock<Listener>>,
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Store").field("connections", &self.pool.size()).finish()
    }
}

impl Store {
    /// Connects once, so that a wrong address shows at start; later losses heal by themselves.
    pub async fn connect(url: &str, options: StoreOptions) -> Result<Self> {
        let patient = PgConnectOptions::from_str(url)?
            .application_name(&options.application_name)
            .disable_statement_logging();
        let limit_ms = options.statement_timeout.as_millis().to_string();
        let hurried = patient.clone().options([
            ("statement_timeout", limit_ms.as_str()),
            ("lock_timeout", limit_ms.as_str()),
            ("idle_in_transaction_session_timeout", limit_ms.as_str()),
        ]);
        let pool = PgPoolOptions::new()
            .max_connections(options.max_connections)
            .acquire_timeout(options.acquire_timeout)
            .connect_lazy_with(hurried);
        let store = Self {
            pool,
            patient: Arc::new(patient),
            listener: Arc::default(),
        };
        store.ping().await?;
        Ok(store)
    }

    /// Brings the schema up to date; several processes may call it at once.
    pub async fn migrate(&self) -> Result<()> {
        // Apart from the pool: waiting for another process' migration may take longer than a statement should.
        let pool = PgPoolOptions::new()
            .max_connections(1)
            .connect_with((*self.patient).clone())
            .await?;
        let migrated = sqlx::migrate!("../migrations").run(&pool).await;
        pool.close().await;
        migrated.map_err(StoreError::Migration)
    }

    /// True answer to "is the database there now".
    pub async fn ping(&self) -> Result<()> {
        sqlx::query("SELECT 1").execute(&self.pool).await?;
        Ok(())
    }

    /// Gives the connections back; later calls fail.
    pub async fn close(&self) {
        self.pool.close().await;
    }
}
