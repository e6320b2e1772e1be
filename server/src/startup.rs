//! From flags to a running service, and its orderly end.

use crate::app::error::chain;
use crate::config::{Config, write_whole};
use crate::objects::ObjectFolder;
use crate::router::router;
use crate::state::{AppState, StateParts};
use crate::tokens;
use anyhow::Context as _;
use axum::serve::ListenerExt as _;
use std::future::IntoFuture as _;
use std::net::SocketAddr;
use std::time::Duration;
use store::{Store, StoreError, StoreOptions};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// Pause between two attempts to reach the database.
const RETRY: Duration = Duration::from_secs(1);
/// Requests that are under way get this long after the signal.
const GRACE: Duration = Duration::from_secs(10);
/// A request waits this long for a connection, then it is answered with 503.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(3);
const CONNECTIONS: u32 = 10;

/// Runs until `shutdown` is cancelled.
pub async fn run(config: Config, shutdown: CancellationToken) -> anyhow::Result<()> {
    config.check()?;
    let objects =
        ObjectFolder::open(config.objects()).with_context(|| format!("open {}", config.objects().display()))?;
    let listener = TcpListener::bind(config.listen)
        .await
        .with_context(|| format!("listen on {}", config.listen))?;
    let address = listener.local_addr().context("own address")?;
    let Some(store) = database(&config, &shutdown).await? else {
        return Ok(());
    };
    tokens::ensure(&store, &config.tokens()).await?;
    let state = AppState::new(StateParts {
        store: store.clone(),
        objects,
        static_dir: config.static_dir.clone(),
        trust_loopback: !config.allow_remote,
        port: address.port(),
        shutdown: shutdown.clone(),
    });
    write_whole(&config.address_file(), &format!("{address}\n"), 0o644).context("write the address file")?;
    tracing::info!(%address, "listening: http://{address}/");
    serve(listener, state, &shutdown).await?;
    store.close().await;
    tracing::info!("ended");
    Ok(())
}

/// The database with its schema up to date. Waits for a database that is not there yet.
async fn database(config: &Config, shutdown: &CancellationToken) -> anyhow::Result<Option<Store>> {
    let mut told = None;
    loop {
        match open(config).await {
            Ok(store) => return Ok(Some(store)),
            Err(error) if error.is_transient() => {
                let text = chain(&error);
                if told.as_ref() != Some(&text) {
                    tracing::warn!(error = text, "waiting for the database");
                    told = Some(text);
                }
            }
            Err(error) => return Err(error).context("open the database given by --database-url"),
        }
        tokio::select! {
            () = tokio::time::sleep(RETRY) => {}
            () = shutdown.cancelled() => return Ok(None),
        }
    }
}

async fn open(config: &Config) -> Result<Store, StoreError> {
    let options = StoreOptions {
        application_name: "robopheus-server".to_owned(),
        max_connections: CONNECTIONS,
        acquire_timeout: ACQUIRE_TIMEOUT,
        ..StoreOptions::default()
    };
    let store = Store::connect(&config.database_url, options).await?;
    store.migrate().await?;
    Ok(store)
}

async fn serve(listener: TcpListener, state: AppState, shutdown: &CancellationToken) -> anyhow::Result<()> {
    let service = router(state).into_make_service_with_connect_info::<SocketAddr>();
    let listener = listener.tap_io(|stream| {
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "cannot set TCP_NODELAY");
        }
    });
    let server = axum::serve(listener, service)
        .with_graceful_shutdown(shutdown.clone().cancelled_owned())
        .into_future();
    tokio::select! {
        ended = server => ended.context("serve"),
        () = async { shutdown.cancelled().await; tokio::time::sleep(GRACE).await } => {
            tracing::warn!("requests still open after {} s are dropped", GRACE.as_secs());
            Ok(())
        }
    }
}
