//! `own`: a controller that the user wrote, as a script, a WebAssembly module or a trained network (ONNX). Here are the rules of its section of an
//! experiment; what compiles and runs it is not part of this library and is handed to [`crate::team::Team::with_law`].

use super::targets::{Owner, TargetRule, YawUse};
use super::{LawSpec, OWN};
use crate::scenario::Control;

/// Largest script.
pub const MAX_SCRIPT_BYTES: usize = 64 * 1024;
/// Largest module.
pub const MAX_MODULE_BYTES: usize = 1024 * 1024;
/// Largest policy.
pub const MAX_POLICY_BYTES: usize = 1024 * 1024;
/// Most parameters besides the program.
pub const MAX_PARAMETERS: usize = 64;
const MAX_NAME_CHARACTERS: usize = 40;
/// Key of a script's text.
pub const SCRIPT: &str = "script";
/// Key of a module in base64.
pub const MODULE: &str = "module";
/// Key of a policy, an ONNX file in base64.
pub const POLICY: &str = "policy";
/// Keys of programs; an own controller has one of them.
const PROGRAMS: [&str; 3] = [SCRIPT, MODULE, POLICY];

/// Not among [`super::LAWS`]: it has no table of parameters.
pub(super) const SPEC: LawSpec = LawSpec {
    name: OWN,
    title: "Own controller: a script, a WebAssembly module or a policy (ONNX)",
    source: "the user",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 0,
        most_each: u32::MAX,
        yaw: YawUse::Free,
        apart: false,
        meaning: "The controller sees the targets of each robot; what they mean is its business.",
    },
    parameters: &[],
};

/// Numbers that an experiment hands to its own controller, in the order of their names.
pub fn numbers(control: &Control) -> Vec<(String, f64)> {
    let entries = control.parameters.as_object().into_iter().flatten();
    let numbers = entries.filter(|(key, _)| !PROGRAMS.contains(&key.as_str()));
    let mut numbers: Vec<(String, f64)> = numbers
        .filter_map(|(key, value)| Some((key.clone(), value.as_f64()?)))
        .collect();
    numbers.sort_by(|a, b| a.0.cmp(&b.0));
    numbers
}

/// Checks the section's form; `report(field, message, limit, remedy)` for each problem.
pub(super) fn check(control: &Control, report: &mut dyn FnMut(String, String, String, String)) {
    let mut problem = |field: &str, message: String, limit: String, remedy: &str| {
        let field = ["control.parameters", field].join(if field.is_empty() { "" } else { "." });
        report(field, message, limit, remedy.into());
    };
    let one = "one of `script`, `module` and `policy`";
    let Some(entries) = control.parameters.as_object() else {
        let message = "the parameters are not an object".into();
        return problem("", message, one.into(), "write {\"script\": \"...\"}");
    };
    if PROGRAMS.iter().filter(|key| entries.contains_key(**key)).count() != 1 {
        let message = "an own controller is a script, a module or a policy".into();
        problem("", message, one.into(), "give exactly one of the three");
    }
    if entries.len() > MAX_PARAMETERS + 1 {
        let message = format!("{} parameters besides the program", entries.len() - 1);
        problem("", message, format!("at most {MAX_PARAMETERS}"), "leave some out");
    }
    // Base64 is four characters for three bytes.
    let encoded = |bytes: usize| bytes.div_ceil(3) * 4;
    let sizes = [MAX_SCRIPT_BYTES, encoded(MAX_MODULE_BYTES), encoded(MAX_POLICY_BYTES)];
    for (key, most_bytes) in PROGRAMS.into_iter().zip(sizes) {
        let Some(value) = entries.get(key) else { continue };
        let limit = format!("a text of 1 to {most_bytes} bytes");
        match value.as_str() {
            Some(text) if text.is_empty() || text.len() > most_bytes => {
                let message = format!("the {key} has {} bytes", text.len());
                problem(key, message, limit, "write a shorter program");
            }
            Some(_) => {}
            None => problem(
                key,
                format!("the {key} is not a text"),
                limit,
                "give it as a JSON string",
            ),
        }
    }
    for (key, value) in entries.iter().filter(|(key, _)| !PROGRAMS.contains(&key.as_str())) {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if key.is_empty() || key.len() > MAX_NAME_CHARACTERS || !key.chars().all(plain) {
            let limit = format!("1 to {MAX_NAME_CHARACTERS} of a-z, A-Z, 0-9 and _");
            let message = format!("{key:?} cannot be the name of a parameter");
            problem("", message, limit, "choose another name");
        }
        if !value.as_f64().is_some_and(f64::is_finite) {
            let message = "every parameter besides the program is a number".into();
            problem(key, message, "a finite number".into(), "give a number or remove it");
        }
    }
}
