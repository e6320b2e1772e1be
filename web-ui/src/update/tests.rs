use super::*;
use crate::command::HttpAnswer;
use crate::pages;
use crate::state::{Submission, Template, TwinStatus};
use api::experiment::Mode;
use api::problem::FieldProblem;
use api::verdict::{Replay, ReplayRobot, Verdict};
use chrono::DateTime;

fn clock(time_s: f64) -> Clock {
    Clock {
        time_s,
        utc: DateTime::from_timestamp_millis((1.7e12 + time_s * 1000.0) as i64).expect("in range"),
    }
}

fn state() -> State {
    State::new(Uuid::from_u128(7 << 64), clock(0.0), false)
}

fn answer(status: u16, body: &str) -> Answer {
    Ok(HttpAnswer {
        status,
        body: body.to_owned(),
    })
}

fn verdict(accepted: bool) -> Verdict {
    Verdict {
        format: "robopheus.verdict/1".to_owned(),
        accepted,
        sentence: "it works".to_owned(),
        findings: Vec::new(),
        digest: "ab".repeat(16),
        twin_version: "twin-0.1.0/1".to_owned(),
        ticks: 1200,
        smallest_separation_m: None,
        smallest_wall_distance_m: 0.4,
        largest_path_error_m: Some(0.02),
    }
}

fn replay(frames: usize) -> Replay {
    let robot = ReplayRobot {
        name: "omni-01".to_owned(),
        poses: vec![[0.0, 0.0, 0.0]; frames],
        targets: vec![[0.0, 0.0]; frames],
    };
    Replay {
        format: "robopheus.replay/1".to_owned(),
        period_s: 0.1,
        robots: vec![robot],
        notes: Vec::new(),
    }
}

fn done(id: u32, accepted: bool) -> Event {
    let verdict = verdict(accepted);
    Event::TwinDone {
        id,
        digest: verdict.digest.clone(),
        twin_version: verdict.twin_version.clone(),
        verdict: Box::new(verdict),
        replay: Box::new(replay(101)),
    }
}

/// A state in which the twin has answered.
fn rehearsed(accepted: bool) -> State {
    let mut state = state();
    tick(&mut state, clock(0.01));
    let id = state.compose.twin.id;
    event(&mut state, done(id, accepted));
    state
}

fn starts(effects: &[Effect]) -> Vec<u32> {
    effects
        .iter()
        .filter_map(|e| match e {
            Effect::StartTwin { id, .. } => Some(*id),
            _ => None,
        })
        .collect()
}

fn run_json(id: Uuid, state: &str, files: &str) -> String {
    let experiment = serde_json::to_string(&Template::RectangleOmni4.experiment()).expect("serialises");
    format!(
        r#"{{"id":"{id}","experiment_id":"{id}","label":"path","submitted_by":"ada","state":"{state}","epoch":3,"queue_position":null,
        "expected_start":null,"waiting_reason":null,"created_at":"2026-01-01T00:00:00Z","queued_at":null,"started_at":null,"ended_at":null,
        "fault":null,"digest":{{"claimed":null,"claimed_twin_version":null,"server":null,"server_twin_version":null,"equal":null}},
        "verdict":null,"experiment":{experiment},"files":[{files}],"ticks_recorded":null,"ticks_missed":null}}"#
    )
}

fn file_json(name: &str) -> String {
    format!(r#"{{"name":"{name}","bytes":10,"sha256":"00","media_type":"application/json"}}"#)
}

fn live_frame(run: Uuid, epoch: i64, tick: i64) -> String {
    format!(
        r#"{{"run_id":"{run}","epoch":{epoch},"tick":{tick},"time_s":{},"ticks_missed":0,"robots":[{{"name":"omni-01","x_m":0.5,"y_m":0.25,"yaw_rad":0.0,
        "target_x_m":0,"target_y_m":0,"pose_age_ms":8,"link_age_ms":4,"bus_v":24.1,"safety":null}}]}}"#,
        tick as f64 / 120.0
    )
}

