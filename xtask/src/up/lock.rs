//! One `up` per data folder.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;

use anyhow::{Context, Result};

use super::record::Record;

/// Held as long as this process lives, however it ends.
pub struct Lock {
    _file: File,
}

impl Lock {
    /// `None` when another process holds it.
    pub fn take(data: &Path) -> Result<Option<Self>> {
        let path = data.join("lock");
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
        let file = file.with_context(|| format!("open {}", path.display()))?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Self { _file: file })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error).with_context(|| format!("lock {}", path.display())),
        }
    }
}

/// Words for the user who starts it a second time.
pub fn already_running(data: &Path) -> String {
    let place = Record::server_in(data)
        .map(|server| format!(" at {server}"))
        .unwrap_or_default();
    format!(
        "Robopheus is already running with the data folder {}{place}; stop it first or choose another with --data DIR.",
        data.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_start_on_the_same_folder_is_refused_until_the_first_ends() {
        let data = std::env::temp_dir().join(format!("xtask-lock-{}", std::process::id()));
        std::fs::create_dir_all(&data).unwrap();
        let first = Lock::take(&data).unwrap();
        assert!(first.is_some());
        assert!(Lock::take(&data).unwrap().is_none());
        std::fs::write(data.join("up.json"), r#"{"server":"http://127.0.0.1:9"}"#).unwrap();
        assert!(already_running(&data).contains("http://127.0.0.1:9"));
        drop(first);
        assert!(Lock::take(&data).unwrap().is_some());
        std::fs::remove_dir_all(&data).unwrap();
    }
}
