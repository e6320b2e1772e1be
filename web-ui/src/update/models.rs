//! The Models page: which robot, which version, and which two on which run.

use super::gap::send_body;
use super::polling::complain;
use super::refusal::decode;
use crate::command::{Answer, Effect, ModelsCommand, Request};
use crate::state::{ComparisonState, Models, Page, Shown, State};
use api::comparison::{ComparisonRequest, ComparisonView};
use api::diagnosis::NOMINAL;
use api::model::{ModelChoice, ModelView, RobotGaps, RobotModel};
use uuid::Uuid;

const VERSIONS_EVERY_S: f64 = 3.0;

pub fn command(state: &mut State, command: ModelsCommand) -> Vec<Effect> {
    match command {
        ModelsCommand::ChooseRobot(robot) => choose_robot(state, robot),
        ModelsCommand::Show(wanted) => {
            let models = &mut state.models;
            models.selected = Some(wanted);
            models.other = models.other.filter(|other| *other != wanted);
            models.comparison = ComparisonState::Ready;
        }
        ModelsCommand::CompareWith(other) => {
            state.models.other = Some(other);
            state.models.comparison = ComparisonState::Ready;
        }
        ModelsCommand::OnRun(run) => {
            state.models.run = Some(run);
            state.models.comparison = ComparisonState::Ready;
        }
        ModelsCommand::Use => return make_current(state),
        ModelsCommand::Compare => return compare(state),
    }
    Vec::new()
}

fn choose_robot(state: &mut State, robot: String) {
    if state.models.robot.as_ref() == Some(&robot) {
        return;
    }
    let asked = [
        Request::Versions(robot.clone()),
        Request::Gaps(robot.clone()),
        Request::RobotModel(robot.clone()),
    ];
    for request in asked {
        state.service.asked_at_s.remove(&request);
    }
    state.models = Models {
        robot: Some(robot),
        ..Models::default()
    };
}

/// The page opens with the robot of the Gap page, else with one that uses a version, else with the first one.
pub fn choose_default(state: &mut State) {
    if state.page != Page::Models || state.models.robot.is_some() {
        return;
    }
    let of_gap = state.gap.robot.clone();
    let in_use = || Some(state.lab.models.as_ref()?.first()?.robot.clone());
    let first = || Some(state.lab.robots.as_ref()?.first()?.name.clone());
    // Not before the server has told which versions are in use.
    let known = state.lab.models.is_some();
    if let Some(robot) = of_gap.or_else(in_use).or_else(|| first().filter(|_| known)) {
        choose_robot(state, robot);
    }
}

/// Calls for what is shown.
pub fn wanted(state: &State) -> Vec<(Request, f64)> {
    let Some(robot) = state.models.robot.clone().filter(|_| state.page == Page::Models) else {
        return Vec::new();
    };
    vec![
        (Request::Versions(robot.clone()), VERSIONS_EVERY_S),
        (Request::RobotModel(robot.clone()), VERSIONS_EVERY_S),
        (Request::Gaps(robot), VERSIONS_EVERY_S),
    ]
}

pub fn answered(state: &mut State, request: Request, answer: Answer) {
    let own = |robot: &String| state.models.robot.as_ref() == Some(robot);
    match request {
        Request::Versions(robot) if own(&robot) => match decode::<Vec<ModelView>>(answer) {
            Ok(versions) => state.models.versions = Some(versions),
            Err(refusal) => complain(state, "model versions", &refusal.sentence),
        },
        Request::Gaps(robot) if own(&robot) => {
            if let Ok(gaps) = decode::<RobotGaps>(answer) {
                state.models.gaps = Some(gaps);
            }
        }
        Request::RobotModel(robot) if own(&robot) => {
            if let Ok(model) = decode::<RobotModel>(answer) {
                state.models.current = Some(model);
            }
        }
        _ => {}
    }
}

/// What is in use now, as the server has just told.
pub fn take_current(state: &mut State, model: &RobotModel) {
    if state.models.robot.as_ref() == Some(&model.robot) {
        state.models.current = Some(model.clone());
    }
}

/// A version of the list.
pub fn version(models: &Models, id: Uuid) -> Option<&ModelView> {
    models.versions.iter().flatten().find(|version| version.id == id)
}

