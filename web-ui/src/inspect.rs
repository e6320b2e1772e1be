//! What a browser test may ask: where things are and what the dashboard believes.
//!
//! Refreshed each frame; see the crate's documentation for the names of the widgets.

use crate::pages::notes;
use crate::pages::run::comparison::data as comparison;
use crate::state::{ComparisonState, ReportState, State, TwinStatus};
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
    /// Frames drawn until this one.
    pub frame: u64,
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
    pub gap: GapSummary,
    pub models: ModelsSummary,
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
    /// From the last change to the start of the twin.
    pub pause_s: Option<f64>,
}

#[derive(Debug, Default, Serialize)]
pub struct ComposeSummary {
    pub template: &'static str,
    pub label: String,
    pub document: serde_json::Value,
    pub playback_s: f64,
    pub playing: bool,
    pub submit_obstacle: Option<&'static str>,
    pub law: String,
    /// The script of an own controller.
    pub script: Option<String>,
    /// Line and column, and words, of what is wrong with it.
    pub mistake: Option<(Option<[u32; 2]>, String)>,
    /// SHA-256 of a module.
    pub module: Option<String>,
    pub refusal: Option<String>,
    /// Log lines of the rehearsal, and drawings on the floor now.
    pub log_lines: usize,
    pub drawings: usize,
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
    /// Lines of the controller's log, and what it draws now.
    pub log_lines: usize,
    pub drawings: usize,
}

#[derive(Debug, Default, Serialize)]
pub struct RunSummary {
    pub id: Option<String>,
    pub state: Option<&'static str>,
    pub has_twin: bool,
    pub has_track: bool,
    pub digest_equal: Option<bool>,
    pub playback_s: f64,
    /// Lines of the controller's log, what it draws at the moment of the playback, and where both come from.
    pub log_lines: usize,
    pub drawings: usize,
    pub notes_of: Option<&'static str>,
    /// The sentence about the path, and the lines of the comparison: run, correction, RMS distance in m.
    pub tracking: Option<String>,
    pub compared: Vec<(String, String, Option<f64>)>,
}

#[derive(Debug, Default, Serialize)]
pub struct GapSummary {
    pub robot: Option<String>,
    /// Version that the robot's twin uses; the nominal equations when absent.
    pub model: Option<String>,
    /// The diagnosis that is shown, its state, verdict and sentence.
    pub diagnosis: Option<String>,
    pub diagnosis_state: Option<&'static str>,
    pub verdict: Option<String>,
    pub headline: Option<String>,
    pub model_is_current: bool,
    pub floor_m: Option<f64>,
    pub limit_m: Option<f64>,
    /// Newest first: id and position gap at the horizon that decides.
    pub runs: Vec<(String, Option<f64>)>,
    pub unchanged: usize,
    pub changed: usize,
    pub kept_back: usize,
}

#[derive(Debug, Default, Serialize)]
pub struct ModelsSummary {
    pub robot: Option<String>,
    /// Newest first.
    pub versions: Vec<String>,
    /// Once the server has told; the inner one is absent for the nominal twin.
    pub in_use: Option<Option<String>>,
    /// Title of what is shown.
    pub shown: String,
    /// Of the comparison that is shown.
    pub sentence: Option<String>,
    pub compared: Option<[String; 2]>,
}

/// The part of the state that tests look at.
pub fn summary(state: &State) -> Summary {
    let compose = &state.compose;
    let (run_notes, notes_of) = crate::pages::run::data::controller_notes(state);
    Summary {
        twin: twin(state),
        compose: ComposeSummary {
            template: compose.template.name(),
            label: compose.label.clone(),
            document: document(state),
            playback_s: compose.playback.time_s,
            playing: compose.playback.playing,
            submit_obstacle: crate::update::submit_obstacle(state),
            ..compose_program(state)
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
            log_lines: state.live.log.len(),
            drawings: state.live.drawings.1.len(),
        },
        run: RunSummary {
            id: state.run.selected.map(|id| id.to_string()),
            state: state.run.view.as_ref().map(|v| v.state.as_str()),
            has_twin: state.run.twin.replay().is_some(),
            has_track: state.run.physical.replay().is_some(),
            digest_equal: state.run.view.as_ref().and_then(|v| v.digest.equal),
            playback_s: state.run.playback.time_s,
            log_lines: notes::lines(run_notes).len(),
            drawings: notes::drawings_at(run_notes, state.run.playback.time_s).len(),
            notes_of: (!run_notes.is_empty()).then_some(notes_of),
            tracking: comparison::headline(state).map(|headline| headline.sentence),
            compared: compared(state),
        },
        gap: gap(state),
        models: models(state),
        toasts: state.toasts.iter().map(|t| t.text.clone()).collect(),
        server_reachable: state.service.reachable,
        last_error: state.last_error.clone(),
    }
}

