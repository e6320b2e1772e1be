//! Composing an experiment, trying it in the twin, submitting it.

use super::refusal::decode;
use crate::command::{Answer, Command, Effect, Event, Request};
use crate::correction::{self, Correction};
use crate::paper_path;
use crate::parameters;
use crate::scenario::scenario_json;
use crate::state::{Page, Playback, Refusal, State, Submission, Template, TwinResult, TwinStatus};
use api::experiment::{DigestClaim, ExperimentView, SubmitRequest};
use uuid::Uuid;

/// Pause after the last change before the twin starts.
const PAUSE_S: f64 = 0.2;
/// The same while a program is written: typing pauses longer between words than within them, and the twin has begun
/// within 0.2 s of the last key, the page's next frame included.
const TYPING_PAUSE_S: f64 = 0.12;
pub const DURATION_S: std::ops::RangeInclusive<f64> = 0.1..=600.0;

pub fn command(state: &mut State, command: Command) -> Vec<Effect> {
    match command {
        Command::ChooseTemplate(template) => choose_template(state, template),
        Command::SetLabel(label) => {
            state.compose.label = label.chars().take(super::LABEL_MAX).collect();
            new_document(state);
        }
        Command::PutOnPath(robot) => put_on_path(state, &robot),
        Command::CopyDocument => {
            super::note(state, "The experiment was copied to the clipboard.".to_owned());
            return vec![Effect::CopyText(document_json(state))];
        }
        Command::Submit => return submit(state),
        other => {
            let was_labelled = state.compose.label == usual_label(state);
            if change_experiment(state, other) {
                if was_labelled {
                    state.compose.label = usual_label(state);
                }
                state.compose.edited = true;
                rehearse_soon(state);
            }
        }
    }
    Vec::new()
}

/// The experiment as a person would write it to a file.
pub fn document_json(state: &State) -> String {
    serde_json::to_string_pretty(&state.compose.experiment)
        .expect("an experiment has string keys and finite numbers or null")
}

fn choose_template(state: &mut State, template: Template) {
    super::program::keep(state);
    let compose = &mut state.compose;
    compose.template = template;
    compose.edited = false;
    compose.experiment = template.experiment();
    compose.playback = Playback::default();
    compose.twin.result = None;
    super::program::forget(state);
    state.compose.label = usual_label(state);
    rehearse_soon(state);
}

/// The label that an experiment has until somebody gives it another one.
fn usual_label(state: &State) -> String {
    let compose = &state.compose;
    match (compose.template, Correction::of(&compose.experiment)) {
        (Template::PaperPath, Correction::Nothing) => "Paper's path, A: feedback alone".to_owned(),
        (Template::PaperPath, Correction::Delay) => "Paper's path, delay compensation".to_owned(),
        (Template::PaperPath, Correction::Model) => "Paper's path, C: corrected by the model".to_owned(),
        (template, _) => template.title().to_owned(),
    }
}

/// The paper's path with another robot, under the correction that was chosen; its label follows.
fn put_on_path(state: &mut State, robot: &str) {
    let Some(mut experiment) = state.lab.robot(robot).map(paper_path::on) else {
        return;
    };
    Correction::of(&state.compose.experiment).write(&mut experiment);
    state.compose.experiment = experiment;
    state.compose.edited = false;
    state.compose.twin.result = None;
    rehearse_soon(state);
}

