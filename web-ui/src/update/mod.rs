//! The only code that changes [`State`]. Pure: no browser, no clock, no drawing.

mod comparison;
mod compose;
mod gap;
mod live;
mod models;
mod playback;
mod polling;
pub mod program;
mod refusal;
mod run;
mod stop;
mod team;
pub use comparison::{leads_along_a_path, peers};
pub use compose::{DURATION_S, document_json, field_problems, submit_obstacle};
pub use gap::start_obstacle;
pub use models::{compare_obstacle, compared, run_of as compared_run, shown, use_obstacle};
pub use playback::duration_s;
pub use run::{REPLAY_FILE, TRACK_FILE};

use crate::command::{Answer, Command, Effect, Event, Request};
use crate::state::{Clock, Page, State, Toast};
use uuid::Uuid;

/// How long a message stays.
const NOTE_S: f64 = 6.0;
const ERROR_S: f64 = 20.0;
/// Messages on the screen at once; the oldest leaves.
const TOASTS_MAX: usize = 5;
/// Length of a label; the server keeps labels in lists.
pub const LABEL_MAX: usize = 120;

/// Carries out what a person did.
pub fn command(state: &mut State, command: Command) -> Vec<Effect> {
    match command {
        Command::ShowPage(page) => show_page(state, page),
        Command::ToggleTheme => {
            state.dark = !state.dark;
            vec![Effect::StoreTheme { dark: state.dark }]
        }
        Command::DismissToast(id) => {
            state.toasts.retain(|t| t.id != id);
            Vec::new()
        }
        Command::FollowAddress(address) => follow_address(state, &address),
        Command::PlayPause | Command::Seek { .. } | Command::SetSpeed(_) => {
            playback::command(state, &command);
            Vec::new()
        }
        Command::AskCancel(id) => {
            state.queue.cancel_asked = Some(id);
            Vec::new()
        }
        Command::KeepRun => {
            state.queue.cancel_asked = None;
            Vec::new()
        }
        Command::ConfirmCancel(id) => {
            state.queue.cancel_asked = None;
            send(state, Request::Cancel(id))
        }
        Command::OpenRun(id) => {
            run::open(state, id);
            show_page(state, Page::Run)
        }
        Command::ShowRunSide(side) => {
            comparison::show_side(state, side);
            Vec::new()
        }
        Command::Download { url, file_name } => vec![Effect::Download { url, file_name }],
        Command::Gap(command) => gap::command(state, command),
        Command::Models(command) => models::command(state, command),
        Command::StopRobots => stop::press(state),
        Command::OpenStopPage(page) => vec![Effect::OpenBeside(page)],
        Command::Program(command) => program::command(state, command),
        Command::ChooseLaw(law) => {
            program::choose_law(state, law);
            Vec::new()
        }
        Command::TakeRobot { name, joins } => {
            team::take(state, &name, joins);
            Vec::new()
        }
        other => compose::command(state, other),
    }
}

/// Takes in what arrived.
pub fn event(state: &mut State, event: Event) -> Vec<Effect> {
    match event {
        Event::Answer { request, answer } => take_answer(state, request, answer),
        Event::LiveOpened { .. } | Event::LiveFrame { .. } | Event::LiveClosed { .. } => {
            live::event(state, event);
            Vec::new()
        }
        Event::ModulePicked { name, bytes } => {
            program::module_picked(state, name, bytes);
            Vec::new()
        }
        other => {
            compose::twin_event(state, other);
            Vec::new()
        }
    }
}

/// Lets time pass: playback, the pause before the twin starts, repeated calls, the live connection.
pub fn tick(state: &mut State, clock: Clock) -> Vec<Effect> {
    let elapsed_s = (clock.time_s - state.clock.time_s).clamp(0.0, 0.25);
    state.clock = clock;
    state.toasts.retain(|t| t.until_s > clock.time_s);
    playback::advance(state, elapsed_s);
    let mut effects = compose::start_twin_when_due(state);
    effects.extend(live::follow_active_run(state));
    run::choose_default(state);
    gap::choose_default(state);
    models::choose_default(state);
    comparison::advance(state);
    effects.extend(polling::due(state));
    effects
}

