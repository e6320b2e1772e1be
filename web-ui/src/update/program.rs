//! Writing an own controller: script, module, numbers, and what the rehearsal says of it.

use super::compose::rehearse_soon;
use crate::command::{Effect, ProgramCommand};
use crate::state::{Mistake, ModuleFile, Side, State, TwinStatus};
use api::experiment::Experiment;
use api::problem::FieldProblem;
use control::law::own::{MAX_MODULE_BYTES, MAX_POLICY_BYTES, MODULE, POLICY, SCRIPT};
use control::law::{OWN, place_in};
use controllers::gallery::SCRIPTS;
use controllers::source::Source;
use serde_json::{Value, json};

/// First bytes of every WebAssembly file.
const MAGIC: &[u8] = b"\0asm";
/// End of the name of a policy's file; ONNX files begin with nothing of their own.
const POLICY_SUFFIX: &str = ".onnx";
/// Keys of an experiment's program.
const PROGRAMS: [&str; 3] = [SCRIPT, MODULE, POLICY];
/// Length of the name of a number.
pub const NUMBER_NAME_MAX: usize = 40;

pub fn is_own(experiment: &Experiment) -> bool {
    experiment.control.law == OWN
}

/// The script of an experiment; none with a module or another law.
pub fn script(experiment: &Experiment) -> Option<&str> {
    is_own(experiment)
        .then(|| experiment.control.parameters.get(SCRIPT)?.as_str())
        .flatten()
}

/// Another law, with its usual parameters; the program is kept for the way back.
pub fn choose_law(state: &mut State, law: &str) {
    let control = &state.compose.experiment.control;
    if control.law == law || (law != OWN && control::law::law_spec(law).is_none()) {
        return;
    }
    keep(state);
    let kept = state.compose.program.kept.clone();
    let control = &mut state.compose.experiment.control;
    law.clone_into(&mut control.law);
    control.parameters = json!({});
    if law == OWN {
        let script = kept.unwrap_or_else(|| SCRIPTS[0].script.to_owned());
        control.parameters = json!({ SCRIPT: script });
        state.compose.program.side = Side::Program;
    } else {
        state.compose.program.side = Side::Settings;
        state.compose.program.mistake = None;
    }
    changed(state);
}

/// A new document came from a template: what belonged to the old one is gone.
pub fn forget(state: &mut State) {
    let own = is_own(&state.compose.experiment);
    state.compose.program = crate::state::Program {
        side: if own { Side::Program } else { Side::Settings },
        kept: state.compose.program.kept.take(),
        ..Default::default()
    };
}

/// The script of now, for the way back to it.
pub fn keep(state: &mut State) {
    if let Some(text) = script(&state.compose.experiment).map(str::to_owned) {
        state.compose.program.kept = Some(text);
    }
}

pub fn command(state: &mut State, command: ProgramCommand) -> Vec<Effect> {
    match command {
        ProgramCommand::ShowSide(side) => state.compose.program.side = side,
        ProgramCommand::SetScript(text) => set_script(state, text),
        ProgramCommand::AskExample(place) => {
            let written = script(&state.compose.experiment).unwrap_or_default();
            if is_of_the_gallery(written) {
                take_example(state, place);
            } else {
                state.compose.program.example_asked = Some(place);
            }
        }
        ProgramCommand::TakeExample(place) => take_example(state, place),
        ProgramCommand::KeepText => state.compose.program.example_asked = None,
        ProgramCommand::SetNumber { name, value } => {
            if value.is_finite() && is_name(&name) {
                set(state, &name, Some(json!(value)));
            }
            state.compose.program.number_name.clear();
        }
        ProgramCommand::RemoveNumber(name) => set(state, &name, None),
        ProgramCommand::NameNumber(name) => {
            let plain = |c: &char| c.is_ascii_alphanumeric() || *c == '_';
            state.compose.program.number_name = name.chars().filter(plain).take(NUMBER_NAME_MAX).collect();
        }
        ProgramCommand::PickModule => return vec![Effect::PickModule],
        ProgramCommand::WriteScript => {
            let script = state.compose.program.kept.clone();
            let script = script.unwrap_or_else(|| SCRIPTS[0].script.to_owned());
            set_script(state, script);
        }
    }
    Vec::new()
}

/// Nothing of a person's own is lost when such a text is replaced.
fn is_of_the_gallery(text: &str) -> bool {
    text.trim().is_empty() || SCRIPTS.iter().any(|example| example.script == text)
}

/// Whether a number may be called so.
pub fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    !name.is_empty() && name.len() <= NUMBER_NAME_MAX && name.chars().all(plain) && !PROGRAMS.contains(&name)
}

