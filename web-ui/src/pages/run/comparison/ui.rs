//! How runs along one path look: the sentence, the table, the floor with all trails and the errors over time.

use super::data;
use crate::arena_view::{self, colour};
use crate::command::{Command, ModelsCommand};
use crate::output::Output;
use crate::pages::parts;
use crate::state::{Page, RunSide, State};
use crate::theme::{self, Palette};
use egui::{Align, Button, Color32, Grid, Label, Layout, RichText, ScrollArea, Sense, Stroke, Ui, vec2};
use egui_plot::{HLine, LineStyle, Plot, PlotPoints};

const TABLE_HEIGHT_SHARE: f32 = 0.46;
const FLOOR_SHARE: f32 = 0.5;
const SIDES: [(RunSide, &str, &str, &str); 2] = [
    (RunSide::Motion, "motion", "This run", "The floor, and errors over time"),
    (
        RunSide::Comparison,
        "comparison",
        "Beside earlier runs",
        "Runs of the same robot along the same path at the same speed",
    ),
];

/// The sentence, and the choice between the run alone and beside others.
pub fn head(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.add_space(theme::GAP);
    ui.with_layout(Layout::right_to_left(Align::TOP), |ui| {
        for (side, name, title, hint) in SIDES.into_iter().rev() {
            let button = Button::new(title)
                .selected(state.comparison.side == side)
                .min_size(vec2(0.0, theme::CONTROL_HEIGHT));
            let response = ui.add(button).on_hover_text(hint);
            output.on_click(format!("run.side.{name}"), &response, Command::ShowRunSide(side));
        }
        ui.add_space(theme::GAP);
        ui.with_layout(Layout::top_down(Align::Min), |ui| sentence(ui, state, output, palette));
    });
}

fn sentence(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let Some(headline) = data::headline(state) else {
        parts::faint(
            ui,
            "How near the robot stays to its path is told when its track is here.",
            palette,
        );
        return;
    };
    let text = RichText::new(headline.sentence)
        .text_style(theme::section_style())
        .color(palette.tone(headline.tone));
    let response = ui.add(Label::new(text).wrap());
    output.mark("run.tracking", &response);
    if let Some(further) = headline.further {
        let text = RichText::new(further).size(13.0).color(palette.faint_ink);
        ui.add(Label::new(text).wrap());
    }
}

/// Table, floor and plot.
pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let rows = data::rows(state);
    ScrollArea::vertical()
        .id_salt("comparison table")
        .max_height(ui.available_height() * TABLE_HEIGHT_SHARE)
        .auto_shrink([false, true])
        .show(ui, |ui| {
            parts::card(ui, palette, |ui| table(ui, &rows, output, palette));
        });
    notes(ui, state, output, palette);
    let height = ui.available_height();
    let (width, gap) = (ui.available_width(), theme::GAP);
    ui.horizontal_top(|ui| {
        ui.allocate_ui_with_layout(vec2(width * FLOOR_SHARE, height), Layout::top_down(Align::Min), |ui| {
            if let Some(scene) = data::scene(state) {
                let arena = arena_view::show(ui, &scene, height);
                output.mark_rect("run.comparison.floor", arena.floor, true);
            }
        });
        let rest = vec2(width * (1.0 - FLOOR_SHARE) - gap, height);
        ui.allocate_ui_with_layout(rest, Layout::top_down(Align::Min), |ui| {
            plot(ui, state, output, palette)
        });
    });
}

const TITLES: [(&str, &str); 7] = [
    ("Correction", "What made up for the robot's delay, slip and lag"),
    ("Run", "When it was submitted; opens it"),
    (
        "RMS",
        "Root of the mean squared distance to the active part of the path; 1 px = 2.5 mm",
    ),
    ("Largest", "Largest distance to the active part of the path"),
    ("Band \u{b1}75 mm (30 px)", "Whether the robot left the paper's band"),
    (
        "In time",
        "RMS distance from where an ideal robot under the same law is at the same time; a constant delay of up to 1 s is taken out",
    ),
    ("Against feedback alone", "How many times smaller the RMS distance is"),
];

