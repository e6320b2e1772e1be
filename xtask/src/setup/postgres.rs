//! The server programs of PostgreSQL.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use super::Missing;
use crate::{paths, run};

/// Oldest major version the migrations are written for.
pub const OLDEST_MAJOR: u32 = 15;
/// Where Debian and its relatives put the server programs, one folder per major version.
const DEBIAN_FOLDER: &str = "/usr/lib/postgresql";

/// A folder with `initdb` and `postgres`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PostgresBinaries {
    pub folder: PathBuf,
    pub major: u32,
}

impl PostgresBinaries {
    /// Path of one of its programs.
    pub fn program(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// `$ROBOPHEUS_PG_BIN`, then PATH, then Debian's folders, newest first.
pub fn find() -> Result<PostgresBinaries, Missing> {
    candidates().into_iter().find_map(|folder| usable(&folder)).ok_or(Missing {
        what: "PostgreSQL 15 or newer (server programs initdb and postgres)",
        remedy: "install the server, or point ROBOPHEUS_PG_BIN at the folder with `initdb`, or set DATABASE_URL to an existing database",
        packages: &["postgresql"],
    })
}

fn candidates() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = env::var_os("ROBOPHEUS_PG_BIN").map(PathBuf::from).into_iter().collect();
    folders.extend(paths::on_path("initdb").and_then(|file| file.parent().map(PathBuf::from)));
    folders.extend(version_folders(Path::new(DEBIAN_FOLDER)));
    folders
}

/// `<base>/<major>/bin`, newest major first.
fn version_folders(base: &Path) -> Vec<PathBuf> {
    let names = fs::read_dir(base).into_iter().flatten().flatten();
    let mut majors: Vec<u32> = names
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .collect();
    majors.sort_unstable_by(|a, b| b.cmp(a));
    majors
        .into_iter()
        .map(|major| base.join(major.to_string()).join("bin"))
        .collect()
}

fn usable(folder: &Path) -> Option<PostgresBinaries> {
    if !paths::is_executable(&folder.join("initdb")) {
        return None;
    }
    let text = run::read(run::command(folder.join("postgres")).arg("--version")).ok()?;
    let major = major_of(&text)?;
    (major >= OLDEST_MAJOR).then(|| PostgresBinaries {
        folder: folder.to_path_buf(),
        major,
    })
}

/// Major version in the output of `postgres --version`.
fn major_of(text: &str) -> Option<u32> {
    let number = text
        .split_whitespace()
        .find(|word| word.starts_with(|first: char| first.is_ascii_digit()))?;
    number.split(|mark: char| !mark.is_ascii_digit()).next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_as_every_distribution_writes_them() {
        assert_eq!(
            major_of("postgres (PostgreSQL) 15.13 (Debian 15.13-0+deb12u1)\n"),
            Some(15)
        );
        assert_eq!(major_of("postgres (PostgreSQL) 17beta1"), Some(17));
        assert_eq!(major_of("postgres"), None);
    }

    #[test]
    fn newest_version_comes_first_and_as_a_number() {
        let base = env::temp_dir().join(format!("xtask-pg-{}", std::process::id()));
        for name in ["9", "15", "17", "notes"] {
            fs::create_dir_all(base.join(name)).unwrap();
        }
        let folders = version_folders(&base);
        fs::remove_dir_all(&base).unwrap();
        assert_eq!(folders, ["17/bin", "15/bin", "9/bin"].map(|tail| base.join(tail)));
    }

    #[test]
    fn an_old_server_is_not_used() {
        let folder = env::temp_dir().join(format!("xtask-oldpg-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let script = |version: &str| format!("#!/bin/sh\necho 'postgres (PostgreSQL) {version}'\n");
        let write = |name: &str, text: String| {
            use std::os::unix::fs::PermissionsExt;
            fs::write(folder.join(name), text).unwrap();
            fs::set_permissions(folder.join(name), fs::Permissions::from_mode(0o755)).unwrap();
        };
        write("initdb", script("14.2"));
        write("postgres", script("14.2"));
        assert_eq!(usable(&folder), None);
        write("postgres", script("16.2"));
        assert_eq!(usable(&folder).map(|found| found.major), Some(16));
        fs::remove_dir_all(&folder).unwrap();
    }
}