fn take_example(state: &mut State, place: usize) {
    if let Some(example) = SCRIPTS.get(place) {
        set_script(state, example.script.to_owned());
    }
}

fn set_script(state: &mut State, text: String) {
    if !is_own(&state.compose.experiment) {
        return;
    }
    state.compose.program.example_asked = None;
    state.compose.program.refusal = None;
    state.compose.program.module = None;
    set(state, MODULE, None);
    set(state, POLICY, None);
    set(state, SCRIPT, Some(json!(text)));
}

/// Writes an entry of the parameters, or takes it out.
fn set(state: &mut State, key: &str, value: Option<Value>) {
    let parameters = &mut state.compose.experiment.control.parameters;
    if !parameters.is_object() {
        *parameters = json!({});
    }
    let Some(entries) = parameters.as_object_mut() else {
        return;
    };
    let before = entries.get(key).cloned();
    if before == value {
        return;
    }
    match value {
        Some(value) => entries.insert(key.to_owned(), value),
        None => entries.remove(key),
    };
    changed(state);
}

fn changed(state: &mut State) {
    state.compose.edited = true;
    rehearse_soon(state);
}

/// A file came from the dialogue: a module or a policy takes the script's place, anything else is refused in words.
pub fn module_picked(state: &mut State, name: String, bytes: Result<Vec<u8>, String>) {
    if !is_own(&state.compose.experiment) {
        return;
    }
    match taken(&name, bytes) {
        Ok((source, file)) => {
            keep(state);
            let key = source.key();
            let (Source::Script(text) | Source::Module(text) | Source::Policy(text)) = source;
            state.compose.program.refusal = None;
            state.compose.program.module = Some(file);
            for other in PROGRAMS {
                set(state, other, None);
            }
            set(state, key, Some(json!(text)));
        }
        Err(refusal) => state.compose.program.refusal = Some(refusal),
    }
}

fn taken(name: &str, bytes: Result<Vec<u8>, String>) -> Result<(Source, ModuleFile), String> {
    let bytes = bytes.map_err(|words| format!("{name} could not be read: {words}."))?;
    let file = format!("{name} ({})", crate::theme::bytes(bytes.len() as i64));
    let is_policy = name.to_ascii_lowercase().ends_with(POLICY_SUFFIX);
    if !is_policy && !bytes.starts_with(MAGIC) {
        return Err(format!(
            "{file} is no WebAssembly module, it does not begin like one, and no policy, whose name ends with {POLICY_SUFFIX}."
        ));
    }
    let (most, what, advice) = if is_policy {
        (MAX_POLICY_BYTES, "a policy", "Train a smaller network.")
    } else {
        (MAX_MODULE_BYTES, "a module", "Build it with optimisation for size.")
    };
    if bytes.len() > most {
        let most = crate::theme::bytes(most as i64);
        return Err(format!("{file} is too large; {what} may have {most}. {advice}"));
    }
    let source = if is_policy {
        Source::policy(&bytes)
    } else {
        Source::module(&bytes)
    };
    let sha256 = source.sha256().map_err(|fault| fault.to_string())?;
    let file = ModuleFile {
        name: name.to_owned(),
        bytes: bytes.len(),
        sha256,
    };
    Ok((source, file))
}

/// What the rehearsal that has just ended says of the program.
pub fn judge(state: &mut State) {
    let twin = &state.compose.twin;
    state.compose.program.mistake = match (&twin.status, &twin.result) {
        (TwinStatus::Problems(problems), _) => problems.iter().find_map(refused),
        (TwinStatus::Done, Some(result)) => {
            let mut findings = result.verdict.findings.iter();
            let fault = findings.find(|finding| finding.code == "controller_fault");
            fault.map(|finding| Mistake {
                place: place_in(&finding.message),
                at_s: Some(finding.at_s),
                text: bare(&finding.message),
            })
        }
        _ => None,
    };
}

fn refused(problem: &FieldProblem) -> Option<Mistake> {
    let field = problem.field.strip_prefix("control.parameters")?;
    (field.is_empty() || field == ".script" || field == ".module" || field == ".policy").then(|| Mistake {
        place: place_in(&problem.message),
        at_s: None,
        text: bare(&problem.message),
    })
}

/// The reason without the place, which stands beside it.
fn bare(message: &str) -> String {
    let message = message.strip_prefix("the controller cannot go on: ").unwrap_or(message);
    let after = |text: &str, word: &str| Some(text.strip_prefix(word)?.split_once(": ")?.1.to_owned());
    let message = after(message, "tick ").unwrap_or_else(|| message.to_owned());
    after(&message, "line ").unwrap_or(message)
}
