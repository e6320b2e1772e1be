//! The result of a diagnosis: the sentence first, what can be done with it, then the evidence.

use super::{data, phrase, plots};
use crate::command::{Command, GapCommand};
use crate::output::Output;
use crate::pages::parts;
use crate::report::{Because, Effect, Report};
use crate::state::{ReportState, State};
use crate::theme::{self, Palette};
use api::diagnosis::{DiagnosisView, NOMINAL};
use egui::{Button, CollapsingHeader, Label, RichText, Ui, vec2};

pub fn show(ui: &mut Ui, state: &State, view: &DiagnosisView, output: &mut Output, palette: &Palette) {
    let report = match &state.gap.report {
        ReportState::Here(report) => Some(&**report),
        _ => None,
    };
    let (word, tone, explanation) = phrase::verdict(view.verdict.as_deref().unwrap_or_default());
    let headline = report.map_or_else(|| view.sentence.clone().unwrap_or_default(), phrase::headline);
    ui.add(Label::new(RichText::new(headline).size(23.0).strong()).wrap());
    if let Some(report) = report.filter(|report| report.verdict == "unexplained") {
        ui.add(Label::new(RichText::new(&report.place.sentence).size(16.0)).wrap());
    }
    ui.add_space(theme::GAP / 2.0);
    ui.horizontal_top(|ui| {
        parts::pill(ui, palette, word, tone);
        ui.add(Label::new(RichText::new(explanation).color(palette.faint_ink)).wrap());
    });
    ui.add_space(theme::GAP);
    actions(ui, state, view, output, palette);
    let Some(report) = report else {
        let text = match &state.gap.report {
            ReportState::Missing(why) => format!("The report cannot be shown. {why}"),
            _ => "Loading the report \u{2026}".to_owned(),
        };
        ui.label(RichText::new(text).color(palette.faint_ink));
        return;
    };
    ui.add_space(theme::SECTION_GAP);
    if !report.gap.is_empty() {
        plots::before_after(ui, report, palette);
        ui.add_space(theme::SECTION_GAP);
    }
    plots::place(ui, state, view, report, output, palette);
    ui.add_space(theme::SECTION_GAP);
    effects(ui, report, palette);
    ui.add_space(theme::SECTION_GAP);
    others(ui, report, palette);
    ui.add_space(theme::SECTION_GAP);
    parts::section(ui, "How it was found");
    parts::facts(ui, palette, "gap facts", &data::facts(view, Some(report)));
    for remark in &report.remarks {
        ui.add(Label::new(RichText::new(remark).color(palette.faint_ink).size(13.0)).wrap());
    }
}

/// The diagnosis added an effect to the model.
fn names_something(view: &DiagnosisView) -> bool {
    matches!(view.verdict.as_deref(), Some("confirmed" | "partial" | "ambiguous"))
}

/// Accept, go back, the next experiment, the report as a page.
fn actions(ui: &mut Ui, state: &State, view: &DiagnosisView, output: &mut Output, palette: &Palette) {
    let size = vec2(190.0, 36.0);
    ui.horizontal_wrapped(|ui| {
        if view.model_is_current {
            let back = view.parent_model.clone().unwrap_or_else(|| NOMINAL.to_owned());
            let response = ui
                .add(Button::new("Take the model back").min_size(size))
                .on_hover_text("The twin uses the model that this diagnosis started from again; nothing is deleted");
            output.on_click("gap.revert", &response, Command::Gap(GapCommand::ChooseModel(back)));
        } else if view.model.is_some() {
            // Without a finding the model is only calibrated: nothing to press for.
            let response = if names_something(view) {
                parts::primary_button(ui, palette, true, "Use this model", size)
            } else {
                ui.add(Button::new("Use the calibrated model").min_size(size))
            };
            let response = response.on_hover_text("The twin in the page and the check of new experiments use it from now on; you can go back");
            output.on_click("gap.accept", &response, Command::Gap(GapCommand::Accept(view.id)));
        }
        if view.next_why.is_some() {
            let under_way = view.next_run.filter(|run| {
                let known = state.queue.find(*run).map(|run| run.state);
                known.is_none_or(|state| !state.is_terminal() || state == api::run::RunState::Done)
            });
            match under_way {
                Some(run) => {
                    let response = ui.add(Button::new("Show the proposed run").min_size(size));
                    output.on_click("gap.next.run", &response, Command::OpenRun(run));
                }
                None => {
                    let response = ui
                        .add(Button::new("Run the next experiment").min_size(size))
                        .on_hover_text("Puts the proposed experiment into the queue; when it is done, a diagnosis with it starts by itself");
                    output.on_click("gap.next", &response, Command::Gap(GapCommand::Next(view.id)));
                }
            }
        }
        let response = ui
            .add(Button::new("Report as a page").min_size(vec2(150.0, 36.0)))
            .on_hover_text("Everything in one file, to print or to send");
        output.on_click("gap.page", &response, Command::Gap(GapCommand::OpenPage(view.id)));
    });
    let mut lines = Vec::new();
    if let Some(model) = &view.model {
        lines.push(if view.model_is_current {
            format!(
                "The model {model} is in use: Compose, the check of experiments and the gaps at the left work with it."
            )
        } else if names_something(view) {
            format!("The new model is {model}. It changes nothing until you use it.")
        } else {
            format!(
                "The model {model} is the robot's description calibrated with the unchanged runs, without a new effect."
            )
        });
    }
    if let Some(why) = &view.next_why {
        let what = match &state.gap.report {
            ReportState::Here(report) => report
                .next_experiment
                .as_ref()
                .and_then(|next| phrase::manoeuvre(&next.experiment)),
            _ => None,
        };
        let what = what.map(|what| format!(" ({what})")).unwrap_or_default();
        lines.push(format!("Proposed next experiment{what}: it {why}."));
    }
    if let Some(next) = view.follow_up {
        let response = ui.link("The proposed run is done; see the diagnosis with it");
        output.on_click("gap.follow", &response, Command::Gap(GapCommand::Open(Some(next))));
    }
    for line in lines {
        ui.add(Label::new(RichText::new(line).color(palette.faint_ink)).wrap());
    }
}

