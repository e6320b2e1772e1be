//! Functions that only a few files may name.

use anyhow::{Context, Result};

use crate::{paths, tidy};

/// A command frame is made of a `SafeCommand` or of an order to stand still, and nowhere else; `robot/src/medium.rs` measures lengths.
const NAMED_ONLY_IN: &[(&str, &[&str])] = &[
    (
        "encode_command",
        &["robot/src/frame/", "robot/src/medium.rs", "lab/src/commander.rs"],
    ),
    ("encode_group", &["robot/src/frame/", "lab/src/chorus.rs"]),
];
/// This file names them to forbid them.
const OWN_FILE: &str = "xtask/src/arch/naming.rs";

/// Every Rust file outside of tests in folders of their own that names what it may not.
pub fn problems() -> Result<Vec<String>> {
    let root = paths::root();
    let mut problems = Vec::new();
    for file in tidy::files_below(&root)? {
        let path = file.to_string_lossy().replace('\\', "/");
        if path.ends_with(".rs") {
            let text = std::fs::read_to_string(root.join(&file)).with_context(|| format!("read {path}"))?;
            problems.extend(problems_of(&path, &text));
        }
    }
    Ok(problems)
}

fn problems_of(path: &str, text: &str) -> Vec<String> {
    let is_free = path == OWN_FILE || path.split('/').any(|folder| folder == "tests");
    let breaks = |(name, files): &&(&str, &[&str])| {
        !is_free && !files.iter().any(|file| path.starts_with(file)) && text.contains(name)
    };
    let broken = NAMED_ONLY_IN.iter().filter(breaks);
    broken
        .map(|(name, files)| format!("{path} names {name}; only {} and tests may", files.join(", ")))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_commander_makes_command_frames() {
        let call = "let length = frame::encode_command(&header, &command, &key, &mut out);";
        assert_eq!(problems_of("lab/src/link.rs", call).len(), 1);
        assert_eq!(
            problems_of("drills/src/stale.rs", "use robot::frame::encode_group;").len(),
            1
        );
        assert!(problems_of("lab/src/commander.rs", call).is_empty());
        assert_eq!(problems_of("lab/src/commander.rs", "encode_group").len(), 1);
        assert!(problems_of("robot/tests/hostile.rs", call).is_empty());
    }
}
