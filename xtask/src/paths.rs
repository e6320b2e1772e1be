//! Where things are: the checkout, the built programs, commands on PATH.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Root folder of the checkout: the folder with the workspace's `Cargo.toml`.
pub fn root() -> PathBuf {
    let start = env::var_os("CARGO_MANIFEST_DIR")
        .map(PathBuf::from)
        .or_else(|| env::current_dir().ok());
    start
        .and_then(|folder| workspace_above(&folder))
        .unwrap_or_else(compiled_root)
}

fn compiled_root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_path_buf()
}

fn workspace_above(folder: &Path) -> Option<PathBuf> {
    folder
        .ancestors()
        .find(|at| at.join("xtask/Cargo.toml").is_file() && at.join("Cargo.lock").is_file())
        .map(Path::to_path_buf)
}

/// Full path of the running xtask program.
pub fn own_program() -> Result<PathBuf> {
    let path = env::current_exe().context("where the running program lies")?;
    Ok(without_deleted_mark(&path))
}

/// Linux marks the path of a program that was replaced while running; a rebuild does that to us.
fn without_deleted_mark(path: &Path) -> PathBuf {
    let text = path.to_string_lossy();
    PathBuf::from(text.strip_suffix(" (deleted)").unwrap_or(&text))
}

/// Folder of the programs built with this one (target/debug).
pub fn program_folder() -> Result<PathBuf> {
    let own = own_program()?;
    Ok(own.parent().context("the running program has no folder")?.to_path_buf())
}

/// First executable of that name on PATH.
pub fn on_path(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    find_in(env::split_paths(&path), name)
}

/// First executable of that name in the folders, in order.
pub fn find_in(folders: impl Iterator<Item = PathBuf>, name: &str) -> Option<PathBuf> {
    folders.map(|folder| folder.join(name)).find(|file| is_executable(file))
}

/// True for a file with an execute permission.
pub fn is_executable(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    file.metadata()
        .is_ok_and(|meta| meta.is_file() && meta.permissions().mode() & 0o111 != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_file_without_execute_permission_is_not_a_program() {
        let folder = env::temp_dir().join(format!("xtask-paths-{}", std::process::id()));
        let (first, second) = (folder.join("a"), folder.join("b"));
        for at in [&first, &second] {
            fs::create_dir_all(at).unwrap();
            fs::write(at.join("tool"), "#!/bin/sh\n").unwrap();
        }
        fs::set_permissions(second.join("tool"), fs::Permissions::from_mode(0o755)).unwrap();
        let found = find_in([first, second.clone()].into_iter(), "tool");
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found, Some(second.join("tool")));
    }

    #[test]
    fn the_mark_of_a_replaced_program_is_removed() {
        assert_eq!(
            without_deleted_mark(Path::new("/t/xtask (deleted)")),
            Path::new("/t/xtask")
        );
        assert_eq!(without_deleted_mark(Path::new("/t/xtask")), Path::new("/t/xtask"));
    }

    #[test]
    fn the_checkout_is_found_from_a_package_folder() {
        let root = compiled_root();
        assert_eq!(workspace_above(&root.join("twin/src")), Some(root));
        assert_eq!(workspace_above(Path::new("/")), None);
    }
}
