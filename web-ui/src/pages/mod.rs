//! The frame around the pages: navigation at the top, messages in the corner.

pub mod compose;
pub mod gap;
pub mod live;
pub mod models;
pub mod notes;
pub mod parts;
pub mod queue;
pub mod robots;
pub mod run;
pub mod words;

use crate::command::Command;
use crate::output::Output;
use crate::state::{Page, State, TwinStatus};
use crate::theme::{self, Palette};
use egui::{
    Align, Align2, Area, Button, CentralPanel, Frame, Id, Layout, Margin, Order, Panel, RichText, Sense, Stroke, Ui,
    vec2,
};

const NAV_HEIGHT: f32 = 48.0;
const TOAST_WIDTH: f32 = 380.0;

/// Draws everything.
pub fn show(ui: &mut Ui, state: &State, output: &mut Output) {
    let palette = theme::palette(state.dark);
    navigation(ui, state, output, &palette);
    match state.page {
        Page::Compose => compose::ui::show(ui, state, output, &palette),
        Page::Queue => page(ui, &palette, |ui| queue::ui::show(ui, state, output, &palette)),
        Page::Live => page(ui, &palette, |ui| live::ui::show(ui, state, output, &palette)),
        Page::Run => run::ui::show(ui, state, output, &palette),
        Page::Gap => gap::ui::show(ui, state, output, &palette),
        Page::Models => models::ui::show(ui, state, output, &palette),
        Page::Robots => page(ui, &palette, |ui| robots::ui::show(ui, state, output, &palette)),
    }
    toasts(ui, state, output, &palette);
}

/// True while something on the screen changes from frame to frame.
pub fn is_moving(state: &State) -> bool {
    match state.page {
        Page::Compose => {
            state.compose.playback.playing || matches!(state.compose.twin.status, TwinStatus::Running { .. })
        }
        Page::Run => state.run.playback.playing,
        _ => false,
    }
}

fn page(ui: &mut Ui, palette: &Palette, content: impl FnOnce(&mut Ui)) {
    CentralPanel::default()
        .frame(
            Frame::new()
                .fill(palette.ground)
                .inner_margin(Margin::same(theme::PAGE_MARGIN + 4)),
        )
        .show(ui, content);
}

fn navigation(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let frame = Frame::new()
        .fill(palette.raised)
        .inner_margin(Margin::symmetric(theme::PAGE_MARGIN, 0));
    Panel::top("navigation")
        .exact_size(NAV_HEIGHT)
        .frame(frame)
        .show(ui, |ui| {
            ui.horizontal_centered(|ui| {
                ui.label(RichText::new("Robopheus").text_style(egui::TextStyle::Heading).strong());
                ui.add_space(theme::SECTION_GAP);
                for (number, page) in Page::ALL.into_iter().enumerate() {
                    tab(ui, state, output, palette, number + 1, page);
                }
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    let (name, hint) = if state.dark {
                        ("Light", "Switch to light colours")
                    } else {
                        ("Dark", "Switch to dark colours")
                    };
                    let response = ui.add(Button::new(name)).on_hover_text(hint);
                    output.on_click("nav.theme", &response, Command::ToggleTheme);
                    ui.add_space(theme::GAP);
                    connection(ui, state, palette);
                    stop(ui, state, output, palette);
                });
            });
        });
}

fn tab(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette, number: usize, page: Page) {
    let selected = state.page == page;
    let text = RichText::new(page.title()).text_style(theme::section_style());
    let text = if selected {
        text.color(palette.accent).strong()
    } else {
        text.color(palette.ink)
    };
    let response = ui.add(
        Button::new(text)
            .frame_when_inactive(false)
            .min_size(vec2(64.0, NAV_HEIGHT - 12.0)),
    );
    if selected {
        let line = response.rect.translate(vec2(0.0, 6.0));
        ui.painter().hline(
            line.x_range().shrink(8.0),
            line.max.y - 2.0,
            Stroke::new(3.0, palette.accent),
        );
    }
    if page == Page::Live && state.queue.active().is_some() {
        ui.painter()
            .circle_filled(response.rect.right_top() + vec2(-6.0, 9.0), 4.0, palette.good);
    }
    output.mark(format!("nav.{}", page.name()), &response);
    if response.on_hover_text(format!("Key {number}")).clicked() {
        output.send(Command::ShowPage(page));
    }
}

/// The protective stop, on every page; pressed, the way to where it is cleared.
fn stop(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    if state.lab.stop_pages().next().is_none() {
        return;
    }
    ui.add_space(theme::GAP);
    let red = |text: &str| {
        let text = RichText::new(text).strong().color(palette.on_accent);
        Button::new(text)
            .fill(palette.error)
            .min_size(vec2(0.0, NAV_HEIGHT - 18.0))
    };
    if let Some(page) = state.lab.stopped() {
        let hint = "The protective stop is pressed: no robot moves. It is cleared on the laboratory's own page, by somebody who sees the floor.";
        let response = ui.add(red("Robots stopped \u{2026}")).on_hover_text(hint);
        output.on_click("nav.stopped", &response, Command::OpenStopPage(page.to_owned()));
    } else {
        let hint = "Protective stop: all robots brake at once and stay still, and the run ends. This goes to the laboratory itself, not through the service.";
        let response = ui.add(red("Stop robots")).on_hover_text(hint);
        output.on_click("nav.stop", &response, Command::StopRobots);
    }
}

fn connection(ui: &mut Ui, state: &State, palette: &Palette) {
    let (colour, text, hint) = match state.service.reachable {
        Some(true) => (palette.good, "Connected", "The server answers."),
        Some(false) => (
            palette.error,
            "No connection",
            "The server does not answer; it is tried again every second. The twin works without it.",
        ),
        None => (
            palette.faint_ink,
            "Connecting \u{2026}",
            "Waiting for the first answer of the server.",
        ),
    };
    let response = ui
        .label(RichText::new(text).color(palette.faint_ink))
        .on_hover_text(hint);
    let (dot, _) = ui.allocate_exact_size(vec2(10.0, 10.0), Sense::hover());
    ui.painter()
        .circle_filled(egui::pos2(dot.center().x, response.rect.center().y), 4.5, colour);
}

fn toasts(ui: &Ui, state: &State, output: &mut Output, palette: &Palette) {
    if state.toasts.is_empty() {
        return;
    }
    Area::new(Id::unique("toasts"))
        .order(Order::Foreground)
        .anchor(Align2::RIGHT_TOP, vec2(-16.0, NAV_HEIGHT + 10.0))
        .show(ui.ctx(), |ui| {
            for toast in &state.toasts {
                let edge = if toast.error { palette.error } else { palette.good };
                Frame::new()
                    .fill(palette.raised)
                    .stroke(Stroke::new(1.5, edge))
                    .corner_radius(theme::CORNER)
                    .shadow(ui.visuals().popup_shadow)
                    .inner_margin(Margin::symmetric(14, 10))
                    .show(ui, |ui| {
                        ui.set_width(TOAST_WIDTH);
                        ui.with_layout(Layout::right_to_left(Align::Min), |ui| {
                            let close = ui.add(Button::new("\u{2715}").frame(false)).on_hover_text("Dismiss");
                            output.on_click(
                                format!("toast.{}.close", toast.id),
                                &close,
                                Command::DismissToast(toast.id),
                            );
                            ui.with_layout(Layout::top_down(Align::Min), |ui| {
                                ui.add(egui::Label::new(&toast.text).wrap())
                            });
                        });
                    });
                ui.add_space(theme::GAP);
            }
        });
}
