//! How the Gap page looks: robot, its runs and its diagnoses at the left; the diagnosis that is shown, or the way to one.

use super::{data, phrase, result};
use crate::command::{Command, GapCommand};
use crate::output::Output;
use crate::pages::parts;
use crate::state::{Page, State};
use crate::theme::{self, Palette, Tone};
use crate::update;
use api::diagnosis::{DiagnosisState, DiagnosisView, NOMINAL};
use egui::{Align, Button, Checkbox, Label, Layout, ProgressBar, RichText, ScrollArea, Sense, Stroke, Ui, vec2};

const TICK_WIDTH: f32 = 68.0;
/// Of unchanged, changed, kept back.
const TICKS: f32 = 3.0;
const GAP_WIDTH: f32 = 70.0;
const RUN_HEIGHT: f32 = 38.0;
const DIAGNOSIS_HEIGHT: f32 = 46.0;
/// Share of the window that the list of runs takes before it scrolls by itself: the button below stays in sight.
const RUNS_SHARE: f32 = 0.38;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::two_columns(
        ui,
        palette,
        "gap",
        output,
        |ui, output| side(ui, state, output, palette),
        |ui, output| centre(ui, state, output, palette),
    );
}

fn side(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.add_space(f32::from(theme::PAGE_MARGIN));
    robot(ui, state, output, palette);
    ui.add_space(theme::GAP);
    model(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    runs(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
    diagnoses(ui, state, output, palette);
    ui.add_space(theme::SECTION_GAP);
}

fn robot(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) -> bool {
    parts::robot_choice(ui, state, output, palette, "gap", state.gap.robot.as_deref(), |robot| {
        Command::Gap(GapCommand::ChooseRobot(robot))
    })
}

/// Which model the twin uses, and the way back.
fn model(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let Some(model) = &state.gap.model else { return };
    let text = match &model.version {
        Some(version) => format!("Its twin uses the model {version}."),
        None => "Its twin uses the nominal equations, without any model version.".to_owned(),
    };
    ui.horizontal_wrapped(|ui| {
        ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
        let before = model.history.get(1).and_then(|line| line.version.clone());
        if model.version.is_some() {
            let back = before.unwrap_or_else(|| NOMINAL.to_owned());
            let hint = if back == NOMINAL {
                "Go back to the nominal equations. The version is kept and can be chosen again.".to_owned()
            } else {
                format!("Go back to {back}. The version is kept and can be chosen again.")
            };
            let response = ui.add(Button::new("Go back").small()).on_hover_text(hint);
            output.on_click("gap.back", &response, Command::Gap(GapCommand::ChooseModel(back)));
        }
    });
}

fn runs(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Finished runs");
    if state.gap.robot.is_none() {
        return;
    }
    let Some(rows) = data::runs(state) else {
        ui.label(RichText::new("Loading the runs \u{2026}").color(palette.faint_ink));
        return;
    };
    if rows.is_empty() {
        let robot = state.gap.robot.as_deref().unwrap_or("this robot");
        let text = format!(
            "{robot} has not finished a run on this floor yet. Every finished run is compared with the twin here."
        );
        ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
        let response = ui.add(Button::new("Compose an experiment"));
        output.on_click("gap.elsewhere", &response, Command::ShowPage(Page::Compose));
        return;
    }
    if let Some(alarm) = data::drift_sentence(state) {
        let response = ui.add(Label::new(RichText::new(alarm).color(palette.tone(Tone::Warning))).wrap());
        output.mark("gap.drift", &response);
    }
    ui.add(
        Label::new(
            RichText::new(data::floor_sentence(state))
                .color(palette.faint_ink)
                .size(13.0),
        )
        .wrap(),
    );
    run_header(ui, palette);
    let most = (ui.ctx().content_rect().height() * RUNS_SHARE).max(3.0 * RUN_HEIGHT);
    let height = (rows.len() as f32 * (RUN_HEIGHT + 2.0)).min(most);
    ScrollArea::vertical()
        .id_salt("gap runs")
        .max_height(height)
        .min_scrolled_height(height)
        .auto_shrink([false, true])
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            for row in &rows {
                run_row(ui, row, output, palette);
            }
        });
    ui.add_space(theme::GAP / 2.0);
    buttons(ui, state, output, palette);
}

