//! Moving through a replay: on the Compose page the twin's, on the Run page the recorded run.

use crate::command::Command;
use crate::state::{Page, Playback, State};
use api::verdict::Replay;

/// Seconds from the first to the last frame.
pub fn duration_s(replay: &Replay) -> f64 {
    let frames = replay.robots.iter().map(|r| r.poses.len()).max().unwrap_or(0);
    replay.period_s * frames.saturating_sub(1) as f64
}

fn current(state: &mut State) -> Option<(&mut Playback, f64)> {
    match state.page {
        Page::Compose => {
            let duration_s = state.compose.twin.result.as_ref().map(|r| duration_s(&r.replay))?;
            Some((&mut state.compose.playback, duration_s))
        }
        Page::Run => {
            let run = &mut state.run;
            let duration_s = [run.twin.replay(), run.physical.replay()]
                .into_iter()
                .flatten()
                .map(duration_s)
                .reduce(f64::max)?;
            Some((&mut run.playback, duration_s))
        }
        _ => None,
    }
}

pub fn command(state: &mut State, command: &Command) {
    let Some((playback, duration_s)) = current(state) else {
        return;
    };
    match command {
        Command::PlayPause => {
            if !playback.playing && playback.time_s >= duration_s {
                playback.time_s = 0.0;
            }
            playback.playing = !playback.playing && duration_s > 0.0;
        }
        Command::Seek { time_s } => {
            playback.time_s = time_s.clamp(0.0, duration_s);
        }
        Command::SetSpeed(speed) => playback.speed = speed.clamp(0.1, 32.0),
        _ => {}
    }
}

pub fn advance(state: &mut State, elapsed_s: f64) {
    let Some((playback, duration_s)) = current(state) else {
        return;
    };
    if playback.playing {
        playback.time_s += elapsed_s * playback.speed;
        if playback.time_s >= duration_s {
            playback.playing = false;
        }
    }
    playback.time_s = playback.time_s.min(duration_s);
}
