//! Calls that repeat: what the server says about runs, robots and the arena.

use super::refusal::decode;
use super::{comparison, gap, models, run};
use crate::command::{Answer, Effect, Request};
use crate::state::{Page, State};
use api::arena::ArenaView;
use api::model::ModelView;
use api::robot::RobotView;
use api::run::RunList;
use serde::Deserialize;

const RUNS_EVERY_S: f64 = 1.0;
const LAB_EVERY_S: f64 = 5.0;
const LAB_EVERY_WHEN_SHOWN_S: f64 = 1.0;
/// A call without an answer for this long is asked again.
const GIVE_UP_S: f64 = 10.0;

/// The calls that are due now.
pub fn due(state: &mut State) -> Vec<Effect> {
    let lab_every_s = if state.page == Page::Robots {
        LAB_EVERY_WHEN_SHOWN_S
    } else {
        LAB_EVERY_S
    };
    let mut wanted = vec![
        (Request::Runs, RUNS_EVERY_S),
        (Request::Robots, lab_every_s),
        (Request::Arenas, lab_every_s),
    ];
    wanted.push((Request::Models, LAB_EVERY_S));
    wanted.extend(run::wanted(state));
    wanted.extend(comparison::wanted(state));
    wanted.extend(gap::wanted(state));
    wanted.extend(models::wanted(state));
    let mut effects = Vec::new();
    for (request, every_s) in wanted {
        if is_due(state, &request, every_s) {
            effects.extend(super::send(state, request));
        }
    }
    effects
}

fn is_due(state: &State, request: &Request, every_s: f64) -> bool {
    let now_s = state.clock.time_s;
    let waiting = state
        .service
        .pending_since_s
        .get(request)
        .is_some_and(|since_s| now_s - since_s < GIVE_UP_S);
    let asked_lately = state
        .service
        .asked_at_s
        .get(request)
        .is_some_and(|at_s| now_s - at_s < every_s);
    !waiting && !asked_lately
}

/// A list stands in the answer by itself or under its noun.
#[derive(Deserialize)]
#[serde(untagged)]
enum RobotList {
    Plain(Vec<RobotView>),
    Named { robots: Vec<RobotView> },
}

#[derive(Deserialize)]
#[serde(untagged)]
enum ArenaList {
    Plain(Vec<ArenaView>),
    Named { arenas: Vec<ArenaView> },
}

pub fn answered(state: &mut State, request: Request, answer: Answer) {
    match request {
        Request::Runs => match decode::<RunList>(answer) {
            Ok(list) => take_runs(state, list),
            Err(refusal) => complain(state, "runs", &refusal.sentence),
        },
        Request::Robots => match decode(answer) {
            Ok(RobotList::Plain(robots) | RobotList::Named { robots }) => take_robots(state, robots),
            Err(refusal) => complain(state, "robots", &refusal.sentence),
        },
        Request::Arenas => match decode(answer) {
            Ok(ArenaList::Plain(arenas) | ArenaList::Named { arenas }) => take_arenas(state, arenas),
            Err(refusal) => complain(state, "arenas", &refusal.sentence),
        },
        Request::Run(id) => run::view_answered(state, id, answer),
        Request::Replay(id) => run::replay_answered(state, id, answer),
        Request::Track(id) => run::track_answered(state, id, answer),
        Request::Models => match decode::<Vec<ModelView>>(answer) {
            Ok(models) => take_models(state, models),
            Err(refusal) => complain(state, "models", &refusal.sentence),
        },
        Request::Gaps(_) | Request::RobotModel(_) => {
            models::answered(state, request.clone(), answer.clone());
            gap::answered(state, request, answer);
        }
        Request::Diagnoses | Request::Report(_) => gap::answered(state, request, answer),
        Request::Versions(_) => models::answered(state, request, answer),
        Request::Submit
        | Request::Cancel(_)
        | Request::StartDiagnosis
        | Request::Diagnosis(..)
        | Request::ChooseModel(_)
        | Request::KeepReferences(_)
        | Request::Compare
        | Request::Stop(_) => {}
    }
}

/// A failed poll is shown once, not every second; an unreachable server has its own message.
pub(super) fn complain(state: &mut State, what: &str, sentence: &str) {
    if state.service.reachable == Some(true) {
        let text = format!("The list of {what} could not be updated. {sentence}");
        if state.last_error.as_deref() != Some(&text) {
            super::error(state, text);
        }
    }
}

fn take_runs(state: &mut State, list: RunList) {
    let mut runs = list.runs;
    runs.sort_by(|a, b| b.created_at.cmp(&a.created_at).then(b.id.cmp(&a.id)));
    state.queue.runs = Some(runs);
}

fn take_robots(state: &mut State, robots: Vec<RobotView>) {
    let before = described(state);
    state.lab.robots = Some(robots);
    rehearse_when_changed(state, &before);
}

fn take_arenas(state: &mut State, arenas: Vec<ArenaView>) {
    let before = described(state);
    state.lab.arenas = Some(arenas);
    rehearse_when_changed(state, &before);
}

fn take_models(state: &mut State, models: Vec<ModelView>) {
    let before = described(state);
    state.lab.models = Some(models);
    rehearse_when_changed(state, &before);
}

/// What the twin computes from, as far as the laboratory decides it.
fn described(state: &State) -> Result<String, Vec<api::problem::FieldProblem>> {
    crate::scenario::scenario_json(&state.compose.experiment, &state.lab)
}

fn rehearse_when_changed(state: &mut State, before: &Result<String, Vec<api::problem::FieldProblem>>) {
    if described(state) != *before {
        super::compose::rehearse_soon(state);
    }
}
