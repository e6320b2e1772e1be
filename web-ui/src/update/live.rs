//! The live connection follows the run on the floor by itself.

use crate::command::{Effect, Event};
use crate::state::{LIVE_FRAMES_MAX, State};
use api::live::LiveFrame;
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
    let Ok(frame) = serde_json::from_str::<LiveFrame>(text) else {
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
        }
    }
    live.open = true;
    live.last_frame_at_s = state.clock.time_s;
    live.frames.push_back(frame);
    if live.frames.len() > LIVE_FRAMES_MAX {
        live.frames.pop_front();
        live.frames_dropped += 1;
    }
}