fn table(ui: &mut Ui, rows: &[data::Row], output: &mut Output, palette: &Palette) {
    ui.spacing_mut().interact_size.y = 20.0;
    Grid::new("comparison")
        .num_columns(TITLES.len())
        .min_row_height(20.0)
        .spacing(vec2(18.0, 4.0))
        .show(ui, |ui| {
            for (title, hint) in TITLES {
                let text = RichText::new(title).text_style(egui::TextStyle::Small);
                ui.label(text.color(palette.faint_ink)).on_hover_text(hint);
            }
            ui.end_row();
            for row in rows {
                ui.horizontal(|ui| {
                    sample(ui, colour(row.ink, palette), row.dashed);
                    let what = RichText::new(&row.what);
                    ui.label(if row.is_shown { what.strong() } else { what });
                    if let Some(note) = &row.note {
                        ui.label(RichText::new(note).size(12.5).color(palette.faint_ink));
                    }
                });
                if row.is_shown {
                    ui.label("this run");
                } else {
                    let response = ui.link(&row.when).on_hover_text("Show this run");
                    output.on_click(format!("run.peer.{}", row.run), &response, Command::OpenRun(row.run));
                }
                cells(ui, &row.cells, palette, palette.ink);
                ui.end_row();
            }
            for (what, paper) in data::paper() {
                ui.label(RichText::new(what).italics().color(palette.faint_ink));
                ui.label(RichText::new("paper").italics().color(palette.faint_ink));
                cells(ui, &paper, palette, palette.faint_ink);
                ui.end_row();
            }
        });
}

fn cells(ui: &mut Ui, cells: &data::Cells, palette: &Palette, ink: Color32) {
    ui.label(RichText::new(&cells.rms).color(ink));
    ui.label(RichText::new(&cells.largest).color(ink));
    ui.label(RichText::new(&cells.band.0).color(palette.tone(cells.band.1)));
    ui.label(RichText::new(&cells.time_rms).color(ink));
    ui.label(RichText::new(&cells.against).color(ink));
}

fn notes(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        let text = "Distances are of positions as they were measured, so the measurement's own noise is part of them. How well a model \
                    predicts is on the";
        ui.label(RichText::new(text).size(13.0).color(palette.faint_ink));
        let response = ui
            .link(RichText::new("Models page").size(13.0))
            .on_hover_text("Two versions through one run, and which predicts it better");
        let robots = state.run.view.iter().flat_map(|view| &view.experiment.robots);
        let robot = robots.map(|robot| robot.name.clone()).next();
        if let (true, Some(robot)) = (response.clicked(), robot) {
            output.send(Command::Models(ModelsCommand::ChooseRobot(robot)));
        }
        output.on_click("run.comparison.models", &response, Command::ShowPage(Page::Models));
    });
}

fn sample(ui: &mut Ui, ink: Color32, dashed: bool) {
    let (rect, _) = ui.allocate_exact_size(vec2(22.0, 18.0), Sense::hover());
    let ends = [rect.left_center(), rect.right_center()];
    if dashed {
        ui.painter()
            .extend(egui::Shape::dashed_line(&ends, Stroke::new(2.0, ink), 5.0, 3.0));
    } else {
        ui.painter().line_segment(ends, Stroke::new(2.5, ink));
    }
}

fn plot(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let lines = data::lines(state);
    let with_band = data::band_is_near(&lines);
    let title = if with_band {
        "Distance to the path; the dashed line is the band of 75 mm"
    } else {
        "Distance to the path; the band of 75 mm lies above the picture"
    };
    ui.label(RichText::new(title).strong());
    let palette = *palette;
    let response = Plot::new("comparison errors")
        .height(ui.available_height())
        .allow_scroll(false)
        .allow_drag([true, false])
        .allow_zoom([true, false])
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .x_axis_label("time in s")
        .y_axis_label("distance in mm")
        .grid_color(palette.wall.gamma_multiply(0.35))
        .show(ui, |plot| {
            if with_band {
                let band = HLine::new("Band \u{b1}75 mm (30 px)", 1000.0 * crate::error_measure::BAND_M);
                plot.hline(band.color(palette.good).style(LineStyle::dashed_loose()).width(1.5));
            }
            for line in lines.into_iter().rev() {
                let style = if line.dashed {
                    LineStyle::dashed_dense()
                } else {
                    LineStyle::Solid
                };
                plot.line(
                    egui_plot::Line::new(line.name, PlotPoints::from(line.points))
                        .color(colour(line.ink, &palette))
                        .width(1.6)
                        .style(style),
                );
            }
        });
    output.mark("run.comparison.plot", &response.response);
}
