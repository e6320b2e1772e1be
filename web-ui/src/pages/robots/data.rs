//! What the Robots page shows.

use crate::pages::words;
use crate::state::State;
use crate::theme::{self, Tone};

#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub name: String,
    pub kind: String,
    pub state: String,
    pub tone: Tone,
    pub battery: String,
    pub message: String,
}

/// One row a robot; `None` until the server answered.
pub fn rows(state: &State) -> Option<Vec<Row>> {
    let robots = state.lab.robots.as_deref()?;
    Some(
        robots
            .iter()
            .map(|view| {
                let (word, tone) = match view.state.as_str() {
                    "idle" => ("Ready", Tone::Good),
                    "leased" => ("In a run", Tone::Active),
                    "offline" => ("Offline", Tone::Error),
                    other => (other, Tone::Neutral),
                };
                Row {
                    name: view.name.clone(),
                    kind: words::chassis(&view.robot.description.chassis).to_owned(),
                    state: word.to_owned(),
                    tone,
                    battery: view.bus_v.map_or_else(|| "not measured".to_owned(), theme::volts),
                    message: view.message.clone().unwrap_or_default(),
                }
            })
            .collect(),
    )
}

/// The arena in one line.
pub fn arena(state: &State) -> Option<(String, Tone)> {
    let view = state.lab.arenas.as_deref()?.first()?;
    let (word, tone) = match view.state.as_str() {
        "free" => ("is free", Tone::Good),
        "leased" => ("is in use", Tone::Active),
        "held" => ("is held", Tone::Warning),
        "offline" => ("is offline", Tone::Error),
        other => (other, Tone::Neutral),
    };
    let size = format!(
        "{} by {}",
        theme::metres(view.arena.width_m),
        theme::metres(view.arena.height_m)
    );
    let message = view
        .message
        .as_deref()
        .map(|m| format!(" {}", words::full_stop(m)))
        .unwrap_or_default();
    Some((
        format!("Arena \u{201c}{}\u{201d} ({size}) {word}.{message}", view.arena.name),
        tone,
    ))
}
