//! Documents and code agree, files stay small, nothing unfinished is left in the code.

mod documents;
mod rust_files;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::{End, paths};

/// Packages whose results must be the same bits everywhere; their clippy.toml bans what would break that.
const DETERMINISTIC: &[&str] = &["twin", "control", "identify", "robot"];
/// Folders without files of ours.
const SKIPPED_FOLDERS: &[&str] = &["data", "node_modules", "bundle"];

/// `cargo xtask tidy`.
pub fn tidy() -> Result<End> {
    let problems = problems()?;
    for problem in &problems {
        eprintln!("tidy: {problem}");
    }
    println!("tidy: {} problems", problems.len());
    Ok(if problems.is_empty() { End::Good } else { End::Failed })
}

/// Every problem in a sentence.
pub fn problems() -> Result<Vec<String>> {
    let root = paths::root();
    let files = files_below(&root)?;
    let mut problems = documents::problems(&root, &files)?;
    for file in files
        .iter()
        .filter(|file| file.extension().is_some_and(|ending| ending == "rs"))
    {
        let text = fs::read_to_string(root.join(file)).with_context(|| format!("read {}", file.display()))?;
        problems.extend(rust_files::problems(file, &text));
    }
    for package in DETERMINISTIC {
        let text = fs::read_to_string(root.join(package).join("clippy.toml")).unwrap_or_default();
        problems.extend(missing_bans(package, &text));
    }
    Ok(problems)
}

/// Files of the checkout relative to its root, without built and hidden ones.
pub fn files_below(root: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![PathBuf::new()];
    while let Some(folder) = open.pop() {
        let at = root.join(&folder);
        for entry in fs::read_dir(&at).with_context(|| format!("read {}", at.display()))? {
            let entry = entry?;
            let name = entry.file_name();
            let text = name.to_string_lossy();
            let path = folder.join(&name);
            if entry.file_type()?.is_dir() {
                if !is_skipped(&folder, &text) {
                    open.push(path);
                }
            } else {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

fn is_skipped(parent: &Path, name: &str) -> bool {
    let at_root = parent.as_os_str().is_empty();
    let is_hidden = name.starts_with('.') && name != ".ci" && name != ".config";
    is_hidden
        || name == "node_modules"
        || (at_root && name.starts_with("target"))
        || (SKIPPED_FOLDERS.contains(&name) && (at_root || parent == Path::new("static")))
}

fn missing_bans(package: &str, clippy: &str) -> Vec<String> {
    let wanted = [
        "disallowed-methods",
        "disallowed-types",
        "f64::sin",
        "Instant",
        "HashMap",
    ];
    let absent = wanted.iter().filter(|word| !clippy.contains(**word));
    absent
        .map(|word| {
            format!("{package}/clippy.toml does not ban or name {word}: its results must be the same bits everywhere")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deterministic_package_without_bans_is_noticed() {
        assert_eq!(missing_bans("twin", "").len(), 5);
        let full = "disallowed-methods = [\"f64::sin\"]\ndisallowed-types = [\"std::time::Instant\", \"std::collections::HashMap\"]";
        assert!(missing_bans("twin", full).is_empty());
    }

    #[test]
    fn built_folders_are_not_looked_at() {
        assert!(is_skipped(Path::new(""), "target-wasm"));
        assert!(is_skipped(Path::new("static"), "bundle"));
        assert!(is_skipped(Path::new(""), ".git"));
        assert!(!is_skipped(Path::new(""), ".ci"));
        assert!(!is_skipped(Path::new("identify/src"), "bundle"));
        assert!(!is_skipped(Path::new("lab/src"), "target"));
    }
}
