//! How the Compose page looks: settings at the left, the arena, playback, and the twin's verdict with the way on.

use super::{data, handles, program, settings};
use crate::arena_view;
use crate::command::Command;
use crate::output::Output;
use crate::pages::parts;
use crate::state::{Side, State, Submission};
use crate::theme::{self, Palette};
use crate::update;
use egui::{
    Align, Button, CentralPanel, Frame, Label, Layout, Margin, Panel, ProgressBar, RichText, ScrollArea, Stroke, Ui,
    vec2,
};

const STRIP_HEIGHT: f32 = 128.0;
const PLAYBACK_HEIGHT: f32 = 44.0;
const SUBMIT_WIDTH: f32 = 190.0;
/// The panel at the left while a controller is written: a share of the page.
const WRITING_SHARE: f32 = 0.46;
const WRITING_WIDTH_LEAST: f32 = 440.0;
const WRITING_WIDTH_MOST: f32 = 760.0;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let side = Frame::new().fill(palette.ground).inner_margin(Margin {
        left: theme::PAGE_MARGIN,
        right: 0,
        top: 0,
        bottom: 0,
    });
    let own = update::program::is_own(&state.compose.experiment);
    let writing = own && state.compose.program.side == Side::Program;
    let width = if writing {
        (ui.available_width() * WRITING_SHARE).clamp(WRITING_WIDTH_LEAST, WRITING_WIDTH_MOST)
    } else {
        theme::SIDE_WIDTH
    };
    Panel::left("compose settings")
        .exact_size(width)
        .resizable(false)
        .frame(side)
        .show(ui, |ui| {
            if own {
                program::ui::sides(ui, state, output);
            }
            if writing {
                program::ui::show(ui, state, output, palette);
                return;
            }
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.set_width(theme::SIDE_WIDTH - f32::from(theme::PAGE_MARGIN) - 18.0);
                settings::show(ui, state, output, palette);
            });
        });
    let strip = Frame::new()
        .fill(palette.raised)
        .inner_margin(Margin::symmetric(theme::PAGE_MARGIN, 12));
    Panel::bottom("compose verdict")
        .exact_size(STRIP_HEIGHT)
        .frame(strip)
        .show(ui, |ui| verdict(ui, state, output, palette));
    let center = Frame::new()
        .fill(palette.ground)
        .inner_margin(Margin::symmetric(theme::PAGE_MARGIN, 6));
    CentralPanel::default().frame(center).show(ui, |ui| {
        let arena = arena_view::show(ui, &data::scene(state), ui.available_height() - PLAYBACK_HEIGHT);
        output.mark_rect("compose.arena", arena.floor, true);
        handles::show(ui, state, output, palette, &arena);
        let duration_s = state
            .compose
            .twin
            .result
            .as_ref()
            .map_or(0.0, |r| update::duration_s(&r.replay));
        parts::playback_bar(ui, output, &state.compose.playback, duration_s, "compose");
    });
}

fn verdict(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let strip = data::strip(state);
    ui.horizontal_top(|ui| {
        let width = ui.available_width() - SUBMIT_WIDTH - theme::SECTION_GAP;
        ui.allocate_ui_with_layout(vec2(width, ui.available_height()), Layout::top_down(Align::Min), |ui| {
            ui.set_width(width);
            ScrollArea::vertical()
                .auto_shrink(false)
                .id_salt("verdict")
                .show(ui, |ui| words_of(ui, state, &strip, output, palette));
        });
        ui.add_space(theme::SECTION_GAP - theme::GAP);
        ui.allocate_ui_with_layout(
            vec2(SUBMIT_WIDTH, ui.available_height()),
            Layout::top_down(Align::Min),
            |ui| {
                submit(ui, state, output, palette);
            },
        );
    });
}

fn words_of(ui: &mut Ui, state: &State, strip: &data::Strip, output: &mut Output, palette: &Palette) {
    ui.horizontal_wrapped(|ui| {
        parts::pill(ui, palette, strip.word, strip.tone);
        ui.add(Label::new(RichText::new(&strip.sentence).text_style(theme::section_style())).wrap());
    });
    if let Some(fraction) = strip.progress {
        ui.add(
            ProgressBar::new(fraction as f32)
                .desired_height(6.0)
                .fill(palette.accent)
                .corner_radius(3),
        );
    }
    for (index, problem) in strip.problems.iter().enumerate() {
        let text = format!("{}: {}", problem.field, problem.text);
        let response = ui.add(Label::new(RichText::new(text).color(palette.error)).wrap());
        output.mark(format!("compose.problem.{index}"), &response);
    }
    for (index, finding) in strip.findings.iter().enumerate() {
        let text = format!("{}   {}", theme::moment(finding.at_s), finding.text);
        let button = Button::new(RichText::new(text).color(palette.tone(finding.tone)))
            .wrap()
            .fill(palette.ground)
            .stroke(Stroke::new(1.0, palette.line));
        let response = ui.add(button).on_hover_text("Show this moment");
        output.on_click(
            format!("compose.finding.{index}"),
            &response,
            Command::Seek { time_s: finding.at_s },
        );
    }
    if !strip.details.is_empty() {
        let response = ui.add(Label::new(RichText::new(&strip.details).color(palette.faint_ink)).wrap());
        if let Some(identity) = data::twin_identity(state) {
            response.on_hover_text(identity);
        }
    }
    if let Some(models) = data::models(state) {
        let response = ui.add(Label::new(RichText::new(models).color(palette.faint_ink)).wrap());
        output.mark("compose.models", &response);
    }
}

fn submit(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let obstacle = update::submit_obstacle(state);
    let text = if state.compose.submission == Submission::Sending {
        "Sending \u{2026}"
    } else {
        "Submit"
    };
    let response = parts::primary_button(ui, palette, obstacle.is_none(), text, vec2(SUBMIT_WIDTH, 40.0));
    output.on_click("compose.submit", &response, Command::Submit);
    response.on_hover_text("Queue it for the robots (Ctrl+Enter)");
    let below = obstacle.map_or_else(|| "Ctrl+Enter".to_owned(), str::to_owned);
    ui.add(
        Label::new(
            RichText::new(below)
                .text_style(egui::TextStyle::Small)
                .color(palette.faint_ink),
        )
        .wrap(),
    );
}
