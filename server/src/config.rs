//! Everything the process can be told, parsed once.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// REST, WebSocket and static files of the service.
#[derive(Debug, Clone, clap::Parser)]
#[command(name = "robopheus-server", version)]
pub struct Config {
    /// Address to listen on; port 0 takes any free port. The real address is written to `<data>/server.addr`.
    #[arg(long, env = "ROBOPHEUS_LISTEN", default_value = "127.0.0.1:8080")]
    pub listen: SocketAddr,
    /// PostgreSQL to keep everything in, `postgres://user@host:port/database`.
    #[arg(long, env = "DATABASE_URL", hide_env_values = true)]
    pub database_url: String,
    /// Data folder: `tokens/<role>`, `objects/`, `server.addr`.
    #[arg(long, env = "ROBOPHEUS_DATA", default_value = "data")]
    pub data: PathBuf,
    /// Folder with `index.html` and `bundle/` (built by `cargo xtask wasm`).
    #[arg(long = "static", env = "ROBOPHEUS_STATIC", default_value = "static")]
    pub static_dir: PathBuf,
    /// Allow an address beyond this machine; every call of the API then needs a token.
    #[arg(long, env = "ROBOPHEUS_ALLOW_REMOTE")]
    pub allow_remote: bool,
}

impl Config {
    /// Where the object store keeps its files.
    pub fn objects(&self) -> PathBuf {
        self.data.join("objects")
    }

    /// Where the first-start tokens stand, one file per role.
    pub fn tokens(&self) -> PathBuf {
        self.data.join("tokens")
    }

    /// File that tells the other processes where this one listens.
    pub fn address_file(&self) -> PathBuf {
        self.data.join("server.addr")
    }

    /// Refuses an address that other machines can reach unless that was asked for.
    pub fn check(&self) -> anyhow::Result<()> {
        if !self.listen.ip().is_loopback() && !self.allow_remote {
            anyhow::bail!(
                "--listen {} can be reached from other machines; use 127.0.0.1, or add --allow-remote \
                 (every call then needs a token from {})",
                self.listen,
                self.tokens().display()
            );
        }
        Ok(())
    }
}

/// Writes a small file so that a reader sees the old text or the new text, never half of it.
pub fn write_whole(path: &Path, text: &str, mode: u32) -> std::io::Result<()> {
    use std::io::Write as _;
    use std::os::unix::fs::OpenOptionsExt as _;
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let temporary = folder.join(format!(".{}.tmp", uuid::Uuid::now_v7()));
    let mut file = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(&temporary)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    std::fs::rename(&temporary, path)?;
    std::fs::File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    fn parse(arguments: &[&str]) -> Config {
        let all = ["robopheus-server", "--database-url", "postgres://x"]
            .iter()
            .chain(arguments);
        Config::try_parse_from(all).expect("valid flags")
    }

    #[test]
    fn loopback_is_allowed_and_anything_else_needs_the_flag() {
        assert!(parse(&[]).check().is_ok());
        assert!(parse(&["--listen", "[::1]:0"]).check().is_ok());
        assert!(parse(&["--listen", "0.0.0.0:8080"]).check().is_err());
        assert!(parse(&["--listen", "0.0.0.0:8080", "--allow-remote"]).check().is_ok());
    }
}
