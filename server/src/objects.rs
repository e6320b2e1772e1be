//! The object folder: files of attempts, written so that a crash leaves an old file or a new one, never half of one.

use crate::app::error::AppError;
use sha2::{Digest as _, Sha256};
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};
use std::time::Duration;
use uuid::Uuid;

/// Longest file name inside an attempt.
const NAME_LIMIT_BYTES: usize = 200;
/// Another server may be writing here too; only files this old are surely nobody's.
const LEFT_OVER_AFTER: Duration = Duration::from_secs(3600);
/// Deepest folder inside an attempt.
const DEPTH_LIMIT: usize = 6;
/// Names the service writes itself.
pub const RESERVED: [&str; 2] = ["archive.zip", "archive.json"];

/// `<data>/objects`.
#[derive(Debug, Clone)]
pub struct ObjectFolder {
    root: PathBuf,
}

impl ObjectFolder {
    /// Opens the folder, making it when needed, and clears what an earlier process left half written.
    pub fn open(root: PathBuf) -> std::io::Result<Self> {
        let folder = Self { root };
        std::fs::create_dir_all(folder.root.join("runs"))?;
        std::fs::create_dir_all(folder.temporary_folder())?;
        for entry in std::fs::read_dir(folder.temporary_folder())? {
            let entry = entry?;
            let age = entry.metadata()?.modified()?.elapsed().unwrap_or_default();
            if age > LEFT_OVER_AFTER {
                std::fs::remove_file(entry.path())?;
            }
        }
        Ok(folder)
    }

    /// Folder of one attempt.
    pub fn attempt(&self, run: Uuid, epoch: i64) -> PathBuf {
        self.root.join("runs").join(run.to_string()).join(epoch.to_string())
    }

    /// Place of a file of an attempt, relative to the folder. Other bytes get another place, so nothing is overwritten.
    pub fn object_path(run: Uuid, epoch: i64, name: &str, sha256: &str) -> String {
        let last = name.rsplit('/').next().unwrap_or(name);
        format!("runs/{run}/{epoch}/{}-{last}", sha256.get(..32).unwrap_or(sha256))
    }

    /// Where an object lies on this machine; refuses a path that would leave the folder.
    pub fn path_of(&self, object_path: &str) -> Result<PathBuf, AppError> {
        let normal = Path::new(object_path)
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        if normal && !object_path.is_empty() {
            Ok(self.root.join(object_path))
        } else {
            Err(AppError::Internal(format!(
                "object path {object_path:?} leaves the folder"
            )))
        }
    }

    /// A fresh name on the same file system.
    pub fn temporary(&self) -> PathBuf {
        self.temporary_folder().join(Uuid::now_v7().to_string())
    }

    fn temporary_folder(&self) -> PathBuf {
        self.root.join("tmp")
    }

    /// Moves a fully written file to its place and makes that last over a power cut. Blocks.
    pub fn publish(&self, temporary: &Path, target: &Path) -> std::io::Result<()> {
        std::fs::File::open(temporary)?.sync_all()?;
        let mut made = Vec::new();
        let mut folder = target.parent();
        while let Some(path) = folder.filter(|path| !path.exists() && path.starts_with(&self.root)) {
            made.push(path.to_owned());
            folder = path.parent();
        }
        if let Some(parent) = target.parent() {
            std::fs::create_dir_all(parent)?;
        }
        std::fs::rename(temporary, target)?;
        for path in target
            .parent()
            .into_iter()
            .chain(made.iter().filter_map(|path| path.parent()))
        {
            std::fs::File::open(path)?.sync_all()?;
        }
        Ok(())
    }
}

/// Accepts plain relative names only; the text says what is wrong.
pub fn check_name(name: &str) -> Result<(), &'static str> {
    if name.is_empty() || name.len() > NAME_LIMIT_BYTES {
        return Err("a name has 1 to 200 characters");
    }
    if !name
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || b"._-/".contains(&byte))
    {
        return Err("a name has only ASCII letters, digits and `._-/`");
    }
    let parts: Vec<_> = name.split('/').collect();
    if parts.len() > DEPTH_LIMIT {
        return Err("a name has at most 6 parts");
    }
    if parts.iter().any(|part| part.is_empty() || part.starts_with('.')) {
        return Err("a name is relative, and no part is empty or begins with a dot");
    }
    if RESERVED.contains(&name) {
        return Err("the service makes this file itself");
    }
    Ok(())
}

/// Media type of an archive member, from its name.
pub fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next().unwrap_or_default() {
        "json" => "application/json",
        "txt" | "log" => "text/plain; charset=utf-8",
        "csv" => "text/csv; charset=utf-8",
        "zip" => "application/zip",
        _ => "application/octet-stream",
    }
}

/// Length and lower-case hexadecimal SHA-256 of a file. Blocks.
pub fn sha256_of(path: &Path) -> std::io::Result<(u64, String)> {
    let mut file = std::fs::File::open(path)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 128 * 1024];
    let mut length = 0;
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok((length, hex(&hasher.finalize())));
        }
        length += count as u64;
        hasher.update(&buffer[..count]);
    }
}

/// Refuses a file whose bytes are not those that were stored.
pub async fn verify(path: PathBuf, bytes: i64, sha256: String) -> Result<(), AppError> {
    let what = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let found = tokio::task::spawn_blocking(move || sha256_of(&path))
        .await
        .map_err(|e| AppError::Internal(e.to_string()))?;
    match found {
        Ok((length, found)) if i64::try_from(length) == Ok(bytes) && found == sha256 => Ok(()),
        Ok(_) => Err(AppError::Corrupt { what }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(AppError::Corrupt { what }),
        Err(error) => Err(error.into()),
    }
}

/// Lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_relative_names_are_accepted() {
        for good in ["manifest.json", "robots/omni-01/telemetry.parquet", "run.mcap"] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        let long = "a".repeat(201);
        for bad in [
            "",
            "/etc/passwd",
            "../x",
            "a/../b",
            "a//b",
            "a/",
            ".hidden",
            "a/.b",
            "a\\b",
            "a\0b",
            "ü.json",
            "a b",
            "archive.zip",
            long.as_str(),
            "a/b/c/d/e/f/g",
        ] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn publishing_replaces_the_whole_file() -> std::io::Result<()> {
        let root = std::env::temp_dir().join(format!("robopheus-objects-{}", Uuid::now_v7()));
        let objects = ObjectFolder::open(root.clone())?;
        let target = objects.attempt(Uuid::nil(), 3).join("robots/omni-01/run.json");
        for text in ["first", "second"] {
            let temporary = objects.temporary();
            std::fs::write(&temporary, text)?;
            objects.publish(&temporary, &target)?;
            assert_eq!(std::fs::read_to_string(&target)?, text);
            assert!(!temporary.exists());
        }
        std::fs::remove_dir_all(root)
    }
}