#[test]
fn embedded_examples_and_laboratory_are_read_and_fit_together() {
    let state = state();
    for template in Template::ALL {
        let experiment = template.experiment();
        assert!(
            crate::scenario::scenario_json(&experiment, &state.lab).is_ok(),
            "{template:?}"
        );
    }
}

#[test]
fn the_twin_starts_after_a_pause_and_only_once_for_a_burst_of_changes() {
    let mut state = rehearsed(true);
    tick(&mut state, clock(0.95));
    for step in 0..5 {
        command(
            &mut state,
            Command::MoveStart {
                robot: 0,
                x_m: -1.0 + f64::from(step) * 0.01 + 0.001,
                y_m: -0.5,
            },
        );
        assert!(starts(&tick(&mut state, clock(1.0 + f64::from(step) * 0.1))).is_empty());
    }
    assert!(starts(&tick(&mut state, clock(1.49))).is_empty());
    let effects = tick(&mut state, clock(1.51));
    assert_eq!(starts(&effects), [2]);
    assert!(effects.contains(&Effect::CancelTwin { id: 1 }));
    assert!(starts(&tick(&mut state, clock(1.6))).is_empty());
}

#[test]
fn the_mode_is_part_of_the_document_and_is_rehearsed() {
    let mut state = rehearsed(true);
    command(&mut state, Command::SetMode(Mode::Virtual));
    assert_eq!(state.compose.experiment.mode, Mode::Virtual);
    assert!(matches!(state.compose.twin.status, TwinStatus::Waiting { .. }));
}

#[test]
fn an_answer_about_an_older_document_is_dropped() {
    let mut state = rehearsed(true);
    command(&mut state, Command::SetSeed(9));
    event(&mut state, done(1, true));
    assert!(matches!(state.compose.twin.status, TwinStatus::Waiting { .. }));
    assert!(submit_obstacle(&state).is_some());
    tick(&mut state, clock(1.0));
    event(&mut state, done(1, true));
    assert!(matches!(state.compose.twin.status, TwinStatus::Running { .. }));
    event(&mut state, done(2, true));
    assert_eq!(submit_obstacle(&state), None);
}

#[test]
fn only_an_accepted_experiment_is_submitted_with_its_digest() {
    let mut state = rehearsed(false);
    assert!(command(&mut state, Command::Submit).is_empty());
    assert_eq!(state.toasts.len(), 1);

    let mut state = rehearsed(true);
    let effects = command(&mut state, Command::Submit);
    let [
        Effect::Send {
            request: Request::Submit,
            body: Some(body),
            idempotency_key: Some(_),
        },
    ] = &effects[..]
    else {
        panic!("{effects:?}");
    };
    let request: api::experiment::SubmitRequest = serde_json::from_str(body).expect("the server reads it");
    let claim = request.claim.expect("claims a digest");
    assert_eq!(
        (claim.digest.as_str(), claim.engine.as_str()),
        ("abababababababababababababababab", "browser")
    );
    // A second press while it is on its way sends nothing.
    assert!(
        command(&mut state, Command::Submit)
            .iter()
            .all(|e| !matches!(e, Effect::Send { .. }))
    );
}

#[test]
fn a_repeated_attempt_keeps_its_key_and_another_document_gets_another() {
    let key = |effects: Vec<Effect>| {
        effects.into_iter().find_map(|e| match e {
            Effect::Send { idempotency_key, .. } => idempotency_key,
            _ => None,
        })
    };
    let mut state = rehearsed(true);
    let first = key(command(&mut state, Command::Submit));
    event(
        &mut state,
        Event::Answer {
            request: Request::Submit,
            answer: Err("offline".to_owned()),
        },
    );
    assert!(matches!(state.compose.submission, Submission::Refused(_)));
    let second = key(command(&mut state, Command::Submit));
    assert!(first.is_some() && first == second);
    event(
        &mut state,
        Event::Answer {
            request: Request::Submit,
            answer: Err("offline".to_owned()),
        },
    );
    command(&mut state, Command::SetLabel("other".to_owned()));
    assert_ne!(key(command(&mut state, Command::Submit)), first);
}

