//! Debian's package manager, used only by root.

use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::{paths, run};

/// Longest time one apt-get call may take.
const APT_LIMIT: Duration = Duration::from_secs(15 * 60);
/// Says whether Debian's PostgreSQL package makes and starts a cluster of its own.
const CLUSTER_SETTINGS: &str = "/etc/postgresql-common/createcluster.conf";

/// True on a machine with apt-get.
pub fn is_there() -> bool {
    paths::on_path("apt-get").is_some()
}

/// Installs packages without asking anything.
pub fn install(packages: &[&str]) -> Result<()> {
    if packages.iter().any(|name| name.starts_with("postgresql")) {
        keep_debian_from_starting_postgres(Path::new(CLUSTER_SETTINGS))?;
    }
    apt_get(&["update"])?;
    let mut arguments = vec![
        "install",
        "--yes",
        "--no-install-recommends",
        "-o",
        "Dpkg::Options::=--force-confold",
    ];
    arguments.extend(packages);
    apt_get(&arguments)
}

fn apt_get(arguments: &[&str]) -> Result<()> {
    let mut command = run::command("apt-get");
    command
        .args(["-qq", "-o", "Acquire::Retries=2", "-o", "DPkg::Lock::Timeout=120"])
        .args(arguments);
    command
        .env("DEBIAN_FRONTEND", "noninteractive")
        .env_remove("LD_LIBRARY_PATH");
    match run::within(&mut command, APT_LIMIT)? {
        Some(status) if status.success() => Ok(()),
        Some(status) => bail!("`{}` failed ({status})", run::text(&command)),
        None => bail!(
            "`{}` took longer than {} min",
            run::text(&command),
            APT_LIMIT.as_secs() / 60
        ),
    }
}

/// A cluster of Debian's own would only take memory and a port; ours is private.
fn keep_debian_from_starting_postgres(settings: &Path) -> Result<()> {
    if settings.exists() {
        return Ok(());
    }
    let folder = settings.parent().context("settings have no folder")?;
    fs::create_dir_all(folder).with_context(|| format!("make {}", folder.display()))?;
    fs::write(settings, "create_main_cluster = false\n").with_context(|| format!("write {}", settings.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_somebody_made_are_left_alone() {
        let folder = std::env::temp_dir().join(format!("xtask-apt-{}", std::process::id()));
        let settings = folder.join("etc/createcluster.conf");
        keep_debian_from_starting_postgres(&settings).unwrap();
        assert_eq!(fs::read_to_string(&settings).unwrap(), "create_main_cluster = false\n");
        fs::write(&settings, "ssl = on\n").unwrap();
        keep_debian_from_starting_postgres(&settings).unwrap();
        assert_eq!(fs::read_to_string(&settings).unwrap(), "ssl = on\n");
        fs::remove_dir_all(&folder).unwrap();
    }
}
