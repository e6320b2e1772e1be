//! The Gap page's state: ticking, starting, taking answers in, accepting.

use super::*;
use crate::command::{GapCommand, HttpAnswer};
use crate::state::{Clock, ReportState};
use api::diagnosis::DiagnosisRequest;
use serde_json::json;

fn state() -> State {
    let mut state = State::new(
        Uuid::from_u128(7),
        Clock {
            time_s: 0.0,
            utc: chrono::DateTime::from_timestamp(1_000_000, 0).expect("valid"),
        },
        false,
    );
    state.page = Page::Gap;
    state.gap.robot = Some("omni-03".to_owned());
    state
}

fn answer(state: &mut State, request: Request, status: u16, body: &serde_json::Value) -> Vec<Effect> {
    let answer = Ok(HttpAnswer {
        status,
        body: body.to_string(),
    });
    event(state, Event::Answer { request, answer })
}

fn run(number: u128) -> Uuid {
    Uuid::from_u128(number)
}

fn gaps(references: &[u128]) -> serde_json::Value {
    let runs: Vec<_> = (1..=4)
        .rev()
        .map(|number| {
            json!({"run": run(number), "label": "", "submitted_by": "ada", "ended_at": null,
                "is_reference": references.contains(&number), "horizons": [], "problem": null})
        })
        .collect();
    json!({"robot": "omni-03", "floor": "lab-floor", "model": null, "version": null, "horizon_s": 2.0,
        "floor_position_m": null, "limit_position_m": null, "runs": runs})
}

fn diagnosis(id: u128, state: &str) -> serde_json::Value {
    json!({"id": run(id), "robot": "omni-03", "arena": "reference", "floor": "lab-floor", "requested_by": "ada", "origin": "person",
        "follows": null, "reference_runs": [], "changed_runs": [], "locked_runs": [], "parent_model": null, "state": state,
        "cancel_requested": false, "progress": 0.0, "stage": "", "verdict": null, "sentence": null, "model": "omni-03/1",
        "model_is_current": false, "problem": null, "next_why": null, "next_run": null, "follow_up": null,
        "created_at": "2026-01-01T00:00:00Z", "started_at": null, "ended_at": null})
}

fn press(state: &mut State, pressed: GapCommand) -> Vec<Effect> {
    command(state, Command::Gap(pressed))
}

#[test]
fn a_run_is_ticked_one_way_only_and_two_changed_ones_start() {
    let mut state = state();
    answer(&mut state, Request::Gaps("omni-03".to_owned()), 200, &gaps(&[1]));
    assert_eq!(
        state.gap.references.iter().copied().collect::<Vec<_>>(),
        [run(1)],
        "those that are kept"
    );
    assert!(start_obstacle(&state).is_some());
    assert!(press(&mut state, GapCommand::Start).is_empty());
    for number in [4, 3, 1] {
        press(&mut state, GapCommand::ToggleChanged(run(number)));
    }
    assert!(state.gap.references.is_empty(), "1 was taken over");
    press(&mut state, GapCommand::ToggleReference(run(2)));
    assert_eq!(start_obstacle(&state), None);
    let effects = press(&mut state, GapCommand::Start);
    let [
        Effect::Send {
            request,
            body,
            idempotency_key,
        },
    ] = effects.as_slice()
    else {
        panic!("{effects:?}")
    };
    assert_eq!((request, idempotency_key.is_some()), (&Request::StartDiagnosis, true));
    let sent: DiagnosisRequest = serde_json::from_str(body.as_deref().unwrap_or_default()).expect("a request");
    assert_eq!(sent.changed_runs, [run(1), run(3), run(4)], "oldest first");
    assert_eq!(sent.reference_runs, [run(2)]);
    assert!(press(&mut state, GapCommand::Start).is_empty(), "one request at a time");
}

#[test]
fn a_run_kept_back_is_neither_changed_nor_unchanged_and_is_sent_as_locked() {
    let mut state = state();
    answer(&mut state, Request::Gaps("omni-03".to_owned()), 200, &gaps(&[1]));
    for number in [2, 3, 4] {
        press(&mut state, GapCommand::ToggleChanged(run(number)));
    }
    for number in [1, 4] {
        press(&mut state, GapCommand::ToggleLocked(run(number)));
    }
    assert!(
        state.gap.references.is_empty() && state.gap.references_touched,
        "1 was taken over"
    );
    assert_eq!(state.gap.changed.len(), 2);
    press(&mut state, GapCommand::ToggleLocked(run(1)));
    press(&mut state, GapCommand::ToggleReference(run(1)));
    let effects = press(&mut state, GapCommand::Start);
    let Some(Effect::Send { body: Some(body), .. }) = effects.first() else {
        panic!("{effects:?}")
    };
    let sent: DiagnosisRequest = serde_json::from_str(body).expect("a request");
    assert_eq!(
        (sent.changed_runs, sent.locked_runs),
        (vec![run(2), run(3)], vec![run(4)])
    );
    assert_eq!(sent.reference_runs, [run(1)]);
}

