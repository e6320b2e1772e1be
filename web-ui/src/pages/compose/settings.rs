//! The panel at the left of the Compose page.

use super::correction;
use crate::command::{Command, ProgramCommand};
use crate::output::Output;
use crate::pages::{parts, words};
use crate::parameters;
use crate::state::{Side, State, Template};
use crate::theme::{self, Palette};
use crate::update;
use api::experiment::Mode;
use egui::{Align, Button, CollapsingHeader, ComboBox, DragValue, Grid, Layout, RichText, Slider, TextEdit, Ui, vec2};

const NAME_WIDTH: f32 = 116.0;
/// Width of a field with a figure and its unit.
const FIGURE_WIDTH: f32 = 84.0;
/// All laws are seen at once.
const LAWS_HEIGHT: f32 = 420.0;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.add_space(f32::from(theme::PAGE_MARGIN));
    templates(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    experiment(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    team(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    law(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    starts(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    document(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
}

fn templates(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Start from");
    for template in Template::ALL {
        let selected = state.compose.template == template;
        let title = RichText::new(template.title());
        let title = if selected {
            title.color(palette.accent).strong()
        } else {
            title
        };
        let fill = if selected { palette.accent_soft } else { palette.raised };
        let edge = if selected { palette.accent } else { palette.line };
        let button = Button::new(title)
            .fill(fill)
            .stroke(egui::Stroke::new(1.0, edge))
            .right_text("")
            .min_size(vec2(ui.available_width(), 36.0));
        let response = ui.add(button).on_hover_text(template.explanation());
        output.on_click(
            format!("compose.template.{}", template.name()),
            &response,
            Command::ChooseTemplate(template),
        );
    }
    let text = if state.compose.edited {
        "Changed by you. Choosing a template again starts over."
    } else {
        state.compose.template.explanation()
    };
    ui.label(
        RichText::new(text)
            .text_style(egui::TextStyle::Small)
            .color(palette.faint_ink),
    );
    correction::steps(ui, state, output, palette);
}

pub(super) fn row(ui: &mut Ui, palette: &Palette, name: &str, hint: &str, content: impl FnOnce(&mut Ui)) {
    ui.horizontal(|ui| {
        let size = vec2(NAME_WIDTH, theme::CONTROL_HEIGHT);
        let label = ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(NAME_WIDTH);
            ui.label(RichText::new(name).color(palette.ink))
        });
        if !hint.is_empty() {
            label.inner.on_hover_text(hint);
        }
        content(ui);
    });
}

/// Mode, its title, and what it means.
const MODES: [(Mode, &str, &str); 3] = [
    (
        Mode::Physical,
        "Robots",
        "The laboratory's robots drive; the twin drives beside them with a control of its own",
    ),
    (
        Mode::Interactive,
        "Both",
        "The robots drive; the twin gets their commands and poses and tells where they are now",
    ),
    (
        Mode::Virtual,
        "Twin",
        "The twin alone, at the robots' pace; needs no laboratory and gives the same files",
    ),
];

fn experiment(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let compose = &state.compose;
    parts::section(ui, "Experiment");
    row(ui, palette, "Label", "Shown in the queue", |ui| {
        let mut label = compose.label.clone();
        let response = ui.add(
            TextEdit::singleline(&mut label)
                .desired_width(f32::INFINITY)
                .hint_text("What is it for?")
                .margin(egui::Margin::symmetric(8, 6)),
        );
        output.mark("compose.label", &response);
        if response.changed() {
            output.send(Command::SetLabel(label));
        }
    });
    row(ui, palette, "Runs on", "What carries the experiment out", |ui| {
        for (mode, title, hint) in MODES {
            let chosen = compose.experiment.mode == mode;
            let button = Button::new(title)
                .selected(chosen)
                .min_size(vec2(0.0, theme::CONTROL_HEIGHT));
            let response = ui.add(button).on_hover_text(hint);
            output.mark(format!("compose.mode.{title}"), &response);
            if response.clicked() && !chosen {
                output.send(Command::SetMode(mode));
            }
        }
    });
    correction::choice(ui, state, output, palette);
    row(
        ui,
        palette,
        "Duration",
        "Longest time on the floor; it ends earlier when every target is reached",
        |ui| {
            let mut duration_s = compose.experiment.duration_s;
            let response = ui.add(
                DragValue::new(&mut duration_s)
                    .range(update::DURATION_S)
                    .speed(0.5)
                    .suffix(" s")
                    .min_size(vec2(84.0, theme::CONTROL_HEIGHT)),
            );
            output.mark("compose.duration", &response);
            if response.changed() {
                output.send(Command::SetDuration { duration_s });
            }
        },
    );
    row(
        ui,
        palette,
        "Seed",
        "Number that random parts start from; the same number gives the same run of the twin",
        |ui| {
            let mut seed = compose.experiment.seed;
            let response = ui.add(
                DragValue::new(&mut seed)
                    .speed(0.2)
                    .min_size(vec2(84.0, theme::CONTROL_HEIGHT)),
            );
            output.mark("compose.seed", &response);
            if response.changed() {
                output.send(Command::SetSeed(seed));
            }
        },
    );
}

/// Which robots of the laboratory take part.
fn team(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let experiment = &state.compose.experiment;
    let (taken, here) = (experiment.robots.len(), state.lab.robots_in(&experiment.arena));
    let title = format!("Robots: {taken} of {}", here.len().max(taken));
    let header = CollapsingHeader::new(RichText::new(title).text_style(theme::section_style()).strong());
    let response = header.id_salt("team").show(ui, |ui| {
        ui.label(
            RichText::new("A robot that joins is put where there is room; one that leaves takes its targets along.")
                .color(palette.faint_ink),
        );
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(6.0, 6.0);
            for (name, robot) in here {
                let place = experiment.robots.iter().position(|taken| taken.name == name);
                let text = match place {
                    Some(place) => RichText::new(name).color(palette.robot(place)).strong(),
                    None => RichText::new(name),
                };
                let response = ui
                    .add(Button::new(text).selected(place.is_some()))
                    .on_hover_text(format!(
                        "{}, controller {}",
                        words::chassis(&robot.description.chassis),
                        robot.controller
                    ));
                let command = Command::TakeRobot {
                    name: name.to_owned(),
                    joins: place.is_none(),
                };
                output.on_click(format!("compose.take.{name}"), &response, command);
            }
        });
    });
    output.mark("compose.team", &response.header_response);
}

/// Every law that an experiment may name, the own controller last.
fn laws(ui: &mut Ui, chosen: &str, output: &mut Output) {
    let list = ComboBox::from_id_salt("law")
        .selected_text(parameters::law_name(chosen))
        .width(ui.available_width())
        .height(LAWS_HEIGHT);
    let shown = list.show_ui(ui, |ui| {
        for law in parameters::laws() {
            let response = ui
                .selectable_label(law == chosen, parameters::law_name(law))
                .on_hover_text(parameters::law_explained(law));
            output.on_click(format!("compose.law.{law}"), &response, Command::ChooseLaw(law));
        }
    });
    output.mark("compose.laws", &shown.response);
}

fn law(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let experiment = &state.compose.experiment;
    parts::section(ui, "Control law");
    laws(ui, &experiment.control.law, output);
    ui.label(RichText::new(parameters::law_explained(&experiment.control.law)).color(palette.faint_ink));
    if update::program::is_own(experiment) {
        let button = Button::new("Open the controller").min_size(vec2(0.0, theme::CONTROL_HEIGHT));
        let response = ui.add(button);
        let command = ProgramCommand::ShowSide(Side::Program);
        output.on_click("compose.controller", &response, Command::Program(command));
        return;
    }
    for spec in parameters::specs(&experiment.control.law) {
        let mut value = parameters::value(experiment, spec);
        let hint = format!(
            "{} Range {} to {} {}, usually {}.",
            spec.meaning, spec.min, spec.max, spec.unit, spec.default
        );
        row(ui, palette, &parameters::title(spec), &hint, |ui| {
            ui.spacing_mut().slider_width = ui.available_width() - FIGURE_WIDTH - theme::GAP;
            let suffix = if spec.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", spec.unit)
            };
            let range = spec.min..=spec.max;
            let slider = Slider::new(&mut value, range.clone())
                .show_value(false)
                .max_decimals(3)
                .logarithmic(spec.min > 0.0 && spec.max / spec.min > 50.0);
            let response = ui.add(slider).on_hover_text(&hint);
            output.mark(format!("compose.parameter.{}", spec.key), &response);
            let figure = DragValue::new(&mut value)
                .range(range)
                .speed(spec.max / 500.0)
                .max_decimals(3)
                .suffix(suffix);
            let figure = ui.add(figure.min_size(vec2(FIGURE_WIDTH, 26.0)));
            if response.changed() || figure.changed() {
                output.send(Command::SetParameter { key: spec.key, value });
            }
        });
    }
    let changed = experiment.control.parameters.as_object().is_some_and(|p| !p.is_empty());
    let response = ui
        .add_enabled(changed, Button::new("Usual values"))
        .on_hover_text("Set every parameter of the law back");
    output.on_click("compose.parameters.reset", &response, Command::ResetParameters);
}

