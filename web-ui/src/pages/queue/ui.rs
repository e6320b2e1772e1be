//! How the Queue page looks: one row a run, the first column opens it.

use super::data::{self, Row};
use crate::command::Command;
use crate::output::Output;
use crate::pages::parts;
use crate::state::{Page, State};
use crate::theme::{self, Palette};
use egui::{
    Align, Button, Frame, Id, Label, Layout, Margin, Modal, Rect, RichText, ScrollArea, Sense, Stroke, Ui, vec2,
};
use uuid::Uuid;

const ROW_HEIGHT: f32 = 52.0;

/// Name, share of the width.
const COLUMNS: [(&str, f32); 7] = [
    ("Run", 0.24),
    ("State", 0.11),
    ("Place", 0.07),
    ("Start", 0.10),
    ("Why", 0.28),
    ("Who", 0.11),
    ("", 0.09),
];

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let Some(rows) = data::rows(state) else {
        parts::empty(
            ui,
            palette,
            "Loading the runs \u{2026}",
            "The server has not answered yet.",
            None,
        );
        return;
    };
    if rows.is_empty() {
        let text = "Compose an experiment and submit it; it appears here with its place in the queue.";
        if let Some(response) = parts::empty(ui, palette, "No runs yet", text, Some("Compose one")) {
            output.on_click("queue.compose", &response, Command::ShowPage(Page::Compose));
        }
        return;
    }
    header(ui, palette);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 6.0;
        for row in &rows {
            show_row(ui, row, output, palette);
        }
    });
    if let Some(run) = state.queue.cancel_asked {
        confirm(ui, state, run, output, palette);
    }
}

/// The cells of a row, left to right.
fn cells(rect: Rect) -> [Rect; COLUMNS.len()] {
    let inner = rect.shrink2(vec2(14.0, 0.0));
    let mut left = inner.min.x;
    COLUMNS.map(|(_, share)| {
        let width = inner.width() * share;
        let cell = Rect::from_min_size(egui::pos2(left, inner.min.y), vec2(width - 10.0, inner.height()));
        left += width;
        cell
    })
}

fn header(ui: &mut Ui, palette: &Palette) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 26.0), Sense::hover());
    for (cell, (title, _)) in cells(rect).into_iter().zip(COLUMNS) {
        let text = RichText::new(title)
            .color(palette.faint_ink)
            .text_style(egui::TextStyle::Small);
        in_cell(ui, cell, |ui| ui.add(Label::new(text).selectable(false)));
    }
}

fn in_cell<R>(ui: &mut Ui, cell: Rect, content: impl FnOnce(&mut Ui) -> R) -> R {
    let builder = egui::UiBuilder::new()
        .max_rect(cell)
        .layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(builder, |ui| {
        ui.shrink_clip_rect(cell.expand(2.0));
        content(ui)
    })
    .inner
}

fn show_row(ui: &mut Ui, row: &Row, output: &mut Output, palette: &Palette) {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), ROW_HEIGHT), Sense::click());
    let response = response.on_hover_cursor(egui::CursorIcon::PointingHand);
    let lit = response.hovered() || response.has_focus();
    let edge = if lit {
        Stroke::new(1.5, palette.accent)
    } else {
        Stroke::new(1.0, palette.line)
    };
    ui.painter()
        .rect(rect, theme::CORNER, palette.raised, edge, egui::StrokeKind::Inside);
    output.on_click(format!("queue.row.{}", row.id), &response, Command::OpenRun(row.id));
    let [label, state, position, start, reason, who, action] = cells(rect);
    let plain = |text: &str| Label::new(RichText::new(text)).selectable(false).truncate();
    in_cell(ui, label, |ui| {
        ui.with_layout(Layout::top_down(Align::Min), |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            ui.add_space(7.0);
            ui.add(
                Label::new(RichText::new(&row.label).strong())
                    .selectable(false)
                    .truncate(),
            );
            let when = RichText::new(format!("submitted {}", row.submitted))
                .text_style(egui::TextStyle::Small)
                .color(palette.faint_ink);
            ui.add(Label::new(when).selectable(false).truncate());
        });
    });
    in_cell(ui, state, |ui| parts::pill(ui, palette, row.state, row.tone));
    in_cell(ui, position, |ui| ui.add(plain(&row.position)));
    in_cell(ui, start, |ui| ui.add(plain(&row.start)));
    let why = in_cell(ui, reason, |ui| {
        let text = RichText::new(&row.reason).color(palette.faint_ink).size(13.0);
        ui.add(Label::new(text).selectable(false).wrap())
    });
    why.on_hover_text(&row.reason);
    in_cell(ui, who, |ui| ui.add(plain(&row.who)));
    if row.can_cancel {
        let cancel = in_cell(ui, action, |ui| ui.add(Button::new("Cancel")));
        output.on_click(format!("queue.cancel.{}", row.id), &cancel, Command::AskCancel(row.id));
    }
}

/// Asks before a run is taken back.
pub fn confirm(ui: &Ui, state: &State, run: Uuid, output: &mut Output, palette: &Palette) {
    let label = state.queue.find(run).map(|r| r.label.clone()).unwrap_or_default();
    let frame = Frame::popup(ui.style())
        .fill(palette.raised)
        .inner_margin(Margin::same(20));
    let modal = Modal::new(Id::unique("cancel run")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(380.0);
        ui.label(RichText::new("Cancel this run?").text_style(egui::TextStyle::Heading).strong());
        ui.add(Label::new(format!("\u{201c}{label}\u{201d} will not be driven to its end. Robots that move now come to a stop; what was measured is kept.")).wrap());
        ui.add_space(theme::GAP);
        ui.horizontal(|ui| {
            let keep = ui.add(Button::new("Keep it").min_size(vec2(110.0, 34.0)));
            output.on_click("queue.cancel.no", &keep, Command::KeepRun);
            let text = RichText::new("Cancel the run").color(palette.ground).strong();
            let yes = ui.add(Button::new(text).fill(palette.error).min_size(vec2(140.0, 34.0)));
            output.on_click("queue.cancel.yes", &yes, Command::ConfirmCancel(run));
        });
    });
    if modal.should_close() {
        output.send(Command::KeepRun);
    }
}
