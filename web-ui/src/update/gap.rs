//! The Gap page: which robot, which runs, which diagnosis, and what the server says about them.

use super::polling::complain;
use super::refusal::decode;
use crate::command::{Answer, Effect, GapCommand, Request};
use crate::net::report_page_url;
use crate::report::Report;
use crate::state::{Gap, Page, ReportState, State};
use api::diagnosis::{CHANGED_RUNS_LEAST, DiagnosisList, DiagnosisRequest, DiagnosisState, DiagnosisView};
use api::model::{ModelChoice, ReferencesRequest, RobotGaps, RobotModel};
use serde::Serialize;
use std::collections::BTreeSet;
use uuid::Uuid;

const DIAGNOSES_EVERY_S: f64 = 1.0;
const GAPS_EVERY_S: f64 = 3.0;
const REPORT_RETRY_S: f64 = 2.0;

pub fn command(state: &mut State, command: GapCommand) -> Vec<Effect> {
    match command {
        GapCommand::ChooseRobot(robot) => {
            choose_robot(state, robot);
            super::show_page(state, Page::Gap)
        }
        GapCommand::ToggleReference(run) => {
            state.gap.references_touched = true;
            state.gap.requests = state.gap.requests.wrapping_add(1);
            let gap = &mut state.gap;
            toggle(&mut gap.references, [&mut gap.changed, &mut gap.locked], run);
            Vec::new()
        }
        GapCommand::ToggleChanged(run) => {
            let gap = about_to_change(state, run);
            toggle(&mut gap.changed, [&mut gap.references, &mut gap.locked], run);
            Vec::new()
        }
        GapCommand::ToggleLocked(run) => {
            let gap = about_to_change(state, run);
            toggle(&mut gap.locked, [&mut gap.references, &mut gap.changed], run);
            Vec::new()
        }
        GapCommand::KeepReferences => keep_references(state),
        GapCommand::Start => start(state),
        GapCommand::Open(id) => {
            open(state, id);
            super::show_page(state, Page::Gap)
        }
        GapCommand::Cancel(id) => super::send(state, Request::Diagnosis(id, "cancel")),
        GapCommand::Accept(id) => super::send(state, Request::Diagnosis(id, "accept")),
        GapCommand::Next(id) => super::send(state, Request::Diagnosis(id, "next-experiment")),
        GapCommand::ChooseModel(model) => match state.gap.robot.clone() {
            Some(robot) => send_body(state, Request::ChooseModel(robot), &ModelChoice { model }),
            None => Vec::new(),
        },
        GapCommand::OpenPage(id) => vec![Effect::OpenBeside(report_page_url(id))],
    }
}

/// A run is about to be ticked as something else than unchanged.
fn about_to_change(state: &mut State, run: Uuid) -> &mut Gap {
    state.gap.requests = state.gap.requests.wrapping_add(1);
    if state.gap.references.contains(&run) {
        state.gap.references_touched = true;
    }
    &mut state.gap
}

/// Every run has one role.
fn toggle(set: &mut BTreeSet<Uuid>, others: [&mut BTreeSet<Uuid>; 2], run: Uuid) {
    if !set.remove(&run) {
        set.insert(run);
        for other in others {
            other.remove(&run);
        }
    }
}

/// Shows another diagnosis, or the form for a new one.
pub fn open(state: &mut State, id: Option<Uuid>) {
    if state.gap.selected == id {
        return;
    }
    state.gap.selected = id;
    state.gap.report = ReportState::Unknown;
    if let Some(id) = id {
        state.service.asked_at_s.remove(&Request::Report(id));
    }
    if let Some(robot) = state.gap.shown().map(|shown| shown.robot.clone()) {
        choose_robot(state, robot);
    }
}

fn choose_robot(state: &mut State, robot: String) {
    if state.gap.robot.as_ref() == Some(&robot) {
        return;
    }
    let keep = state.gap.shown().is_some_and(|shown| shown.robot == robot);
    let before = std::mem::take(&mut state.gap);
    state.gap = Gap {
        robot: Some(robot.clone()),
        diagnoses: before.diagnoses,
        selected: before.selected.filter(|_| keep),
        report: if keep { before.report } else { ReportState::Unknown },
        requests: before.requests,
        ..Gap::default()
    };
    for request in [Request::Gaps(robot.clone()), Request::RobotModel(robot)] {
        state.service.asked_at_s.remove(&request);
    }
}

