//! The live connection follows the run on the floor by itself.

use crate::command::{Effect, Event};
use crate::state::{LIVE_FRAMES_MAX, LIVE_LOG_MAX, Live, State};
use api::live::LiveFrame;
use api::note::Note;
use uuid::Uuid;

const RECONNECT_S: f64 = 1.0;

/// Opens, keeps or closes the connection so that it belongs to the active run.
pub fn follow_active_run(state: &mut State) -> Vec<Effect> {
    let wanted = state.queue.active().map(|r| r.id);
    if state.live.connected == wanted {
        return Vec::new();
    }
    let mut effects = Vec::new();
    if state.live.connected.take().is_some() {
        state.live.open = false;
        effects.push(Effect::CloseLive);
    }
    if let Some(run) = wanted.filter(|_| state.clock.time_s >= state.live.reconnect_at_s) {
        if state.live.run != Some(run) {
            state.live.run = Some(run);
            state.live.frames.clear();
            state.live.drawings = (0.0, Vec::new());
            state.live.log.clear();
            state.live.frames_dropped = 0;
            state.live.unreadable = 0;
        }
        state.live.connected = Some(run);
        state.live.open = false;
        effects.push(Effect::OpenLive { run });
    }
    effects
}

pub fn event(state: &mut State, event: Event) {
    match event {
        Event::LiveOpened { run } if state.live.connected == Some(run) => state.live.open = true,
        Event::LiveFrame { run, text } if state.live.connected == Some(run) => take_frame(state, run, &text),
        Event::LiveClosed { run, .. } if state.live.connected == Some(run) => {
            state.live.connected = None;
            state.live.open = false;
            state.live.reconnect_at_s = state.clock.time_s + RECONNECT_S;
        }
        _ => {}
    }
}

fn take_frame(state: &mut State, run: Uuid, text: &str) {
    let Ok(mut frame) = serde_json::from_str::<LiveFrame>(text) else {
        state.live.unreadable += 1;
        return;
    };
    let live = &mut state.live;
    // A newer attempt starts from the beginning; frames of an older one are late.
    if let Some(last) = live.frames.back() {
        if frame.run_id != run || frame.epoch < last.epoch {
            return;
        }
        if frame.epoch > last.epoch {
            live.frames.clear();
            live.log.clear();
        }
    }
    take_notes(live, &mut frame);
    live.open = true;
    live.last_frame_at_s = state.clock.time_s;
    live.frames.push_back(frame);
    if live.frames.len() > LIVE_FRAMES_MAX {
        live.frames.pop_front();
        live.frames_dropped += 1;
    }
}

/// What the controller said goes to its log; of what it drew only the newest is kept.
fn take_notes(live: &mut Live, frame: &mut LiveFrame) {
    let mut drawings = Vec::new();
    for note in std::mem::take(&mut frame.notes) {
        match note {
            Note::Log { text } => live.log.push_back((frame.time_s, text)),
            drawing => drawings.push(drawing),
        }
    }
    while live.log.len() > LIVE_LOG_MAX {
        live.log.pop_front();
    }
    live.drawings = (frame.time_s, drawings);
}
