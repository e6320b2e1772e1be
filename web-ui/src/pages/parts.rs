//! Parts that several pages share.

use crate::command::Command;
use crate::output::Output;
use crate::state::{Playback, State};
use crate::theme::{self, Palette, Tone};
use egui::{
    Align, Button, CentralPanel, ComboBox, Frame, Grid, Label, Layout, Margin, Panel, Response, RichText, ScrollArea,
    Slider, Stroke, Ui, vec2,
};

/// Speeds of a playback.
const SPEEDS: [f64; 4] = [0.5, 1.0, 4.0, 16.0];
const CLOCK_WIDTH: f32 = 132.0;
const SPEED_WIDTH: f32 = 214.0;
/// Left column of a page of two.
const SIDE_WIDTH: f32 = 450.0;
/// Room of their scroll bars.
const SIDE_BAR: f32 = 18.0;
const CENTRE_BAR: f32 = 12.0;

/// Title of a part of a page.
pub fn section(ui: &mut Ui, title: &str) {
    ui.label(RichText::new(title).text_style(theme::section_style()).strong());
    ui.add_space(-2.0);
}

/// Less important words.
pub fn faint(ui: &mut Ui, text: &str, palette: &Palette) {
    ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
}

/// A page of two columns that scroll by themselves; both are drawn with the same thing at hand.
///
/// - `name`: of the page, for what egui remembers.
pub fn two_columns<T>(
    ui: &mut Ui,
    palette: &Palette,
    name: &str,
    at_hand: &mut T,
    side: impl FnOnce(&mut Ui, &mut T),
    centre: impl FnOnce(&mut Ui, &mut T),
) {
    let ground = Frame::new().fill(palette.ground);
    let side_margin = Margin {
        left: theme::PAGE_MARGIN,
        right: 0,
        top: 0,
        bottom: 0,
    };
    Panel::left(format!("{name} side"))
        .exact_size(SIDE_WIDTH)
        .resizable(false)
        .frame(ground.inner_margin(side_margin))
        .show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.set_width(SIDE_WIDTH - f32::from(theme::PAGE_MARGIN) - SIDE_BAR);
                side(ui, at_hand);
            });
        });
    CentralPanel::default()
        .frame(ground.inner_margin(Margin::symmetric(theme::PAGE_MARGIN, 0)))
        .show(ui, |ui| {
            ScrollArea::vertical()
                .id_salt(format!("{name} centre"))
                .auto_shrink(false)
                .show(ui, |ui| {
                    ui.set_width(ui.available_width() - CENTRE_BAR);
                    ui.add_space(f32::from(theme::PAGE_MARGIN));
                    centre(ui, at_hand);
                    ui.add_space(theme::SECTION_GAP);
                });
        });
}

/// Which robot a page is about; false, and a line that says why, when there is none to choose yet.
///
/// - `name`: of the page, in the names of its widgets.
pub fn robot_choice(
    ui: &mut Ui,
    state: &State,
    output: &mut Output,
    palette: &Palette,
    name: &str,
    chosen: Option<&str>,
    choose: impl Fn(String) -> Command,
) -> bool {
    let Some(chosen) = chosen else {
        let text = match &state.lab.robots {
            Some(robots) if robots.is_empty() => "No laboratory has registered robots with the server yet.",
            _ => "Loading the robots \u{2026}",
        };
        faint(ui, text, palette);
        return false;
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new("Robot").text_style(theme::section_style()).strong());
        let combo = ComboBox::from_id_salt(format!("{name} robot"))
            .selected_text(RichText::new(chosen).strong())
            .width(180.0)
            .show_ui(ui, |ui| {
                for robot in state.lab.robots.iter().flatten() {
                    let response = ui.selectable_label(robot.name == chosen, &robot.name);
                    output.on_click(
                        format!("{name}.robot.{}", robot.name),
                        &response,
                        choose(robot.name.clone()),
                    );
                }
            });
        output.mark(format!("{name}.robot"), &combo.response);
    });
    true
}

/// A raised box.
pub fn card<R>(ui: &mut Ui, palette: &Palette, content: impl FnOnce(&mut Ui) -> R) -> egui::InnerResponse<R> {
    Frame::new()
        .fill(palette.raised)
        .stroke(Stroke::new(1.0, palette.line))
        .corner_radius(theme::CORNER)
        .inner_margin(Margin::symmetric(14, 12))
        .show(ui, |ui| {
            ui.set_width(ui.available_width());
            content(ui)
        })
}

/// The one thing to do on a page.
pub fn primary_button(ui: &mut Ui, palette: &Palette, enabled: bool, text: &str, size: egui::Vec2) -> Response {
    let ink = if enabled { palette.on_accent } else { palette.faint_ink };
    let fill = if enabled { palette.accent } else { palette.stripe };
    let button = Button::new(RichText::new(text).color(ink).strong())
        .fill(fill)
        .min_size(size);
    ui.allocate_ui_with_layout(
        size,
        Layout::centered_and_justified(egui::Direction::LeftToRight),
        |ui| ui.add_enabled(enabled, button),
    )
    .inner
}

