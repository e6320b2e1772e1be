//! Two versions on a run: the choice, the sentence, the error over the run, the table.

use super::data;
use crate::command::{Command, ModelsCommand};
use crate::output::Output;
use crate::pages::parts;
use crate::state::{ComparisonState, State};
use crate::theme::{self, Palette, Tone};
use crate::update;
use api::comparison::{ComparisonView, NearerModel};
use egui::{Color32, ComboBox, Grid, Label, RichText, Ui, vec2};
use egui_plot::{Legend, Line, Plot, PlotPoints};

const PLOT_HEIGHT: f32 = 210.0;
const CHOICE_WIDTH: f32 = 170.0;
const RUN_WIDTH: f32 = 300.0;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Compare on a run");
    let text = "Both twins start again and again from what was measured and are driven by the recorded commands; the one whose \
                predictions stay nearer to the measurements is the better model of this run.";
    ui.add(Label::new(RichText::new(text).color(palette.faint_ink).size(13.0)).wrap());
    choice(ui, state, output, palette);
    match &state.models.comparison {
        ComparisonState::Ready => {}
        ComparisonState::Asking => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(
                    RichText::new("The server drives both twins through the run \u{2026}").color(palette.faint_ink),
                );
            });
        }
        ComparisonState::Refused(refusal) => {
            let response = ui.add(Label::new(RichText::new(&refusal.sentence).color(palette.error)).wrap());
            output.mark("models.refusal", &response);
            for problem in &refusal.problems {
                let text = format!(
                    "Allowed: {}. {}.",
                    problem.limit,
                    crate::pages::words::full_stop(&problem.remedy)
                );
                ui.add(
                    Label::new(
                        RichText::new(text.replace("..", "."))
                            .color(palette.faint_ink)
                            .size(13.0),
                    )
                    .wrap(),
                );
            }
        }
        ComparisonState::Here(view) => result(ui, view, output, palette),
    }
}

fn choice(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let models = &state.models;
    let obstacle = update::compare_obstacle(models);
    ui.horizontal_wrapped(|ui| {
        let Some([other, shown]) = update::compared(models) else {
            return;
        };
        ui.label(format!("{} with", data::name(models, shown)));
        let combo = ComboBox::from_id_salt("models other")
            .selected_text(data::name(models, other))
            .width(CHOICE_WIDTH)
            .show_ui(ui, |ui| {
                for choice in data::others(models) {
                    let name = data::name(models, choice);
                    let response = ui.selectable_label(choice == other, &name);
                    let command = Command::Models(ModelsCommand::CompareWith(choice));
                    output.on_click(format!("models.other.{name}"), &response, command);
                }
            });
        output.mark("models.other", &combo.response);
        ui.label("on");
        let runs = data::runs(state);
        let chosen = update::compared_run(models);
        let name = runs.iter().find(|(run, _)| Some(*run) == chosen);
        let combo = ComboBox::from_id_salt("models run")
            .selected_text(name.map_or("no finished run", |(_, name)| name.as_str()))
            .width(RUN_WIDTH)
            .truncate()
            .show_ui(ui, |ui| {
                for (run, name) in &runs {
                    let response = ui.selectable_label(Some(*run) == chosen, name);
                    let command = Command::Models(ModelsCommand::OnRun(*run));
                    output.on_click(format!("models.run.{run}"), &response, command);
                }
            });
        output.mark("models.run", &combo.response);
        let compare = parts::primary_button(ui, palette, obstacle.is_none(), "Compare", vec2(110.0, 30.0));
        let compare = match obstacle {
            Some(why) => compare.on_disabled_hover_text(why),
            None => compare.on_hover_text("Takes about a second"),
        };
        output.on_click("models.compare", &compare, Command::Models(ModelsCommand::Compare));
    });
    if let Some(why) = obstacle.filter(|_| models.comparison != ComparisonState::Asking) {
        ui.add(Label::new(RichText::new(why).color(palette.faint_ink).size(13.0)).wrap());
    }
}

fn result(ui: &mut Ui, view: &ComparisonView, output: &mut Output, palette: &Palette) {
    ui.add_space(theme::GAP / 2.0);
    let tone = match view.nearer {
        NearerModel::First | NearerModel::Second => Tone::Good,
        NearerModel::Alike | NearerModel::Unknown => Tone::Warning,
    };
    let sentence = RichText::new(&view.sentence).text_style(theme::section_style());
    let response = ui.add(Label::new(sentence.color(palette.tone(tone))).wrap());
    output.mark("models.result", &response);
    if let Some(text) = data::ratio_sentence(view) {
        ui.add(Label::new(RichText::new(text).color(palette.faint_ink).size(13.0)).wrap());
    }
    ui.add_space(theme::GAP);
    plot(ui, view, palette);
    ui.add_space(theme::GAP);
    table(ui, view, palette);
}

/// Colours of the first and the second.
fn inks(palette: &Palette) -> [Color32; 2] {
    [palette.warning, palette.accent]
}

/// Distance of both predictions from the measured position over the run.
fn plot(ui: &mut Ui, view: &ComparisonView, palette: &Palette) {
    let [first_ink, second_ink] = inks(palette);
    let points = |of: fn(&api::comparison::ComparisonMoment) -> f64| -> Vec<[f64; 2]> {
        let moments = view.course.iter();
        moments.map(|moment| [moment.time_s, 1000.0 * of(moment)]).collect()
    };
    let [first, second] = data::compared(view);
    let lines = [
        (first, points(|moment| moment.first_m), first_ink),
        (second, points(|moment| moment.second_m), second_ink),
    ];
    parts::card(ui, palette, |ui| {
        ui.label(RichText::new("Prediction made 2 s before, distance from the measured position").strong());
        Plot::new("models course")
            .height(PLOT_HEIGHT)
            .legend(Legend::default())
            .allow_scroll(false)
            .allow_drag(false)
            .allow_zoom(false)
            .allow_boxed_zoom(false)
            .include_y(0.0)
            .x_axis_label("time in s")
            .y_axis_label("distance in mm")
            .grid_color(palette.wall.gamma_multiply(0.25))
            .show(ui, |plot| {
                for (name, points, ink) in lines {
                    plot.line(Line::new(name, PlotPoints::from(points)).color(ink).width(1.8));
                }
            });
    });
}

fn table(ui: &mut Ui, view: &ComparisonView, palette: &Palette) {
    parts::card(ui, palette, |ui| {
        ui.label(RichText::new("Prediction error (RMS); green: smaller by more than a tenth").strong());
        ui.spacing_mut().interact_size.y = 18.0;
        Grid::new("models errors")
            .num_columns(4)
            .min_row_height(18.0)
            .min_col_width(90.0)
            .spacing(vec2(28.0, 4.0))
            .show(ui, |ui| {
                let [first, second] = data::compared(view);
                let titles = ["Quantity", "Ahead", first, second];
                for title in titles {
                    let text = RichText::new(title).text_style(egui::TextStyle::Small);
                    ui.label(text.color(palette.faint_ink));
                }
                ui.end_row();
                for row in data::errors(view) {
                    ui.label(row.channel);
                    ui.label(RichText::new(row.ahead).color(palette.faint_ink));
                    for (place, text) in row.texts.into_iter().enumerate() {
                        let text = RichText::new(text);
                        ui.label(if row.smaller == Some(place) {
                            text.color(palette.good)
                        } else {
                            text
                        });
                    }
                    ui.end_row();
                }
            });
    });
}