/// What the page shows: what was clicked, else what is in use, else the newest version.
pub fn shown(models: &Models) -> Shown {
    let known = |shown: &Shown| match shown {
        Shown::Nominal => true,
        Shown::Version(id) => version(models, *id).is_some(),
    };
    let in_use = || models.current.as_ref()?.model.map(Shown::Version).filter(known);
    let newest = || Some(Shown::Version(models.versions.as_ref()?.first()?.id));
    let clicked = models.selected.filter(known);
    clicked.or_else(in_use).or_else(newest).unwrap_or(Shown::Nominal)
}

/// First and second of a comparison: what was chosen, else the version that the shown one was made from; and the shown one.
pub fn compared(models: &Models) -> Option<[Shown; 2]> {
    let shown = shown(models);
    let by_name = |name: &str| models.versions.iter().flatten().find(|one| one.version == name);
    let default = match shown {
        Shown::Version(id) => {
            let parent = version(models, id).and_then(|one| one.parent.as_deref());
            let parent = parent.and_then(by_name).map(|parent| Shown::Version(parent.id));
            Some(parent.unwrap_or(Shown::Nominal))
        }
        Shown::Nominal => models
            .versions
            .iter()
            .flatten()
            .next()
            .map(|newest| Shown::Version(newest.id)),
    };
    let other = models.other.filter(|other| *other != shown).or(default)?;
    Some([other, shown])
}

/// The run that the comparison is made on.
pub fn run_of(models: &Models) -> Option<Uuid> {
    let runs = || models.gaps.iter().flat_map(|gaps| &gaps.runs);
    let usable = || runs().find(|run| run.problem.is_none()).map(|run| run.run);
    models.run.or_else(usable)
}

/// Why nothing can be compared now, in words.
pub fn compare_obstacle(models: &Models) -> Option<&'static str> {
    if models.comparison == ComparisonState::Asking {
        return Some("It is being computed.");
    }
    if compared(models).is_none() {
        return Some("There is no version to compare with yet.");
    }
    run_of(models)
        .is_none()
        .then_some("This robot has not finished a run on this floor yet.")
}

/// Why what is shown cannot be put into use, in words.
pub fn use_obstacle(models: &Models) -> Option<String> {
    let Some(current) = &models.current else {
        return Some("The server has not told yet what is in use.".to_owned());
    };
    match shown(models) {
        Shown::Nominal if current.model.is_none() => Some("It is in use.".to_owned()),
        Shown::Version(id) if current.model == Some(id) => Some("It is in use.".to_owned()),
        Shown::Version(id) => {
            let made_for = &version(models, id)?.floor;
            (*made_for != current.floor).then(|| {
                format!(
                    "It was made on {made_for}; {} stands on {} now.",
                    current.robot, current.floor
                )
            })
        }
        Shown::Nominal => None,
    }
}

/// As the service names it.
fn name(models: &Models, shown: Shown) -> String {
    match shown {
        Shown::Nominal => NOMINAL.to_owned(),
        Shown::Version(id) => version(models, id).map_or_else(|| id.to_string(), |one| one.version.clone()),
    }
}

fn make_current(state: &mut State) -> Vec<Effect> {
    let Some(robot) = state.models.robot.clone() else {
        return Vec::new();
    };
    if use_obstacle(&state.models).is_some() {
        return Vec::new();
    }
    let model = name(&state.models, shown(&state.models));
    send_body(state, Request::ChooseModel(robot), &ModelChoice { model })
}

fn compare(state: &mut State) -> Vec<Effect> {
    let models = &state.models;
    let (Some(robot), Some([first, second]), Some(run), None) = (
        models.robot.clone(),
        compared(models),
        run_of(models),
        compare_obstacle(models),
    ) else {
        return Vec::new();
    };
    let request = ComparisonRequest {
        robot,
        run,
        first: name(models, first),
        second: name(models, second),
    };
    state.models.comparison = ComparisonState::Asking;
    send_body(state, Request::Compare, &request)
}

pub fn compared_answered(state: &mut State, answer: Answer) -> Vec<Effect> {
    // Something else was chosen meanwhile.
    if state.models.comparison != ComparisonState::Asking {
        return Vec::new();
    }
    state.models.comparison = match decode::<ComparisonView>(answer) {
        Ok(view) if state.models.robot.as_ref() == Some(&view.robot) => ComparisonState::Here(Box::new(view)),
        Ok(_) => ComparisonState::Ready,
        Err(refusal) => ComparisonState::Refused(refusal),
    };
    Vec::new()
}
