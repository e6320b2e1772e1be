//! How the Live page looks: the arena, and the robots' health beside it.

use super::data;
use crate::arena_view;
use crate::command::Command;
use crate::output::Output;
use crate::pages::{notes, parts, words};
use crate::state::{Page, State};
use crate::theme::{self, Palette};
use egui::{Align, Layout, RichText, ScrollArea, Ui, vec2};

const SIDE_WIDTH: f32 = 268.0;
const LOG_HEIGHT: f32 = 140.0;
const LOG_TITLE_HEIGHT: f32 = 40.0;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let Some(run) = data::run(state) else {
        let waiting = state
            .queue
            .runs
            .iter()
            .flatten()
            .filter(|r| !r.state.is_terminal())
            .count();
        let text = match waiting {
            0 => "No robot is moving and nothing waits in the queue. This page connects by itself when a run starts."
                .to_owned(),
            1 => "No robot is moving. One run is on its way; this page connects by itself when it starts.".to_owned(),
            n => {
                format!("No robot is moving. {n} runs are on their way; this page connects by itself when one starts.")
            }
        };
        if let Some(response) = parts::empty(ui, palette, "Nothing runs now", &text, Some("Compose an experiment")) {
            output.on_click("live.compose", &response, Command::ShowPage(Page::Compose));
        }
        return;
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new(&run.label).text_style(egui::TextStyle::Heading).strong());
        let (word, tone) = words::run_state(run.state);
        parts::pill(ui, palette, word, tone);
        let (text, tone) = data::connection(state);
        parts::pill(ui, palette, &text, tone);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let response = ui.button("Details of this run");
            output.on_click("live.open", &response, Command::OpenRun(run.id));
        });
    });
    ui.horizontal_top(|ui| {
        let height = ui.available_height();
        let width = ui.available_width() - SIDE_WIDTH - theme::SECTION_GAP;
        ui.allocate_ui_with_layout(vec2(width, height), Layout::top_down(Align::Min), |ui| {
            let lines = data::log(state);
            let log_height = if lines.is_empty() { 0.0 } else { LOG_HEIGHT };
            let arena = arena_view::show(ui, &data::scene(state, run), height - log_height);
            output.mark_rect("live.arena", arena.floor, true);
            if !lines.is_empty() {
                parts::section(ui, "Controller's log");
                notes::log(
                    ui,
                    output,
                    palette,
                    "live.log",
                    &lines,
                    None,
                    LOG_HEIGHT - LOG_TITLE_HEIGHT,
                );
            }
        });
        ui.add_space(theme::SECTION_GAP - theme::GAP);
        ui.allocate_ui_with_layout(vec2(SIDE_WIDTH, height), Layout::top_down(Align::Min), |ui| {
            ScrollArea::vertical()
                .auto_shrink(false)
                .show(ui, |ui| side(ui, state, run, palette));
        });
    });
}

fn side(ui: &mut Ui, state: &State, run: &api::run::RunView, palette: &Palette) {
    ui.add_space(theme::GAP);
    parts::facts(ui, palette, "live facts", &data::facts(state));
    let stages = data::stages(state);
    if !stages.is_empty() {
        ui.add_space(theme::GAP);
        parts::section(ui, "From light to robot");
        ui.add_space(theme::GAP / 2.0);
        parts::facts(ui, palette, "live stages", &stages);
    }
    ui.add_space(theme::GAP);
    for robot in data::robots(state, run) {
        parts::card(ui, palette, |ui| {
            ui.label(RichText::new(&robot.name).color(palette.robot(robot.index)).strong());
            egui::Grid::new(("live robot", &robot.name))
                .num_columns(2)
                .min_col_width(92.0)
                .spacing(vec2(10.0, 3.0))
                .show(ui, |ui| {
                    for (name, value, tone) in &robot.lines {
                        ui.label(RichText::new(*name).color(palette.faint_ink));
                        let ink = if *tone == theme::Tone::Neutral {
                            palette.ink
                        } else {
                            palette.tone(*tone)
                        };
                        ui.label(RichText::new(value).color(ink));
                        ui.end_row();
                    }
                });
        });
    }
}
