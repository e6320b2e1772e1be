//! Which words may stand at the cursor of a script.

use super::highlight::{Token, tokens};
use controllers::vocabulary::{Of, WORDS, Word};

/// So many letters open the list by themselves: a single one is mostly a variable, and Enter a new line.
const LETTERS_LEAST: usize = 2;

/// Words for the place where the cursor is.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestions {
    /// Where the begun word starts, in characters.
    pub start: usize,
    /// The begun word.
    pub begun: String,
    pub words: Vec<&'static Word>,
}

/// What may be meant; none where there is nothing to complete.
///
/// - `cursor`: in characters from the start of the text.
/// - `asked`: the person wants to see what there is, also before a word is begun.
pub fn suggestions(text: &str, cursor: usize, asked: bool) -> Option<Suggestions> {
    let at = byte_at(text, cursor);
    let letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let before = &text[..at];
    let stem = before.trim_end_matches(letter);
    let begun = &before[stem.len()..];
    if begun.starts_with(|c: char| c.is_ascii_digit()) || is_prose(text, at) {
        return None;
    }
    let kinds: &[Of] = match receiver(stem) {
        Some("now") => &[Of::Now],
        Some(name) if name.starts_with(|c: char| c.is_ascii_digit()) => return None,
        Some(_) => &[Of::Robot, Of::Target, Of::Collection],
        None if begun.len() < LETTERS_LEAST && !asked => return None,
        None => &[Of::Function, Of::Language],
    };
    let mut words: Vec<&Word> = Vec::new();
    for word in WORDS
        .iter()
        .filter(|word| kinds.contains(&word.of) && word.name.starts_with(begun))
    {
        let known = |other: &&Word| other.name == word.name && (word.of != Of::Function || other.form == word.form);
        if !words.iter().any(known) {
            words.push(word);
        }
    }
    let is_whole = words.iter().all(|word| word.name == begun);
    (!words.is_empty() && (!is_whole || asked)).then(|| Suggestions {
        start: before.chars().count() - begun.chars().count(),
        begun: begun.to_owned(),
        words,
    })
}

/// What stands before the dot that the text ends with; empty behind a bracket.
fn receiver(stem: &str) -> Option<&str> {
    let owner = stem.strip_suffix('.').filter(|owner| !owner.ends_with('.'))?;
    let start = owner.trim_end_matches(|c: char| c.is_ascii_alphanumeric() || c == '_');
    Some(&owner[start.len()..])
}

/// Within a comment or a text.
fn is_prose(text: &str, at: usize) -> bool {
    tokens(text).iter().any(|(range, token)| {
        let piece = &text[range.clone()];
        let closed = |mark: char| piece.len() > 1 && piece.ends_with(mark);
        let is_open = *token == Token::Comment || !piece.chars().next().is_some_and(closed);
        let open_end = is_open && range.end == at;
        matches!(token, Token::Comment | Token::Text) && range.start < at && (at < range.end || open_end)
    })
}

/// The text with a word in the place of the begun one, and the cursor behind it.
pub fn complete(text: &str, cursor: usize, found: &Suggestions, word: &Word) -> (String, usize) {
    let (from, to) = (byte_at(text, found.start), byte_at(text, cursor));
    let bracketed = text[to..].starts_with('(');
    let behind = word.form.rsplit_once(word.name).map_or("", |(_, behind)| behind);
    let bracket = match behind {
        _ if bracketed || word.of == Of::Language => "",
        "()" => "()",
        behind if behind.starts_with('(') => "(",
        _ => "",
    };
    let inserted = format!("{}{bracket}", word.name);
    let cursor = found.start + inserted.chars().count();
    (format!("{}{inserted}{}", &text[..from], &text[to..]), cursor)
}

/// Byte of a character; the end of the text beyond it.
pub fn byte_at(text: &str, character: usize) -> usize {
    text.char_indices().nth(character).map_or(text.len(), |(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<&'static str> {
        let found = suggestions(text, text.chars().count(), false);
        found.map_or_else(Vec::new, |found| found.words.iter().map(|word| word.name).collect())
    }

    #[test]
    fn words_follow_what_is_begun_and_what_stands_before_the_dot() {
        assert_eq!(names("vel"), ["velocity", "velocity"]);
        assert_eq!(names("now.rob"), ["robots", "robot"]);
        assert!(names("now.").contains(&"time_s") && !names("now.").contains(&"x_m"));
        assert_eq!(names("robot.x"), ["x_m"]);
        assert_eq!(names("now.robot(0).yaw"), ["yaw_rad", "yaw_rate_rad_per_s"]);
        for nothing in [
            "",
            "v",
            "let ",
            "now.count",
            "0.",
            "0..",
            "// vel",
            "\"vel",
            "1vel",
            "zzz",
        ] {
            assert_eq!(names(nothing), [""; 0], "{nothing}");
        }
        assert!(suggestions("", 0, true).is_some_and(|found| found.words.len() > 20));
    }

    #[test]
    fn a_word_takes_the_place_of_the_begun_one_and_brings_its_bracket() {
        let done = |text: &str, cursor: usize, name: &str| {
            let found = suggestions(text, cursor, true).expect("suggestions");
            let word = *found.words.iter().find(|word| word.name == name).expect("the word");
            complete(text, cursor, &found, word)
        };
        assert_eq!(done("ä sto;", 5, "stop"), ("ä stop(;".to_owned(), 7));
        assert_eq!(done("sto(0)", 3, "stop"), ("stop(0)".to_owned(), 4));
        assert_eq!(done("P", 1, "PI"), ("PI()".to_owned(), 4));
        assert_eq!(done("now.tim", 7, "time_s"), ("now.time_s".to_owned(), 10));
        assert_eq!(done("whi", 3, "while"), ("while".to_owned(), 5));
    }
}
