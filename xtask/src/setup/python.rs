//! The Python of the second robot and of the examples' tests.

use std::path::PathBuf;
use std::process::Command;

use super::Missing;
use crate::paths;

/// Least version, as in the examples.
const LEAST: (u32, u32) = (3, 11);

/// Looks on PATH for the program that the tests call.
pub fn find() -> Result<PathBuf, Missing> {
    paths::on_path("python3")
        .filter(|program| version(program).is_some_and(|version| version >= LEAST))
        .ok_or(Missing {
            what: "Python 3.11 or newer (tests of the Python robot)",
            remedy: "install it with your system's package manager so that `python3` is on PATH",
            packages: &["python3"],
        })
}

fn version(program: &PathBuf) -> Option<(u32, u32)> {
    let output = Command::new(program).arg("--version").output().ok()?;
    parse(&String::from_utf8_lossy(&output.stdout))
}

/// Major and minor of `Python 3.11.2`.
fn parse(words: &str) -> Option<(u32, u32)> {
    let mut numbers = words.trim().strip_prefix("Python ")?.split('.');
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_compare_as_numbers() {
        assert!(parse("Python 3.9.18\n") < Some(LEAST));
        assert!(parse("Python 3.11.2") >= Some(LEAST) && parse("Python 3.14.0rc1") >= Some(LEAST));
        assert_eq!(parse("pypy 7"), None);
    }
}
