//! Rows of the reliability goals, each at its full count: a drill in virtual time, or tests that are ignored otherwise. `names` are sets of the blind bench that were mended once, `page` is a long way through the page.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::setup::find_browser;
use crate::{paths, run, test};

/// How a row is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// Arguments of `robopheus-drills`; it prints the row's line itself.
    Drill(&'static str),
    /// An ignored test: package, test program, name.
    Test(&'static str, &'static str, &'static str),
}

/// A row, or a part of one.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// As on the command line: the name of the row, with a part after `-`.
    pub name: &'static str,
    way: Way,
}

const fn drill(name: &'static str, verb: &'static str) -> Row {
    Row {
        name,
        way: Way::Drill(verb),
    }
}

const fn ignored(name: &'static str, package: &'static str, binary: &'static str, case: &'static str) -> Row {
    Row {
        name,
        way: Way::Test(package, binary, case),
    }
}

/// Shortest first; those that measure wall clock run alone, as all do here.
pub const ROWS: &[Row] = &[
    drill("S1", "link-loss"),
    ignored("S1-udp", "system-tests", "link_cuts", "a_hundred_links_are_cut"),
    drill("S2", "nuisance"),
    ignored("S2-robot", "robot", "cuts", ""),
    drill("S3", "blind"),
    drill("S4", "stale"),
    ignored("S4-robot", "robot", "attacks", ""),
    ignored("S6", "control", "filter_total", ""),
    drill("S7", "geofence"),
    drill("S8", "audit"),
    drill("S9", "deadlock"),
    ignored("S10", "system-tests", "protective_stop", "five_hundred_presses"),
    drill("S11", "agent"),
    ignored("S11-kill", "system-tests", "kill", "the_laboratory_dies_twenty_times"),
    ignored(
        "S12",
        "system-tests",
        "loop_timing",
        "ticks_are_in_time_idle_and_under_load",
    ),
    drill("S13", "liar"),
    drill("S14", "ladder"),
    ignored("names", "blind", "alone", ""),
    ignored("names-beside", "blind", "beside_others", ""),
    ignored("page", "system-tests", "own_page", ""),
    ignored("X1", "sandbox", "rows", "x1"),
    ignored("X2", "sandbox", "rows", "x2"),
    ignored("X3", "sandbox", "rows", "x3"),
    ignored("X6", "sandbox", "rows", "x6"),
    ignored("X7", "sandbox", "rows", "x7"),
    drill("S5-strangers", "strangers"),
    drill("S5-obstacles", "obstacles"),
    drill("S5-approach", "approach"),
    drill("S5", "adversary"),
    drill("S5-search", "falsify"),
    ignored(
        "S10-driving",
        "system-tests",
        "driving_stop",
        "five_hundred_presses_on_robots_that_drive",
    ),
];

/// The rows that were asked for, all when none was; a row's name stands for its parts, too.
///
/// - Errors: a name that is no row's.
pub fn chosen(names: &[String]) -> Result<Vec<Row>> {
    let matches = |row: &Row, name: &str| {
        row.name.eq_ignore_ascii_case(name)
            || row
                .name
                .split_once('-')
                .is_some_and(|(whole, _)| whole.eq_ignore_ascii_case(name))
    };
    if let Some(unknown) = names.iter().find(|name| !ROWS.iter().any(|row| matches(row, name))) {
        let known: Vec<_> = ROWS.iter().map(|row| row.name).collect();
        bail!("there is no row {unknown:?}; choose from {}", known.join(" "));
    }
    let wanted = |row: &&Row| names.is_empty() || names.iter().any(|name| matches(row, name));
    Ok(ROWS.iter().filter(wanted).copied().collect())
}

/// Where what rows printed is kept, by the commit that was measured.
pub fn kept_folder() -> Result<PathBuf> {
    let mut git = run::command("git");
    let commit = run::read(git.args(["describe", "--always", "--dirty"]))?;
    let folder = paths::program_folder()?.join("soak").join(commit.trim());
    fs::create_dir_all(&folder).with_context(|| format!("make {}", folder.display()))?;
    Ok(folder)
}

