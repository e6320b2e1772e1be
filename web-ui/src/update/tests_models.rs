//! The Models page's state: what is shown, what is put into use, what is compared.

use super::*;
use crate::command::{HttpAnswer, ModelsCommand};
use crate::pages::models::data;
use crate::state::{Clock, ComparisonState, Shown};
use api::comparison::ComparisonRequest;
use api::model::ModelChoice;
use serde_json::{Value, json};

const ROBOT: &str = "omni-03";

fn state() -> State {
    let mut state = State::new(
        Uuid::from_u128(7),
        Clock {
            time_s: 0.0,
            utc: "2026-01-01T00:05:00Z".parse().expect("a date"),
        },
        false,
    );
    state.page = Page::Models;
    press(&mut state, ModelsCommand::ChooseRobot(ROBOT.to_owned()));
    state
}

fn answer(state: &mut State, request: Request, status: u16, body: &Value) -> Vec<Effect> {
    let answer = Ok(HttpAnswer {
        status,
        body: body.to_string(),
    });
    event(state, Event::Answer { request, answer })
}

fn press(state: &mut State, pressed: ModelsCommand) -> Vec<Effect> {
    command(state, Command::Models(pressed))
}

fn id(number: u128) -> Uuid {
    Uuid::from_u128(number)
}

/// Three versions, newest first: the second is a child of the first, the third a child of the first on another floor.
fn versions() -> Value {
    let radius = json!([{"name": "wheel_radius", "index": null, "parameters": [{"name": "relative", "value": 0.04, "unit": "1"}]}]);
    let version = |number: u128, parent: Value, floor: &str, more: Value| {
        let mut one = json!({"id": id(number), "version": format!("{ROBOT}/{number}"), "robot": ROBOT, "floor": floor, "parent": parent,
            "created_at": "2026-01-01T00:00:00Z", "effects": radius, "document": {"format": "robopheus.model/1", "id": "4f2a".repeat(16)}});
        for (key, value) in more.as_object().expect("an object") {
            one[key] = value.clone();
        }
        one
    };
    let first = json!(format!("{ROBOT}/1"));
    json!([
        version(
            3,
            first.clone(),
            "moon",
            json!({"document": {"provenance": {"learned_online": {}}}})
        ),
        version(
            2,
            first,
            "lab-floor",
            json!({"residual": {"inputs": [], "outputs": [], "weights": 27},
            "gap": {"horizon_s": 0.5, "before_m": 0.041, "after_m": 0.006}})
        ),
        version(1, Value::Null, "lab-floor", json!({"diagnosis": id(70)})),
    ])
}

fn current(number: Option<u128>) -> Value {
    let version = number.map(|number| format!("{ROBOT}/{number}"));
    let line = json!({"model": number.map(id), "version": version, "since": "2026-01-01T00:02:00Z", "chosen_by": "ada", "diagnosis": null});
    let history = if number.is_some() { vec![line] } else { Vec::new() };
    json!({"robot": ROBOT, "floor": "lab-floor", "model": number.map(id), "version": version, "history": history})
}

fn gaps() -> Value {
    let run = |number: u128, problem: Value| {
        json!({"run": id(number), "label": format!("run {number}"), "submitted_by": "ada", "ended_at": "2026-01-01T00:00:00Z",
            "is_reference": false, "horizons": [], "problem": problem})
    };
    json!({"robot": ROBOT, "floor": "lab-floor", "model": null, "version": null, "horizon_s": 2.0, "floor_position_m": null,
        "limit_position_m": null, "runs": [run(93, json!("no poses")), run(92, Value::Null), run(91, Value::Null)]})
}

fn filled(in_use: Option<u128>) -> State {
    let mut state = state();
    answer(&mut state, Request::Versions(ROBOT.to_owned()), 200, &versions());
    answer(&mut state, Request::RobotModel(ROBOT.to_owned()), 200, &current(in_use));
    answer(&mut state, Request::Gaps(ROBOT.to_owned()), 200, &gaps());
    state
}

