//! How the Models page looks: robot and lineage at the left; the version that is shown, and two of them on a run.

use super::{comparison, data};
use crate::command::{Command, ModelsCommand};
use crate::net::{model_url, network_url};
use crate::output::Output;
use crate::pages::parts::{self, faint};
use crate::state::{Page, Shown, State};
use crate::theme::{self, Palette, Tone};
use crate::update;
use egui::{Align, Button, Label, Layout, Rect, RichText, Sense, Stroke, Ui, pos2, vec2};

const ROW_HEIGHT: f32 = 56.0;
/// Room for the lines of descent at the left of the rows.
const RAIL_WIDTH: f32 = 34.0;
/// Distance of the line of a version that does not stand above its parent.
const LANE: f32 = 7.0;
const LANES: usize = 3;
const BUTTON: egui::Vec2 = vec2(170.0, 34.0);

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::two_columns(
        ui,
        palette,
        "models",
        output,
        |ui, output| side(ui, state, output, palette),
        |ui, output| centre(ui, state, output, palette),
    );
}

fn side(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.add_space(f32::from(theme::PAGE_MARGIN));
    if !robot(ui, state, output, palette) {
        return;
    }
    if let Some(text) = data::in_use_sentence(state) {
        faint(ui, &text, palette);
    }
    if let Some(alarm) = data::drift_sentence(state) {
        let text = format!("{alarm} A diagnosis on the Gap page finds out why.");
        let response = ui.add(Label::new(RichText::new(text).color(palette.tone(Tone::Warning))).wrap());
        output.mark("models.drift", &response);
    }
    ui.add_space(theme::SECTION_GAP);
    parts::section(ui, "Versions, newest first");
    match data::rows(state) {
        None => faint(ui, "Loading the versions \u{2026}", palette),
        Some(rows) => lineage(ui, &rows, output, palette),
    }
    ui.add_space(theme::SECTION_GAP);
}

/// False while there is no robot to choose.
fn robot(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) -> bool {
    parts::robot_choice(
        ui,
        state,
        output,
        palette,
        "models",
        state.models.robot.as_deref(),
        |robot| Command::Models(ModelsCommand::ChooseRobot(robot)),
    )
}

/// Rows with a dot each; a line leads from every dot down to that of the version it was made from.
fn lineage(ui: &mut Ui, rows: &[data::VersionRow], output: &mut Output, palette: &Palette) {
    ui.spacing_mut().item_spacing.y = 5.0;
    let places: Vec<Rect> = rows.iter().map(|row| version_row(ui, row, output, palette)).collect();
    let dot = |place: usize| {
        let rect = places.get(place)?;
        Some(pos2(rect.min.x + RAIL_WIDTH - 10.0, rect.center().y))
    };
    for (place, row) in rows.iter().enumerate() {
        let (Some(own), Some(parent)) = (dot(place), row.parent.and_then(dot)) else {
            continue;
        };
        let over = row.parent.map_or(0, |parent| parent - place - 1);
        let line = Stroke::new(1.5, palette.faint_ink);
        let x = own.x - LANE * over.min(LANES) as f32;
        let (from, to) = (pos2(x, own.y), pos2(x, parent.y));
        ui.painter().line_segment([own, from], line);
        ui.painter().line_segment([from, to], line);
        ui.painter().line_segment([to, parent], line);
    }
    for (place, row) in rows.iter().enumerate() {
        if let Some(dot) = dot(place) {
            let ink = if row.in_use { palette.good } else { palette.faint_ink };
            ui.painter().circle_filled(dot, 5.0, ink);
        }
    }
}

fn version_row(ui: &mut Ui, row: &data::VersionRow, output: &mut Output, palette: &Palette) -> Rect {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), ROW_HEIGHT), Sense::click());
    let response = response.on_hover_cursor(egui::CursorIcon::PointingHand);
    let lit = row.lit || response.hovered() || response.has_focus();
    let edge = Stroke::new(
        if lit { 1.5 } else { 1.0 },
        if lit { palette.accent } else { palette.line },
    );
    let card = Rect::from_min_max(rect.min + vec2(RAIL_WIDTH, 0.0), rect.max);
    ui.painter()
        .rect(card, theme::CORNER, palette.raised, edge, egui::StrokeKind::Inside);
    let show = Command::Models(ModelsCommand::Show(row.shown));
    output.on_click(format!("models.row.{}", row.name), &response, show);
    response.on_hover_text(&row.contents);
    // A child, not a scope: what stands in the card must not decide where the next one begins.
    let inside = egui::UiBuilder::new().max_rect(card.shrink2(vec2(12.0, 6.0)));
    let mut ui = ui.new_child(inside.layout(Layout::top_down(Align::Min)));
    ui.spacing_mut().item_spacing.y = 2.0;
    ui.spacing_mut().interact_size.y = 18.0;
    ui.horizontal(|ui| {
        ui.add(Label::new(RichText::new(&row.name).strong()).selectable(false));
        if row.in_use {
            parts::pill(ui, palette, "in use", Tone::Good);
        }
        let made = RichText::new(&row.made)
            .text_style(egui::TextStyle::Small)
            .color(palette.faint_ink);
        ui.add(Label::new(made).selectable(false).truncate());
    });
    let text = RichText::new(&row.contents).size(13.0).color(palette.faint_ink);
    ui.add(Label::new(text).selectable(false).truncate());
    rect
}