impl Row {
    /// Measures the row and keeps what it printed; an error when it is missed.
    pub fn measure(&self, kept: &Path) -> Result<()> {
        let mut command = self.command()?;
        let words = run::text(&command);
        println!("{words}");
        let mut child = command
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start `{words}`"))?;
        let mut text = String::new();
        for line in BufReader::new(child.stdout.take().context("no output")?).lines() {
            let line = line?;
            println!("{line}");
            text.push_str(&line);
            text.push('\n');
        }
        let status = child.wait()?;
        let file = self.file(kept, status.success());
        fs::remove_file(self.file(kept, !status.success())).ok();
        fs::write(&file, &text).with_context(|| format!("write {}", file.display()))?;
        if !status.success() {
            bail!("`{words}` failed ({status}), see {}", file.display());
        }
        Ok(())
    }

    /// What it printed when it was measured before, and whether it held.
    pub fn kept(&self, kept: &Path) -> Option<(bool, String)> {
        let read = |held: bool| Some((held, fs::read_to_string(self.file(kept, held)).ok()?));
        read(true).or_else(|| read(false))
    }

    /// Lines of the table among what it printed.
    pub fn table<'a>(&self, text: &'a str) -> Vec<&'a str> {
        let row = self.name.split('-').next().unwrap_or_default();
        let is_line = |line: &&str| line.split_whitespace().next() == Some(row);
        text.lines().filter(is_line).collect()
    }

    fn file(&self, kept: &Path, held: bool) -> PathBuf {
        kept.join(format!("{}.{}.txt", self.name, if held { "holds" } else { "missed" }))
    }

    fn command(&self) -> Result<Command> {
        match self.way {
            Way::Drill(verb) => {
                let mut command = run::command(paths::program_folder()?.join("robopheus-drills"));
                command.arg(verb);
                Ok(command)
            }
            Way::Test(package, binary, case) => {
                let mut command = if test::has_nextest() {
                    let mut filter = format!("package({package}) & binary({binary})");
                    if !case.is_empty() {
                        filter.push_str(&format!(" & test(={case})"));
                    }
                    run::cargo([
                        "nextest",
                        "run",
                        "--locked",
                        "--profile",
                        "soak",
                        "--no-capture",
                        "--run-ignored",
                        "only",
                        "--filterset",
                        &filter,
                    ])
                } else {
                    let mut command = run::cargo(["test", "--locked", "--package", package, "--test", binary, "--"]);
                    command.args(["--ignored", "--nocapture"]);
                    if !case.is_empty() {
                        command.args(["--exact", case]);
                    }
                    command
                };
                test::export_own_program(&mut command)?;
                if let Ok(browser) = find_browser() {
                    browser.export(&mut command);
                }
                Ok(command)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(asked: &[&str]) -> Vec<&'static str> {
        let asked: Vec<String> = asked.iter().map(|name| (*name).to_owned()).collect();
        chosen(&asked).unwrap().iter().map(|row| row.name).collect()
    }

    #[test]
    fn a_row_stands_for_its_parts_and_a_part_for_itself() {
        assert_eq!(names(&["s10"]), ["S10", "S10-driving"]);
        assert_eq!(names(&["S10-driving", "S1"]), ["S1", "S1-udp", "S10-driving"]);
        assert_eq!(names(&[]).len(), ROWS.len());
        let unknown = chosen(&["S99".to_owned()]).unwrap_err().to_string();
        assert!(unknown.contains("S99") && unknown.contains("S5-search"), "{unknown}");
    }

    #[test]
    fn the_table_line_is_found_and_kept() {
        let folder = std::env::temp_dir().join(format!("xtask-soak-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let row = ROWS.iter().find(|row| row.name == "S5-search").unwrap();
        assert_eq!(row.kept(&folder), None);
        let text = "row  what\nS5   search 5000  13.6 mm  holds\nS51 no\n";
        fs::write(row.file(&folder, false), text).unwrap();
        let (held, kept) = row.kept(&folder).unwrap();
        assert!(!held);
        assert_eq!(row.table(&kept), ["S5   search 5000  13.6 mm  holds"]);
        fs::remove_dir_all(&folder).unwrap();
    }
}
