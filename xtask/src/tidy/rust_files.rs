//! Rules for one Rust file.

use std::path::Path;

/// Longest file without a reason in its head.
const LINES_MAX: usize = 600;
/// Lines that count as the head.
const HEAD_LINES: usize = 20;
/// Stands in the head of a file that is long on purpose, followed by the reason.
const LONG_BECAUSE: &str = "// tidy: long because ";
/// Marks of unfinished work, put together here so that this file is not found itself.
const MARKS: &[&str] = &[
    concat!("TO", "DO"),
    concat!("FIX", "ME"),
    concat!("to", "do!("),
    concat!("unimple", "mented!("),
];

/// Every broken rule of one file.
pub fn problems(file: &Path, text: &str) -> Vec<String> {
    let mut problems = Vec::new();
    let lines = text.lines().count();
    if lines > LINES_MAX && !has_reason(text) {
        problems.push(format!(
            "{}: {lines} lines; split it, or say in its head `{LONG_BECAUSE}...`",
            file.display()
        ));
    }
    for (index, line) in text.lines().enumerate() {
        for mark in MARKS.iter().filter(|mark| has_word(line, mark)) {
            problems.push(format!("{}:{}: {mark}", file.display(), index + 1));
        }
    }
    problems
}

fn has_reason(text: &str) -> bool {
    text.lines().take(HEAD_LINES).any(|line| {
        line.trim()
            .strip_prefix(LONG_BECAUSE)
            .is_some_and(|reason| reason.trim().len() > 5)
    })
}

/// True when the mark stands in the line and is not the end of a longer word.
fn has_word(line: &str, mark: &str) -> bool {
    let is_letter = |letter: char| letter.is_alphanumeric() || letter == '_';
    line.match_indices(mark).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + mark.len()..].chars().next();
        !before.is_some_and(is_letter) && (mark.ends_with('(') || !after.is_some_and(is_letter))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(text: &str) -> usize {
        problems(Path::new("a.rs"), text).len()
    }

    #[test]
    fn a_long_file_needs_a_reason() {
        let long = "let a = 1;\n".repeat(LINES_MAX + 1);
        assert_eq!(count(&long), 1);
        assert_eq!(count(&"let a = 1;\n".repeat(LINES_MAX)), 0);
        assert_eq!(count(&format!("{LONG_BECAUSE}it is one table of equations\n{long}")), 0);
        assert_eq!(count(&format!("{LONG_BECAUSE}\n{long}")), 1, "a reason has words");
    }

    #[test]
    fn unfinished_work_is_found_where_it_stands() {
        assert_eq!(count(&format!("fn a() {{ {}) }}\n", MARKS[2])), 1);
        assert_eq!(count(&format!("// {}: later\n", MARKS[0])), 1);
        assert_eq!(count("let methodology = mastodon!(1);\n"), 0);
    }
}