fn centre(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    if state.models.robot.is_none() && state.lab.robots.as_ref().is_some_and(Vec::is_empty) {
        let text = "Versions belong to robots, and no laboratory has registered any with the server yet.";
        parts::empty(ui, palette, "No robots", text, None);
        return;
    }
    let Some(versions) = &state.models.versions else {
        parts::empty(
            ui,
            palette,
            "Loading the versions \u{2026}",
            "The server has not answered yet.",
            None,
        );
        return;
    };
    if versions.is_empty() {
        let robot = state.models.robot.as_deref().unwrap_or("This robot");
        let text = format!(
            "The twin of {robot} is the nominal one: the laboratory's description and nothing else. A version is made when a \
             diagnosis on the Gap page finds out why runs and twin disagree, or when the learning server learns something \
             during a run. Every version stays and can be chosen again."
        );
        if let Some(go) = parts::empty(ui, palette, "No versions yet", &text, Some("Go to the Gap page")) {
            output.on_click("models.elsewhere", &go, Command::ShowPage(Page::Gap));
        }
        return;
    }
    let (title, sentence) = data::headline(state);
    ui.add(Label::new(RichText::new(title).size(23.0).strong()).wrap());
    ui.add(Label::new(RichText::new(sentence).size(16.0)).wrap());
    ui.add_space(theme::GAP / 2.0);
    actions(ui, state, output, palette);
    ui.add_space(theme::GAP);
    if let Some(version) = data::shown_version(&state.models) {
        parts::facts(ui, palette, "model facts", &data::facts(state, version));
    }
    ui.add_space(theme::SECTION_GAP);
    comparison::show(ui, state, output, palette);
}

fn actions(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let obstacle = update::use_obstacle(&state.models);
    let is_nominal = update::shown(&state.models) == Shown::Nominal;
    ui.horizontal_wrapped(|ui| {
        let text = if is_nominal { "Go back to nominal" } else { "Use this version" };
        let response = parts::primary_button(ui, palette, obstacle.is_none(), text, BUTTON);
        let response = match &obstacle {
            Some(why) => response.on_disabled_hover_text(why),
            None => response.on_hover_text(
                "The twin in the page, the check of new experiments and the gaps use it from now on; every version can be chosen again",
            ),
        };
        output.on_click("models.use", &response, Command::Models(ModelsCommand::Use));
        let Some(version) = data::shown_version(&state.models) else {
            return;
        };
        let file = version.version.replace('/', "-");
        let response = ui
            .add(Button::new("Download model.json").min_size(BUTTON))
            .on_hover_text("The whole version as one document, for `robopheus simulate --model` and other programs");
        let download = Command::Download {
            url: model_url(version.id),
            file_name: format!("{file}.json"),
        };
        output.on_click("models.download.json", &response, download);
        let response = ui
            .add_enabled(
                version.residual.is_some(),
                Button::new("Download network (ONNX)").min_size(BUTTON),
            )
            .on_hover_text("The learned neural network in the exchange format ONNX, for programs that run such networks")
            .on_disabled_hover_text("This version carries no neural network: its effects say it all");
        let download = Command::Download {
            url: network_url(version.id),
            file_name: format!("{file}.onnx"),
        };
        output.on_click("models.download.onnx", &response, download);
    });
    let mut notes: Vec<String> = obstacle.into_iter().collect();
    if data::shown_version(&state.models).is_some_and(|version| version.residual.is_none()) {
        notes.push("It carries no neural network, so there is no ONNX file.".to_owned());
    }
    if !notes.is_empty() {
        ui.add(Label::new(RichText::new(notes.join(" ")).color(palette.faint_ink).size(13.0)).wrap());
    }
}