/// Only on the Run page: finding runs along the same path takes time in every frame.
fn compared(state: &State) -> Vec<(String, String, Option<f64>)> {
    if state.page != crate::state::Page::Run {
        return Vec::new();
    }
    let rms_m = |run: &uuid::Uuid| Some(state.comparison.found.get(run)?.as_ref()?.figures.rms_m);
    let rows = comparison::rows(state).into_iter();
    rows.map(|row| (row.run.to_string(), row.what, rms_m(&row.run)))
        .collect()
}

fn models(state: &State) -> ModelsSummary {
    let models = &state.models;
    let view = match &models.comparison {
        ComparisonState::Here(view) => Some(view),
        _ => None,
    };
    ModelsSummary {
        robot: models.robot.clone(),
        versions: models
            .versions
            .iter()
            .flatten()
            .map(|one| one.version.clone())
            .collect(),
        in_use: models.current.as_ref().map(|current| current.version.clone()),
        shown: crate::pages::models::data::headline(state).0,
        sentence: view.map(|view| view.sentence.clone()),
        compared: view.map(|view| crate::pages::models::data::compared(view).map(str::to_owned)),
    }
}

/// The experiment; without the bytes of a module, which are many.
fn document(state: &State) -> serde_json::Value {
    let mut document = serde_json::to_value(&state.compose.experiment).unwrap_or_default();
    if let Some(parameters) = document["control"]["parameters"].as_object_mut() {
        parameters.remove(control::law::own::MODULE);
        parameters.remove(control::law::own::POLICY);
    }
    document
}

fn compose_program(state: &State) -> ComposeSummary {
    let (compose, program) = (&state.compose, &state.compose.program);
    let replay = compose.twin.result.as_ref().map(|result| &result.replay);
    ComposeSummary {
        law: compose.experiment.control.law.clone(),
        script: crate::update::program::script(&compose.experiment).map(str::to_owned),
        mistake: program
            .mistake
            .as_ref()
            .map(|mistake| (mistake.place, mistake.text.clone())),
        module: program.module.as_ref().map(|file| file.sha256.clone()),
        refusal: program.refusal.clone(),
        log_lines: replay.map_or(0, |replay| notes::lines(&replay.notes).len()),
        drawings: replay.map_or(0, |replay| {
            notes::drawings_at(&replay.notes, compose.playback.time_s).len()
        }),
        ..ComposeSummary::default()
    }
}

fn gap(state: &State) -> GapSummary {
    let gap = &state.gap;
    let shown = gap.shown();
    let at = |run: &api::model::RunGap, horizon_s: f64| {
        let mut horizons = run.horizons.iter();
        horizons
            .find(|gap| gap.horizon_s == horizon_s)
            .map(|gap| gap.position_m)
    };
    GapSummary {
        robot: gap.robot.clone(),
        model: gap.model.as_ref().and_then(|model| model.version.clone()),
        diagnosis: shown.map(|view| view.id.to_string()),
        diagnosis_state: shown.map(|view| view.state.as_str()),
        verdict: shown.and_then(|view| view.verdict.clone()),
        headline: match &gap.report {
            ReportState::Here(report) => Some(crate::pages::gap::phrase::headline(report)),
            _ => None,
        },
        model_is_current: shown.is_some_and(|view| view.model_is_current),
        floor_m: gap.gaps.as_ref().and_then(|gaps| gaps.floor_position_m),
        limit_m: gap.gaps.as_ref().and_then(|gaps| gaps.limit_position_m),
        runs: gap
            .gaps
            .iter()
            .flat_map(|gaps| {
                gaps.runs
                    .iter()
                    .map(|run| (run.run.to_string(), at(run, gaps.horizon_s)))
            })
            .collect(),
        unchanged: gap.references.len(),
        changed: gap.changed.len(),
        kept_back: gap.locked.len(),
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
        pause_s: twin.pause_s,
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

/// Counts the frame and keeps what it showed.
pub fn publish(mut inspection: Inspection) {
    NEWEST.with(|newest| {
        let mut newest = newest.borrow_mut();
        inspection.frame = newest.frame + 1;
        *newest = inspection;
    });
}

/// JSON of the newest frame.
pub fn newest_json() -> String {
    NEWEST.with(|newest| serde_json::to_string(&*newest.borrow()).unwrap_or_else(|_| "{}".to_owned()))
}