/// A coloured word in a rounded box.
pub fn pill(ui: &mut Ui, palette: &Palette, text: &str, tone: Tone) -> Response {
    let ink = palette.tone(tone);
    let galley = ui
        .painter()
        .layout_no_wrap(text.to_owned(), egui::FontId::proportional(13.0), ink);
    let (rect, response) = ui.allocate_exact_size(galley.size() + vec2(20.0, 7.0), egui::Sense::hover());
    ui.painter()
        .rect_filled(rect, rect.height() / 2.0, ink.gamma_multiply(0.14));
    ui.painter().galley(rect.center() - galley.size() / 2.0, galley, ink);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, text));
    response
}

/// Names and values in two columns.
pub fn facts(ui: &mut Ui, palette: &Palette, id: &str, rows: &[(String, String)]) {
    let name_width = 104.0;
    ui.scope(|ui| {
        ui.spacing_mut().interact_size.y = 18.0;
        facts_grid(ui, palette, id, rows, name_width);
    });
}

fn facts_grid(ui: &mut Ui, palette: &Palette, id: &str, rows: &[(String, String)], name_width: f32) {
    Grid::new(id.to_owned())
        .num_columns(2)
        .min_col_width(name_width)
        .spacing(vec2(12.0, 6.0))
        .show(ui, |ui| {
            for (name, value) in rows {
                ui.with_layout(Layout::left_to_right(Align::Min), |ui| {
                    ui.label(RichText::new(name).color(palette.faint_ink))
                });
                ui.vertical(|ui| {
                    ui.set_max_width((ui.available_width()).max(120.0));
                    ui.add(egui::Label::new(value).wrap());
                });
                ui.end_row();
            }
        });
}

/// What a page says when there is nothing to show; with a way on.
pub fn empty(ui: &mut Ui, palette: &Palette, title: &str, text: &str, action: Option<&str>) -> Option<Response> {
    ui.add_space(ui.available_height() * 0.28);
    ui.vertical_centered(|ui| {
        ui.label(RichText::new(title).text_style(egui::TextStyle::Heading).strong());
        ui.add_space(theme::GAP / 2.0);
        ui.allocate_ui(vec2(520.0, 0.0), |ui| {
            ui.label(RichText::new(text).color(palette.faint_ink))
        });
        ui.add_space(theme::GAP);
        action.map(|action| primary_button(ui, palette, true, action, vec2(180.0, 36.0)))
    })
    .inner
}

/// Play and pause, the time, and how fast. `prefix` names the widgets.
pub fn playback_bar(ui: &mut Ui, output: &mut Output, playback: &Playback, duration_s: f64, prefix: &str) {
    let enabled = duration_s > 0.0;
    ui.horizontal(|ui| {
        let (mark, hint) = if playback.playing {
            ("||  Pause", "Pause (space)")
        } else {
            ("\u{25b6}  Play", "Play (space)")
        };
        let play = ui
            .add_enabled(enabled, Button::new(mark).min_size(vec2(92.0, theme::CONTROL_HEIGHT)))
            .on_hover_text(hint);
        output.on_click(format!("{prefix}.play"), &play, Command::PlayPause);
        let mut time_s = playback.time_s.min(duration_s);
        ui.spacing_mut().slider_width = (ui.available_width() - CLOCK_WIDTH - SPEED_WIDTH).max(80.0);
        let slider = Slider::new(&mut time_s, 0.0..=duration_s.max(0.001)).show_value(false);
        let seek = ui.add_enabled(enabled, slider).on_hover_text("Drag to a moment");
        output.mark(format!("{prefix}.seek"), &seek);
        if seek.changed() {
            output.send(Command::Seek { time_s });
        }
        let clock = format!(
            "{} / {}",
            theme::moment(playback.time_s.min(duration_s)),
            theme::moment(duration_s)
        );
        ui.add_sized(
            vec2(CLOCK_WIDTH - 16.0, theme::CONTROL_HEIGHT),
            egui::Label::new(RichText::new(clock).monospace()),
        );
        let mut row = None::<egui::Rect>;
        for speed in SPEEDS {
            let text = if speed < 1.0 {
                "\u{bd}\u{d7}".to_owned()
            } else {
                format!("{speed:.0}\u{d7}")
            };
            let response = ui
                .add_enabled(
                    enabled,
                    Button::selectable((playback.speed - speed).abs() < 1e-9, text)
                        .min_size(vec2(44.0, theme::CONTROL_HEIGHT)),
                )
                .on_hover_text("Speed of the playback");
            row = Some(row.map_or(response.rect, |r| r.union(response.rect)));
            if response.clicked() {
                output.send(Command::SetSpeed(speed));
            }
        }
        if let Some(rect) = row {
            output.mark_rect(format!("{prefix}.speed"), rect, enabled);
        }
    });
}
