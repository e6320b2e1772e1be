//! Quick look before a commit, and the same steps as stages of `test`.

use anyhow::{Result, bail};

use crate::stages::Stages;
use crate::{End, arch, paths, run, tidy};

/// `cargo xtask check`.
pub fn check() -> Result<End> {
    let mut stages = Stages::new(&[]);
    add_rules(&mut stages);
    stages.run("clippy", clippy);
    Ok(stages.finish())
}

/// Format, architecture, tidiness: seconds, no compiler.
pub fn add_rules(stages: &mut Stages) {
    stages.run("format", || run::succeed(&mut run::cargo(["fmt", "--all", "--check"])));
    stages.run("architecture", || none(arch::problems()?));
    stages.run("tidiness", || none(tidy::problems()?));
}

/// Lints of every package; a warning is an error.
pub fn clippy() -> Result<()> {
    run::succeed(&mut run::cargo([
        "clippy",
        "--quiet",
        "--locked",
        "--workspace",
        "--all-targets",
        "--",
        "--deny",
        "warnings",
    ]))
}

/// Licences, banned packages and sources, without the network; left out without cargo-deny.
pub fn add_licences(stages: &mut Stages) {
    if paths::on_path("cargo-deny").is_none() {
        stages.leave_out("licences", "cargo-deny is not installed (`cargo install cargo-deny`)");
        return;
    }
    let arguments = ["deny", "--offline", "--locked", "check", "licenses", "bans", "sources"];
    stages.run("licences", || run::succeed(&mut run::cargo(arguments)));
}

fn none(problems: Vec<String>) -> Result<()> {
    if problems.is_empty() {
        return Ok(());
    }
    for problem in &problems {
        eprintln!("  {problem}");
    }
    bail!("{} problems, the first: {}", problems.len(), problems[0])
}