/// True when the document is another one afterwards.
fn change_experiment(state: &mut State, command: Command) -> bool {
    let before = state.compose.experiment.clone();
    let arena = state.lab.arena_or_reference(&before.arena).clone();
    let half = [arena.width_m / 2.0, arena.height_m / 2.0];
    let experiment = &mut state.compose.experiment;
    match command {
        Command::SetDuration { duration_s } => {
            experiment.duration_s = duration_s.clamp(*DURATION_S.start(), *DURATION_S.end())
        }
        Command::SetMode(mode) => correction::set_mode(experiment, mode),
        Command::SetCorrection(chosen) => chosen.write(experiment),
        Command::SetHorizon { horizon_s } => {
            let [least_s, _, most_s] = correction::HORIZON_S;
            if let Some(asked) = &mut experiment.control.interaction {
                asked.horizon_s = (horizon_s.clamp(least_s, most_s) * 100.0).round() / 100.0;
            }
        }
        Command::SetSeed(seed) => experiment.seed = seed,
        Command::SetParameter { key, value } => parameters::set(experiment, key, value),
        Command::ResetParameters => experiment.control.parameters = serde_json::json!({}),
        Command::MoveStart { robot, x_m, y_m } => {
            if let Some(robot) = experiment.robots.get_mut(robot) {
                robot.start.x_m = millimetres(x_m, half[0]);
                robot.start.y_m = millimetres(y_m, half[1]);
            }
        }
        Command::TurnStart { robot, yaw_rad } => {
            if let Some(robot) = experiment.robots.get_mut(robot) {
                robot.start.yaw_rad = (yaw_rad * 1000.0).round() / 1000.0;
            }
        }
        Command::MoveTarget { target, x_m, y_m } => {
            // One place on the floor is one thing to a person: targets of a robot in the same place move together.
            if let Some(moved) = before.targets.get(target) {
                for target in &mut experiment.targets {
                    if target.robot == moved.robot && (target.x_m - moved.x_m).hypot(target.y_m - moved.y_m) < 1e-3 {
                        target.x_m = millimetres(x_m, half[0]);
                        target.y_m = millimetres(y_m, half[1]);
                    }
                }
            }
        }
        _ => {}
    }
    *experiment != before
}

/// Dragging gives whole millimetres inside the arena.
fn millimetres(value_m: f64, limit_m: f64) -> f64 {
    (value_m.clamp(-limit_m, limit_m) * 1000.0).round() / 1000.0
}

fn new_document(state: &mut State) {
    state.compose.document_number = state.compose.document_number.wrapping_add(1);
    if state.compose.submission != Submission::Sending {
        state.compose.submission = Submission::Ready;
    }
}

/// The document changed: any verdict is out of date now.
pub fn rehearse_soon(state: &mut State) {
    new_document(state);
    state.compose.playback.playing = false;
    let pause_s = if super::program::is_own(&state.compose.experiment) {
        TYPING_PAUSE_S
    } else {
        PAUSE_S
    };
    state.compose.twin.changed_at_s = state.clock.time_s;
    state.compose.twin.status = TwinStatus::Waiting {
        start_at_s: state.clock.time_s + pause_s,
    };
}

pub fn start_twin_when_due(state: &mut State) -> Vec<Effect> {
    let TwinStatus::Waiting { start_at_s } = state.compose.twin.status else {
        return Vec::new();
    };
    if state.clock.time_s < start_at_s {
        return Vec::new();
    }
    let former = state.compose.twin.id;
    let mut effects = if former == 0 {
        Vec::new()
    } else {
        vec![Effect::CancelTwin { id: former }]
    };
    match scenario_json(&state.compose.experiment, &state.lab) {
        Ok(scenario) => {
            state.compose.twin.id += 1;
            state.compose.twin.status = TwinStatus::Running { fraction: 0.0 };
            state.compose.twin.pause_s = Some(state.clock.time_s - state.compose.twin.changed_at_s);
            effects.push(Effect::StartTwin {
                id: state.compose.twin.id,
                scenario,
            });
        }
        Err(problems) => {
            state.compose.twin.status = TwinStatus::Problems(problems);
            super::program::judge(state);
        }
    }
    effects
}