#[test]
fn a_refusal_is_told_in_words_with_field_limit_and_remedy() {
    let mut state = rehearsed(true);
    command(&mut state, Command::Submit);
    let body = r#"{"type":"about:blank","title":"Unprocessable","status":422,"detail":"the experiment is not valid","code":"invalid_experiment",
        "errors":[{"field":"robots[0].start.x_m","message":"outside the arena","limit":"-2 m to 2 m","remedy":"move the robot inside"}]}"#;
    event(
        &mut state,
        Event::Answer {
            request: Request::Submit,
            answer: answer(422, body),
        },
    );
    let strip = pages::compose::data::strip(&state);
    assert_eq!(strip.sentence, "The experiment is not valid.");
    assert_eq!(strip.problems[0].field, "Robot 1, start, x");
    assert_eq!(
        strip.problems[0].text,
        "Outside the arena. Allowed: -2 m to 2 m. Remedy: move the robot inside."
    );
}

#[test]
fn an_accepted_submission_leads_to_the_queue() {
    let mut state = rehearsed(true);
    command(&mut state, Command::Submit);
    let id = Uuid::from_u128(5);
    let experiment = serde_json::to_string(&state.compose.experiment).expect("serialises");
    let body = format!(
        r#"{{"id":"{id}","label":"path","submitted_by":"ada","submitted_at":"2026-01-01T00:00:00Z","experiment":{experiment},"run_id":"{id}"}}"#
    );
    let effects = event(
        &mut state,
        Event::Answer {
            request: Request::Submit,
            answer: answer(201, &body),
        },
    );
    assert_eq!(state.page, Page::Queue);
    assert_eq!(state.compose.submission, Submission::Accepted(id));
    assert_eq!(effects, [Effect::SetAddress("#/queue".to_owned())]);
}

#[test]
fn problems_of_the_twin_are_counted_and_block_submitting() {
    let mut state = state();
    tick(&mut state, clock(0.01));
    let problem = FieldProblem {
        field: "duration_s".to_owned(),
        message: "too long".to_owned(),
        limit: "600 s".to_owned(),
        remedy: String::new(),
    };
    event(
        &mut state,
        Event::TwinProblems {
            id: 1,
            problems: vec![problem],
        },
    );
    let strip = pages::compose::data::strip(&state);
    assert_eq!(
        (strip.word, strip.sentence.as_str()),
        ("Not valid", "One field needs attention.")
    );
    assert!(submit_obstacle(&state).is_some());
}

#[test]
fn dragging_stays_in_the_arena_in_whole_millimetres_and_moves_shared_targets_together() {
    let mut state = state();
    command(
        &mut state,
        Command::MoveStart {
            robot: 0,
            x_m: 9.0,
            y_m: 0.123_456,
        },
    );
    let start = state.compose.experiment.robots[0].start;
    assert_eq!((start.x_m, start.y_m), (2.0, 0.123));
    command(
        &mut state,
        Command::MoveTarget {
            target: 1,
            x_m: -1.2,
            y_m: 0.7,
        },
    );
    let places: Vec<_> = state
        .compose
        .experiment
        .targets
        .iter()
        .map(|t| (t.x_m, t.y_m))
        .collect();
    assert_eq!(
        places,
        [(-1.0, -0.5), (-1.2, 0.7), (1.0, 0.5), (-1.2, 0.7), (-1.0, -0.5)]
    );
    assert!(state.compose.edited);
}

#[test]
fn playback_runs_at_its_speed_ends_and_starts_over() {
    let mut state = rehearsed(true);
    command(&mut state, Command::SetSpeed(4.0));
    command(&mut state, Command::PlayPause);
    for step in 1..=10 {
        tick(&mut state, clock(0.01 + f64::from(step) * 0.1));
    }
    assert!(
        (state.compose.playback.time_s - 4.0).abs() < 1e-9,
        "{}",
        state.compose.playback.time_s
    );
    command(&mut state, Command::Seek { time_s: 99.0 });
    tick(&mut state, clock(1.2));
    assert!(!state.compose.playback.playing && state.compose.playback.time_s <= 10.0);
    command(&mut state, Command::PlayPause);
    assert!(state.compose.playback.playing && state.compose.playback.time_s == 0.0);
}

