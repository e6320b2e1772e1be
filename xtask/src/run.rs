//! Running other programs.

use std::env;
use std::path::Path;
use std::process::{Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::{paths, sys};

/// Variables `cargo run` sets for us that must not reach another cargo: build scripts watch some of them
/// and would rebuild their package at every other call.
fn is_left_over_from_cargo_run(name: &str) -> bool {
    name.starts_with("CARGO_PKG_")
        || matches!(
            name,
            "CARGO_MANIFEST_DIR"
                | "CARGO_MANIFEST_PATH"
                | "CARGO_MANIFEST_LINKS"
                | "CARGO_BIN_NAME"
                | "CARGO_CRATE_NAME"
                | "CARGO_PRIMARY_PACKAGE"
                | "OUT_DIR"
        )
}

/// A command in the checkout without standard input that ends when this process ends.
pub fn command(program: impl AsRef<Path>) -> Command {
    let mut command = Command::new(program.as_ref());
    command.current_dir(paths::root()).stdin(Stdio::null());
    for (name, _) in env::vars_os() {
        if name.to_str().is_some_and(is_left_over_from_cargo_run) {
            command.env_remove(&name);
        }
    }
    sys::die_with_parent(&mut command, libc::SIGTERM);
    command
}

/// The cargo that runs us.
pub fn cargo<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Command {
    let mut command = command(env::var_os("CARGO").map_or_else(|| "cargo".into(), std::path::PathBuf::from));
    command.args(arguments);
    command
}

/// Command line as a person would type it.
pub fn text(command: &Command) -> String {
    let program = Path::new(command.get_program())
        .file_name()
        .unwrap_or(command.get_program());
    let words = std::iter::once(program).chain(command.get_args());
    words
        .map(|word| word.to_string_lossy().into_owned())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Runs to the end; an error when the program cannot start or does not succeed.
pub fn succeed(command: &mut Command) -> Result<()> {
    let status = command
        .status()
        .with_context(|| format!("cannot start `{}`", text(command)))?;
    if !status.success() {
        bail!("`{}` failed ({status})", text(command));
    }
    Ok(())
}

/// Runs to the end without showing output; standard output when it succeeded, standard error in the error.
pub fn read(command: &mut Command) -> Result<String> {
    let output = command
        .output()
        .with_context(|| format!("cannot start `{}`", text(command)))?;
    if !output.status.success() {
        bail!(
            "`{}` failed ({}): {}",
            text(command),
            output.status,
            last_lines(&output, 5)
        );
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn last_lines(output: &Output, count: usize) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(count)..].join(" / ")
}

/// Runs in a process group of its own; the whole group is killed at the limit. `None` when that happened.
pub fn within(command: &mut Command, limit: Duration) -> Result<Option<ExitStatus>> {
    use std::os::unix::process::CommandExt;
    let mut child = command
        .process_group(0)
        .spawn()
        .with_context(|| format!("cannot start `{}`", text(command)))?;
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if started.elapsed() > limit {
            sys::signal_group(child.id(), libc::SIGKILL);
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(30));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_over_its_time_is_killed_with_its_children() {
        let started = Instant::now();
        let end = within(
            Command::new("sh").args(["-c", "sleep 30 & wait"]),
            Duration::from_millis(200),
        )
        .unwrap();
        assert!(end.is_none());
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_failing_program_is_an_error_with_its_last_words() {
        let error = read(Command::new("sh").args(["-c", "echo no such luck >&2; exit 4"]))
            .unwrap_err()
            .to_string();
        assert!(error.contains("no such luck"), "{error}");
        assert!(succeed(Command::new("sh").args(["-c", "exit 4"])).is_err());
    }

    #[test]
    fn only_the_variables_of_cargo_run_are_hidden() {
        assert!(is_left_over_from_cargo_run("CARGO_PKG_NAME"));
        assert!(is_left_over_from_cargo_run("CARGO_MANIFEST_DIR"));
        for kept in ["CARGO", "CARGO_HOME", "CARGO_TARGET_DIR", "PATH", "RUSTUP_TOOLCHAIN"] {
            assert!(!is_left_over_from_cargo_run(kept), "{kept}");
        }
    }
}
