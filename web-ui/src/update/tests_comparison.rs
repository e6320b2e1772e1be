//! Runs along one path beside each other: which belong together, what their tracks say, and what is told.

use super::*;
use crate::command::HttpAnswer;
use crate::correction::Correction;
use crate::course::courses;
use crate::pages::run::comparison::data;
use crate::state::{Clock, RunSide, TRACKS_MAX, Template};
use api::experiment::{Experiment, Mode};
use serde_json::{Value, json};

/// A run: number, correction, how far beside its path it was driven, mm; the higher the number, the later.
type Driven = (u128, Correction, f64);

fn state() -> State {
    let clock = Clock {
        time_s: 0.0,
        utc: "2026-01-01T01:00:00Z".parse().expect("a date"),
    };
    let mut state = State::new(Uuid::from_u128(7), clock, false);
    // The laboratory has told its robots; the reference one's stand for them.
    state.lab.robots = Some(Vec::new());
    state.page = Page::Run;
    state
}

fn id(number: u128) -> Uuid {
    Uuid::from_u128(number)
}

fn experiment(correction: Correction) -> Experiment {
    let mut experiment = Template::PaperPath.experiment();
    correction.write(&mut experiment);
    experiment
}

fn run_json(number: u128, experiment: &Experiment) -> Value {
    let models = if experiment.mode == Mode::Interactive {
        json!({"omni-01": "omni-01/2"})
    } else {
        json!({})
    };
    json!({
        "id": id(number), "experiment_id": id(number), "label": "path", "submitted_by": "ada", "state": "done", "epoch": 1,
        "queue_position": null, "expected_start": null, "waiting_reason": null, "queued_at": null, "started_at": null, "ended_at": null,
        "created_at": format!("2026-01-01T00:{number:02}:00Z"), "fault": null, "verdict": null, "experiment": experiment, "models": models,
        "digest": {"claimed": null, "claimed_twin_version": null, "server": null, "server_twin_version": null, "equal": null},
        "files": [{"name": "track.json", "bytes": 10, "sha256": "00", "media_type": "application/json"}],
        "ticks_recorded": null, "ticks_missed": null,
    })
}

/// The whole path, so many millimetres to its left.
fn track_json(beside_mm: f64) -> Value {
    let lab = state().lab;
    let line = courses(&Template::PaperPath.experiment(), &lab)
        .remove(0)
        .expect("a way")
        .line;
    let mut poses = Vec::new();
    for leg in line.windows(2) {
        let along = [leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]];
        let length_m = along[0].hypot(along[1]);
        let aside_m = beside_mm / 1000.0 / length_m;
        for step in 0..=100 {
            let share = f64::from(step) / 100.0;
            poses.push([
                leg[0][0] + along[0] * share - along[1] * aside_m,
                leg[0][1] + along[1] * share + along[0] * aside_m,
                0.0,
            ]);
        }
    }
    let targets = vec![[0.0, 0.0]; poses.len()];
    json!({"format": "robopheus.replay/1", "period_s": 1.0 / 30.0, "robots": [{"name": "omni-01", "poses": poses, "targets": targets}]})
}

fn answered(state: &mut State, request: Request, body: &Value) {
    let answer = Ok(HttpAnswer {
        status: 200,
        body: body.to_string(),
    });
    event(state, Event::Answer { request, answer });
}

/// Lets the page ask for what it wants until it wants nothing more.
fn settle(state: &mut State, driven: &[Driven]) -> Vec<Uuid> {
    let mut asked = Vec::new();
    for step in 0..40 {
        let clock = Clock {
            time_s: f64::from(step) * 0.5,
            ..state.clock
        };
        for effect in tick(state, clock) {
            let Effect::Send { request, .. } = effect else { continue };
            match request {
                Request::Track(run) => {
                    asked.push(run);
                    let found = driven.iter().find(|(number, ..)| id(*number) == run);
                    let (_, _, beside_mm) = found.expect("a run of the list");
                    answered(state, Request::Track(run), &track_json(*beside_mm));
                }
                Request::Run(run) => {
                    let found = driven.iter().find(|(number, ..)| id(*number) == run);
                    let (number, correction, _) = found.expect("a run of the list");
                    answered(state, Request::Run(run), &run_json(*number, &experiment(*correction)));
                }
                _ => {}
            }
        }
    }
    asked
}