#[test]
fn calls_repeat_each_second_but_never_pile_up() {
    let mut state = state();
    let asked = |effects: Vec<Effect>| {
        effects
            .iter()
            .filter(|e| {
                matches!(
                    e,
                    Effect::Send {
                        request: Request::Runs,
                        ..
                    }
                )
            })
            .count()
    };
    assert_eq!(asked(tick(&mut state, clock(0.1))), 1);
    assert_eq!(asked(tick(&mut state, clock(5.0))), 0, "the first is still on its way");
    event(
        &mut state,
        Event::Answer {
            request: Request::Runs,
            answer: answer(200, r#"{"runs":[]}"#),
        },
    );
    assert_eq!(asked(tick(&mut state, clock(5.1))), 1);
    event(
        &mut state,
        Event::Answer {
            request: Request::Runs,
            answer: answer(200, r#"{"runs":[]}"#),
        },
    );
    assert_eq!(asked(tick(&mut state, clock(5.6))), 0);
    assert_eq!(asked(tick(&mut state, clock(6.2))), 1);
    assert_eq!(asked(tick(&mut state, clock(17.0))), 1, "a lost call is asked again");
}

#[test]
fn the_live_connection_follows_the_run_on_the_floor() {
    let mut state = state();
    let run = Uuid::from_u128(1);
    let list = |word: &str| answer(200, &format!(r#"{{"runs":[{}]}}"#, run_json(run, word, "")));
    event(
        &mut state,
        Event::Answer {
            request: Request::Runs,
            answer: list("running"),
        },
    );
    assert!(tick(&mut state, clock(0.1)).contains(&Effect::OpenLive { run }));
    assert!(pages::live::data::robots(&state, state.queue.active().expect("runs")).is_empty());
    event(
        &mut state,
        Event::LiveFrame {
            run,
            text: live_frame(run, 3, 12),
        },
    );
    event(
        &mut state,
        Event::LiveFrame {
            run,
            text: live_frame(run, 2, 900),
        },
    );
    event(
        &mut state,
        Event::LiveFrame {
            run,
            text: "{".to_owned(),
        },
    );
    assert_eq!(
        (state.live.frames.len(), state.live.unreadable),
        (1, 1),
        "an older attempt and broken text are left out"
    );
    let cards = pages::live::data::robots(&state, state.queue.active().expect("runs"));
    assert_eq!(cards[0].lines[0].1, "4 ms old");

    event(
        &mut state,
        Event::LiveClosed {
            run,
            reason: String::new(),
        },
    );
    assert!(
        !tick(&mut state, clock(0.5)).contains(&Effect::OpenLive { run }),
        "waits a second"
    );
    assert!(tick(&mut state, clock(1.2)).contains(&Effect::OpenLive { run }));
    assert_eq!(state.live.frames.len(), 1, "the trail survives a broken connection");
    event(
        &mut state,
        Event::Answer {
            request: Request::Runs,
            answer: list("done"),
        },
    );
    assert!(tick(&mut state, clock(1.3)).contains(&Effect::CloseLive));
    assert_eq!(
        pages::live::data::run(&state).map(|ended| ended.id),
        Some(run),
        "the last picture stays"
    );
    assert_eq!(pages::live::data::connection(&state).0, "Last picture");
}

#[test]
fn the_run_page_loads_view_then_recordings_and_then_rests() {
    let mut state = state();
    let id = Uuid::from_u128(2);
    let wanted = |effects: &[Effect]| -> Vec<Request> {
        let of_run = |r: &Request| matches!(r, Request::Run(_) | Request::Replay(_) | Request::Track(_));
        effects
            .iter()
            .filter_map(|e| match e {
                Effect::Send { request, .. } if of_run(request) => Some(request.clone()),
                _ => None,
            })
            .collect()
    };
    command(&mut state, Command::OpenRun(id));
    assert_eq!(wanted(&tick(&mut state, clock(0.1))), [Request::Run(id)]);
    let files = format!("{},{}", file_json("replay.json"), file_json("track.json"));
    event(
        &mut state,
        Event::Answer {
            request: Request::Run(id),
            answer: answer(200, &run_json(id, "done", &files)),
        },
    );
    let mut asked = wanted(&tick(&mut state, clock(0.2)));
    asked.sort();
    assert_eq!(asked, [Request::Replay(id), Request::Track(id)]);
    let recording = serde_json::to_string(&replay(31)).expect("serialises");
    for request in asked {
        event(
            &mut state,
            Event::Answer {
                request,
                answer: answer(200, &recording),
            },
        );
    }
    assert!(
        wanted(&tick(&mut state, clock(9.0))).is_empty(),
        "nothing of an ended run changes"
    );
    let view = state.run.view.clone().expect("loaded");
    let names: Vec<String> = pages::run::data::series(&state, &view)
        .into_iter()
        .map(|s| s.name)
        .collect();
    assert_eq!(names, ["Twin to path", "Measured to path", "Twin to measured"]);
    assert!(pages::run::data::archive(&view).is_some());
}

#[test]
fn without_a_track_the_live_pictures_stand_in_for_the_measurement() {
    let mut state = state();
    let run = Uuid::from_u128(3);
    event(
        &mut state,
        Event::Answer {
            request: Request::Runs,
            answer: answer(200, &format!(r#"{{"runs":[{}]}}"#, run_json(run, "running", ""))),
        },
    );
    tick(&mut state, clock(0.1));
    for frame in 0..=30 {
        event(
            &mut state,
            Event::LiveFrame {
                run,
                text: live_frame(run, 3, frame * 4 - 8),
            },
        );
    }
    command(&mut state, Command::OpenRun(run));
    let (measured, recorded) = pages::run::data::physical(&state).expect("frames were received");
    assert!(!recorded);
    // 112 ticks at 120 Hz are 0.933 s: 29 frames at 30 Hz, the preparation left out.
    assert_eq!(measured.robots[0].poses.len(), 29);
}

#[test]
fn addresses_lead_to_pages_and_runs() {
    let mut state = state();
    let id = Uuid::from_u128(4);
    command(&mut state, Command::FollowAddress(format!("#/run/{id}")));
    assert_eq!((state.page, state.run.selected), (Page::Run, Some(id)));
    command(&mut state, Command::FollowAddress("#/nowhere".to_owned()));
    assert_eq!(state.page, Page::Run);
    assert_eq!(
        command(&mut state, Command::ShowPage(Page::Queue)),
        [Effect::SetAddress("#/queue".to_owned())]
    );
}

#[test]
fn messages_are_bounded_and_leave_by_themselves() {
    let mut state = state();
    for n in 0..20 {
        note(&mut state, n.to_string());
    }
    assert_eq!(state.toasts.len(), TOASTS_MAX);
    tick(&mut state, clock(NOTE_S + 0.1));
    assert!(state.toasts.is_empty());
}

#[test]
fn robots_of_the_server_replace_the_embedded_ones_and_start_the_twin_again() {
    let mut state = rehearsed(true);
    let mut robots: Vec<serde_json::Value> = Vec::new();
    for robot in state.lab.reference.robots.clone() {
        let mut view = serde_json::to_value(&robot).expect("serialises");
        view["name"] = robot.description.name.clone().into();
        view["arena"] = "reference".into();
        view["state"] = "idle".into();
        robots.push(view);
    }
    let same = serde_json::Value::from(robots.clone()).to_string();
    event(
        &mut state,
        Event::Answer {
            request: Request::Robots,
            answer: answer(200, &same),
        },
    );
    assert_eq!(
        state.compose.twin.status,
        TwinStatus::Done,
        "the same robots change nothing: {:?}",
        state.last_error
    );
    robots[0]["description"]["mass_kg"] = 13.0.into();
    let other = serde_json::json!({ "robots": robots }).to_string();
    event(
        &mut state,
        Event::Answer {
            request: Request::Robots,
            answer: answer(200, &other),
        },
    );
    assert!(matches!(state.compose.twin.status, TwinStatus::Waiting { .. }));
}
