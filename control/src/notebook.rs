//! What a user's own controller said and drew in a rehearsal, for playback: bounded, and the same in every build.

use serde::{Deserialize, Serialize};

use crate::law::Note;

/// Most bytes of a rehearsal's notes, roughly as they are written; later ones are left out.
pub const NOTES_MAX_BYTES: usize = 4 * 1024 * 1024;
/// What a note takes besides its text.
const NOTE_BYTES: usize = 64;

/// What was said and drawn in one control tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TickNotes {
    /// Control ticks since the run began.
    pub tick: u64,
    pub notes: Vec<Note>,
}

/// Notes of a rehearsal in the order of its ticks.
#[derive(Debug, Clone, Default)]
pub struct Notebook {
    ticks: Vec<TickNotes>,
    bytes: usize,
    is_full: bool,
}

impl Notebook {
    /// Takes a tick's notes down.
    ///
    /// - `with_drawings`: false in ticks between two frames of the replay, which nobody sees.
    pub fn take(&mut self, tick: u64, notes: &[Note], with_drawings: bool) {
        if self.is_full || notes.is_empty() {
            return;
        }
        let mut kept = Vec::new();
        for note in notes {
            let text_bytes = match note {
                Note::Log { text } | Note::Text { text, .. } => text.len(),
                Note::Point { .. } | Note::Line { .. } => 0,
            };
            if !with_drawings && !matches!(note, Note::Log { .. }) {
                continue;
            }
            self.bytes += text_bytes + NOTE_BYTES;
            if self.bytes > NOTES_MAX_BYTES {
                self.is_full = true;
                let text = "what the controller said and drew from here on was not kept".to_owned();
                kept.push(Note::Log { text });
                break;
            }
            kept.push(note.clone());
        }
        if !kept.is_empty() {
            self.ticks.push(TickNotes { tick, notes: kept });
        }
    }

    /// All of it.
    pub fn finish(self) -> Vec<TickNotes> {
        self.ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawings_between_frames_are_left_out_and_the_whole_is_bounded() {
        let log = Note::Log { text: "x".repeat(1000) };
        let point = Note::Point {
            at_m: [0.0, 0.0],
            colour: 1,
        };
        let mut book = Notebook::default();
        book.take(0, &[log.clone(), point.clone()], true);
        book.take(1, &[log.clone(), point.clone()], false);
        book.take(2, std::slice::from_ref(&point), false);
        for tick in 3..10_000 {
            book.take(tick, std::slice::from_ref(&log), true);
        }
        let ticks = book.finish();
        assert_eq!(ticks[0].notes, [log.clone(), point]);
        assert_eq!((ticks[1].tick, &ticks[1].notes[..]), (1, &[log][..]));
        assert_eq!(ticks[2].tick, 3);
        assert!(
            ticks.len() * 1000 <= NOTES_MAX_BYTES && ticks.len() > 3000,
            "{}",
            ticks.len()
        );
        assert!(matches!(&ticks.last().expect("a tick").notes[..], [Note::Log { text }] if text.contains("not kept")));
    }
}
