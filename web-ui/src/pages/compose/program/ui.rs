//! How the panel looks: examples and upload above, the text, its mistake, numbers, and the log.

use super::data;
use crate::command::{Command, ProgramCommand};
use crate::output::Output;
use crate::pages::compose::editor;
use crate::pages::{notes, parts};
use crate::state::{Program, Side, State};
use crate::theme::{self, Palette};
use crate::update::program::{is_name, script};
use controllers::gallery::SCRIPTS;
use egui::{Align, Button, DragValue, Label, Layout, RichText, ScrollArea, TextEdit, Ui, vec2};

const NUMBERS_HEIGHT: f32 = 104.0;
const LOG_HEIGHT: f32 = 96.0;
const NUMBER_WIDTH: f32 = 84.0;
const MENU_WIDTH: f32 = 360.0;
/// What is below the text besides log and numbers.
const BELOW: f32 = 66.0;
const LEAST_TEXT_HEIGHT: f32 = 120.0;

fn send(command: ProgramCommand) -> Command {
    Command::Program(command)
}

/// Settings or program: the two sides of the panel while the law is an own controller.
pub fn sides(ui: &mut Ui, state: &State, output: &mut Output) {
    ui.add_space(theme::GAP);
    ui.horizontal(|ui| {
        for (side, title, name) in [
            (Side::Settings, "Settings", "compose.side.settings"),
            (Side::Program, "Controller", "compose.side.program"),
        ] {
            let button = Button::selectable(state.compose.program.side == side, title)
                .min_size(vec2(92.0, theme::CONTROL_HEIGHT));
            let response = ui.add(button);
            output.on_click(name, &response, send(ProgramCommand::ShowSide(side)));
        }
    });
    ui.add_space(theme::GAP / 2.0);
}

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let program = &state.compose.program;
    tools(ui, state, output);
    if let Some(refusal) = &program.refusal {
        ui.add(Label::new(RichText::new(refusal).color(palette.error)).wrap());
    }
    if let Some(place) = program.example_asked {
        ask(ui, output, palette, place);
    }
    let result = state.compose.twin.result.as_ref();
    let lines = result.map_or_else(Vec::new, |result| notes::lines(&result.replay.notes));
    let log_height = if lines.is_empty() { 0.0 } else { LOG_HEIGHT + 34.0 };
    let height = ui.available_height() - BELOW - NUMBERS_HEIGHT - log_height;
    match (script(&state.compose.experiment), data::module(state)) {
        (Some(text), _) => text_and_mistake(ui, output, palette, program, text, height.max(LEAST_TEXT_HEIGHT)),
        (None, Some((title, facts))) => module(ui, output, palette, program, title, &facts),
        (None, None) => {}
    }
    ScrollArea::vertical()
        .id_salt("program numbers")
        .max_height(NUMBERS_HEIGHT)
        .show(ui, |ui| numbers(ui, state, output, palette));
    if !lines.is_empty() {
        ui.add_space(theme::GAP / 2.0);
        parts::section(ui, "Log");
        let now_s = state.compose.playback.time_s;
        notes::log(ui, output, palette, "compose.log", &lines, Some(now_s), LOG_HEIGHT);
    }
}

fn tools(ui: &mut Ui, state: &State, output: &mut Output) {
    ui.horizontal(|ui| {
        let menu = ui.menu_button("Examples", |ui| {
            ui.set_min_width(MENU_WIDTH);
            for (place, example) in SCRIPTS.iter().enumerate() {
                let button = Button::new(example.title).frame(false).min_size(vec2(MENU_WIDTH, 26.0));
                let response = ui.add(button);
                output.on_click(
                    format!("compose.example.{}", example.name),
                    &response,
                    send(ProgramCommand::AskExample(place)),
                );
            }
        });
        output.mark("compose.examples", &menu.response);
        menu.response.on_hover_text("Scripts to start from");
        let upload = ui.button("Module or policy \u{2026}").on_hover_text(
            "A WebAssembly module (.wasm) or a trained network (.onnx) of at most 1 MiB in the place of a script; docs/controllers.md says how they are made",
        );
        output.on_click("compose.module.upload", &upload, send(ProgramCommand::PickModule));
        if state.compose.program.module.is_some() || script(&state.compose.experiment).is_none() {
            let back = ui.button("Write a script instead");
            output.on_click("compose.module.back", &back, send(ProgramCommand::WriteScript));
        }
    });
}

fn ask(ui: &mut Ui, output: &mut Output, palette: &Palette, place: usize) {
    let Some(example) = SCRIPTS.get(place) else { return };
    parts::card(ui, palette, |ui| {
        let question = format!("Your text is replaced by \u{201c}{}\u{201d}.", example.title);
        ui.add(Label::new(question).wrap());
        ui.horizontal(|ui| {
            let yes = ui.button("Replace it");
            output.on_click("compose.example.yes", &yes, send(ProgramCommand::TakeExample(place)));
            let no = ui.button("Keep my text");
            output.on_click("compose.example.no", &no, send(ProgramCommand::KeepText));
        });
    });
}