fn run_header(ui: &mut Ui, palette: &Palette) {
    ui.horizontal(|ui| {
        let small = |text: &str| {
            RichText::new(text)
                .color(palette.faint_ink)
                .text_style(egui::TextStyle::Small)
        };
        let name_width = name_width(ui);
        let (left, middle) = (Layout::left_to_right(Align::Center), Layout::top_down(Align::Center));
        ui.spacing_mut().item_spacing.x = 0.0;
        let mut cell = |layout: Layout, width: f32, text: &str, hint: &str| {
            ui.allocate_ui_with_layout(vec2(width, 18.0), layout, |ui| {
                ui.set_min_width(width);
                ui.add(Label::new(small(text)).selectable(false)).on_hover_text(hint);
            });
        };
        cell(
            middle,
            TICK_WIDTH,
            "unchanged",
            "Runs in which robot and floor were as always: they show what chance does.",
        );
        cell(
            middle,
            TICK_WIDTH,
            "changed",
            "Runs whose difference to the twin is to be explained.",
        );
        cell(
            middle,
            TICK_WIDTH,
            "kept back",
            "Changed runs that nothing is fitted to: they are opened once, for the figures of the result. \
             With none ticked, some of six or more changed runs are kept back without being asked.",
        );
        cell(left, name_width, "run", "");
        cell(
            left,
            GAP_WIDTH,
            "gap at 2 s",
            "How far the twin's prediction is from the measured position two seconds later, RMS.",
        );
    });
}

fn name_width(ui: &Ui) -> f32 {
    (ui.available_width() - TICKS * TICK_WIDTH - GAP_WIDTH - 12.0).max(80.0)
}

fn run_row(ui: &mut Ui, row: &data::RunRow, output: &mut Output, palette: &Palette) {
    ui.horizontal(|ui| {
        ui.set_height(RUN_HEIGHT);
        ui.spacing_mut().item_spacing.x = 0.0;
        let name_width = name_width(ui);
        let left = Layout::left_to_right(Align::Center);
        let ticks = [
            ("same", row.same, GapCommand::ToggleReference(row.run)),
            ("changed", row.changed, GapCommand::ToggleChanged(row.run)),
            ("locked", row.locked, GapCommand::ToggleLocked(row.run)),
        ];
        for (name, mut ticked, command) in ticks {
            ui.allocate_ui_with_layout(vec2(TICK_WIDTH, RUN_HEIGHT), left, |ui| {
                ui.set_min_width(TICK_WIDTH);
                // The box itself, without text, is 16 wide.
                ui.add_space((TICK_WIDTH - 16.0) / 2.0);
                let response = ui.add(Checkbox::without_text(&mut ticked));
                output.on_click(format!("gap.run.{}.{name}", row.run), &response, Command::Gap(command));
            });
        }
        ui.allocate_ui_with_layout(vec2(name_width, RUN_HEIGHT), Layout::top_down(Align::Min), |ui| {
            ui.set_min_width(name_width);
            ui.spacing_mut().item_spacing.y = 0.0;
            ui.spacing_mut().interact_size.y = 16.0;
            ui.set_max_width(name_width - 10.0);
            ui.add(Label::new(&row.label).selectable(false).truncate())
                .on_hover_text(&row.label);
            let when = RichText::new(&row.when)
                .text_style(egui::TextStyle::Small)
                .color(palette.faint_ink);
            ui.add(Label::new(when).selectable(false).truncate());
        });
        ui.allocate_ui_with_layout(vec2(GAP_WIDTH, RUN_HEIGHT), left, |ui| {
            let ink = if row.tone == Tone::Neutral {
                palette.faint_ink
            } else {
                palette.tone(row.tone)
            };
            ui.add(Label::new(RichText::new(&row.gap).color(ink).strong()).selectable(false))
                .on_hover_text(&row.hint);
        });
    });
}

