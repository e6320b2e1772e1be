//! Keys that an editor of programs treats in its own way: Tab and Enter keep the indentation.

use super::completion::byte_at;
use egui::{Event, Key, Ui};

const STEP: &str = "    ";

/// Turns Tab and Enter into the text that they stand for here.
///
/// - `cursor`: in characters, before this frame's events.
pub fn indent(ui: &Ui, text: &str, cursor: usize) {
    ui.input_mut(|input| {
        // What is typed before it in the same frame is not in the text yet.
        let mut is_first = true;
        for event in &mut input.events {
            match event {
                Event::Key {
                    key: key @ (Key::Tab | Key::Enter),
                    pressed: true,
                    modifiers,
                    ..
                } if modifiers.is_none() => {
                    let inserted = match key {
                        Key::Tab => STEP.to_owned(),
                        _ if is_first => line_break(text, cursor),
                        _ => continue,
                    };
                    if inserted != "\n" {
                        *event = Event::Text(inserted);
                    }
                    is_first = false;
                }
                Event::Text(_) | Event::Paste(_) => is_first = false,
                _ => {}
            }
        }
    });
}

/// A new line that begins where this one does, one step further behind an opening bracket.
fn line_break(text: &str, cursor: usize) -> String {
    let before = &text[..byte_at(text, cursor)];
    let line = before.rsplit('\n').next().unwrap_or_default();
    let blank = &line[..line.len() - line.trim_start_matches([' ', '\t']).len()];
    let step = if line.trim_end().ends_with(['{', '[', '(']) {
        STEP
    } else {
        ""
    };
    format!("\n{blank}{step}")
}

#[cfg(test)]
mod tests {
    use super::line_break;

    #[test]
    fn a_new_line_begins_where_the_last_one_did() {
        let text = "fn step(now) {\n    let ä = 1;";
        assert_eq!(line_break(text, 14), "\n    ");
        assert_eq!(line_break(text, text.chars().count()), "\n    ");
        assert_eq!(line_break(text, 17), "\n  ");
        assert_eq!(line_break("", 0), "\n");
    }
}