fn starts(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Start poses");
    ui.label(
        RichText::new("Drag robots, headings and targets on the floor, or enter figures here.")
            .color(palette.faint_ink),
    );
    Grid::new("starts")
        .num_columns(4)
        .spacing(vec2(6.0, 6.0))
        .show(ui, |ui| {
            for (robot, item) in state.compose.experiment.robots.iter().enumerate() {
                let hint = format!(
                    "{}, {}, controller {}",
                    item.name,
                    words::chassis(&item.chassis),
                    item.controller
                );
                ui.label(RichText::new(&item.name).color(palette.robot(robot)).strong())
                    .on_hover_text(hint);
                let start = item.start;
                let (mut x_m, mut y_m, mut yaw_deg) = (start.x_m, start.y_m, start.yaw_rad.to_degrees());
                let size = vec2(66.0, 26.0);
                let x = ui
                    .add(
                        DragValue::new(&mut x_m)
                            .speed(0.01)
                            .fixed_decimals(2)
                            .suffix(" m")
                            .min_size(size),
                    )
                    .on_hover_text("x, to the right");
                let y = ui
                    .add(
                        DragValue::new(&mut y_m)
                            .speed(0.01)
                            .fixed_decimals(2)
                            .suffix(" m")
                            .min_size(size),
                    )
                    .on_hover_text("y, up");
                let yaw = ui
                    .add(
                        DragValue::new(&mut yaw_deg)
                            .speed(1.0)
                            .fixed_decimals(0)
                            .suffix("\u{b0}")
                            .min_size(vec2(54.0, 26.0)),
                    )
                    .on_hover_text("Heading, counter-clockwise from the x axis");
                if x.changed() || y.changed() {
                    output.send(Command::MoveStart { robot, x_m, y_m });
                }
                if yaw.changed() {
                    output.send(Command::TurnStart {
                        robot,
                        yaw_rad: yaw_deg.to_radians(),
                    });
                }
                ui.end_row();
            }
        });
}

fn document(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let header = CollapsingHeader::new(
        RichText::new("Document (JSON)")
            .text_style(theme::section_style())
            .strong(),
    );
    let response = header.show(ui, |ui| {
        ui.label(
            RichText::new("The same document works with the command line and the REST interface.")
                .color(palette.faint_ink),
        );
        let copy = ui.add(Button::new("Copy"));
        output.on_click("compose.json.copy", &copy, Command::CopyDocument);
        let text = super::program::data::readable_document(state);
        ui.add(
            TextEdit::multiline(&mut text.as_str())
                .code_editor()
                .desired_width(f32::INFINITY)
                .desired_rows(12),
        );
    });
    output.mark("compose.json", &response.header_response);
}
