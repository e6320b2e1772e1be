//! What the panel shows besides the text: numbers, mistakes, the module.

use crate::pages::compose::editor::highlight::{Token, tokens};
use crate::state::{Mistake, State};
use crate::theme;
use crate::update::program::script;
use control::law::own::{MODULE, POLICY, numbers as given_numbers};

/// A number that is handed to the program.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    pub name: String,
    /// In the experiment, or else what the script takes without one.
    pub value: Option<f64>,
    /// The experiment says it.
    pub is_given: bool,
}

/// Numbers of the experiment, and those that the script asks for.
pub fn numbers(state: &State) -> Vec<Number> {
    let experiment = &state.compose.experiment;
    let control = control::scenario::Control {
        law: experiment.control.law.clone(),
        parameters: experiment.control.parameters.clone(),
        interaction: None,
        feedback_alone: false,
    };
    let mut numbers: Vec<Number> = given_numbers(&control)
        .into_iter()
        .map(|(name, value)| Number {
            name,
            value: Some(value),
            is_given: true,
        })
        .collect();
    for (name, value) in asked_for(script(experiment).unwrap_or_default()) {
        if !numbers.iter().any(|number| number.name == name) {
            numbers.push(Number {
                name,
                value,
                is_given: false,
            });
        }
    }
    numbers
}

/// `parameter("name", otherwise)` in a script: names and what they are otherwise, where that is a plain number.
fn asked_for(text: &str) -> Vec<(String, Option<f64>)> {
    let mut found: Vec<(String, Option<f64>)> = Vec::new();
    for (range, token) in tokens(text) {
        if token != Token::Function || &text[range.clone()] != "parameter" {
            continue;
        }
        let call = text[range.end..].trim_start().strip_prefix('(').map(str::trim_start);
        let Some((name, rest)) = call.and_then(|call| call.strip_prefix('"')?.split_once('"')) else {
            continue;
        };
        let otherwise = rest.trim_start().strip_prefix(',').and_then(|rest| {
            let (value, _) = rest.split_once(')')?;
            value.trim().replace('_', "").parse().ok()
        });
        if crate::update::program::is_name(name) && !found.iter().any(|(known, _)| known == name) {
            found.push((name.to_owned(), otherwise));
        }
    }
    found
}

/// Where and what, in one line.
pub fn mistake(mistake: &Mistake) -> String {
    let place = mistake
        .place
        .map_or_else(String::new, |[line, column]| format!("Line {line}, column {column}: "));
    let when = mistake.at_s.map_or_else(String::new, |at_s| {
        format!(" (after {} of the rehearsal)", theme::seconds(at_s))
    });
    format!("{place}{}{when}", mistake.text)
}

/// What stands in the place of a script, and its name, size and hash; none when there is a script.
pub fn module(state: &State) -> Option<(&'static str, Vec<(String, String)>)> {
    let parameters = &state.compose.experiment.control.parameters;
    let kinds = [(MODULE, "WebAssembly module"), (POLICY, "Policy (ONNX)")];
    let (title, text) = kinds
        .into_iter()
        .find_map(|(key, title)| Some((title, parameters.get(key)?.as_str()?)))?;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let facts = match &state.compose.program.module {
        Some(file) => vec![
            fact("File", file.name.clone()),
            fact("Size", theme::bytes(file.bytes as i64)),
            fact("SHA-256", file.sha256.clone()),
        ],
        None => vec![fact("Size", theme::bytes(text.len() as i64 / 4 * 3))],
    };
    Some((title, facts))
}

/// The experiment for reading: a module or a policy is named by its size only.
pub fn readable_document(state: &State) -> String {
    let mut experiment = state.compose.experiment.clone();
    for key in [MODULE, POLICY] {
        if let Some(program) = experiment.control.parameters.get_mut(key) {
            let characters = program.as_str().map_or(0, str::len);
            *program = format!("({characters} characters of base64; Copy gives them)").into();
        }
    }
    serde_json::to_string_pretty(&experiment).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_a_script_asks_for_are_found() {
        let text = "// parameter(\"no\", 1)\nlet a = parameter( \"gain\" , -1_0.5 ) + parameter(\"must\");\nlet b = parameter(\"gain\", 3); parameter(\"of\", a)";
        assert_eq!(
            asked_for(text),
            [
                ("gain".to_owned(), Some(-10.5)),
                ("must".to_owned(), None),
                ("of".to_owned(), None)
            ]
        );
        assert_eq!(
            asked_for(controllers::gallery::SCRIPTS[0].script),
            [("speed_m_per_s".to_owned(), Some(0.4))]
        );
    }

    #[test]
    fn a_mistake_says_where_and_when() {
        let one = Mistake {
            place: Some([3, 9]),
            at_s: Some(0.5),
            text: "Function not found".to_owned(),
        };
        assert!(
            mistake(&one).starts_with("Line 3, column 9: Function not found (after 0.5"),
            "{}",
            mistake(&one)
        );
    }
}
