//! How the Robots page looks.

use super::data;
use crate::output::Output;
use crate::pages::parts;
use crate::state::State;
use crate::theme::Palette;
use egui::{Grid, RichText, ScrollArea, Ui, vec2};

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let Some(rows) = data::rows(state) else {
        parts::empty(
            ui,
            palette,
            "Loading the robots \u{2026}",
            "The server has not answered yet.",
            None,
        );
        return;
    };
    if rows.is_empty() {
        parts::empty(
            ui,
            palette,
            "No robots",
            "No laboratory has registered with the server yet.",
            None,
        );
        return;
    }
    if let Some((sentence, tone)) = data::arena(state) {
        ui.label(
            RichText::new(sentence)
                .text_style(crate::theme::section_style())
                .color(palette.tone(tone)),
        );
        ui.add_space(crate::theme::GAP);
    }
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        parts::card(ui, palette, |ui| {
            Grid::new("robots")
                .num_columns(6)
                .min_col_width(120.0)
                .min_row_height(34.0)
                .spacing(vec2(24.0, 4.0))
                .show(ui, |ui| {
                    for title in ["Robot", "State", "Battery", "Link", "Chassis", "Message"] {
                        ui.label(
                            RichText::new(title)
                                .text_style(egui::TextStyle::Small)
                                .color(palette.faint_ink),
                        );
                    }
                    ui.end_row();
                    for row in &rows {
                        let name = ui.label(RichText::new(&row.name).strong());
                        output.mark(format!("robots.row.{}", row.name), &name);
                        ui.horizontal(|ui| parts::pill(ui, palette, &row.state, row.tone));
                        ui.label(RichText::new(&row.battery).color(palette.tone(row.battery_tone)));
                        ui.label(RichText::new(&row.link).color(palette.tone(row.link_tone)));
                        ui.label(&row.kind);
                        ui.label(&row.message);
                        ui.end_row();
                    }
                });
        });
    });
}