/// The page of a run beside all others.
fn page(driven: &[Driven], shown: u128) -> State {
    let mut state = state();
    let runs: Vec<Value> = driven
        .iter()
        .map(|(number, correction, _)| run_json(*number, &experiment(*correction)))
        .collect();
    answered(&mut state, Request::Runs, &json!({"runs": runs}));
    command(&mut state, Command::OpenRun(id(shown)));
    settle(&mut state, driven);
    state
}

const THREE: [Driven; 3] = [
    (1, Correction::Nothing, 10.0),
    (2, Correction::Delay, 5.0),
    (3, Correction::Model, 2.0),
];

#[test]
fn a_corrected_run_is_told_against_feedback_alone() {
    let state = page(&THREE, 3);
    let headline = data::headline(&state).expect("told");
    assert_eq!(
        headline.sentence,
        "Corrected by the model omni-01/2 the robot stays 2.0 mm RMS from its path, 5.0 times nearer than with feedback alone."
    );
    assert_eq!(headline.further, None);
    let rows = data::rows(&state);
    let told: Vec<(&str, &str, &str, bool)> = rows
        .iter()
        .map(|row| {
            let cells = &row.cells;
            (
                row.what.as_str(),
                cells.rms.as_str(),
                cells.against.as_str(),
                row.is_shown,
            )
        })
        .collect();
    assert_eq!(
        told,
        [
            (
                "Corrected by the model omni-01/2",
                "2.0 mm (0.8 px)",
                "5.0 times smaller",
                true
            ),
            ("Delay compensation", "5.0 mm (2.0 px)", "2.0 times smaller", false),
            (
                "Feedback alone",
                "10 mm (4.0 px)",
                "what others are held against",
                false
            ),
        ]
    );
    assert!(
        rows.iter()
            .all(|row| row.cells.band.0 == "inside the band all the time")
    );
    assert_eq!(data::lines(&state).len(), 3);
    assert!(!data::band_is_near(&data::lines(&state)));
    assert_eq!(data::scene(&state).map(|scene| scene.trails.len()), Some(3));
}

#[test]
fn alone_a_run_is_told_by_itself_and_what_to_do_next() {
    let state = page(&THREE[..1], 1);
    let headline = data::headline(&state).expect("told");
    assert_eq!(
        headline.sentence,
        "With feedback alone the robot stays 10 mm RMS from its path: at most 10 mm, inside the band all the time."
    );
    assert!(
        headline
            .further
            .is_some_and(|text| text.contains("corrected by a model"))
    );
    let state = page(&THREE[2..], 3);
    let further = data::headline(&state).and_then(|headline| headline.further);
    assert!(further.is_some_and(|text| text.contains("feedback alone")));
}

#[test]
fn a_run_outside_the_band_and_one_that_is_worse_are_said_to_be_so() {
    let driven = [(1, Correction::Nothing, 10.0), (2, Correction::Model, 100.0)];
    let state = page(&driven, 2);
    let headline = data::headline(&state).expect("told");
    assert!(
        headline.sentence.contains("10.0 times further away than"),
        "{}",
        headline.sentence
    );
    assert_eq!(headline.tone, crate::theme::Tone::Warning);
    let rows = data::rows(&state);
    assert!(
        rows[0].cells.band.0.starts_with("outside the band 9"),
        "{:?}",
        rows[0].cells
    );
    assert_eq!(rows[0].cells.against, "0.1 times smaller");
    assert!(data::band_is_near(&data::lines(&state)));
}