fn show_page(state: &mut State, page: Page) -> Vec<Effect> {
    state.page = page;
    run::choose_default(state);
    gap::choose_default(state);
    models::choose_default(state);
    vec![Effect::SetAddress(address(state))]
}

/// The part of the address after `#` that leads back to what is shown.
fn address(state: &State) -> String {
    match (state.page, state.run.selected) {
        (Page::Run, Some(id)) => format!("#/run/{id}"),
        (Page::Gap, _) => state
            .gap
            .selected
            .map_or_else(|| "#/gap".to_owned(), |id| format!("#/gap/{id}")),
        (page, _) => format!("#/{}", page.name()),
    }
}

fn follow_address(state: &mut State, text: &str) -> Vec<Effect> {
    let mut parts = text.trim_start_matches(['#', '/']).split('/');
    let name = parts.next().unwrap_or_default();
    let Some(page) = Page::ALL.into_iter().find(|p| p.name() == name) else {
        return Vec::new();
    };
    match (page, parts.next().map(str::parse::<Uuid>)) {
        (Page::Run, Some(Ok(id))) => run::open(state, id),
        (Page::Gap, Some(Ok(id))) => gap::open(state, Some(id)),
        _ => {}
    }
    state.page = page;
    Vec::new()
}

fn take_answer(state: &mut State, request: Request, answer: Answer) -> Vec<Effect> {
    state.service.pending_since_s.remove(&request);
    if let Request::Stop(page) = &request {
        // A laboratory's answer says nothing about the service.
        stop::answered(state, page, answer);
        return Vec::new();
    }
    let reachable = answer.as_ref().is_ok_and(|a| !matches!(a.status, 502..=504));
    if state.service.reachable == Some(true) && !reachable {
        error(
            state,
            "The server does not answer. What you compose here stays; it is tried again every second.".to_owned(),
        );
    }
    state.service.reachable = Some(reachable);
    match request {
        Request::Submit => compose::submitted(state, answer),
        Request::Cancel(id) => run::cancel_answered(state, id, answer),
        Request::StartDiagnosis => gap::started(state, answer),
        Request::Diagnosis(id, verb) => gap::verb_answered(state, id, verb, answer),
        Request::ChooseModel(robot) => gap::model_chosen(state, &robot, answer),
        Request::KeepReferences(_) => gap::references_kept(state, answer),
        Request::Compare => models::compared_answered(state, answer),
        other => {
            polling::answered(state, other, answer);
            Vec::new()
        }
    }
}

/// A call without body.
fn send(state: &mut State, request: Request) -> Vec<Effect> {
    state
        .service
        .pending_since_s
        .insert(request.clone(), state.clock.time_s);
    state.service.asked_at_s.insert(request.clone(), state.clock.time_s);
    vec![Effect::Send {
        request,
        body: None,
        idempotency_key: None,
    }]
}

fn note(state: &mut State, text: String) {
    push_toast(state, text, false);
}

fn error(state: &mut State, text: String) {
    state.last_error = Some(text.clone());
    push_toast(state, text, true);
}

fn push_toast(state: &mut State, text: String, error: bool) {
    let until_s = state.clock.time_s + if error { ERROR_S } else { NOTE_S };
    state.toasts.retain(|t| t.text != text);
    if state.toasts.len() >= TOASTS_MAX {
        state.toasts.pop_front();
    }
    state.toasts.push_back(Toast {
        id: state.next_toast,
        error,
        text,
        until_s,
    });
    state.next_toast += 1;
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_comparison;
#[cfg(test)]
mod tests_gap;
#[cfg(test)]
mod tests_models;
#[cfg(test)]
mod tests_program;
#[cfg(test)]
mod tests_stop;
