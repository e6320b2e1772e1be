//! Model versions, which one a robot's twin uses, and the runs that count as references.

use super::contents;
use super::drift;
use super::error::AppError;
use super::runs::owner_filter;
use crate::access::Principal;
use api::diagnosis::{NOMINAL, RUNS_MOST};
use api::experiment::Mode;
use api::lab::LearnedModel;
use api::model::{ModelView, RobotGaps, RobotModel};
use api::problem::FieldProblem;
use api::run::{RunState, RunView};
use store::Store;
use twin::model_document::ModelDocument;
use uuid::Uuid;

/// Newest first; of one robot and floor when given, and only those in use when asked for.
pub async fn list(
    store: &Store,
    robot: Option<&str>,
    floor: Option<&str>,
    current: bool,
) -> Result<Vec<ModelView>, AppError> {
    let mut models = if current {
        store.models_current().await?
    } else {
        store.model_list(robot).await?
    };
    models.retain(|model| {
        robot.is_none_or(|robot| model.robot == robot) && floor.is_none_or(|floor| model.floor == floor)
    });
    Ok(models.into_iter().map(contents::described).collect())
}

pub async fn get(store: &Store, id: Uuid) -> Result<ModelView, AppError> {
    let found = store.model_get(id).await?;
    let found = found.ok_or_else(|| AppError::not_found("model", id))?;
    Ok(contents::described(found))
}

/// The document of a version as a file: its name and its text.
pub async fn document(store: &Store, id: Uuid) -> Result<(String, String), AppError> {
    let model = get(store, id).await?;
    let text = serde_json::to_string_pretty(&model.document).map_err(|error| AppError::Internal(error.to_string()))?;
    Ok((format!("{}.json", model.version.replace('/', "-")), text))
}

/// The residual of a version as an ONNX file: its name and its bytes.
pub async fn onnx(store: &Store, id: Uuid) -> Result<(String, Vec<u8>), AppError> {
    let model = get(store, id).await?;
    let corrupt = || AppError::Corrupt {
        what: format!("the model {}", model.version),
    };
    let document = ModelDocument::parse(&model.document.to_string()).map_err(|_| corrupt())?;
    if document.residual.is_none() {
        return Err(AppError::not_found("learned residual of the model", &model.version));
    }
    let bytes = learn::onnx::export(&document).map_err(|_| corrupt())?;
    Ok((format!("{}.onnx", model.version.replace('/', "-")), bytes))
}

/// Which model the robot's twin uses, and since when.
pub async fn of_robot(store: &Store, robot: &str) -> Result<RobotModel, AppError> {
    let (_, floor) = place(store, robot).await?;
    Ok(store.robot_model(robot, &floor).await?)
}

/// Makes a version, or the nominal twin, the robot's current model.
pub async fn choose(store: &Store, principal: &Principal, robot: &str, wanted: &str) -> Result<RobotModel, AppError> {
    let (_, floor) = place(store, robot).await?;
    let model = named(store, "model", robot, &floor, wanted).await?;
    let (id, diagnosis) = model.map_or((None, None), |model| (Some(model.id), model.diagnosis));
    let now = store
        .robot_model_set(robot, &floor, id, diagnosis, &principal.name)
        .await?;
    tracing::info!(
        robot,
        model = now.version.as_deref().unwrap_or(NOMINAL),
        user = principal.name,
        "model chosen"
    );
    Ok(now)
}

/// A model by version or id, which must be of this robot and floor; none is the nominal twin.
pub async fn named(
    store: &Store,
    field: &str,
    robot: &str,
    floor: &str,
    wanted: &str,
) -> Result<Option<ModelView>, AppError> {
    if wanted == NOMINAL {
        return Ok(None);
    }
    let found = store.model_find(wanted).await?;
    let fits = |model: &ModelView| model.robot == robot && model.floor == floor;
    if let Some(model) = found.clone().filter(fits) {
        return Ok(Some(model));
    }
    let known: Vec<String> = store
        .model_list(Some(robot))
        .await?
        .into_iter()
        .filter(fits)
        .map(|model| model.version)
        .collect();
    let limit = std::iter::once(NOMINAL.to_owned())
        .chain(known)
        .collect::<Vec<_>>()
        .join(", ");
    let message = match found {
        Some(other) => format!(
            "the model {} is of {} on {}, not of {robot} on {floor}",
            other.version, other.robot, other.floor
        ),
        None => format!("there is no model {wanted:?}"),
    };
    Err(invalid("invalid_model", field, message, limit, "name one of these"))
}

/// Stores a version that a learning server made from a run.
pub async fn learned(store: &Store, run: Uuid, learned: &LearnedModel) -> Result<ModelView, AppError> {
    let run = store
        .run_get(run)
        .await?
        .ok_or_else(|| AppError::not_found("run", run))?;
    let refused = |field: &str, message: String, limit: &str| {
        invalid(
            "invalid_model",
            field,
            message,
            limit,
            "hand in what was learned in this run",
        )
    };
    let robot = learned.robot.as_str();
    let experiment = &run.experiment;
    if experiment.mode == Mode::Virtual || !experiment.robots.iter().any(|other| other.name == robot) {
        let message = format!("nothing of {robot} was measured in the run {}", run.id);
        return Err(refused("robot", message, "a robot that drove in the run"));
    }
    let document = ModelDocument::parse(&learned.document.to_string())
        .map_err(|error| refused("document", error.to_string(), "`robopheus.model/1`"))?;
    if document.robot.name != robot || document.floor != experiment.floor {
        let message = format!("the document is of {} on {}", document.robot.name, document.floor);
        let limit = format!("{robot} on {}", experiment.floor);
        return Err(refused("document", message, &limit));
    }
    let parent = match &document.parent {
        None => None,
        Some(parent) => {
            let found = store.model_find(parent).await?;
            let fits = found.filter(|model| model.robot == robot && model.floor == document.floor);
            let message = format!("there is no version {parent} of {robot} on {}", document.floor);
            Some(fits.ok_or_else(|| refused("document.parent", message, "a version of this robot and floor"))?)
        }
    };
    let stored = serde_json::to_value(&document).map_err(|error| refused("document", error.to_string(), "JSON"))?;
    let id = store
        .model_put(robot, &document.floor, parent.map(|model| model.id), &stored)
        .await?;
    let view = get(store, id).await?;
    tracing::info!(run.id = %run.id, robot, model = view.version, "version learned in a run");
    Ok(view)
}

