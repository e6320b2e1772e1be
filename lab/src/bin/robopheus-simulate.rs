//! `robopheus-simulate`: the virtual simulation server, a live shadow of the run in the laboratory.

use anyhow::{Context, Result};
use clap::Parser;
use lab::hub::ADDRESS_FILE;
use lab::record::Record;
use lab::shadow::ShadowRun;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Wait before connecting again.
const RECONNECT: Duration = Duration::from_millis(500);

/// Drives the twin beside the robots, with a control of its own, and tells the laboratory's hub where the virtual robots are.
#[derive(Debug, Parser)]
#[command(name = "robopheus-simulate", version)]
struct Settings {
    /// Address of the laboratory's hub; what `<data>/lab-hub.addr` says when left out.
    #[arg(long)]
    hub: Option<String>,
    /// Data folder of the laboratory.
    #[arg(long, env = "ROBOPHEUS_DATA", default_value = "data")]
    data: PathBuf,
}

fn main() -> Result<()> {
    let settings = Settings::parse();
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let mut quiet = false;
    loop {
        let result = address(settings.hub.as_deref(), &settings.data)
            .and_then(|address| TcpStream::connect(&address).with_context(|| address))
            .and_then(|stream| {
                tracing::info!("connected to the hub");
                quiet = false;
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

/// Run after run, until the hub is gone.
fn follow(mut stream: TcpStream) -> Result<()> {
    stream.set_nodelay(true)?;
    let reader = BufReader::new(stream.try_clone()?);
    let mut shadow = ShadowRun::default();
    for line in reader.lines() {
        let line = line?;
        // Words about lost lines are no records.
        let Ok(record) = serde_json::from_str::<Record>(&line) else {
            tracing::warn!(line, "not a record");
            continue;
        };
        match shadow.take(&record) {
            Ok(Some(picture)) => {
                let mut line = serde_json::to_vec(&Record::Shadow(picture))?;
                line.push(b'\n');
                stream.write_all(&line)?;
            }
            Ok(None) => {}
            Err(problem) => tracing::warn!(problem, "this run has no shadow"),
        }
    }
    Ok(())
}
