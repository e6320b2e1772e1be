//! The editor of a script: line numbers, colours, the line with a mistake, words that complete themselves.

pub mod completion;
pub mod highlight;
mod keys;
mod paint;
mod popup;

use crate::output::Output;
use crate::theme::{self, Palette};
use completion::byte_at;
use egui::text::{CCursor, CCursorRange};
use egui::text_edit::TextEditState;
use egui::{EventFilter, Frame, Id, Margin, ScrollArea, Stroke, TextEdit, Ui, vec2};

/// Room for line numbers.
const GUTTER: i8 = 46;

/// One frame of the editor; the text afterwards, when a person changed it.
///
/// - `mistake`: line and column from 1.
/// - `go_to`: the cursor jumps there and the editor takes the keyboard.
pub fn show(
    ui: &mut Ui,
    output: &mut Output,
    palette: &Palette,
    text: &str,
    mistake: Option<[u32; 2]>,
    go_to: Option<[u32; 2]>,
    height: f32,
) -> Option<String> {
    let id = id();
    if let Some(place) = go_to {
        let mut state = TextEditState::load(ui.ctx(), id).unwrap_or_default();
        let cursor = CCursor::new(character_at(text, place));
        state.cursor.set_char_range(Some(CCursorRange::one(cursor)));
        state.store(ui.ctx(), id);
        ui.memory_mut(|memory| memory.request_focus(id));
    }
    let mut changed = None;
    let frame = Frame::new()
        .fill(palette.sunken)
        .stroke(Stroke::new(1.0, palette.line))
        .corner_radius(theme::CORNER);
    let shown = frame.show(ui, |ui| {
        ScrollArea::vertical()
            .id_salt("program text")
            .max_height(height)
            .min_scrolled_height(height)
            .auto_shrink(false)
            .show(ui, |ui| {
                ui.set_min_height(height);
                changed = text_edit(ui, output, palette, text, mistake, height);
            });
    });
    output.mark_rect("compose.editor", shown.response.rect, true);
    changed
}

fn id() -> Id {
    Id::unique("program editor")
}

fn text_edit(
    ui: &mut Ui,
    output: &mut Output,
    palette: &Palette,
    text: &str,
    mistake: Option<[u32; 2]>,
    height: f32,
) -> Option<String> {
    let id = id();
    let mut edited = text.to_owned();
    let (cursor, other) = TextEditState::load(ui.ctx(), id)
        .and_then(|state| state.cursor.char_range())
        .map_or((0, 0), |range| (range.primary.index.0, range.secondary.index.0));
    let mut words = popup::Popup::load(ui, id);
    if ui.memory(|memory| memory.has_focus(id)) {
        words.take_keys(ui);
        keys::indent(ui, text, cursor, cursor != other);
    }
    let behind_text = ui.painter().add(egui::Shape::Noop);
    let font = egui::TextStyle::Monospace.resolve(ui.style());
    let row_height = ui.fonts_mut(|fonts| fonts.row_height(&font));
    let margin = Margin {
        left: GUTTER,
        right: 8,
        top: 6,
        bottom: 6,
    };
    let mut layouter = |ui: &Ui, text: &dyn egui::TextBuffer, wrap_width: f32| {
        let job = paint::job(text.as_str(), &font, wrap_width, palette);
        ui.fonts_mut(|fonts| fonts.layout_job(job))
    };
    let surrender = words.hold_focus(ui);
    let shown = TextEdit::multiline(&mut edited)
        .id(id)
        .frame(Frame::new().inner_margin(margin))
        .desired_width(f32::INFINITY)
        .min_size(vec2(0.0, height - 2.0))
        .desired_rows((height / row_height) as usize)
        .event_filter(EventFilter {
            tab: true,
            horizontal_arrows: true,
            vertical_arrows: true,
            escape: words.is_open(),
        })
        .hint_text("fn step(now) { }")
        .layouter(&mut layouter)
        .show(ui);
    popup::Popup::let_focus(ui, surrender);
    let rows = paint::Rows {
        galley: &shown.galley,
        origin: shown.galley_pos,
    };
    paint::mistake(ui, behind_text, &rows, text, mistake, palette);
    paint::numbers(ui, &rows, mistake.map(|place| place[0]), palette);
    let cursor = shown.cursor_range.map_or(cursor, |range| range.primary.index.0);
    let has_focus = ui.memory(|memory| memory.has_focus(id));
    let caret = shown
        .galley
        .pos_from_cursor(CCursor::new(cursor))
        .translate(shown.galley_pos.to_vec2());
    if let Some((completed, cursor)) = words.show(ui, output, palette, &edited, cursor, has_focus, caret) {
        edited = completed;
        let mut state = shown.state;
        state
            .cursor
            .set_char_range(Some(CCursorRange::one(CCursor::new(cursor))));
        state.store(ui.ctx(), id);
        ui.memory_mut(|memory| memory.request_focus(id));
    }
    words.store(ui, id);
    (edited != text).then_some(edited)
}

/// Characters before a place; the end of its line when that is shorter.
fn character_at(text: &str, [line, column]: [u32; 2]) -> usize {
    let skipped = text.split_inclusive('\n').take(line.saturating_sub(1) as usize);
    let start: usize = skipped.map(|line| line.chars().count()).sum();
    let rest = &text[byte_at(text, start)..];
    let length = rest.split('\n').next().unwrap_or_default().chars().count();
    start + length.min(column.saturating_sub(1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_counted_in_characters() {
        let text = "ä = 1;\n\nfür\n";
        assert_eq!(character_at(text, [1, 3]), 2);
        assert_eq!(character_at(text, [2, 9]), 7);
        assert_eq!(character_at(text, [3, 3]), 10);
        assert_eq!(character_at(text, [9, 1]), 12);
    }
}
