//! The Run page: which run, its view, the twin's replay and the measured track.

use super::refusal::decode;
use crate::command::{Answer, Effect, Request};
use crate::state::{Page, Playback, Recording, Run, State};
use api::run::RunView;
use api::verdict::Replay;
use uuid::Uuid;

const VIEW_EVERY_S: f64 = 1.0;
pub(super) const FILE_RETRY_S: f64 = 2.0;
pub const REPLAY_FILE: &str = "replay.json";
pub const TRACK_FILE: &str = "track.json";

/// Shows another run; nothing of the former one stays.
pub fn open(state: &mut State, id: Uuid) {
    if state.run.selected == Some(id) {
        return;
    }
    let view = state.queue.find(id).cloned();
    for request in [Request::Run(id), Request::Replay(id), Request::Track(id)] {
        state.service.asked_at_s.remove(&request);
    }
    state.run = Run {
        selected: Some(id),
        view,
        playback: Playback::default(),
        ..Run::default()
    };
}

/// The Run page never stands empty while there are runs: the newest is shown.
pub fn choose_default(state: &mut State) {
    if state.page == Page::Run
        && state.run.selected.is_none()
        && let Some(id) = state.queue.runs.as_deref().and_then(|runs| runs.first()).map(|r| r.id)
    {
        open(state, id);
    }
}

/// Calls for the run that is shown.
pub fn wanted(state: &State) -> Vec<(Request, f64)> {
    let Some(id) = state.run.selected.filter(|_| state.page == Page::Run) else {
        return Vec::new();
    };
    let mut wanted = Vec::new();
    let ended = state.run.view.as_ref().is_some_and(|v| v.state.is_terminal());
    if state.run.missing.is_none() && !(ended && recordings_settled(&state.run)) {
        wanted.push((Request::Run(id), VIEW_EVERY_S));
    }
    if let Some(view) = &state.run.view {
        if state.run.twin.replay().is_none() && has_file(view, REPLAY_FILE) {
            wanted.push((Request::Replay(id), FILE_RETRY_S));
        }
        if state.run.physical.replay().is_none() && has_file(view, TRACK_FILE) {
            wanted.push((Request::Track(id), FILE_RETRY_S));
        }
    }
    wanted
}

fn recordings_settled(run: &Run) -> bool {
    !matches!(run.twin, Recording::Unknown | Recording::Loading)
        && !matches!(run.physical, Recording::Unknown | Recording::Loading)
}

pub(super) fn has_file(view: &RunView, name: &str) -> bool {
    view.files.iter().any(|f| f.name == name)
}

pub fn view_answered(state: &mut State, id: Uuid, answer: Answer) {
    if state.run.selected != Some(id) {
        return;
    }
    match decode::<RunView>(answer) {
        Ok(view) => {
            settle(
                &mut state.run.twin,
                &view,
                REPLAY_FILE,
                "The twin's replay was not kept with this run.",
            );
            settle(
                &mut state.run.physical,
                &view,
                TRACK_FILE,
                "No measured track was uploaded for this run.",
            );
            state.run.missing = None;
            state.run.view = Some(view);
        }
        Err(refusal) if state.run.view.is_none() && state.service.reachable == Some(true) => {
            state.run.missing = Some(refusal.sentence);
        }
        Err(_) => {}
    }
}

/// Says whether a recording is on its way or will never come.
fn settle(recording: &mut Recording, view: &RunView, file: &str, missing: &str) {
    if recording.replay().is_some() {
        return;
    }
    *recording = match (has_file(view, file), view.state.is_terminal()) {
        (true, _) => Recording::Loading,
        (false, true) => Recording::Missing(missing.to_owned()),
        (false, false) => Recording::Unknown,
    };
}

pub fn replay_answered(state: &mut State, id: Uuid, answer: Answer) {
    if state.run.selected == Some(id) {
        state.run.twin = recording(answer);
    }
}

pub fn track_answered(state: &mut State, id: Uuid, answer: Answer) {
    let recording = recording(answer);
    if state.run.selected == Some(id) {
        state.run.physical = recording.clone();
    }
    super::comparison::track_answered(state, id, recording);
}

fn recording(answer: Answer) -> Recording {
    match decode::<Replay>(answer) {
        Ok(replay) if replay.period_s > 0.0 && replay.period_s.is_finite() => Recording::Here(replay),
        Ok(_) => Recording::Missing("The recording states no time step.".to_owned()),
        Err(refusal) => Recording::Missing(refusal.sentence),
    }
}

pub fn cancel_answered(state: &mut State, id: Uuid, answer: Answer) -> Vec<Effect> {
    match decode::<serde_json::Value>(answer.map(|mut a| {
        if a.body.trim().is_empty() {
            "null".clone_into(&mut a.body);
        }
        a
    })) {
        Ok(_) => super::note(
            state,
            "Cancelling was asked for; the run ends as soon as the laboratory confirms.".to_owned(),
        ),
        Err(refusal) => super::error(state, format!("The run was not cancelled. {}", refusal.sentence)),
    }
    state.service.asked_at_s.remove(&Request::Runs);
    state.service.asked_at_s.remove(&Request::Run(id));
    Vec::new()
}