/// The page opens with the robot of the newest diagnosis, else of the newest finished run, else the first one.
pub fn choose_default(state: &mut State) {
    if state.page != Page::Gap {
        return;
    }
    if let Some(robot) = state.gap.shown().map(|shown| shown.robot.clone()) {
        choose_robot(state, robot);
    }
    if state.gap.robot.is_some() {
        return;
    }
    let (Some(diagnoses), Some(runs), Some(robots)) = (&state.gap.diagnoses, &state.queue.runs, &state.lab.robots)
    else {
        return;
    };
    let of_diagnosis = diagnoses.first().map(|one| one.robot.clone());
    let mut done = runs.iter().filter(|run| run.state == api::run::RunState::Done);
    let of_run = || {
        done.next()
            .and_then(|run| run.experiment.robots.first())
            .map(|robot| robot.name.clone())
    };
    let first = || robots.first().map(|robot| robot.name.clone());
    if let Some(robot) = of_diagnosis.or_else(of_run).or_else(first) {
        choose_robot(state, robot);
    }
}

/// Calls for what is shown.
pub fn wanted(state: &State) -> Vec<(Request, f64)> {
    if state.page != Page::Gap {
        return Vec::new();
    }
    let mut wanted = vec![(Request::Diagnoses, DIAGNOSES_EVERY_S)];
    if let Some(robot) = &state.gap.robot {
        wanted.push((Request::Gaps(robot.clone()), GAPS_EVERY_S));
        wanted.push((Request::RobotModel(robot.clone()), GAPS_EVERY_S));
    }
    if let Some(shown) = state.gap.shown()
        && shown.state == DiagnosisState::Done
        && state.gap.report == ReportState::Unknown
    {
        wanted.push((Request::Report(shown.id), REPORT_RETRY_S));
    }
    wanted
}

pub fn answered(state: &mut State, request: Request, answer: Answer) {
    match request {
        Request::Diagnoses => match decode::<DiagnosisList>(answer) {
            Ok(list) => state.gap.diagnoses = Some(list.diagnoses),
            Err(refusal) => complain(state, "diagnoses", &refusal.sentence),
        },
        Request::Gaps(robot) if state.gap.robot.as_ref() == Some(&robot) => match decode::<RobotGaps>(answer) {
            Ok(gaps) => take_gaps(state, gaps),
            Err(refusal) => complain(state, "gaps", &refusal.sentence),
        },
        Request::RobotModel(robot) if state.gap.robot.as_ref() == Some(&robot) => {
            if let Ok(model) = decode::<RobotModel>(answer) {
                state.gap.model = Some(model);
            }
        }
        Request::Report(id) if state.gap.selected == Some(id) => match decode::<Report>(answer) {
            Ok(report) => state.gap.report = ReportState::Here(Box::new(report)),
            Err(refusal) if state.service.reachable == Some(true) => {
                state.gap.report = ReportState::Missing(refusal.sentence);
            }
            Err(_) => {}
        },
        _ => {}
    }
}

fn take_gaps(state: &mut State, gaps: RobotGaps) {
    if !state.gap.references_touched {
        let kept = gaps.runs.iter().filter(|run| run.is_reference).map(|run| run.run);
        state.gap.references = kept.collect();
        let references = state.gap.references.clone();
        state.gap.changed.retain(|run| !references.contains(run));
        state.gap.locked.retain(|run| !references.contains(run));
    }
    state.gap.gaps = Some(gaps);
}

/// Why no diagnosis can be started now, in words.
pub fn start_obstacle(state: &State) -> Option<&'static str> {
    if state.gap.asking {
        return Some("It is being sent.");
    }
    if state.gap.changed.len() < CHANGED_RUNS_LEAST {
        return Some("Tick at least two runs as changed; one alone cannot tell an effect from chance.");
    }
    None
}

/// In the order of the list, oldest first.
fn ticked(gap: &Gap, set: &BTreeSet<Uuid>) -> Vec<Uuid> {
    let runs = gap.gaps.iter().flat_map(|gaps| gaps.runs.iter().rev());
    runs.map(|run| run.run).filter(|run| set.contains(run)).collect()
}