/// Answers of the worker. Only the newest computation counts, and only while nothing changed since.
pub fn twin_event(state: &mut State, event: Event) {
    let twin = &mut state.compose.twin;
    if !matches!(twin.status, TwinStatus::Running { .. }) {
        return;
    }
    match event {
        Event::TwinProgress { id, fraction } if id == twin.id => {
            twin.status = TwinStatus::Running {
                fraction: fraction.clamp(0.0, 1.0),
            };
        }
        Event::TwinDone {
            id,
            verdict,
            replay,
            digest,
            twin_version,
        } if id == twin.id => {
            twin.status = TwinStatus::Done;
            twin.result = Some(TwinResult {
                verdict: *verdict,
                replay: *replay,
                digest,
                twin_version,
            });
            super::program::judge(state);
        }
        Event::TwinProblems { id, problems } if id == twin.id => {
            twin.status = TwinStatus::Problems(problems);
            twin.result = None;
            super::program::judge(state);
        }
        Event::TwinFailed { id, message } if id == twin.id => {
            twin.status = TwinStatus::Failed(message.clone());
            twin.result = None;
            super::error(state, format!("The twin stopped: {message}"));
        }
        _ => {}
    }
}

/// Why the experiment cannot be submitted now; `None` when it can.
pub fn submit_obstacle(state: &State) -> Option<&'static str> {
    if state.compose.submission == Submission::Sending {
        return Some("It is being sent.");
    }
    match (&state.compose.twin.status, &state.compose.twin.result) {
        (TwinStatus::Done, Some(result)) if result.verdict.accepted => None,
        (TwinStatus::Done, _) => Some("The twin rejects this experiment; mend the findings first."),
        (TwinStatus::Problems(_), _) => Some("Mend the fields named below first."),
        (TwinStatus::Failed(_), _) => Some("The twin stopped with an error; change something to try again."),
        _ => Some("Wait until the twin has driven it."),
    }
}

fn submit(state: &mut State) -> Vec<Effect> {
    if let Some(obstacle) = submit_obstacle(state) {
        super::note(state, format!("Not submitted yet. {obstacle}"));
        return Vec::new();
    }
    let Some(result) = &state.compose.twin.result else {
        return Vec::new();
    };
    let label = state.compose.label.trim();
    let request = SubmitRequest {
        experiment: state.compose.experiment.clone(),
        claim: Some(DigestClaim {
            digest: result.digest.clone(),
            twin_version: result.twin_version.clone(),
            engine: "browser".to_owned(),
        }),
        label: (!label.is_empty()).then(|| label.to_owned()),
    };
    let body = serde_json::to_string(&request).expect("a request has string keys");
    let idempotency_key = Some(idempotency_key(state.compose.session, state.compose.document_number));
    state.compose.submission = Submission::Sending;
    state
        .service
        .pending_since_s
        .insert(Request::Submit, state.clock.time_s);
    vec![Effect::Send {
        request: Request::Submit,
        body: Some(body),
        idempotency_key,
    }]
}

/// The same for every attempt at one document, another for the next document.
fn idempotency_key(session: Uuid, document_number: u32) -> Uuid {
    Uuid::from_u128(session.as_u128() ^ u128::from(document_number))
}

pub fn submitted(state: &mut State, answer: Answer) -> Vec<Effect> {
    match decode::<ExperimentView>(answer) {
        Ok(view) => {
            state.compose.submission = Submission::Accepted(view.run_id);
            // Pressing the button again means another run, not a repetition of this request.
            state.compose.document_number = state.compose.document_number.wrapping_add(1);
            state.service.asked_at_s.remove(&Request::Runs);
            super::note(
                state,
                format!("Submitted: \u{201c}{}\u{201d} is on its way.", view.label),
            );
            super::show_page(state, Page::Queue)
        }
        Err(refusal) => {
            super::error(state, format!("Not submitted. {}", refusal.sentence));
            state.compose.submission = Submission::Refused(refusal);
            Vec::new()
        }
    }
}

/// The problems that stand beside the fields: the twin's, or else the server's.
pub fn field_problems(state: &State) -> &[api::problem::FieldProblem] {
    match (&state.compose.twin.status, &state.compose.submission) {
        (TwinStatus::Problems(problems), _) => problems,
        (_, Submission::Refused(Refusal { problems, .. })) => problems,
        _ => &[],
    }
}