/// Named effects with their values and what speaks for them.
fn effects(ui: &mut Ui, report: &Report, palette: &Palette) {
    parts::section(ui, "What was found");
    if report.effects.is_empty() {
        let text = match report.verdict.as_str() {
            "no_discrepancy" => "No effect had to be added.",
            _ => "No effect of the library passed all tests.",
        };
        ui.label(RichText::new(text).color(palette.faint_ink));
        return;
    }
    let largest = report
        .effects
        .iter()
        .map(|effect| effect.evidence.gain)
        .fold(1.0, f64::max);
    for effect in &report.effects {
        parts::card(ui, palette, |ui| one_effect(ui, effect, largest, palette));
        ui.add_space(theme::GAP / 2.0);
    }
    if !report.absorbed.is_empty() {
        let names: Vec<String> = report
            .absorbed
            .iter()
            .map(|absorbed| {
                let values: Vec<String> = absorbed.parameters.iter().filter_map(phrase::parameter).collect();
                format!("{} ({})", phrase::plain(&absorbed.name), values.join(", "))
            })
            .collect();
        let text = format!(
            "Calibrated with the unchanged runs, hence not news: {}.",
            names.join("; ")
        );
        ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
    }
}

fn one_effect(ui: &mut Ui, effect: &Effect, largest: f64, palette: &Palette) {
    let wheel = effect
        .index
        .map_or_else(String::new, |index| format!(" of wheel {}", index + 1));
    let name = format!("{}{wheel}", phrase::plain(&effect.name));
    ui.label(RichText::new(name).text_style(theme::section_style()).strong());
    for parameter in &effect.parameters {
        ui.label(phrase::parameter_with_interval(parameter));
    }
    plots::evidence(ui, effect, largest, palette);
    if effect.status == "ambiguous" && effect.alternatives.is_empty() {
        let text = "Not proven yet. Another run can tell.";
        ui.add(Label::new(RichText::new(text).color(palette.warning)).wrap());
    }
    if !effect.alternatives.is_empty() {
        let names: Vec<String> = effect.alternatives.iter().map(|name| phrase::plain(name)).collect();
        let text = format!("These runs cannot tell it from: {}.", names.join(", "));
        ui.add(Label::new(RichText::new(text).color(palette.warning)).wrap());
    }
    if !effect.excluded.is_empty() {
        CollapsingHeader::new(RichText::new(format!("Why not something else ({})", effect.excluded.len())).size(13.5))
            .id_salt(("excluded", &effect.name, effect.index))
            .show(ui, |ui| because(ui, &effect.excluded, palette));
    }
}

/// What cannot be told with these runs, and what it is not.
fn others(ui: &mut Ui, report: &Report, palette: &Palette) {
    if !report.untestable.is_empty() {
        CollapsingHeader::new(
            RichText::new(format!("What these runs cannot tell ({})", report.untestable.len()))
                .text_style(theme::section_style())
                .strong(),
        )
        .id_salt("untestable")
        .show(ui, |ui| because(ui, &report.untestable, palette));
    }
    if !report.rejected.is_empty() {
        CollapsingHeader::new(
            RichText::new(format!("What it is not ({})", report.rejected.len()))
                .text_style(theme::section_style())
                .strong(),
        )
        .id_salt("rejected")
        .show(ui, |ui| because(ui, &report.rejected, palette));
    }
}

fn because(ui: &mut Ui, list: &[Because], palette: &Palette) {
    let name_width = 190.0;
    for one in list {
        ui.horizontal_top(|ui| {
            ui.allocate_ui(vec2(name_width, 18.0), |ui| {
                ui.set_min_width(name_width);
                ui.add(Label::new(phrase::plain(&one.name)).wrap());
            });
            ui.vertical(|ui| {
                ui.add(Label::new(RichText::new(&one.because).color(palette.faint_ink)).wrap());
                if let Some(what) = phrase::manoeuvre(&one.run_this) {
                    let text = format!("To tell: {what}");
                    ui.add(Label::new(RichText::new(text).color(palette.faint_ink).size(12.5)).wrap());
                }
            });
        });
    }
}
