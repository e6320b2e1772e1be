//! Answers that are not what was asked for, in words.

use crate::command::Answer;
use crate::state::Refusal;
use api::problem::Problem;
use serde::de::DeserializeOwned;

/// The body of a successful answer, or why there is none.
pub fn decode<T: DeserializeOwned>(answer: Answer) -> Result<T, Refusal> {
    let answer = answer.map_err(|words| sentence(format!("The server could not be reached ({words}).")))?;
    if !(200..300).contains(&answer.status) {
        return Err(refusal(answer.status, &answer.body));
    }
    serde_json::from_str(&answer.body)
        .map_err(|e| sentence(format!("The server's answer could not be read: {e}. Reload the page; server and dashboard may be of different versions.")))
}

fn sentence(sentence: String) -> Refusal {
    Refusal {
        sentence,
        problems: Vec::new(),
    }
}

fn refusal(status: u16, body: &str) -> Refusal {
    match serde_json::from_str::<Problem>(body) {
        Ok(problem) => Refusal {
            sentence: if problem.detail.is_empty() {
                with_stop(&problem.title)
            } else {
                with_stop(&problem.detail)
            },
            problems: problem.errors,
        },
        Err(_) => sentence(match status {
            401 | 403 => "You may not do this: the server asks for a token with the right role.".to_owned(),
            404 => "The server does not know it.".to_owned(),
            413 => "The document is too large for the server.".to_owned(),
            429 => "Too many requests; please wait a moment and try again.".to_owned(),
            500..=599 => format!("The server has a fault of its own (status {status}); please try again."),
            _ => format!("The server refused (status {status})."),
        }),
    }
}

fn with_stop(text: &str) -> String {
    let text = text.trim();
    let mut letters = text.chars();
    let capital: String = letters.next().map(|c| c.to_uppercase().collect()).unwrap_or_default();
    let stop = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    format!("{capital}{}{stop}", letters.as_str())
}
