//! The protective stop.

use crate::command::{Answer, Effect, Request};
use crate::state::State;

/// Presses the button of every laboratory that has told where its own is.
pub fn press(state: &mut State) -> Vec<Effect> {
    let pages: Vec<String> = state.lab.stop_pages().map(str::to_owned).collect();
    if pages.is_empty() {
        super::error(
            state,
            "No laboratory has told where its protective stop is. Use the button in the hall, or cancel the run."
                .to_owned(),
        );
    }
    pages
        .into_iter()
        .flat_map(|page| super::send(state, Request::Stop(page)))
        .collect()
}

/// The laboratory has stopped its robots, or could not be asked.
pub fn answered(state: &mut State, page: &str, answer: Answer) {
    let lab = name(state, page);
    match answer {
        Ok(answer) if answer.status == 200 => {
            super::note(
                state,
                format!(
                    "The robots of {lab} are stopped. They stay still until somebody clears the stop on the laboratory's own page."
                ),
            );
            // Whether robots move is to be seen soon.
            state.service.asked_at_s.remove(&Request::Arenas);
        }
        Ok(answer) => super::error(
            state,
            format!(
                "{lab} answered with {}: {} Use the button in the hall.",
                answer.status,
                answer.body.trim()
            ),
        ),
        Err(_) => super::error(
            state,
            format!(
                "The protective stop of {lab} at {page} did not answer: its robots may still move. Use the button in the hall. A page that was \
                 opened before the laboratory was started there must be loaded anew."
            ),
        ),
    }
}

fn name(state: &State, page: &str) -> String {
    let arenas = state.lab.arenas.iter().flatten();
    let here = arenas.filter(|arena| arena.stop_url.as_deref() == Some(page));
    let names: Vec<&str> = here.map(|arena| arena.arena.name.as_str()).collect();
    if names.is_empty() {
        "the laboratory".to_owned()
    } else {
        names.join(" and ")
    }
}
