//! Folders of a cluster: where its user can reach them and where a socket's path is short enough.

use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};

use super::user::{User, may_enter};
use crate::sys;

/// The kernel's limit for a socket's path is 108 bytes with the closing zero.
const SOCKET_PATH_MAX_BYTES: usize = 107;
/// Name of the server's socket in its folder.
pub const SOCKET_FILE: &str = ".s.PGSQL.5432";
/// Names this data folder, so that a new one of the same name does not get an old one's cluster.
const ID_FILE: &str = "id";

/// Folders of one cluster.
#[derive(Clone, Debug)]
pub struct ClusterPlace {
    pub cluster: PathBuf,
    pub socket_folder: PathBuf,
}

impl ClusterPlace {
    /// Chooses and makes both folders, owned by the server's user, closed to everybody else.
    pub fn prepare(data: &Path, major: u32, user: Option<&User>) -> Result<Self> {
        let data = data
            .canonicalize()
            .with_context(|| format!("find {}", data.display()))?;
        let id = folder_id(&data)?;
        let base = match user {
            Some(user) if !may_enter(*user, &data) => private_folder(Path::new("/var/tmp"), &id)?,
            _ => data.clone(),
        };
        let socket_base = if socket_fits(&base.join("pg-socket"), SOCKET_FILE) {
            base.clone()
        } else {
            short_base(&id, user)?
        };
        let place = Self {
            cluster: base.join(format!("pg-{major}")),
            socket_folder: socket_base.join("pg-socket"),
        };
        for folder in [&place.cluster, &place.socket_folder] {
            make_private(folder, user)?;
        }
        Ok(place)
    }

    /// Removes both folders.
    pub fn remove(&self) {
        for folder in [&self.cluster, &self.socket_folder] {
            fs::remove_dir_all(folder).ok();
            // The folder around it, when it was made for us and is empty now.
            folder.parent().filter(|parent| is_ours(parent)).map(fs::remove_dir);
        }
    }
}

fn is_ours(folder: &Path) -> bool {
    folder
        .file_name()
        .is_some_and(|name| name.to_string_lossy().starts_with("robopheus-"))
}

/// A folder where sockets with names of up to 20 bytes fit: the data folder itself, else a private one.
pub fn short_socket_folder(data: &Path) -> Result<PathBuf> {
    let data = data
        .canonicalize()
        .with_context(|| format!("find {}", data.display()))?;
    if socket_fits(&data, "twenty-bytes-of-name") {
        return Ok(data);
    }
    short_base(&folder_id(&data)?, None)
}

/// True when a socket of that name in that folder stays under the kernel's limit.
fn socket_fits(folder: &Path, name: &str) -> bool {
    folder.join(name).as_os_str().len() <= SOCKET_PATH_MAX_BYTES
}

/// `$XDG_RUNTIME_DIR` for an ordinary user, /tmp otherwise (another user cannot enter root's run-time folder).
fn short_base(id: &str, user: Option<&User>) -> Result<PathBuf> {
    let run_time = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let usable = run_time.filter(|at| user.is_none() && at.is_dir() && at.as_os_str().len() < 40);
    private_folder(&usable.unwrap_or_else(|| PathBuf::from("/tmp")), id)
}

/// `<base>/robopheus-<id>`, ours alone to write; a folder somebody else put there is refused.
fn private_folder(base: &Path, id: &str) -> Result<PathBuf> {
    let folder = base.join(format!("robopheus-{id}"));
    // A root process's server must be able to pass through; what lies inside is closed by itself.
    let mode = if sys::is_root() { 0o711 } else { 0o700 };
    match fs::DirBuilder::new().mode(mode).create(&folder) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            return Err(error).with_context(|| format!("make {}", folder.display()));
        }
        _ => {}
    }
    let meta = folder.symlink_metadata()?;
    if !meta.is_dir() || meta.uid() != sys::effective_uid() {
        bail!(
            "{} belongs to somebody else; remove it or choose another data folder",
            folder.display()
        );
    }
    fs::set_permissions(&folder, fs::Permissions::from_mode(mode))?;
    Ok(folder)
}

fn make_private(folder: &Path, user: Option<&User>) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("make {}", folder.display()))?;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o700))?;
    if let Some(user) = user {
        std::os::unix::fs::chown(folder, Some(user.uid), Some(user.gid))
            .with_context(|| format!("give away {}", folder.display()))?;
    }
    Ok(())
}

/// 16 hex characters that belong to this data folder; made from its path and the moment it was first used.
fn folder_id(data: &Path) -> Result<String> {
    let file = data.join(ID_FILE);
    if let Ok(text) = fs::read_to_string(&file)
        && text.trim().len() == 16
        && text.trim().bytes().all(|byte| byte.is_ascii_hexdigit())
    {
        return Ok(text.trim().to_owned());
    }
    let mut hash = Sha256::new();
    hash.update(data.as_os_str().as_encoded_bytes());
    hash.update(std::process::id().to_le_bytes());
    hash.update(format!("{:?}", std::time::SystemTime::now()));
    let id: String = hash
        .finalize()
        .iter()
        .take(8)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    fs::write(&file, &id).with_context(|| format!("write {}", file.display()))?;
    Ok(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn temporary(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("xtask-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn the_limit_of_a_socket_path_counts_every_byte() {
        let longest = PathBuf::from(format!(
            "/{}",
            "a".repeat(SOCKET_PATH_MAX_BYTES - 2 - SOCKET_FILE.len())
        ));
        assert!(socket_fits(&longest, SOCKET_FILE));
        assert!(!socket_fits(
            &longest.with_file_name(format!("{}b", longest.file_name().unwrap().display())),
            SOCKET_FILE
        ));
    }

    #[test]
    fn sockets_of_a_deep_data_folder_go_to_a_short_private_one() {
        let base = temporary("deep");
        let deep = base.join("x".repeat(90));
        fs::create_dir_all(&deep).unwrap();
        let short = short_socket_folder(&deep).unwrap();
        assert!(short.as_os_str().len() < 70, "{}", short.display());
        assert_eq!(short.metadata().unwrap().mode() & 0o066, 0);
        assert_eq!(short_socket_folder(&deep).unwrap(), short, "the same folder every time");
        assert_eq!(short_socket_folder(&base).unwrap(), base.canonicalize().unwrap());
        fs::remove_dir(&short).unwrap();
        fs::remove_dir_all(&base).unwrap();
    }

    #[test]
    fn a_data_folder_made_anew_gets_a_new_identity() {
        let data = temporary("identity");
        let first = folder_id(&data).unwrap();
        assert_eq!(folder_id(&data).unwrap(), first);
        fs::remove_file(data.join(ID_FILE)).unwrap();
        assert_ne!(folder_id(&data).unwrap(), first);
        fs::remove_dir_all(&data).unwrap();
    }

    #[test]
    fn a_folder_that_is_a_link_is_refused() {
        let base = temporary("link");
        std::os::unix::fs::symlink("/etc", base.join("robopheus-0123")).unwrap();
        assert!(private_folder(&base, "0123").is_err());
        fs::remove_dir_all(&base).unwrap();
    }
}