fn sent(effects: &[Effect]) -> (&Request, &str) {
    match effects {
        [Effect::Send { request, body, .. }] => (request, body.as_deref().unwrap_or_default()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_lineage_stands_newest_first_with_parents_and_what_each_contains() {
    let state = filled(Some(2));
    let rows = data::rows(&state).expect("rows");
    let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(names, ["omni-03/3", "omni-03/2", "omni-03/1", "Nominal twin"]);
    let parents: Vec<_> = rows.iter().map(|row| row.parent).collect();
    assert_eq!(parents, [Some(2), Some(2), Some(3), None]);
    let in_use: Vec<bool> = rows.iter().map(|row| row.in_use).collect();
    assert_eq!(in_use, [false, true, false, false]);
    assert_eq!(rows[0].made, "5 min ago, learned during a run, for moon");
    assert_eq!(rows[2].made, "5 min ago, by a diagnosis");
    assert_eq!(
        data::headline(&state),
        (
            "omni-03/2".to_owned(),
            "omni-03 has wheels 4.0 % larger than described and is corrected by a small neural network (27 learned numbers) \
             where no named effect explains it."
                .to_owned()
        )
    );
    assert_eq!(
        data::in_use_sentence(&state).as_deref(),
        Some("omni-03 on lab-floor uses omni-03/2: chosen by ada 3 min ago.")
    );
    let shown = data::shown_version(&state.models).expect("a version").clone();
    let facts = data::facts(&state, &shown);
    let gap = facts.iter().find(|(name, _)| name == "Gap when made").expect("a fact");
    assert!(
        gap.1
            .starts_with("41 mm \u{2192} 6.0 mm from the measured position 0.5 s ahead"),
        "{gap:?}"
    );
}

#[test]
fn what_is_in_use_or_made_on_another_floor_is_not_put_into_use_and_the_rest_is() {
    let mut state = filled(Some(2));
    assert_eq!(update_obstacle(&state).as_deref(), Some("It is in use."));
    assert!(press(&mut state, ModelsCommand::Use).is_empty());
    press(&mut state, ModelsCommand::Show(Shown::Version(id(3))));
    assert!(update_obstacle(&state).is_some_and(|why| why.contains("moon")));
    assert!(press(&mut state, ModelsCommand::Use).is_empty());
    for (wanted, named) in [(Shown::Version(id(1)), "omni-03/1"), (Shown::Nominal, "nominal")] {
        press(&mut state, ModelsCommand::Show(wanted));
        let effects = press(&mut state, ModelsCommand::Use);
        let (request, body) = sent(&effects);
        assert_eq!(request, &Request::ChooseModel(ROBOT.to_owned()));
        assert_eq!(
            serde_json::from_str::<ModelChoice>(body).expect("a choice").model,
            named
        );
    }
    state
        .service
        .asked_at_s
        .insert(Request::Versions(ROBOT.to_owned()), 0.0);
    answer(&mut state, Request::ChooseModel(ROBOT.to_owned()), 200, &current(None));
    assert!(data::rows(&state).expect("rows")[3].in_use);
    assert!(
        !state
            .service
            .asked_at_s
            .contains_key(&Request::Versions(ROBOT.to_owned())),
        "asked for at once"
    );
    assert!(state.gap.model.is_none(), "the Gap page shows another robot, or none");
}

fn update_obstacle(state: &State) -> Option<String> {
    use_obstacle(&state.models)
}

#[test]
fn a_version_is_compared_with_its_parent_on_the_newest_usable_run_until_something_else_is_chosen() {
    let mut state = filled(Some(2));
    let request = |effects: &[Effect]| -> ComparisonRequest {
        let (request, body) = sent(effects);
        assert_eq!(request, &Request::Compare);
        serde_json::from_str(body).expect("a request")
    };
    let effects = press(&mut state, ModelsCommand::Compare);
    let asked = request(&effects);
    assert_eq!(
        (asked.first.as_str(), asked.second.as_str(), asked.run),
        ("omni-03/1", "omni-03/2", id(92))
    );
    assert!(press(&mut state, ModelsCommand::Compare).is_empty(), "one at a time");
    let view = json!({"robot": ROBOT, "run": id(92), "label": "run 92", "floor": "lab-floor",
        "first": {"version": "omni-03/1", "id": id(1), "robot": ROBOT, "floor": "lab-floor"},
        "second": {"version": "omni-03/2", "id": id(2), "robot": ROBOT, "floor": "lab-floor"},
        "nearer": "second", "sentence": "omni-03/2 is nearer.", "ratio": {"value": 0.5, "low": 0.4, "high": 0.6},
        "rows": [{"channel": "pose", "horizon_s": 0.5, "unit": "m", "first": 0.01, "second": 0.0095, "samples": 40},
            {"channel": "pose", "horizon_s": 2.0, "unit": "m", "first": 0.04, "second": 0.02, "samples": 40},
            {"channel": "gyro", "horizon_s": 1.0, "unit": "rad/s", "first": 0.02, "second": 0.05, "samples": 20}],
        "course": [{"time_s": 2.5, "first_m": 0.04, "second_m": 0.02}]});
    answer(&mut state, Request::Compare, 200, &view);
    let ComparisonState::Here(found) = &state.models.comparison else {
        panic!("{:?}", state.models.comparison)
    };
    let rows = data::errors(found);
    let cells: Vec<_> = rows
        .iter()
        .map(|row| (row.channel.as_str(), row.ahead.as_str(), row.smaller))
        .collect();
    assert_eq!(
        cells,
        [
            ("Position", "0.5 s", None),
            ("", "2 s", Some(1)),
            ("Yaw rate (gyro)", "1 s", Some(0))
        ]
    );
    assert_eq!(rows[1].texts, ["40 mm", "20 mm"]);

    press(&mut state, ModelsCommand::CompareWith(Shown::Nominal));
    assert_eq!(
        state.models.comparison,
        ComparisonState::Ready,
        "what was shown is of another pair"
    );
    press(&mut state, ModelsCommand::OnRun(id(91)));
    let effects = press(&mut state, ModelsCommand::Compare);
    let asked = request(&effects);
    assert_eq!((asked.first.as_str(), asked.run), ("nominal", id(91)));
    let problem = json!({"type": "about:blank", "title": "Unprocessable Content", "status": 422, "code": "invalid_comparison",
        "detail": "run: too short", "errors": [{"field": "run", "message": "m", "limit": "l", "remedy": "r"}]});
    answer(&mut state, Request::Compare, 422, &problem);
    assert!(matches!(&state.models.comparison, ComparisonState::Refused(refusal) if refusal.problems.len() == 1));
    assert_eq!(compare_obstacle(&state.models), None, "it may be tried again");
}

#[test]
fn an_answer_to_an_earlier_question_is_passed_over() {
    let mut state = filled(Some(2));
    press(&mut state, ModelsCommand::Compare);
    press(&mut state, ModelsCommand::Show(Shown::Version(id(1))));
    answer(&mut state, Request::Compare, 500, &json!({}));
    assert_eq!(state.models.comparison, ComparisonState::Ready);
    answer(&mut state, Request::Versions("diff-01".to_owned()), 200, &json!([]));
    assert_eq!(state.models.versions.as_ref().map(Vec::len), Some(3));
}

#[test]
fn a_robot_without_versions_and_runs_says_so_and_nothing_can_be_pressed() {
    let mut state = state();
    assert_eq!(data::rows(&state), None);
    answer(&mut state, Request::Versions(ROBOT.to_owned()), 200, &json!([]));
    answer(&mut state, Request::RobotModel(ROBOT.to_owned()), 200, &current(None));
    assert_eq!(data::rows(&state).map(|rows| rows.len()), Some(1), "the nominal twin");
    assert_eq!(
        data::in_use_sentence(&state).as_deref(),
        Some("omni-03 on lab-floor uses the nominal twin: nobody has chosen a version yet.")
    );
    assert!(compare_obstacle(&state.models).is_some_and(|why| why.contains("no version")));
    assert!(press(&mut state, ModelsCommand::Compare).is_empty());
    assert!(press(&mut state, ModelsCommand::Use).is_empty());
}

#[test]
fn compose_says_which_version_every_twin_drives_with() {
    let line = |state: &State| crate::pages::compose::data::models(state);
    let mut state = state();
    assert_eq!(line(&state), None, "not before the server has told");
    answer(&mut state, Request::Models, 200, &json!([]));
    let robot = state.compose.experiment.robots[0].name.clone();
    let floor = state.compose.experiment.floor.clone();
    assert_eq!(
        line(&state),
        Some(format!("Twin of {robot}: nominal, no version is in use on {floor}."))
    );
    let model = json!([{"id": id(5), "version": format!("{robot}/1"), "robot": robot, "floor": floor,
        "created_at": "2026-01-01T00:00:00Z", "document": {}}]);
    answer(&mut state, Request::Models, 200, &model);
    assert_eq!(
        line(&state),
        Some(format!("Twin of {robot}: version {robot}/1, made on {floor}."))
    );
    state.compose.experiment.model = Some("nominal".to_owned());
    assert!(line(&state).is_some_and(|text| text.contains("the document names: nominal")));
}
