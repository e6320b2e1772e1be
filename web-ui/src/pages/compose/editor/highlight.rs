//! Tokens of a script, as far as colours need them.

use controllers::vocabulary;
use std::ops::Range;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Token {
    Plain,
    Keyword,
    /// A function that every script may call.
    Function,
    Number,
    /// Texts, also those in backticks.
    Text,
    Comment,
}

/// The whole text in pieces of one kind each, as byte ranges in order and without gaps.
pub fn tokens(text: &str) -> Vec<(Range<usize>, Token)> {
    let mut tokens: Vec<(Range<usize>, Token)> = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let (length, token) = first(&text[at..]);
        match tokens.last_mut() {
            Some((range, Token::Plain)) if token == Token::Plain => range.end += length,
            _ => tokens.push((at..at + length, token)),
        }
        at += length;
    }
    tokens
}

/// Length and kind of the first token; the text is not empty.
fn first(text: &str) -> (usize, Token) {
    let letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let Some(head) = text.chars().next() else {
        return (0, Token::Plain);
    };
    if text.starts_with("//") {
        return (text.find('\n').unwrap_or(text.len()), Token::Comment);
    }
    if text.starts_with("/*") {
        return (block_comment(text), Token::Comment);
    }
    if matches!(head, '"' | '`' | '\'') {
        return (quoted(text, head), Token::Text);
    }
    if head.is_ascii_digit() {
        return (number(text), Token::Number);
    }
    if letter(head) {
        let length = text.find(|c| !letter(c)).unwrap_or(text.len());
        let token = match &text[..length] {
            word if vocabulary::is_keyword(word) => Token::Keyword,
            word if vocabulary::is_function(word) => Token::Function,
            _ => Token::Plain,
        };
        return (length, token);
    }
    (head.len_utf8(), Token::Plain)
}

/// Comments may stand in each other.
fn block_comment(text: &str) -> usize {
    let bytes = text.as_bytes();
    let (mut at, mut depth) = (2, 1);
    while at < bytes.len() && depth > 0 {
        match &bytes[at..] {
            [b'/', b'*', ..] => (at, depth) = (at + 2, depth + 1),
            [b'*', b'/', ..] => (at, depth) = (at + 2, depth - 1),
            _ => at += 1,
        }
    }
    // Between the bytes of a letter nothing above can stop.
    at.min(text.len())
}

/// Up to the closing mark; a text in double quotes that is left open ends with its line.
fn quoted(text: &str, mark: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' if mark != '`' => escaped = true,
            '\n' if mark != '`' => return at,
            c if c == mark => return at + c.len_utf8(),
            _ => {}
        }
    }
    text.len()
}

/// Digits, a point that digits follow (`0..8` is a range), an exponent; `0x` and the like by their letters.
fn number(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let next_is_digit = bytes.get(at + 1).is_some_and(u8::is_ascii_digit);
        match bytes[at] {
            c if c.is_ascii_alphanumeric() || c == b'_' => at += 1,
            b'.' if next_is_digit => at += 1,
            b'-' | b'+' if next_is_digit && at > 0 && matches!(bytes[at - 1], b'e' | b'E') => at += 1,
            _ => break,
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(text: &str) -> Vec<(&str, Token)> {
        let pieces = tokens(text).into_iter();
        pieces
            .filter(|(_, token)| *token != Token::Plain)
            .map(|(range, token)| (&text[range], token))
            .collect()
    }

    #[test]
    fn each_kind_is_known() {
        assert_eq!(
            kinds("let x = 1.5e-3; // half\nfor k in 0..8 { print(`a ${k}\nb`); }"),
            [
                ("let", Token::Keyword),
                ("1.5e-3", Token::Number),
                ("// half", Token::Comment),
                ("for", Token::Keyword),
                ("in", Token::Keyword),
                ("0", Token::Number),
                ("8", Token::Number),
                ("print", Token::Function),
                ("`a ${k}\nb`", Token::Text),
            ]
        );
        assert_eq!(kinds("\"a \\\" b\" x"), [("\"a \\\" b\"", Token::Text)]);
        assert_eq!(kinds("/* a /* b */ c */ x"), [("/* a /* b */ c */", Token::Comment)]);
        assert_eq!(kinds("letter sink"), []);
    }

    #[test]
    fn pieces_join_to_the_text_whatever_it_is() {
        let mut texts: Vec<String> = controllers::gallery::SCRIPTS
            .iter()
            .map(|one| one.script.to_owned())
            .collect();
        texts.extend(
            [
                "/*",
                "/* ä */ ö",
                "\"offen\nlet",
                "'",
                "`",
                "1..",
                "1.e",
                "ß1",
                "\\",
                "/*/",
            ]
            .map(str::to_owned),
        );
        for text in texts {
            let joined: String = tokens(&text)
                .into_iter()
                .map(|(range, _)| text[range].to_owned())
                .collect();
            assert_eq!(joined, text);
        }
    }
}
