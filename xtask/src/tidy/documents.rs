//! Documents name only what exists, and the code map names every package.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;

/// Endings that make a word in backticks a file of ours.
const KNOWN_ENDINGS: &[&str] = &[
    "rs", "md", "toml", "json", "sql", "js", "html", "sh", "py", "png", "yml", "yaml",
];
/// Files and folders that exist only while something runs or inside an archive; no document can point at them in the checkout.
const MADE_WHEN_RUNNING: &[&str] = &[
    "data/",
    "logs/",
    "objects/",
    "tokens/",
    "target/",
    "target-wasm/",
    "static/bundle/",
    "bundle/",
    "robots/",
    "up.json",
    "link-keys.json",
    "manifest.json",
    "experiment.json",
    "verdict.json",
    "run.json",
    "track.json",
    "replay.json",
    "openapi.json",
    "lab.json",
    "claim.json",
    "web_ui.js",
    "sim_wasm.js",
    "server.addr",
    "description.json",
];

/// Every link of a document that leads nowhere, and every package the code map leaves out.
pub fn problems(root: &Path, files: &[PathBuf]) -> Result<Vec<String>> {
    let mut problems = Vec::new();
    for name in ["README.md", "ARCHITECTURE.md"] {
        if !root.join(name).is_file() {
            problems.push(format!("{name} is missing"));
        }
    }
    for file in files.iter().filter(|file| is_document(file)) {
        let text = fs::read_to_string(root.join(file))?;
        for word in references(&text) {
            if !exists(root, file, &word, files) {
                problems.push(format!("{}: `{word}` does not exist", file.display()));
            }
        }
    }
    let map = code_map(&fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap_or_default());
    let packages = files
        .iter()
        .filter(|file| file.ends_with("Cargo.toml"))
        .filter_map(|file| file.parent());
    let named =
        |package: &&Path| !package.as_os_str().is_empty() && !map.contains(&format!("`{}/`", package.display()));
    problems.extend(
        packages
            .filter(named)
            .map(|package| format!("ARCHITECTURE.md: the code map does not name `{}/`", package.display())),
    );
    Ok(problems)
}

fn is_document(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "md") && !file.starts_with("tests/fixtures")
}

/// The section whose heading says "code map".
fn code_map(text: &str) -> String {
    let is_heading = |line: &str| line.starts_with('#');
    let inside = text
        .lines()
        .skip_while(|line| !(is_heading(line) && line.to_lowercase().contains("code map")));
    let mut lines = inside.peekable();
    lines.next();
    lines
        .take_while(|line| !is_heading(line))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Paths in backticks and targets of relative links, outside of code blocks.
fn references(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut in_block = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if !in_block {
            found.extend(
                line.split('`')
                    .skip(1)
                    .step_by(2)
                    .filter(|word| is_path(word))
                    .map(str::to_owned),
            );
            found.extend(link_targets(line));
        }
    }
    found
}

fn is_path(word: &str) -> bool {
    let odd = |letter: char| !(letter.is_alphanumeric() || "._-/".contains(letter));
    if word.is_empty() || word.starts_with('/') || word.starts_with('-') || word.contains("//") || word.contains(odd) {
        return false;
    }
    let name = word.rsplit('/').next().unwrap_or(word);
    let ending = name
        .rsplit_once('.')
        .filter(|(stem, _)| !stem.is_empty())
        .map(|(_, ending)| ending);
    word.ends_with('/') || ending.is_some_and(|ending| KNOWN_ENDINGS.contains(&ending))
}

/// Targets of `[text](target)` that stay in the checkout.
fn link_targets(line: &str) -> Vec<String> {
    let pieces = line.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    let targets = pieces.map(|(target, _)| target.split(['#', ' ']).next().unwrap_or_default());
    targets
        .filter(|target| {
            !target.is_empty()
                && !target.contains("://")
                && !target.starts_with(['/', '<'])
                && !target.starts_with("mailto:")
        })
        .map(str::to_owned)
        .collect()
}

/// From the root, beside the document, in a package of the same document's folder, or, for a bare name, anywhere.
fn exists(root: &Path, document: &Path, word: &str, files: &[PathBuf]) -> bool {
    let beside = root.join(document.parent().unwrap_or(Path::new(""))).join(word);
    if root.join(word).exists() || beside.exists() || is_made_when_running(word) {
        return true;
    }
    let is_bare_name = !word.contains('/');
    is_bare_name
        && files
            .iter()
            .any(|file| file.file_name().is_some_and(|name| name == word))
}

fn is_made_when_running(word: &str) -> bool {
    MADE_WHEN_RUNNING.iter().any(|made| {
        word == *made || (made.ends_with('/') && word.starts_with(made)) || word.ends_with(&format!("/{made}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_a_path_and_what_is_not() {
        for path in [
            "twin/",
            "lab/src/claim.rs",
            "Cargo.toml",
            "docs/adr/0001-one.md",
            ".ci/",
            "README.md",
        ] {
            assert!(is_path(path), "{path}");
        }
        for word in [
            "cargo xtask up",
            "/api/v1/runs/",
            "f64::sqrt",
            "twin",
            "https://a.b/",
            "<data>/up.json",
            "docs/*.md",
            "1.95",
            "run.mcap",
            "--json",
            ".rs",
        ] {
            assert!(!is_path(word), "{word}");
        }
    }

    #[test]
    fn code_blocks_are_examples_and_links_are_references() {
        let text = "see `gone/` and [x](docs/x.md#part) and [y](https://y.z/)\n```\n`block/`\n```\n![p](pic.png)\n";
        assert_eq!(references(text), ["gone/", "docs/x.md", "pic.png"]);
    }

    #[test]
    fn a_dead_path_and_a_package_missing_from_the_map_are_found() {
        let root = std::env::temp_dir().join(format!("xtask-documents-{}", std::process::id()));
        fs::create_dir_all(root.join("alpha/src")).unwrap();
        let files = ["ARCHITECTURE.md", "README.md", "alpha/Cargo.toml", "alpha/src/lib.rs"].map(PathBuf::from);
        for file in &files {
            fs::write(root.join(file), "").unwrap();
        }
        fs::write(
            root.join("README.md"),
            "`alpha/src/lib.rs`, `lib.rs`, `alpha/src/gone.rs`, `beta/`, `data/up.json`\n",
        )
        .unwrap();
        fs::write(root.join("ARCHITECTURE.md"), "## Code map\n`alpha/`\n## More\n").unwrap();
        let found = problems(&root, &files).unwrap();
        assert_eq!(
            found,
            [
                "README.md: `alpha/src/gone.rs` does not exist",
                "README.md: `beta/` does not exist"
            ]
        );
        fs::write(root.join("ARCHITECTURE.md"), "## Code map\n## More\n`alpha/`\n").unwrap();
        fs::write(root.join("README.md"), "").unwrap();
        assert_eq!(
            problems(&root, &files).unwrap(),
            ["ARCHITECTURE.md: the code map does not name `alpha/`"]
        );
        fs::remove_dir_all(&root).unwrap();
    }
}
