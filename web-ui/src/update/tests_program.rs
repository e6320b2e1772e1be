//! Own controllers: editing, examples, modules, mistakes.

use super::*;
use crate::command::ProgramCommand;
use crate::state::{Side, Template, TwinStatus};
use api::verdict::{Finding, Replay, Verdict};
use chrono::DateTime;
use controllers::gallery::{MODULE, POLICY, SCRIPTS};

fn clock(time_s: f64) -> Clock {
    Clock {
        time_s,
        utc: DateTime::from_timestamp_millis((1.7e12 + time_s * 1000.0) as i64).expect("in range"),
    }
}

/// A page with the template of an own controller, its first rehearsal under way.
fn writing() -> State {
    let mut state = State::new(Uuid::from_u128(9 << 64), clock(0.0), false);
    command(&mut state, Command::ChooseTemplate(Template::OwnController));
    tick(&mut state, clock(1.0));
    assert!(matches!(state.compose.twin.status, TwinStatus::Running { .. }));
    state
}

fn write(state: &mut State, text: &str) {
    command(state, Command::Program(ProgramCommand::SetScript(text.to_owned())));
}

fn script(state: &State) -> Option<&str> {
    program::script(&state.compose.experiment)
}

fn starts(effects: &[Effect]) -> bool {
    effects.iter().any(|effect| matches!(effect, Effect::StartTwin { .. }))
}

/// What the twin's worker would answer to the document of now.
fn rehearse(state: &mut State) {
    let time_s = state.clock.time_s + 1.0;
    let effects = tick(state, clock(time_s));
    let started = effects.iter().find_map(|effect| match effect {
        Effect::StartTwin { id, scenario } => Some((*id, scenario.clone())),
        _ => None,
    });
    let (id, scenario) = started.expect("the twin starts");
    let answer = match controllers::experiment::rehearse_json(&scenario) {
        Ok(outcome) => {
            let json = serde_json::to_string(&outcome.verdict).expect("serialises");
            let verdict: Verdict = serde_json::from_str(&json).expect("the wire's verdict");
            let json = serde_json::to_string(&outcome.replay).expect("serialises");
            let replay: Replay = serde_json::from_str(&json).expect("the wire's replay");
            Event::TwinDone {
                id,
                digest: verdict.digest.clone(),
                twin_version: verdict.twin_version.clone(),
                verdict: Box::new(verdict),
                replay: Box::new(replay),
            }
        }
        Err(problems) => {
            let json = serde_json::to_string(&problems).expect("serialises");
            let problems = serde_json::from_str(&json).expect("the wire's problems");
            Event::TwinProblems { id, problems }
        }
    };
    event(state, answer);
}

#[test]
fn the_twin_starts_soon_after_the_last_key_and_once_for_a_burst() {
    let mut state = writing();
    let begun = script(&state).expect("a script").to_owned();
    for key in 0..5 {
        let time_s = 2.0 + f64::from(key) * 0.1;
        assert!(!starts(&tick(&mut state, clock(time_s))));
        write(&mut state, &format!("{begun}// {key}"));
    }
    assert!(!starts(&tick(&mut state, clock(2.5))));
    assert!(starts(&tick(&mut state, clock(2.55))));
    let pause_s = state.compose.twin.pause_s.expect("a pause");
    assert!((0.1..0.2).contains(&pause_s), "{pause_s} s");
}

#[test]
fn mistakes_carry_the_place_where_the_rehearsal_found_them() {
    let mut state = writing();
    write(&mut state, "fn step(now) {\n    let x = ;\n}\n");
    rehearse(&mut state);
    let mistake = state.compose.program.mistake.clone().expect("a mistake");
    assert_eq!(
        (mistake.place.map(|place| place[0]), mistake.at_s),
        (Some(2), None),
        "{mistake:?}"
    );
    assert!(!mistake.text.contains("line"), "{mistake:?}");
    // What is wrong stays marked while the next rehearsal runs.
    write(
        &mut state,
        "fn step(now) {\n    for r in now.robots { stop(r.index); }\n    if now.tick == 60 { nothing(1); }\n}\n",
    );
    assert_eq!(state.compose.program.mistake, Some(mistake));
    rehearse(&mut state);
    let mistake = state.compose.program.mistake.clone().expect("a mistake");
    assert_eq!(mistake.place.map(|place| place[0]), Some(3), "{mistake:?}");
    assert!(
        mistake.at_s.is_some_and(|at_s| (at_s - 0.5).abs() < 0.02),
        "{mistake:?}"
    );
    assert!(
        mistake.text.contains("nothing") && !mistake.text.contains("tick 60"),
        "{mistake:?}"
    );
    write(
        &mut state,
        "fn step(now) {\n    for r in now.robots { stop(r.index); }\n    loop { }\n}\n",
    );
    rehearse(&mut state);
    // The engine does not tell the line of a script that ran out of operations, but the reason.
    let mistake = state.compose.program.mistake.clone().expect("a mistake");
    assert!(mistake.text.contains("operations in one tick"), "{mistake:?}");
    write(
        &mut state,
        "fn step(now) { for r in now.robots { stop(r.index); finished(r.index); print(`at ${r.x_m}`); } }",
    );
    rehearse(&mut state);
    assert_eq!(state.compose.program.mistake, None);
    let result = state.compose.twin.result.as_ref().expect("a result");
    assert!(result.replay.notes.iter().any(|tick| !tick.notes.is_empty()));
}