fn text_and_mistake(ui: &mut Ui, output: &mut Output, palette: &Palette, program: &Program, text: &str, height: f32) {
    let place = program.mistake.as_ref().and_then(|mistake| mistake.place);
    // Drawn after the text, pressed a frame before it.
    let jump_id = egui::Id::unique("program jump");
    let go_to = ui.data_mut(|data| data.remove_temp::<[u32; 2]>(jump_id));
    if let Some(text) = editor::show(ui, output, palette, text, place, go_to, height) {
        output.send(send(ProgramCommand::SetScript(text)));
    }
    ui.allocate_ui_with_layout(vec2(ui.available_width(), 38.0), Layout::top_down(Align::Min), |ui| {
        ui.set_min_height(38.0);
        let Some(mistake) = &program.mistake else {
            let hint = "Ctrl+Space lists what a script may use. Escape leaves the text.";
            ui.label(
                RichText::new(hint)
                    .text_style(egui::TextStyle::Small)
                    .color(palette.faint_ink),
            );
            return;
        };
        let words = RichText::new(data::mistake(mistake)).color(palette.error);
        let button = Button::new(words).frame(false).wrap();
        let response = ui.add(button).on_hover_text("Go to this line");
        output.mark("compose.mistake", &response);
        if let (true, Some(place)) = (response.clicked(), mistake.place) {
            ui.data_mut(|data| data.insert_temp(jump_id, place));
            ui.ctx().request_repaint();
        }
    });
}

fn module(
    ui: &mut Ui,
    output: &mut Output,
    palette: &Palette,
    program: &Program,
    title: &str,
    facts: &[(String, String)],
) {
    let card = parts::card(ui, palette, |ui| {
        parts::section(ui, title);
        parts::facts(ui, palette, "module facts", facts);
        let words = "It drives in the twin as in the laboratory. Its numbers stand below, in the order of their names.";
        ui.add(Label::new(RichText::new(words).color(palette.faint_ink)).wrap());
    });
    output.mark("compose.module", &card.response);
    if let Some(mistake) = &program.mistake {
        let response = ui.add(Label::new(RichText::new(data::mistake(mistake)).color(palette.error)).wrap());
        output.mark("compose.mistake", &response);
    }
}

fn numbers(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Numbers");
    let known = data::numbers(state);
    ui.horizontal_wrapped(|ui| {
        for number in &known {
            ui.horizontal(|ui| one_number(ui, output, palette, number));
        }
        ui.horizontal(|ui| new_number(ui, &state.compose.program, output, &known));
    });
}

fn one_number(ui: &mut Ui, output: &mut Output, palette: &Palette, number: &data::Number) {
    let ink = if number.is_given {
        palette.ink
    } else {
        palette.faint_ink
    };
    let hint = match (number.is_given, number.value) {
        (true, _) => "Given by the experiment",
        (false, Some(_)) => "As the script has it; change it here without changing the script",
        (false, None) => "The script asks for it; without a value the run ends",
    };
    ui.label(RichText::new(&number.name).monospace().color(ink))
        .on_hover_text(hint);
    let mut value = number.value.unwrap_or(0.0);
    let speed = (value.abs() / 100.0).max(0.005);
    let field = DragValue::new(&mut value)
        .speed(speed)
        .max_decimals(4)
        .min_size(vec2(NUMBER_WIDTH, 26.0));
    let response = ui.add(field).on_hover_text(hint);
    output.mark(format!("compose.number.{}", number.name), &response);
    let name = number.name.clone();
    if response.changed() {
        output.send(send(ProgramCommand::SetNumber { name, value }));
    } else if number.is_given {
        let remove = ui
            .add(Button::new("\u{2715}").frame(false))
            .on_hover_text("Not given by the experiment");
        let widget = format!("compose.number.{name}.remove");
        output.on_click(widget, &remove, send(ProgramCommand::RemoveNumber(name)));
    }
}

fn new_number(ui: &mut Ui, program: &Program, output: &mut Output, known: &[data::Number]) {
    let mut name = program.number_name.clone();
    let field = TextEdit::singleline(&mut name)
        .desired_width(120.0)
        .hint_text("another name");
    let response = ui.add(field.margin(egui::Margin::symmetric(8, 5)));
    output.mark("compose.number.name", &response);
    if response.changed() {
        output.send(send(ProgramCommand::NameNumber(name.clone())));
    }
    let is_new = is_name(&name) && !known.iter().any(|number| number.name == name);
    let add = ui
        .add_enabled(is_new, Button::new("Add"))
        .on_hover_text("A number for the program");
    output.on_click(
        "compose.number.add",
        &add,
        send(ProgramCommand::SetNumber { name, value: 1.0 }),
    );
}
