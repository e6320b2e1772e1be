//! What the user's own controller says and draws, on its way into the record, to watchers and into the archive.

use crate::pilot::Sink;
use crate::record::{Notes, Record};
use api::note::Note;
use control::law;

/// Log lines of one tick that are recorded: the queue is the measurements' first.
const LINES_PER_TICK: usize = 8;
/// Drawings of one tick that are recorded.
const DRAWINGS_PER_TICK: usize = 64;
/// Drawings are recorded in every one of so many ticks: thirty times a second.
pub(crate) const TICKS_PER_DRAWING: i64 = 4;
/// Longest text on the arena; it stands among robots.
const TEXT_BYTES: usize = 200;
/// What a note takes besides its text, roughly.
const NOTE_BYTES: usize = 160;
/// Most bytes of a live frame that notes may take; the service takes frames of 64 KiB.
const LIVE_BYTES: usize = 24 * 1024;
/// Most bytes of a track that notes may take.
const TRACK_BYTES: usize = 4 * 1024 * 1024;

/// Writes down what was said in a tick.
pub(crate) fn tell(notes: &[law::Note], tick: i64, at_us: i64, sink: &mut impl Sink) {
    let (mut lines, mut drawings) = (0, 0);
    let draws = tick % TICKS_PER_DRAWING == 0;
    let kept = notes.iter().filter(|note| {
        let (count, most) = match note {
            law::Note::Log { .. } => (&mut lines, LINES_PER_TICK),
            _ => (&mut drawings, if draws { DRAWINGS_PER_TICK } else { 0 }),
        };
        *count += 1;
        *count <= most
    });
    let notes: Vec<Note> = kept.map(wire).collect();
    if !notes.is_empty() {
        sink.push(Record::Notes(Notes { tick, at_us, notes }));
    }
}

fn wire(note: &law::Note) -> Note {
    match note {
        law::Note::Log { text } => Note::Log { text: text.clone() },
        law::Note::Point { at_m, colour } => Note::Point {
            at_m: *at_m,
            colour: *colour,
        },
        law::Note::Line { from_m, to_m, colour } => Note::Line {
            from_m: *from_m,
            to_m: *to_m,
            colour: *colour,
        },
        law::Note::Text { at_m, text, colour } => Note::Text {
            at_m: *at_m,
            text: text[..text.floor_char_boundary(TEXT_BYTES)].to_owned(),
            colour: *colour,
        },
    }
}

/// Log lines among notes.
pub(crate) fn lines(notes: &[Note]) -> impl Iterator<Item = &str> {
    notes.iter().filter_map(|note| match note {
        Note::Log { text } => Some(text.as_str()),
        _ => None,
    })
}

/// Roughly what a note takes as JSON; escapes double a text at most.
fn bytes(note: &Note) -> usize {
    match note {
        Note::Log { text } | Note::Text { text, .. } => 2 * text.len() + NOTE_BYTES,
        Note::Point { .. } | Note::Line { .. } => NOTE_BYTES,
    }
}

/// Notes for the next live frame: all lines since the last one, and the newest drawings.
#[derive(Debug, Clone, Default)]
pub(crate) struct LiveNotes {
    lines: Vec<Note>,
    left_out: usize,
    bytes: usize,
    drawn_at: i64,
    drawings: Vec<Note>,
}

impl LiveNotes {
    pub(crate) fn take(&mut self, notes: &Notes) {
        let (lines, drawings): (Vec<&Note>, Vec<&Note>) =
            notes.notes.iter().partition(|note| matches!(note, Note::Log { .. }));
        for line in lines {
            if self.bytes + bytes(line) > LIVE_BYTES / 2 {
                self.left_out += 1;
                continue;
            }
            self.bytes += bytes(line);
            self.lines.push(line.clone());
        }
        if !drawings.is_empty() {
            let mut room = LIVE_BYTES / 2;
            self.drawn_at = notes.tick;
            self.drawings.clear();
            for drawing in drawings {
                room = room.saturating_sub(bytes(drawing));
                if room > 0 {
                    self.drawings.push(drawing.clone());
                }
            }
        }
    }

