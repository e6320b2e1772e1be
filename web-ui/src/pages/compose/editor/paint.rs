//! How a script looks: colours of its words, numbers of its lines, the mark of a mistake.

use super::GUTTER;
use super::character_at;
use super::highlight::{Token, tokens};
use crate::theme::Palette;
use egui::layers::ShapeIdx;
use egui::text::{CCursor, LayoutJob, TextFormat};
use egui::{Align2, Color32, FontId, Galley, Pos2, Rect, Stroke, Ui, pos2, vec2};

const NUMBER_SIZE: f32 = 11.5;

/// The text in its colours; long lines are wrapped.
pub fn job(text: &str, font: &FontId, wrap_width: f32, palette: &Palette) -> LayoutJob {
    let mut job = LayoutJob::default();
    for (range, token) in tokens(text) {
        job.append(&text[range], 0.0, TextFormat::simple(font.clone(), ink(token, palette)));
    }
    if job.sections.is_empty() {
        job.append("", 0.0, TextFormat::simple(font.clone(), palette.ink));
    }
    job.wrap.max_width = wrap_width;
    job.keep_trailing_whitespace = true;
    job
}

fn ink(token: Token, palette: &Palette) -> Color32 {
    match token {
        Token::Plain => palette.ink,
        Token::Keyword => palette.twin,
        Token::Function => palette.accent,
        Token::Number => palette.robot(1),
        Token::Text => palette.good,
        Token::Comment => palette.faint_ink,
    }
}

/// The laid out text and where it is.
pub struct Rows<'a> {
    pub galley: &'a Galley,
    pub origin: Pos2,
}

impl Rows<'_> {
    /// Number of the line, its first row or not, and top and bottom on the page.
    fn placed(&self) -> impl Iterator<Item = (u32, bool, [f32; 2])> {
        let (mut line, mut is_first) = (1, true);
        self.galley.rows.iter().map(move |row| {
            let rect = row.rect().translate(self.origin.to_vec2());
            let placed = (line, is_first, [rect.top(), rect.bottom()]);
            is_first = row.ends_with_newline;
            line += u32::from(is_first);
            placed
        })
    }
}

/// Line numbers of the rows that are seen.
pub fn numbers(ui: &Ui, rows: &Rows<'_>, wrong: Option<u32>, palette: &Palette) {
    let seen = ui.clip_rect();
    let right = rows.origin.x - 12.0;
    for (line, is_first, [top, bottom]) in rows.placed() {
        if !is_first || bottom < seen.top() || top > seen.bottom() {
            continue;
        }
        let ink = if wrong == Some(line) {
            palette.error
        } else {
            palette.faint_ink
        };
        let at = pos2(right, (top + bottom) / 2.0);
        ui.painter()
            .text(at, Align2::RIGHT_CENTER, line, FontId::monospace(NUMBER_SIZE), ink);
    }
}

/// The line with a mistake is shaded, and its place is underlined.
pub fn mistake(ui: &Ui, behind: ShapeIdx, rows: &Rows<'_>, text: &str, place: Option<[u32; 2]>, palette: &Palette) {
    let Some(place) = place else { return };
    let extents = rows
        .placed()
        .filter(|(line, ..)| *line == place[0])
        .map(|(_, _, extent)| extent);
    let Some([top, bottom]) = extents.reduce(|all, one| [all[0].min(one[0]), all[1].max(one[1])]) else {
        return;
    };
    let left = rows.origin.x - f32::from(GUTTER);
    let shade = Rect::from_min_max(pos2(left, top), pos2(ui.clip_rect().right(), bottom));
    ui.painter().set(
        behind,
        egui::Shape::rect_filled(shade, 0.0, palette.error.gamma_multiply(0.14)),
    );
    ui.painter().rect_filled(
        Rect::from_min_size(shade.min, vec2(3.0, shade.height())),
        0.0,
        palette.error,
    );
    let from = character_at(text, place);
    let word = text
        .chars()
        .skip(from)
        .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
        .count();
    let edge = |character: usize| {
        rows.galley
            .pos_from_cursor(CCursor::new(character))
            .translate(rows.origin.to_vec2())
    };
    let (begin, end) = (edge(from), edge(from + word));
    let width = if begin.bottom() == end.bottom() {
        end.left() - begin.left()
    } else {
        0.0
    };
    ui.painter().hline(
        begin.left()..=begin.left() + width.max(7.0),
        begin.bottom(),
        Stroke::new(2.0, palette.error),
    );
}