/// Arena and floor of a registered robot.
pub async fn place(store: &Store, robot: &str) -> Result<(String, String), AppError> {
    let place = store.robot_place(robot).await?;
    place.ok_or_else(|| AppError::not_found("robot", robot))
}

/// Finished runs of the robot against its current model.
pub async fn gaps(store: &Store, principal: &Principal, robot: &str) -> Result<RobotGaps, AppError> {
    let (_, floor) = place(store, robot).await?;
    let mut gaps = store.robot_gaps(robot, &floor, owner_filter(principal)).await?;
    gaps.drift = drift::drift(&gaps.runs, gaps.horizon_s);
    Ok(gaps)
}

/// Replaces the set of runs in which nothing was changed.
pub async fn set_references(
    store: &Store,
    principal: &Principal,
    robot: &str,
    runs: &[Uuid],
) -> Result<RobotGaps, AppError> {
    let (_, floor) = place(store, robot).await?;
    if runs.len() > RUNS_MOST {
        let message = format!("{} runs are named", runs.len());
        return Err(invalid(
            "invalid_references",
            "runs",
            message,
            format!("at most {RUNS_MOST} runs"),
            "keep the newest ones",
        ));
    }
    let mut errors = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        let field = format!("runs[{place}]");
        errors.extend(run_problem(store, principal, robot, &floor, *run, field).await?);
    }
    if let Some(first) = errors.first() {
        return Err(AppError::Invalid {
            code: "invalid_references",
            detail: format!("{}: {}", first.field, first.message),
            errors,
        });
    }
    store.robot_references_set(robot, &floor, runs, &principal.name).await?;
    tracing::info!(robot, count = runs.len(), user = principal.name, "references set");
    gaps(store, principal, robot).await
}

/// A run that a diagnosis of this robot may use, or what is wrong with it.
pub async fn run_problem(
    store: &Store,
    principal: &Principal,
    robot: &str,
    floor: &str,
    id: Uuid,
    field: String,
) -> Result<Option<FieldProblem>, AppError> {
    let run = match measured_run(store, principal, robot, id, field.clone()).await? {
        Ok(run) => run,
        Err(problem) => return Ok(Some(problem)),
    };
    Ok((run.experiment.floor != floor).then(|| FieldProblem {
        field,
        message: format!("the run {id} was on the floor {:?}", run.experiment.floor),
        limit: format!("runs on the floor {floor:?}"),
        remedy: "leave this run out".to_owned(),
    }))
}

/// A run on any floor in which this robot was measured, or what is wrong with it.
pub async fn measured_run(
    store: &Store,
    principal: &Principal,
    robot: &str,
    id: Uuid,
    field: String,
) -> Result<Result<RunView, FieldProblem>, AppError> {
    let run = store
        .run_get(id)
        .await?
        .filter(|run| principal.may_see_what_belongs_to(&run.submitted_by));
    let problem = |message: String, limit: &str, remedy: &str| FieldProblem {
        field,
        message,
        limit: limit.to_owned(),
        remedy: remedy.to_owned(),
    };
    let Some(run) = run else {
        let told = problem(
            format!("there is no run {id}"),
            "ids of runs of this robot that are done",
            "take the ids from the list of runs",
        );
        return Ok(Err(told));
    };
    if !run.experiment.robots.iter().any(|other| other.name == robot) {
        let names: Vec<_> = run.experiment.robots.iter().map(|other| other.name.as_str()).collect();
        let told = problem(
            format!("the run {id} is of {}, not of {robot}", names.join(", ")),
            &format!("runs in which {robot} took part"),
            "leave this run out, or name its robot",
        );
        return Ok(Err(told));
    }
    if run.experiment.mode == Mode::Virtual {
        let told = problem(
            format!("the run {id} is virtual: nothing was measured in it"),
            "runs of the modes `physical` and `interactive`",
            "leave this run out",
        );
        return Ok(Err(told));
    }
    if run.state != RunState::Done {
        let told = problem(
            format!("the run {id} is `{}`", run.state.as_str()),
            "runs that are `done`",
            "wait until it is done, or leave it out",
        );
        return Ok(Err(told));
    }
    Ok(Ok(run))
}

pub fn invalid(
    code: &'static str,
    field: &str,
    message: impl Into<String>,
    limit: impl Into<String>,
    remedy: &str,
) -> AppError {
    let message = message.into();
    AppError::Invalid {
        code,
        detail: format!("{field}: {message}"),
        errors: vec![FieldProblem {
            field: field.to_owned(),
            message,
            limit: limit.into(),
            remedy: remedy.to_owned(),
        }],
    }
}