    /// Notes of a frame at a tick.
    pub(crate) fn frame(&mut self, tick: i64) -> Vec<Note> {
        let mut notes = std::mem::take(&mut self.lines);
        if self.left_out > 0 {
            let text = format!("({} more lines; the run's log has them)", self.left_out);
            notes.push(Note::Log { text });
        }
        (self.left_out, self.bytes) = (0, 0);
        // Two recordings of drawings, and a tick for the order of records.
        if tick - self.drawn_at <= 2 * TICKS_PER_DRAWING {
            notes.extend(self.drawings.iter().cloned());
        }
        notes
    }
}

/// Notes for playback.
#[derive(Debug, Clone, Default)]
pub(crate) struct TrackNotes {
    ticks: Vec<api::note::TickNotes>,
    bytes: usize,
}

impl TrackNotes {
    pub(crate) fn take(&mut self, notes: &Notes) {
        if self.bytes > TRACK_BYTES {
            return;
        }
        self.bytes += notes.notes.iter().map(bytes).sum::<usize>();
        let mut kept = notes.notes.clone();
        if self.bytes > TRACK_BYTES {
            let text = "what the controller said and drew from here on stands in run.mcap and log.txt".to_owned();
            kept = vec![Note::Log { text }];
        }
        self.ticks.push(api::note::TickNotes {
            tick: notes.tick,
            notes: kept,
        });
    }

    pub(crate) fn finish(self) -> Vec<api::note::TickNotes> {
        self.ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(text: &str) -> law::Note {
        law::Note::Log { text: text.to_owned() }
    }

    fn point() -> law::Note {
        law::Note::Point {
            at_m: [1.0, 2.0],
            colour: 3,
        }
    }

    fn told(notes: &[law::Note], tick: i64) -> Vec<Note> {
        let mut records: Vec<Record> = Vec::new();
        tell(notes, tick, 0, &mut records);
        match records.pop() {
            Some(Record::Notes(notes)) => notes.notes,
            _ => Vec::new(),
        }
    }

    #[test]
    fn a_tick_tells_a_bounded_number_and_draws_thirty_times_a_second() {
        let many: Vec<law::Note> = (0..256).flat_map(|_| [log("a"), point()]).collect();
        assert_eq!(told(&many, 8).len(), LINES_PER_TICK + DRAWINGS_PER_TICK);
        assert_eq!(told(&many, 9).len(), LINES_PER_TICK);
        assert_eq!(told(&[point()], 9), []);
        let long = law::Note::Text {
            at_m: [0.0; 2],
            text: "ä".repeat(500),
            colour: 0,
        };
        assert!(matches!(&told(&[long], 0)[..], [Note::Text { text, .. }] if text.len() == TEXT_BYTES));
    }

    #[test]
    fn a_live_frame_stays_small_and_shows_what_was_drawn_last() {
        let mut live = LiveNotes::default();
        let of = |tick, notes: &[law::Note]| Notes {
            tick,
            at_us: 0,
            notes: notes.iter().map(wire).collect(),
        };
        for tick in 0..6 {
            live.take(&of(tick, &vec![log(&"\"".repeat(1000)); LINES_PER_TICK]));
        }
        live.take(&of(4, &vec![point(); DRAWINGS_PER_TICK]));
        let notes = live.frame(6);
        let json = serde_json::to_string(&notes).expect("serialises");
        assert!(json.len() <= LIVE_BYTES, "{} bytes", json.len());
        assert!(lines(&notes).last().is_some_and(|text| text.contains("more lines")));
        let drawn = |notes: &[Note]| notes.iter().filter(|note| matches!(note, Note::Point { .. })).count();
        assert_eq!(drawn(&notes), DRAWINGS_PER_TICK);
        assert_eq!(
            (lines(&live.frame(12)).count(), drawn(&live.frame(12))),
            (0, DRAWINGS_PER_TICK)
        );
        assert_eq!(live.frame(18), []);
    }

    #[test]
    fn a_track_holds_its_bound_and_says_so() {
        let mut track = TrackNotes::default();
        for tick in 0..100_000 {
            let notes = vec![Note::Log { text: "x".repeat(900) }];
            track.take(&Notes { tick, at_us: 0, notes });
        }
        let ticks = track.finish();
        assert!(ticks.len() * 900 < TRACK_BYTES && ticks.len() > 1000, "{}", ticks.len());
        assert!(
            ticks
                .last()
                .is_some_and(|last| lines(&last.notes).any(|text| text.contains("run.mcap")))
        );
    }
}