#[test]
fn a_started_diagnosis_is_shown_and_its_report_fetched_when_it_is_done() {
    let mut state = state();
    answer(&mut state, Request::StartDiagnosis, 201, &diagnosis(9, "queued"));
    assert_eq!((state.gap.selected, state.gap.asking), (Some(run(9)), false));
    let wants_report = |state: &State| {
        gap::wanted(state)
            .iter()
            .any(|(request, _)| *request == Request::Report(run(9)))
    };
    assert!(!wants_report(&state));
    let list = json!({"diagnoses": [diagnosis(9, "done")]});
    answer(&mut state, Request::Diagnoses, 200, &list);
    assert!(wants_report(&state));
    answer(
        &mut state,
        Request::Report(run(9)),
        200,
        &json!({"verdict": "confirmed", "a_newer_field": 1}),
    );
    assert!(matches!(&state.gap.report, ReportState::Here(report) if report.verdict == "confirmed"));
    assert!(!wants_report(&state));
}

#[test]
fn a_refusal_is_told_and_nothing_is_lost() {
    let mut state = state();
    answer(&mut state, Request::Gaps("omni-03".to_owned()), 200, &gaps(&[]));
    for number in [1, 2] {
        press(&mut state, GapCommand::ToggleChanged(run(number)));
    }
    press(&mut state, GapCommand::Start);
    let problem = json!({"type": "about:blank", "title": "Unprocessable Content", "status": 422, "code": "invalid_diagnosis",
        "detail": "changed_runs[0]: the run is `running`", "errors": [{"field": "changed_runs[0]", "message": "m", "limit": "l", "remedy": "r"}]});
    answer(&mut state, Request::StartDiagnosis, 422, &problem);
    assert_eq!(
        state.gap.refusal.as_ref().map(|refusal| refusal.problems.len()),
        Some(1)
    );
    assert_eq!((state.gap.changed.len(), state.gap.selected), (2, None));
    assert_eq!(start_obstacle(&state), None, "it may be tried again");
}

#[test]
fn accepting_asks_for_the_models_at_once_and_the_twin_runs_again() {
    let mut state = state();
    state.service.asked_at_s.insert(Request::Models, 0.0);
    answer(
        &mut state,
        Request::Diagnosis(run(9), "accept"),
        200,
        &diagnosis(9, "done"),
    );
    assert!(!state.service.asked_at_s.contains_key(&Request::Models));
    let robot = &state.compose.experiment.robots[0].name;
    let model = json!([{"id": run(5), "version": format!("{robot}/1"), "robot": robot, "floor": "lab-floor",
        "created_at": "2026-01-01T00:00:00Z", "document": {"format": "robopheus.model/1"}}]);
    state.compose.twin.status = crate::state::TwinStatus::Done;
    answer(&mut state, Request::Models, 200, &model);
    assert!(matches!(
        state.compose.twin.status,
        crate::state::TwinStatus::Waiting { .. }
    ));
    let scenario = crate::scenario::scenario_json(&state.compose.experiment, &state.lab).expect("a scenario");
    assert!(scenario.contains("robopheus.model/1"));
    state.compose.experiment.model = Some("nominal".to_owned());
    let scenario = crate::scenario::scenario_json(&state.compose.experiment, &state.lab).expect("a scenario");
    assert!(!scenario.contains("robopheus.model/1"), "as the service does");
}

#[test]
fn another_robot_empties_the_ticks_and_an_address_leads_back() {
    let mut state = state();
    press(&mut state, GapCommand::ToggleChanged(run(1)));
    press(&mut state, GapCommand::ChooseRobot("diff-01".to_owned()));
    assert!(state.gap.changed.is_empty() && state.gap.gaps.is_none());
    let effects = press(&mut state, GapCommand::Open(Some(run(9))));
    assert_eq!(effects, [Effect::SetAddress(format!("#/gap/{}", run(9)))]);
    press(&mut state, GapCommand::Open(None));
    command(&mut state, Command::FollowAddress(format!("#/gap/{}", run(9))));
    assert_eq!((state.page, state.gap.selected), (Page::Gap, Some(run(9))));
}

#[test]
fn a_drift_is_told_in_words() {
    let mut state = state();
    let mut told = gaps(&[]);
    answer(&mut state, Request::Gaps("omni-03".to_owned()), 200, &told);
    assert_eq!(crate::pages::gap::data::drift_sentence(&state), None);
    told["drift"] = json!({"since": "2026-03-03T09:05:00Z", "newest_m": 0.0262, "before_m": 0.0095, "factor": 2.789});
    answer(&mut state, Request::Gaps("omni-03".to_owned()), 200, &told);
    assert_eq!(
        crate::pages::gap::data::drift_sentence(&state).as_deref(),
        Some(
            "omni-03 drifts: its gap is 2.8 times what it was since Tuesday, 3 March 09:05, 26 mm instead of 9.5 mm 2 s ahead."
        )
    );
}
