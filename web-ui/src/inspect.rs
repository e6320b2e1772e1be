//! What a browser test may ask: where things are and what the dashboard believes.
//!
//! Refreshed each frame; see the crate's documentation for the names of the widgets.

use crate::state::{State, TwinStatus};
use serde::Serialize;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// A widget on the page, in CSS pixels from the top left corner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Place {
    pub x: f32,
    pub y: f32,
    pub w: f32,
    pub h: f32,
    pub enabled: bool,
}

#[derive(Debug, Default, Serialize)]
pub struct Inspection {
    pub page: &'static str,
    pub widgets: BTreeMap<String, Place>,
    pub state: Summary,
}

#[derive(Debug, Default, Serialize)]
pub struct Summary {
    pub twin: TwinSummary,
    pub compose: ComposeSummary,
    pub queue: QueueSummary,
    pub live: LiveSummary,
    pub run: RunSummary,
    pub toasts: Vec<String>,
    pub server_reachable: Option<bool>,
    pub last_error: Option<String>,
}

#[derive(Debug, Default, Serialize)]
pub struct TwinSummary {
    /// A change waits to be computed or is being computed.
    pub running: bool,
    pub accepted: Option<bool>,
    pub digest: Option<String>,
    pub sentence: Option<String>,
    /// `idle`, `waiting`, `running`, `done`, `problems` or `failed`.
    pub status: &'static str,
    pub findings: Vec<String>,
    pub problems: Vec<String>,
}

#[derive(Debug, Default, Serialize)]
pub struct ComposeSummary {
    pub template: &'static str,
    pub label: String,
    pub document: serde_json::Value,
    pub playback_s: f64,
    pub playing: bool,
    pub submit_obstacle: Option<&'static str>,
}

#[derive(Debug, Default, Serialize)]
pub struct QueueSummary {
    /// Newest first: id and state.
    pub runs: Vec<(String, &'static str)>,
}

#[derive(Debug, Default, Serialize)]
pub struct LiveSummary {
    pub run: Option<String>,
    pub connected: bool,
    pub frames: usize,
    pub tick: Option<i64>,
}

#[derive(Debug, Default, Serialize)]
pub struct RunSummary {
    pub id: Option<String>,
    pub state: Option<&'static str>,
    pub has_twin: bool,
    pub has_track: bool,
    pub digest_equal: Option<bool>,
    pub playback_s: f64,
}

/// The part of the state that tests look at.
pub fn summary(state: &State) -> Summary {
    let compose = &state.compose;
    Summary {
        twin: twin(state),
        compose: ComposeSummary {
            template: compose.template.name(),
            label: compose.label.clone(),
            document: serde_json::to_value(&compose.experiment).unwrap_or_default(),
            playback_s: compose.playback.time_s,
            playing: compose.playback.playing,
            submit_obstacle: crate::update::submit_obstacle(state),
        },
        queue: QueueSummary {
            runs: state
                .queue
                .runs
                .iter()
                .flatten()
                .map(|r| (r.id.to_string(), r.state.as_str()))
                .collect(),
        },
        live: LiveSummary {
            run: state.live.run.map(|id| id.to_string()),
            connected: state.live.open,
            frames: state.live.frames.len(),
            tick: state.live.frames.back().map(|f| f.tick),
        },
        run: RunSummary {
            id: state.run.selected.map(|id| id.to_string()),
            state: state.run.view.as_ref().map(|v| v.state.as_str()),
            has_twin: state.run.twin.replay().is_some(),
            has_track: state.run.physical.replay().is_some(),
            digest_equal: state.run.view.as_ref().and_then(|v| v.digest.equal),
            playback_s: state.run.playback.time_s,
        },
        toasts: state.toasts.iter().map(|t| t.text.clone()).collect(),
        server_reachable: state.service.reachable,
        last_error: state.last_error.clone(),
    }
}

fn twin(state: &State) -> TwinSummary {
    let twin = &state.compose.twin;
    let current = matches!(twin.status, TwinStatus::Done)
        .then_some(())
        .and(twin.result.as_ref());
    TwinSummary {
        running: matches!(twin.status, TwinStatus::Waiting { .. } | TwinStatus::Running { .. }),
        accepted: current.map(|r| r.verdict.accepted),
        digest: current.map(|r| r.digest.clone()),
        sentence: current.map(|r| r.verdict.sentence.clone()),
        status: match twin.status {
            TwinStatus::Idle => "idle",
            TwinStatus::Waiting { .. } => "waiting",
            TwinStatus::Running { .. } => "running",
            TwinStatus::Done => "done",
            TwinStatus::Problems(_) => "problems",
            TwinStatus::Failed(_) => "failed",
        },
        findings: current
            .map(|r| r.verdict.findings.iter().map(|f| f.code.clone()).collect())
            .unwrap_or_default(),
        problems: crate::update::field_problems(state)
            .iter()
            .map(|p| p.field.clone())
            .collect(),
    }
}

thread_local! {
    /// One page has one thread and one dashboard.
    static NEWEST: RefCell<Inspection> = RefCell::default();
}

pub fn publish(inspection: Inspection) {
    NEWEST.with(|newest| *newest.borrow_mut() = inspection);
}

/// JSON of the newest frame.
pub fn newest_json() -> String {
    NEWEST.with(|newest| serde_json::to_string(&*newest.borrow()).unwrap_or_else(|_| "{}".to_owned()))
}