fn start(state: &mut State) -> Vec<Effect> {
    let Some(robot) = state.gap.robot.clone().filter(|_| start_obstacle(state).is_none()) else {
        return Vec::new();
    };
    let request = DiagnosisRequest {
        robot,
        reference_runs: ticked(&state.gap, &state.gap.references),
        changed_runs: ticked(&state.gap, &state.gap.changed),
        locked_runs: ticked(&state.gap, &state.gap.locked),
        model: None,
    };
    state.gap.asking = true;
    state.gap.refusal = None;
    // Repeating the request after a lost answer makes no second diagnosis.
    let key = Uuid::from_u128(state.compose.session.as_u128() ^ (u128::from(state.gap.requests) << 32) ^ 0x6761_7000);
    let mut effects = send_body(state, Request::StartDiagnosis, &request);
    for effect in &mut effects {
        if let Effect::Send { idempotency_key, .. } = effect {
            *idempotency_key = Some(key);
        }
    }
    effects
}

pub fn started(state: &mut State, answer: Answer) -> Vec<Effect> {
    state.gap.asking = false;
    match decode::<DiagnosisView>(answer) {
        Ok(view) => {
            state.gap.requests = state.gap.requests.wrapping_add(1);
            let id = view.id;
            take_view(state, view);
            open(state, Some(id));
            super::show_page(state, Page::Gap)
        }
        Err(refusal) => {
            super::error(state, format!("The diagnosis was not started. {}", refusal.sentence));
            state.gap.refusal = Some(refusal);
            Vec::new()
        }
    }
}

pub fn verb_answered(state: &mut State, id: Uuid, verb: &str, answer: Answer) -> Vec<Effect> {
    match decode::<DiagnosisView>(answer) {
        Ok(view) => {
            let text = match verb {
                "cancel" => "Cancelling was asked for.".to_owned(),
                "accept" => format!(
                    "From now on the twin of {} uses {}.",
                    view.robot,
                    view.model.as_deref().unwrap_or("the new model")
                ),
                _ => "The proposed experiment is in the queue; when its run is done, a diagnosis with it starts by itself."
                    .to_owned(),
            };
            super::note(state, text);
            take_view(state, view);
        }
        Err(refusal) => super::error(state, refusal.sentence),
    }
    look_again(state);
    state.service.asked_at_s.remove(&Request::Report(id));
    Vec::new()
}

pub fn model_chosen(state: &mut State, robot: &str, answer: Answer) -> Vec<Effect> {
    match decode::<RobotModel>(answer) {
        Ok(model) => {
            let version = model.version.as_deref().unwrap_or("the nominal equations");
            super::note(state, format!("From now on the twin of {robot} uses {version}."));
            super::models::take_current(state, &model);
            if state.gap.robot.as_deref() == Some(robot) {
                state.gap.model = Some(model);
            }
        }
        Err(refusal) => super::error(state, refusal.sentence),
    }
    look_again(state);
    Vec::new()
}

fn keep_references(state: &mut State) -> Vec<Effect> {
    let Some(robot) = state.gap.robot.clone() else {
        return Vec::new();
    };
    let runs = ticked(&state.gap, &state.gap.references);
    send_body(state, Request::KeepReferences(robot), &ReferencesRequest { runs })
}

pub fn references_kept(state: &mut State, answer: Answer) -> Vec<Effect> {
    match decode::<RobotGaps>(answer) {
        Ok(gaps) => {
            state.gap.references_touched = false;
            take_gaps(state, gaps);
            super::note(
                state,
                "Kept: new runs are compared with these, and large gaps ask for a diagnosis by themselves.".to_owned(),
            );
        }
        Err(refusal) => super::error(state, refusal.sentence),
    }
    Vec::new()
}

fn take_view(state: &mut State, view: DiagnosisView) {
    let list = state.gap.diagnoses.get_or_insert_default();
    match list.iter_mut().find(|one| one.id == view.id) {
        Some(known) => *known = view,
        None => list.insert(0, view),
    }
}

/// What depends on the model or on a diagnosis is asked for at once.
fn look_again(state: &mut State) {
    let asked = &mut state.service.asked_at_s;
    asked.retain(|request, _| {
        !matches!(
            request,
            Request::Diagnoses
                | Request::Gaps(_)
                | Request::RobotModel(_)
                | Request::Models
                | Request::Runs
                | Request::Versions(_)
        )
    });
}

pub(super) fn send_body(state: &mut State, request: Request, body: &impl Serialize) -> Vec<Effect> {
    let mut effects = super::send(state, request);
    for effect in &mut effects {
        if let Effect::Send { body: text, .. } = effect {
            *text = Some(serde_json::to_string(body).expect("a request has string keys"));
        }
    }
    effects
}
