//! How every process of the laboratory begins: its settings, its log on standard error, TLS.

use anyhow::{Result, bail};
use clap::Parser;
use tracing_subscriber::EnvFilter;

/// Settings from the command line; `RUST_LOG` says what is logged, `info` when it is not set.
///
/// - Errors: a TLS provider is installed already. Wrong settings end the process in words.
pub fn begin<S: Parser>() -> Result<S> {
    // First: reqwest is built without a TLS provider of its own and panics without this one.
    if rustls::crypto::ring::default_provider().install_default().is_err() {
        bail!("another TLS provider is installed");
    }
    let settings = S::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    Ok(settings)
}
