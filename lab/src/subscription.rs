//! How other servers follow the laboratory's hub: again and again, whoever of the two is away.

use crate::hub::ADDRESS_FILE;
use anyhow::{Context, Result};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

/// Wait before connecting again.
const RECONNECT: Duration = Duration::from_millis(500);

/// Connects and follows until the process ends.
///
/// - `hub`: address; what `<data>/lab-hub.addr` says when absent.
pub fn keep(hub: Option<&str>, data: &Path, follow: impl Fn(TcpStream) -> Result<()>) {
    let mut quiet = false;
    loop {
        let result = address(hub, data)
            .and_then(|address| TcpStream::connect(&address).with_context(|| address))
            .and_then(|stream| {
                tracing::info!("connected to the hub");
                quiet = false;
                stream.set_nodelay(true)?;
                follow(stream)
            });
        if !std::mem::replace(&mut quiet, true) {
            tracing::warn!(result = ?result.err(), "no hub");
        }
        std::thread::sleep(RECONNECT);
    }
}

fn address(given: Option<&str>, data: &Path) -> Result<String> {
    match given {
        Some(address) => Ok(address.to_owned()),
        None => {
            let path = data.join(ADDRESS_FILE);
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
        }
    }
}
