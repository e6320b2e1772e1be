//! The rows of the Compose page about the correction of commands, and the steps of the paper's comparison.

use super::settings::row;
use crate::command::Command;
use crate::correction::{Correction, HORIZON_S};
use crate::output::Output;
use crate::paper_path;
use crate::scenario::models_of;
use crate::state::{State, Template};
use crate::theme::{self, Palette};
use api::experiment::Mode;
use egui::{Button, ComboBox, Label, RichText, Slider, Ui, vec2};

const ROBOT_WIDTH: f32 = 150.0;
const ROBOTS_HEIGHT: f32 = 420.0;

/// The steps of the comparison, and on which robot; below the templates, for the template of the paper's path.
pub fn steps(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let compose = &state.compose;
    if compose.template != Template::PaperPath {
        return;
    }
    let chosen = Correction::of(&compose.experiment);
    for (correction, name, title, hint) in [
        (
            Correction::Nothing,
            "a",
            "A: feedback alone",
            "The control law and nothing else: it sees the robot where it was measured",
        ),
        (
            Correction::Model,
            "c",
            "C: corrected by the model",
            "The same law and gains; the robot's model corrects the commands",
        ),
    ] {
        let button = Button::new(title)
            .selected(chosen == correction)
            .min_size(vec2(ui.available_width(), theme::CONTROL_HEIGHT));
        let response = ui.add(button).on_hover_text(hint);
        output.on_click(
            format!("compose.step.{name}"),
            &response,
            Command::SetCorrection(correction),
        );
    }
    let robot = compose
        .experiment
        .robots
        .first()
        .map_or("", |robot| robot.name.as_str());
    row(
        ui,
        palette,
        "Driven by",
        "Gains and start of its chassis are put in with it",
        |ui| {
            let list = ComboBox::from_id_salt("path robot")
                .selected_text(robot)
                .width(ROBOT_WIDTH)
                .height(ROBOTS_HEIGHT)
                .show_ui(ui, |ui| {
                    for (name, other) in state.lab.robots_in(&compose.experiment.arena) {
                        if !paper_path::has_settings(&other.description.chassis) {
                            continue;
                        }
                        let response = ui
                            .selectable_label(name == robot, name)
                            .on_hover_text(crate::pages::words::chassis(&other.description.chassis));
                        let command = Command::PutOnPath(name.to_owned());
                        output.on_click(format!("compose.path.{name}"), &response, command);
                    }
                });
            output.mark("compose.path", &list.response);
        },
    );
    let text = "Submit A first, then C. The page of the second run holds both against each other.";
    ui.add(
        Label::new(
            RichText::new(text)
                .text_style(egui::TextStyle::Small)
                .color(palette.faint_ink),
        )
        .wrap(),
    );
}

const HINTS: [(Correction, &str); 3] = [
    (
        Correction::Nothing,
        "Feedback alone: the law sees robots where they were measured a moment ago, and nothing is learnt of them",
    ),
    (
        Correction::Delay,
        "As usual: the law sees where robots will be when its commands take effect",
    ),
    (
        Correction::Model,
        "A model of each robot corrects the commands so that it moves as an ideal one would",
    ),
];

/// Who corrects the commands, and how far ahead.
pub fn choice(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let experiment = &state.compose.experiment;
    let chosen = Correction::of(experiment);
    row(
        ui,
        palette,
        "Correction",
        "What makes up for delay, slip and lag of the robots",
        |ui| {
            for (correction, hint) in HINTS {
                // A twin alone has no robot that a model could correct.
                let possible = correction != Correction::Model || experiment.mode != Mode::Virtual;
                let button = Button::new(correction.title())
                    .selected(chosen == correction)
                    .min_size(vec2(0.0, theme::CONTROL_HEIGHT));
                let response = ui
                    .add_enabled(possible, button)
                    .on_hover_text(hint)
                    .on_disabled_hover_text("Models correct robots: let the experiment run on Robots or Both");
                output.mark(format!("compose.correction.{}", correction.title()), &response);
                if response.clicked() && chosen != correction {
                    output.send(Command::SetCorrection(correction));
                }
            }
        },
    );
    let Some(asked) = experiment.control.interaction.filter(|_| chosen == Correction::Model) else {
        return;
    };
    let [least_s, usual_s, most_s] = HORIZON_S;
    let hint = format!(
        "How far the models look ahead: {least_s} to {most_s} s, usually {usual_s} s. The further, the earlier a robot is prepared for a corner and the more it relies on its model."
    );
    row(ui, palette, "Looks ahead", &hint, |ui| {
        let mut horizon_s = asked.horizon_s;
        let slider = Slider::new(&mut horizon_s, least_s..=most_s)
            .step_by(0.05)
            .fixed_decimals(2)
            .suffix(" s");
        let response = ui.add(slider).on_hover_text(&hint);
        output.mark("compose.horizon", &response);
        if response.changed() {
            output.send(Command::SetHorizon { horizon_s });
        }
    });
    let response = ui.add(Label::new(RichText::new(models(state)).color(palette.faint_ink)).wrap());
    output.mark("compose.correction.models", &response);
}

/// Which version of each robot would correct it, in a sentence.
fn models(state: &State) -> String {
    let experiment = &state.compose.experiment;
    if let Some(named) = &experiment.model {
        return format!("Robots are corrected by the model that the document names: {named}.");
    }
    if state.lab.models.is_none() {
        return "Which versions are in use is not known yet.".to_owned();
    }
    let models = models_of(experiment, &state.lab);
    let by = |name: &str| match models.get(name) {
        Some(model) => format!("{name} by {}", model.version),
        None => format!("{name} by its nominal model"),
    };
    let robots: Vec<String> = experiment.robots.iter().map(|robot| by(&robot.name)).collect();
    let learned = experiment
        .robots
        .iter()
        .any(|robot| models.contains_key(robot.name.as_str()));
    let advice = if learned {
        ""
    } else {
        " A learned one corrects more: diagnose runs on the Gap page, then use the version."
    };
    format!("Corrects {}.{advice}", robots.join(", "))
}
