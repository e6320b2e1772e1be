//! What the user's own controller draws on the floor.

use super::Projection;
use crate::theme::Palette;
use api::note::Note;
use egui::{Align2, FontId, Painter, Stroke, vec2};

const POINT_RADIUS: f32 = 4.0;
const LINE_WIDTH: f32 = 1.8;
const TEXT_SIZE: f32 = 12.5;

/// Lines and points, below the robots.
pub fn below(painter: &Painter, notes: &[Note], projection: &Projection, palette: &Palette) {
    for note in notes {
        match note {
            Note::Point { at_m, colour } => {
                let at = projection.page_from_floor(*at_m);
                painter.circle_filled(at, POINT_RADIUS, palette.note(*colour));
            }
            Note::Line { from_m, to_m, colour } => {
                let ends = [from_m, to_m].map(|place| projection.page_from_floor(*place));
                painter.line_segment(ends, Stroke::new(LINE_WIDTH, palette.note(*colour)));
            }
            Note::Log { .. } | Note::Text { .. } => {}
        }
    }
}

/// Words, above the robots.
pub fn above(painter: &Painter, notes: &[Note], projection: &Projection, palette: &Palette) {
    for note in notes {
        let Note::Text { at_m, text, colour } = note else {
            continue;
        };
        let ink = palette.note(*colour);
        let galley = painter.layout_no_wrap(text.clone(), FontId::proportional(TEXT_SIZE), ink);
        let rect = Align2::LEFT_CENTER.anchor_size(projection.page_from_floor(*at_m), galley.size());
        painter.rect_filled(rect.expand2(vec2(3.0, 0.0)), 3.0, palette.floor.gamma_multiply(0.8));
        painter.galley(rect.min, galley, ink);
    }
}