#[test]
fn only_runs_of_the_same_robot_path_and_speed_stand_beside_each_other() {
    let mut state = state();
    let same = experiment(Correction::Nothing);
    let mut others = vec![same.clone(); 5];
    others[0].control.parameters["speed_m_per_s"] = json!(0.5);
    others[1].robots[0].name = "omni-02".to_owned();
    others[2].targets[0].x_m += 0.1;
    others[3].mode = Mode::Virtual;
    // Gains may differ; that is said in the table.
    others[4].control.parameters["distance_gain_per_s"] = json!(1.0);
    let mut runs = vec![run_json(9, &same)];
    runs.extend((1..).zip(&others).map(|(number, other)| run_json(number, other)));
    answered(&mut state, Request::Runs, &json!({"runs": runs}));
    command(&mut state, Command::OpenRun(id(9)));
    let found: Vec<Uuid> = peers(&state).into_iter().map(|run| run.id).collect();
    assert_eq!(found, [id(9), id(5)]);
    assert!(
        data::rows(&state)[1]
            .note
            .as_ref()
            .is_some_and(|note| note.contains("other gains"))
    );
}

#[test]
fn tracks_are_bounded_and_the_run_under_feedback_alone_is_kept_among_them() {
    let mut driven: Vec<Driven> = (2..40).map(|number| (number, Correction::Model, 2.0)).collect();
    driven.push((1, Correction::Nothing, 10.0));
    let mut state = page(&driven, 39);
    assert_eq!(state.comparison.tracks.len(), TRACKS_MAX);
    assert_eq!(data::reference(&state).map(|(run, _)| run.id), Some(id(1)));
    // A run along no path: nothing is kept, nothing more is asked for.
    command(&mut state, Command::ShowRunSide(RunSide::Comparison));
    let other = run_json(50, &Template::SwapCorners.experiment());
    answered(&mut state, Request::Runs, &json!({"runs": [other]}));
    command(&mut state, Command::OpenRun(id(50)));
    let clock = state.clock;
    tick(&mut state, clock);
    assert!(state.comparison.tracks.is_empty() && state.comparison.found.is_empty());
    assert!(data::headline(&state).is_none() && data::rows(&state).is_empty());
}

#[test]
fn a_run_that_did_not_come_to_the_end_is_held_against_nothing() {
    let mut state = page(&THREE, 3);
    let mut half = track_json(1.0);
    let poses = half["robots"][0]["poses"].as_array_mut().expect("poses");
    poses.truncate(120);
    answered(&mut state, Request::Track(id(3)), &half);
    let clock = state.clock;
    tick(&mut state, clock);
    let headline = data::headline(&state).expect("told");
    assert!(
        headline.sentence.ends_with("did not come to the end."),
        "{}",
        headline.sentence
    );
    let rows = data::rows(&state);
    assert_eq!(
        (rows[0].cells.against.as_str(), rows[0].cells.band.0.as_str()),
        ("\u{2013}", "did not come to the end")
    );
}

#[test]
fn the_paper_s_steps_change_correction_mode_and_label_and_keep_a_label_of_one_s_own() {
    let mut state = state();
    command(&mut state, Command::ChooseTemplate(Template::PaperPath));
    assert_eq!(state.compose.label, "Paper's path, A: feedback alone");
    command(&mut state, Command::PutOnPath("fwd-01".to_owned()));
    assert_eq!(state.compose.experiment.robots[0].chassis, "fwd");
    assert_eq!(Correction::of(&state.compose.experiment), Correction::Nothing);
    command(&mut state, Command::SetCorrection(Correction::Model));
    assert_eq!(state.compose.label, "Paper's path, C: corrected by the model");
    command(&mut state, Command::PutOnPath("omni-02".to_owned()));
    assert_eq!(state.compose.experiment.mode, Mode::Interactive);
    command(&mut state, Command::SetHorizon { horizon_s: 9.0 });
    let asked = state.compose.experiment.control.interaction.expect("asked for");
    assert_eq!(asked.horizon_s, 0.5);
    command(&mut state, Command::SetLabel("mine".to_owned()));
    command(&mut state, Command::SetCorrection(Correction::Nothing));
    assert_eq!(state.compose.label, "mine");
}
