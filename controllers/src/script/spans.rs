//! Where ranges may stand: in the head of a loop, `for k in 0..4`, where nothing keeps them.
//!
//! The language lets a range in square brackets replace a part of a text, of any size and by one operation, and does not look at
//! how long the whole becomes: texts grew to megabytes, and a tick took minutes. Whether an index is a range is not known before
//! the script runs; so no variable, no function and no array gets one to hand on, and `range(0, 4)` gives [`Steps`].

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rhai::{Engine, LexError, Token};

const MISPLACED: &str = "a range may stand in the head of a loop, `for k in 0..4`, and nowhere else; of texts, `sub_string(start, length)` gives a part";

/// Whole numbers that a loop runs through; square brackets do not take them.
#[derive(Clone)]
struct Steps(Range<i64>);

impl Iterator for Steps {
    type Item = i64;

    fn next(&mut self) -> Option<i64> {
        self.0.next()
    }
}

/// Where the compiler is among the words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Elsewhere,
    /// Behind `for`.
    Names,
    /// Behind its `in`, so many brackets deep.
    Head(u32),
}

impl Place {
    /// The place behind a word; `None` when the word must not stand here.
    fn behind(self, token: &Token) -> Option<Place> {
        Some(match (self, token) {
            (Place::Head(0), Token::ExclusiveRange | Token::InclusiveRange) => self,
            (_, Token::ExclusiveRange | Token::InclusiveRange) => return None,
            (_, Token::For) => Place::Names,
            (Place::Names, Token::In) => Place::Head(0),
            // It would hand the range on, to a function `contains`.
            (Place::Head(_), Token::In | Token::NotIn) => return None,
            (Place::Head(0), Token::LeftBrace) => Place::Elsewhere,
            (Place::Head(deep), Token::LeftParen | Token::LeftBracket | Token::LeftBrace | Token::MapStart) => {
                Place::Head(deep.saturating_add(1))
            }
            (Place::Head(deep), Token::RightParen | Token::RightBracket | Token::RightBrace) => {
                Place::Head(deep.saturating_sub(1))
            }
            _ => self,
        })
    }
}

/// Refuses ranges elsewhere, and takes the place of the language's own `range`. For one compilation.
pub(super) fn register(engine: &mut Engine) {
    engine.register_iterator::<Steps>();
    engine.register_fn("range", |from: i64, to: i64| Steps(from..to));
    let place = Mutex::new(Place::Elsewhere);
    #[expect(deprecated, reason = "not deprecated, says its author: it may change")]
    engine.on_parse_token(move |token, _, _| {
        let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
        match place.behind(&token) {
            Some(next) => {
                *place = next;
                token
            }
            None => Token::LexError(Box::new(LexError::Runtime(MISPLACED.into()))),
        }
    });
}
