//! Finds, installs or names every thing a command needs from the machine.

mod apt;
mod browser;
mod onnxruntime;
mod postgres;
mod python;
mod wasm_target;

use std::path::PathBuf;

use anyhow::Result;

pub use browser::{Browser, find as find_browser};
pub use onnxruntime::find as onnx_runtime;
pub use postgres::PostgresBinaries;
pub use wasm_target::WasmToolchain;

use crate::sys;

/// One thing this machine lacks and how to get it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    pub what: &'static str,
    pub remedy: &'static str,
    /// Debian packages that bring it; empty when apt cannot help.
    pub packages: &'static [&'static str],
}

/// What a command is going to use.
#[derive(Clone, Copy, Debug, Default)]
pub struct Needs {
    pub wasm: bool,
    pub postgres: bool,
    pub browser: bool,
    pub python: bool,
}

/// What was found.
#[derive(Debug, Default)]
pub struct Found {
    pub wasm: Option<WasmToolchain>,
    pub postgres: Option<PostgresBinaries>,
    pub browser: Option<Browser>,
    pub python: Option<PathBuf>,
}

/// Looks for everything needed, installs what is missing when that is possible, lists the rest.
///
/// `Ok(None)`: something is missing; it has been listed, all at once.
pub fn set_up(needs: Needs) -> Result<Option<Found>> {
    let (found, missing) = look(needs);
    if missing.is_empty() {
        return Ok(Some(found));
    }
    if !sys::is_root() || !apt::is_there() {
        list(&missing);
        return Ok(None);
    }
    let packages: Vec<&str> = missing.iter().flat_map(|one| one.packages).copied().collect();
    println!("setup: installing {}", packages.join(" "));
    if let Err(error) = apt::install(&packages) {
        eprintln!("setup: {error:#}");
    }
    let (found, missing) = look(needs);
    if missing.is_empty() {
        return Ok(Some(found));
    }
    list(&missing);
    Ok(None)
}

fn look(needs: Needs) -> (Found, Vec<Missing>) {
    let mut found = Found::default();
    let mut missing = Vec::new();
    keep(needs.postgres, postgres::find, &mut found.postgres, &mut missing);
    keep(needs.browser, browser::find, &mut found.browser, &mut missing);
    keep(needs.python, python::find, &mut found.python, &mut missing);
    // Last, because it may try the network for a few seconds.
    keep(needs.wasm, wasm_target::find, &mut found.wasm, &mut missing);
    (found, missing)
}

fn keep<T>(needed: bool, find: fn() -> Result<T, Missing>, place: &mut Option<T>, missing: &mut Vec<Missing>) {
    if !needed {
        return;
    }
    match find() {
        Ok(thing) => *place = Some(thing),
        Err(lack) => missing.push(lack),
    }
}

fn list(missing: &[Missing]) {
    eprintln!("This machine lacks:");
    for lack in missing {
        eprintln!("{}", line_about(lack));
    }
    let packages: Vec<&str> = missing.iter().flat_map(|one| one.packages).copied().collect();
    if !packages.is_empty() && !sys::is_root() {
        eprintln!(
            "On Debian, everything at once: sudo apt-get install {}",
            packages.join(" ")
        );
    }
}

fn line_about(lack: &Missing) -> String {
    format!("  - {}: {}", lack.what, lack.remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LACK: Missing = Missing {
        what: "a thing",
        remedy: "get it",
        packages: &["thing"],
    };

    #[test]
    fn everything_missing_is_collected_before_anything_is_said() {
        let (mut first, mut second): (Option<u8>, Option<u8>) = (None, None);
        let mut missing = Vec::new();
        keep(true, || Err(LACK), &mut first, &mut missing);
        keep(
            true,
            || {
                Err(Missing {
                    what: "another",
                    ..LACK
                })
            },
            &mut second,
            &mut missing,
        );
        keep(false, || Err(LACK), &mut second, &mut missing);
        assert_eq!(missing.len(), 2);
        assert_eq!(line_about(&missing[0]), "  - a thing: get it");
    }
}