#[test]
fn an_example_replaces_a_text_of_ones_own_only_after_a_yes() {
    let mut state = writing();
    command(&mut state, Command::Program(ProgramCommand::TakeExample(0)));
    command(&mut state, Command::Program(ProgramCommand::AskExample(1)));
    assert_eq!(script(&state), Some(SCRIPTS[1].script));
    write(&mut state, "fn step(now) { stop(0); }");
    command(&mut state, Command::Program(ProgramCommand::AskExample(2)));
    assert_eq!(state.compose.program.example_asked, Some(2));
    assert_eq!(script(&state), Some("fn step(now) { stop(0); }"));
    command(&mut state, Command::Program(ProgramCommand::KeepText));
    assert_eq!(state.compose.program.example_asked, None);
    command(&mut state, Command::Program(ProgramCommand::AskExample(2)));
    command(&mut state, Command::Program(ProgramCommand::TakeExample(2)));
    assert_eq!(script(&state), Some(SCRIPTS[2].script));
    assert_eq!(state.compose.program.example_asked, None);
}

#[test]
fn a_module_takes_the_scripts_place_and_gives_it_back() {
    let mut state = writing();
    let text = script(&state).expect("a script").to_owned();
    let picked = |name: &str, bytes| Event::ModulePicked {
        name: name.to_owned(),
        bytes: Ok(bytes),
    };
    event(&mut state, picked("notes.txt", b"hello".to_vec()));
    let refusal = state.compose.program.refusal.clone().unwrap_or_default();
    assert!(
        refusal.contains("notes.txt") && refusal.contains("no WebAssembly"),
        "{refusal}"
    );
    let mut large = MODULE.to_vec();
    large.resize(1024 * 1024 + 1, 0);
    event(&mut state, picked("large.wasm", large));
    let refusal = state.compose.program.refusal.clone().unwrap_or_default();
    assert!(refusal.contains("too large"), "{refusal}");
    assert_eq!(script(&state), Some(&*text));

    event(&mut state, picked("drive.wasm", MODULE.to_vec()));
    let file = state.compose.program.module.clone().expect("a module");
    assert_eq!((file.bytes, file.sha256.len()), (MODULE.len(), 64));
    assert_eq!((script(&state), &state.compose.program.refusal), (None, &None));
    rehearse(&mut state);
    assert_eq!(state.compose.program.mistake, None);
    command(&mut state, Command::Program(ProgramCommand::WriteScript));
    assert_eq!(script(&state), Some(&*text));
    assert_eq!(state.compose.program.module, None);
}

#[test]
fn a_policy_takes_the_place_of_script_and_module() {
    let mut state = writing();
    let picked = |name: &str, bytes: &[u8]| Event::ModulePicked {
        name: name.to_owned(),
        bytes: Ok(bytes.to_vec()),
    };
    event(&mut state, picked("drive.wasm", MODULE));
    event(&mut state, picked("Trained.ONNX", POLICY));
    let parameters = &state.compose.experiment.control.parameters;
    assert!(
        parameters["policy"].is_string() && parameters.get("module").is_none() && parameters.get("script").is_none()
    );
    let (title, facts) = crate::pages::compose::program::data::module(&state).expect("a card");
    assert!(
        title.contains("Policy") && facts[0].1 == "Trained.ONNX",
        "{title} {facts:?}"
    );
    command(&mut state, Command::Program(ProgramCommand::WriteScript));
    assert!(script(&state).is_some() && state.compose.experiment.control.parameters.get("policy").is_none());
    event(&mut state, picked("large.onnx", &vec![0; 1024 * 1024 + 1]));
    let refusal = state.compose.program.refusal.clone().unwrap_or_default();
    assert!(refusal.contains("too large; a policy"), "{refusal}");
}

#[test]
fn another_law_and_back_keeps_the_script() {
    let mut state = writing();
    write(&mut state, "fn step(now) { stop(0); }");
    command(&mut state, Command::ChooseLaw("go_to_point"));
    assert_eq!((script(&state), state.compose.program.side), (None, Side::Settings));
    assert_eq!(state.compose.experiment.control.parameters, serde_json::json!({}));
    command(&mut state, Command::ChooseLaw("no_such_law"));
    assert_eq!(state.compose.experiment.control.law, "go_to_point");
    command(&mut state, Command::ChooseLaw("own"));
    assert_eq!(script(&state), Some("fn step(now) { stop(0); }"));
    assert_eq!(state.compose.program.side, Side::Program);
}

#[test]
fn numbers_are_handed_over_by_plain_names() {
    let mut state = writing();
    let set = |state: &mut State, name: &str, value: f64| {
        let name = name.to_owned();
        command(state, Command::Program(ProgramCommand::SetNumber { name, value }));
    };
    set(&mut state, "gain", 2.5);
    set(&mut state, "script", 1.0);
    set(&mut state, "so wide", 1.0);
    set(&mut state, "endless", f64::INFINITY);
    let parameters = &state.compose.experiment.control.parameters;
    assert_eq!(
        (parameters["gain"].as_f64(), parameters["script"].is_string()),
        (Some(2.5), true)
    );
    assert!(parameters.get("so wide").is_none() && parameters.get("endless").is_none());
    command(
        &mut state,
        Command::Program(ProgramCommand::RemoveNumber("gain".to_owned())),
    );
    assert!(state.compose.experiment.control.parameters.get("gain").is_none());
}

#[test]
fn a_fault_that_is_not_the_programs_marks_nothing() {
    let mut state = writing();
    write(
        &mut state,
        "fn step(now) { for r in now.robots { stop(r.index); finished(r.index); } }",
    );
    rehearse(&mut state);
    let result = state.compose.twin.result.as_mut().expect("a result");
    result.verdict.findings = vec![Finding {
        severity: "error".to_owned(),
        code: "robots_collide".to_owned(),
        at_s: 1.0,
        robots: Vec::new(),
        value: None,
        limit: None,
        unit: None,
        message: "line 1, column 1: they touch".to_owned(),
    }];
    program::judge(&mut state);
    assert_eq!(state.compose.program.mistake, None);
}
