//! Keys that an editor of programs treats in its own way: Tab, Enter and closing brackets keep the indentation.

use super::completion::byte_at;
use egui::{Event, Key, Modifiers, Ui};

const STEP: &str = "    ";
/// Keys that move the cursor or the text about it.
const MOVES: [Key; 10] = [
    Key::Enter,
    Key::Tab,
    Key::Backspace,
    Key::Delete,
    Key::ArrowUp,
    Key::ArrowDown,
    Key::ArrowLeft,
    Key::ArrowRight,
    Key::Home,
    Key::End,
];

/// Turns Tab and Enter into the text that they stand for here, and takes a closing bracket a step back.
///
/// - `cursor`: in characters, before this frame's events.
/// - `selected`: what is typed replaces something.
pub fn indent(ui: &Ui, text: &str, cursor: usize, selected: bool) {
    ui.input_mut(|input| {
        if !selected && closes_blank_line(&input.events, text, cursor) {
            // As if they had been pressed by hand, before the bracket.
            let back = backspaces();
            input.events.splice(0..0, back);
            return;
        }
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

/// A closing bracket is the first thing that is typed in this frame, on a line with nothing but a step of blanks or more before it.
fn closes_blank_line(events: &[Event], text: &str, cursor: usize) -> bool {
    // A bracket comes as a text; its own key may come before it.
    let typed = events.iter().find(|event| match event {
        Event::Text(_) | Event::Paste(_) => true,
        Event::Key { key, pressed, .. } => *pressed && MOVES.contains(key),
        _ => false,
    });
    let before = &text[..byte_at(text, cursor)];
    let line = before.rsplit('\n').next().unwrap_or_default();
    let bracket = |typed: &Event| match typed {
        Event::Text(typed) => matches!(typed.as_str(), "}" | "]" | ")"),
        _ => false,
    };
    line.ends_with(STEP) && line.trim().is_empty() && typed.is_some_and(bracket)
}

fn backspaces() -> impl Iterator<Item = Event> {
    [true, false]
        .into_iter()
        .cycle()
        .take(2 * STEP.len())
        .map(|pressed| Event::Key {
            key: Key::Backspace,
            physical_key: None,
            pressed,
            repeat: false,
            modifiers: Modifiers::NONE,
        })
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
    use super::*;

    #[test]
    fn a_new_line_begins_where_the_last_one_did() {
        let text = "fn step(now) {\n    let ä = 1;";
        assert_eq!(line_break(text, 14), "\n    ");
        assert_eq!(line_break(text, text.chars().count()), "\n    ");
        assert_eq!(line_break(text, 17), "\n  ");
        assert_eq!(line_break("", 0), "\n");
    }

    #[test]
    fn a_closing_bracket_goes_back_on_a_blank_line_only() {
        let typed = |text: &str| vec![Event::PointerGone, Event::Text(text.into())];
        let text = "fn step(now) {\n    ";
        let end = text.chars().count();
        assert!(closes_blank_line(&typed("}"), text, end));
        assert!(closes_blank_line(&typed(")"), text, end));
        let pressed = |key| Event::Key {
            key,
            physical_key: None,
            pressed: true,
            repeat: false,
            modifiers: Modifiers::NONE,
        };
        let after = |key| vec![pressed(key), Event::Text("}".into())];
        assert!(closes_blank_line(&after(Key::CloseCurlyBracket), text, end));
        assert!(!closes_blank_line(&after(Key::Enter), text, end));
        for (events, text, cursor) in [
            (typed("x"), text, end),
            (typed("}"), text, end - 1),
            (typed("}"), "fn step(now) {\n  a    ", 21),
            (typed("}"), "", 0),
            (vec![Event::Text("a".into()), Event::Text("}".into())], text, end),
            (Vec::new(), text, end),
        ] {
            assert!(!closes_blank_line(&events, text, cursor), "{events:?}");
        }
        assert_eq!(backspaces().count(), 2 * STEP.len());
    }
}