fn buttons(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    ui.horizontal(|ui| {
        let obstacle = update::start_obstacle(state);
        let start = parts::primary_button(ui, palette, obstacle.is_none(), "Diagnose", vec2(130.0, 34.0));
        let start = match obstacle {
            Some(text) => start.on_disabled_hover_text(text),
            None => start.on_hover_text("Find out why the changed runs differ; takes half a minute to some minutes"),
        };
        output.on_click("gap.start", &start, Command::Gap(GapCommand::Start));
        if state.gap.references_touched {
            let hint = "Remember these runs as unchanged: new runs are compared with them, and large gaps ask for a diagnosis by themselves";
            let keep = ui
                .add(Button::new("Keep as unchanged").min_size(vec2(150.0, 34.0)))
                .on_hover_text(hint);
            output.on_click("gap.keep", &keep, Command::Gap(GapCommand::KeepReferences));
        }
    });
    let kept_back = state.gap.locked.len();
    let counts = format!(
        "{} unchanged, {} changed, {kept_back} kept back",
        state.gap.references.len(),
        state.gap.changed.len(),
    );
    let advice = match (state.gap.references.len(), state.gap.changed.len()) {
        (_, 0 | 1) => "tick at least two changed runs",
        (0, _) => "without unchanged runs the result is at most partly explained",
        (_, changed) if kept_back == 0 && changed < 6 => "six changed runs make a proven result possible",
        (_, changed) if kept_back > 0 && (kept_back < 2 || changed < 4) => {
            "four changed runs and two kept back make a proven result possible"
        }
        _ => "",
    };
    let text = if advice.is_empty() {
        counts
    } else {
        format!("{counts}; {advice}")
    };
    ui.add(Label::new(RichText::new(text).color(palette.faint_ink).size(13.0)).wrap());
    for problem in state.gap.refusal.iter().flat_map(|refusal| &refusal.problems) {
        let text = format!("{}. Allowed: {}. {}.", problem.message, problem.limit, problem.remedy);
        ui.add(Label::new(RichText::new(text).color(palette.error).size(13.0)).wrap());
    }
}

fn diagnoses(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let rows = data::diagnoses(state);
    if rows.is_empty() {
        return;
    }
    parts::section(ui, "Diagnoses");
    ui.spacing_mut().item_spacing.y = 4.0;
    for row in &rows {
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), DIAGNOSIS_HEIGHT), Sense::click());
        let response = response.on_hover_cursor(egui::CursorIcon::PointingHand);
        let lit = row.shown || response.hovered() || response.has_focus();
        let edge = Stroke::new(
            if lit { 1.5 } else { 1.0 },
            if lit { palette.accent } else { palette.line },
        );
        ui.painter()
            .rect(rect, theme::CORNER, palette.raised, edge, egui::StrokeKind::Inside);
        let open = Command::Gap(GapCommand::Open(Some(row.id)));
        output.on_click(format!("gap.row.{}", row.id), &response, open);
        let inner = egui::UiBuilder::new().max_rect(rect.shrink2(vec2(12.0, 5.0)));
        ui.scope_builder(inner.layout(Layout::top_down(Align::Min)), |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            ui.spacing_mut().interact_size.y = 16.0;
            ui.horizontal(|ui| {
                ui.add(Label::new(RichText::new(row.state).color(palette.tone(row.tone)).strong()).selectable(false));
                let when = RichText::new(&row.when)
                    .text_style(egui::TextStyle::Small)
                    .color(palette.faint_ink);
                ui.add(Label::new(when).selectable(false));
            });
            let text = RichText::new(&row.text).size(13.0).color(palette.faint_ink);
            ui.add(Label::new(text).selectable(false).truncate());
        });
    }
}

fn centre(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    match (state.gap.shown(), state.gap.selected, &state.gap.diagnoses) {
        (Some(view), _, _) => shown(ui, state, view, output, palette),
        (None, Some(_), None) | (None, None, None) => {
            parts::empty(
                ui,
                palette,
                "Loading the diagnoses \u{2026}",
                "The server has not answered yet.",
                None,
            );
        }
        (None, Some(_), Some(_)) => {
            parts::empty(
                ui,
                palette,
                "This diagnosis is not here",
                "It belongs to somebody else, or its address is wrong. Choose one at the left.",
                None,
            );
        }
        (None, None, Some(_)) => introduction(ui, palette),
    }
}

