//! Whether a built thing is still what its sources say.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Content of every input file by its path, and the tools that made the output.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    pub tools: Vec<String>,
    pub files: BTreeMap<PathBuf, String>,
}

impl Fingerprint {
    /// Reads all files below the folders and the single files. What does not exist is left out.
    pub fn of(roots: &[PathBuf], tools: Vec<String>) -> Result<Self> {
        let mut fingerprint = Self {
            tools,
            ..Self::default()
        };
        for root in roots {
            fingerprint.add(root)?;
        }
        Ok(fingerprint)
    }

    /// Adds a file, or every file below a folder.
    pub fn add(&mut self, path: &Path) -> Result<()> {
        if path.is_dir() {
            let entries = fs::read_dir(path).with_context(|| format!("read {}", path.display()))?;
            for entry in entries {
                self.add(&entry?.path())?;
            }
        } else if path.is_file() {
            let bytes = fs::read(path).with_context(|| format!("read {}", path.display()))?;
            self.files.insert(path.to_path_buf(), hex(&Sha256::digest(&bytes)));
        }
        Ok(())
    }

    /// The one stored beside an output; `None` when there is none or it cannot be read.
    pub fn stored(file: &Path) -> Option<Self> {
        serde_json::from_slice(&fs::read(file).ok()?).ok()
    }

    /// Stores it beside an output.
    pub fn store(&self, file: &Path) -> Result<()> {
        fs::write(file, serde_json::to_vec_pretty(self)?).with_context(|| format!("write {}", file.display()))
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Input files a finished build names in cargo's dep-info file (`output: input input ...`).
pub fn inputs_in_dep_info(text: &str) -> Vec<PathBuf> {
    let mut inputs = Vec::new();
    for line in text.lines() {
        let Some((_, list)) = line.split_once(": ") else {
            continue;
        };
        let joined = list.replace("\\ ", "\0");
        inputs.extend(
            joined
                .split_whitespace()
                .map(|word| PathBuf::from(word.replace('\0', " "))),
        );
    }
    inputs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_a_new_and_a_removed_file_are_all_noticed() {
        let folder = std::env::temp_dir().join(format!("xtask-print-{}", std::process::id()));
        fs::create_dir_all(folder.join("src")).unwrap();
        fs::write(folder.join("src/a.rs"), "one").unwrap();
        let look = || Fingerprint::of(std::slice::from_ref(&folder), vec!["rustc 1".into()]).unwrap();
        let first = look();
        assert_eq!(first, look());
        fs::write(folder.join("src/a.rs"), "two").unwrap();
        assert_ne!(first, look());
        fs::write(folder.join("src/a.rs"), "one").unwrap();
        fs::write(folder.join("src/b.rs"), "").unwrap();
        assert_ne!(first, look());
        fs::remove_file(folder.join("src/b.rs")).unwrap();
        assert_eq!(first, look());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn names_with_spaces_survive_in_dep_info() {
        let inputs = inputs_in_dep_info("/t/web_ui.wasm: /w/a.rs /w/my\\ folder/b.rs\n");
        assert_eq!(inputs, [PathBuf::from("/w/a.rs"), PathBuf::from("/w/my folder/b.rs")]);
    }
}
