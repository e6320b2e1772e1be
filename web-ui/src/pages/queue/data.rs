//! What the Queue page shows.

use crate::pages::words;
use crate::state::State;
use crate::theme::{self, Tone};
use api::run::{RunState, RunView};
use chrono::{DateTime, Utc};
use uuid::Uuid;

/// Rows on the page; older runs are found by the REST interface.
pub const ROWS_MAX: usize = 200;

#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub id: Uuid,
    pub label: String,
    pub state: &'static str,
    pub tone: Tone,
    pub position: String,
    pub start: String,
    pub reason: String,
    pub who: String,
    pub submitted: String,
    pub can_cancel: bool,
}

/// Active and waiting runs in the order they will run, then the ended ones, newest first.
pub fn rows(state: &State) -> Option<Vec<Row>> {
    let mut runs: Vec<&RunView> = state.queue.runs.as_deref()?.iter().collect();
    runs.sort_by_key(|r| {
        (
            rank(r),
            if r.state.is_terminal() {
                -r.created_at.timestamp_millis()
            } else {
                r.created_at.timestamp_millis()
            },
        )
    });
    Some(
        runs.into_iter()
            .take(ROWS_MAX)
            .map(|r| row(r, state.clock.utc))
            .collect(),
    )
}

fn rank(run: &RunView) -> (u8, i64) {
    let group = match run.state {
        RunState::Running | RunState::Uploading => 0,
        RunState::Preparing => 1,
        RunState::Queued => 2,
        RunState::Validating | RunState::Draft => 3,
        _ => 4,
    };
    (group, run.queue_position.unwrap_or(i64::MAX))
}

fn row(run: &RunView, now: DateTime<Utc>) -> Row {
    let (state, tone) = words::run_state(run.state);
    Row {
        id: run.id,
        label: if run.label.is_empty() {
            "(no label)".to_owned()
        } else {
            run.label.clone()
        },
        state,
        tone,
        position: match (run.state, run.queue_position) {
            (RunState::Queued, Some(1)) => "next".to_owned(),
            (RunState::Queued, Some(position)) => position.to_string(),
            _ => "\u{2013}".to_owned(),
        },
        start: start(run, now),
        reason: reason(run),
        who: run.submitted_by.clone(),
        submitted: theme::relative(run.created_at, now),
        can_cancel: can_cancel(run.state),
    }
}

/// Cancelling makes sense until everything is measured.
pub const fn can_cancel(state: RunState) -> bool {
    matches!(
        state,
        RunState::Validating | RunState::Queued | RunState::Preparing | RunState::Running
    )
}

fn start(run: &RunView, now: DateTime<Utc>) -> String {
    match (run.started_at, run.expected_start) {
        (Some(at), _) => theme::relative(at, now),
        (None, Some(at)) if !run.state.is_terminal() => {
            // An expected start that has passed is only late, not past.
            if at <= now {
                "any moment".to_owned()
            } else {
                theme::relative(at, now)
            }
        }
        _ => "\u{2013}".to_owned(),
    }
}

fn reason(run: &RunView) -> String {
    if let Some(fault) = &run.fault {
        return words::fault(fault);
    }
    if run.state == RunState::Rejected
        && let Some(verdict) = &run.verdict
    {
        return words::full_stop(&verdict.sentence);
    }
    match &run.waiting_reason {
        Some(reason) if !run.state.is_terminal() => words::full_stop(reason),
        _ => words::run_state_explained(run.state).to_owned(),
    }
}