/// What the page is for, in three steps.
fn introduction(ui: &mut Ui, palette: &Palette) {
    ui.add_space(ui.available_height().min(600.0) * 0.12);
    ui.label(
        RichText::new("Why does the robot not drive as its twin says?")
            .text_style(egui::TextStyle::Heading)
            .strong(),
    );
    ui.add_space(theme::GAP);
    let steps = [
        (
            "Unchanged runs show what chance does.",
            "Tick some runs in which robot and floor were as always. Two repetitions of the same run never agree exactly; these runs \
             say how far apart they are.",
        ),
        (
            "Changed runs show the difference.",
            "Tick the runs in which something may be different: another floor, a load, a worn wheel. Two are the least, six make a \
             proven result possible.",
        ),
        (
            "The diagnosis names the cause.",
            "Some fifty physical effects are tried on part of the changed runs; what wins must also explain runs that were held \
             back. The result is a sentence with figures, and a model with which the twin drives like the robot. You decide whether \
             to use it.",
        ),
    ];
    for (number, (title, text)) in steps.iter().enumerate() {
        parts::card(ui, palette, |ui| {
            ui.horizontal_top(|ui| {
                let number = RichText::new((number + 1).to_string())
                    .size(26.0)
                    .color(palette.accent)
                    .strong();
                ui.add_sized(vec2(34.0, 34.0), Label::new(number).selectable(false));
                ui.vertical(|ui| {
                    ui.label(RichText::new(*title).text_style(theme::section_style()).strong());
                    ui.add(Label::new(RichText::new(*text).color(palette.faint_ink)).wrap());
                });
            });
        });
        ui.add_space(theme::GAP / 2.0);
    }
}

fn shown(ui: &mut Ui, state: &State, view: &DiagnosisView, output: &mut Output, palette: &Palette) {
    match view.state {
        DiagnosisState::Queued => {
            under_way(
                ui,
                view,
                output,
                palette,
                "Waiting for its turn",
                "One diagnosis is computed at a time; this one is next or soon.",
            );
        }
        DiagnosisState::Running => {
            let text = format!("{:.0} % \u{2013} {}", 100.0 * view.progress, phrase::stage(&view.stage));
            under_way(ui, view, output, palette, "Looking for the cause", &text);
        }
        DiagnosisState::Failed | DiagnosisState::Cancelled => ended_without(ui, view, output, palette),
        DiagnosisState::Done => result::show(ui, state, view, output, palette),
    }
}

fn under_way(ui: &mut Ui, view: &DiagnosisView, output: &mut Output, palette: &Palette, title: &str, text: &str) {
    ui.add_space(ui.available_height().min(600.0) * 0.16);
    ui.vertical_centered(|ui| {
        ui.set_max_width(560.0);
        ui.label(
            RichText::new(format!("{}: {title}", view.robot))
                .text_style(egui::TextStyle::Heading)
                .strong(),
        );
        ui.add_space(theme::GAP);
        ui.add(
            ProgressBar::new(view.progress as f32)
                .desired_width(520.0)
                .desired_height(14.0)
                .fill(palette.accent),
        );
        ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
        ui.add_space(theme::GAP);
        let kept_back = match view.locked_runs.len() {
            0 => String::new(),
            kept => format!(", {kept} kept back"),
        };
        let figures = format!(
            "{} changed and {} unchanged runs{kept_back}. You may leave the page; the diagnosis goes on.",
            view.changed_runs.len(),
            view.reference_runs.len()
        );
        ui.add(Label::new(RichText::new(figures).color(palette.faint_ink)).wrap());
        ui.add_space(theme::GAP);
        let word = if view.cancel_requested {
            "Stopping \u{2026}"
        } else {
            "Cancel"
        };
        let cancel = ui.add_enabled(!view.cancel_requested, Button::new(word).min_size(vec2(120.0, 34.0)));
        output.on_click("gap.cancel", &cancel, Command::Gap(GapCommand::Cancel(view.id)));
    });
}

fn ended_without(ui: &mut Ui, view: &DiagnosisView, output: &mut Output, palette: &Palette) {
    let cancelled = view.state == DiagnosisState::Cancelled;
    let title = if cancelled {
        "This diagnosis was cancelled"
    } else {
        "This diagnosis has no result"
    };
    let message = view
        .problem
        .as_ref()
        .map(|problem| problem.message.as_str())
        .unwrap_or_default();
    let advice = match view.problem.as_ref().map(|problem| problem.code.as_str()) {
        Some("run_unreadable") => " Leave that run out and start again.",
        Some("not_diagnosable") => {
            " Choose other runs: longer ones, in which the robot moves and its poses are measured."
        }
        Some("cancelled_by_user") => " Tick runs at the left to start another.",
        Some(_) => " Start it again; if it fails again, tell whoever runs this service.",
        None => "",
    };
    if let Some(response) = parts::empty(
        ui,
        palette,
        title,
        &format!("{message}{advice}"),
        Some("Prepare a new one"),
    ) {
        output.on_click("gap.new", &response, Command::Gap(GapCommand::Open(None)));
    }
}
