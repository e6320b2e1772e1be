//! A law that cannot go on, and how a law stands after a tick. Laws that ship always answer; those of users may not.

use serde::{Deserialize, Serialize};

/// What kind of fault ended a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// It cannot be compiled or set up.
    Refused,
    /// It raised an error or trapped.
    Failed,
    /// It used up its operations, fuel, stack or memory.
    Exhausted,
    /// It asked for something that is not a finite number or not possible.
    BadCommand,
    /// It told a robot that has not finished nothing for too long, or did not answer in time.
    Silent,
    /// Its process ended.
    Died,
}

/// Why a controller cannot go on: the user's fault, in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    pub kind: FaultKind,
    /// Control tick at which it happened; none while it was being set up.
    pub tick: Option<u64>,
    /// Line and column in a script, both from 1.
    pub line: Option<u32>,
    pub column: Option<u32>,
    /// What happened, as the end of a sentence.
    pub reason: String,
}

impl Fault {
    /// A fault without a place in a script.
    pub fn new(kind: FaultKind, tick: Option<u64>, reason: impl Into<String>) -> Fault {
        Fault {
            kind,
            tick,
            line: None,
            column: None,
            reason: reason.into(),
        }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(tick) = self.tick {
            write!(f, "tick {tick}: ")?;
        }
        if let (Some(line), Some(column)) = (self.line, self.column) {
            write!(f, "line {line}, column {column}: ")?;
        }
        f.write_str(&self.reason)
    }
}

/// How a law stands after [`super::Law::step`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Standing<'a> {
    /// The demands are those of this tick.
    Answered,
    /// No demands in time: as a tick whose deadline has passed.
    Late,
    /// It will not answer again: the robots stop.
    Faulty(&'a Fault),
}

/// Line and column, both from 1, in the text of a [`Fault`], also where it stands in a longer sentence.
pub fn place_in(text: &str) -> Option<[u32; 2]> {
    text.match_indices("line ").find_map(|(at, word)| {
        let (line, rest) = text[at + word.len()..].split_once(", column ")?;
        let (column, _) = rest.split_once(": ")?;
        Some([line.parse().ok()?, column.parse().ok()?])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_in_a_text_is_that_of_its_fault() {
        let mut fault = Fault::new(FaultKind::Failed, Some(7), "line 3 of nothing, column 2");
        assert_eq!(place_in(&fault.to_string()), None);
        (fault.line, fault.column) = (Some(12), Some(9));
        for text in [fault.to_string(), format!("the controller cannot go on: {fault}")] {
            assert_eq!(place_in(&text), Some([12, 9]), "{text}");
        }
        assert_eq!(place_in("line 4, column "), None);
    }
}
