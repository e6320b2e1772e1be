//! Which service, with which token: flags first, then what `login` stored, then the local default.

use anyhow::Context;
use client::Client;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const LOCAL_SERVICE: &str = "http://127.0.0.1:8080";

#[derive(Debug, Clone)]
pub struct Settings {
    pub server: String,
    pub token: Option<String>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    server: Option<String>,
    token: Option<String>,
}

impl Settings {
    pub fn resolve(server: Option<String>, token: Option<String>) -> anyhow::Result<Self> {
        let stored = match stored_path() {
            Some(path) if path.exists() => read(&path)?,
            _ => Stored::default(),
        };
        // A stored token belongs to the stored service: never send it elsewhere.
        let same_service = server.is_none() || server == stored.server;
        Ok(Self {
            token: token.or(if same_service { stored.token } else { None }),
            server: server.or(stored.server).unwrap_or_else(|| LOCAL_SERVICE.to_owned()),
        })
    }

    pub fn client(&self) -> anyhow::Result<Client> {
        Ok(Client::new(&self.server, self.token.clone())?)
    }

    /// Writes them for later calls, readable by this user only.
    pub fn store(&self) -> anyhow::Result<PathBuf> {
        let path = stored_path().context("neither XDG_CONFIG_HOME nor HOME is set: use --server and --token")?;
        let stored = Stored {
            server: Some(self.server.clone()),
            token: self.token.clone(),
        };
        write_private(&path, &serde_json::to_vec_pretty(&stored)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    }
}

fn read(path: &Path) -> anyhow::Result<Stored> {
    let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_slice(&text)
        .with_context(|| format!("{} is not valid; delete it and log in again", path.display()))
}

fn stored_path() -> Option<PathBuf> {
    let base = std::env::var_os("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config")))?;
    Some(base.join("robopheus").join("client.json"))
}

fn write_private(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    use std::io::Write;
    use std::os::unix::fs::OpenOptionsExt;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let partial = path.with_extension("json.part");
    let mut options = std::fs::OpenOptions::new();
    let mut file = options
        .create(true)
        .write(true)
        .truncate(true)
        .mode(0o600)
        .open(&partial)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    std::fs::rename(partial, path)
}
