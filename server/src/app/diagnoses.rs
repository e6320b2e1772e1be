//! Asking for a diagnosis, and what can be done with its result.

use super::error::AppError;
use super::experiments::{self, Accepted, Submission};
use super::manoeuvre;
use super::models::{self, invalid, run_problem};
use super::runs::owner_filter;
use crate::access::Principal;
use api::diagnosis::{CHANGED_RUNS_LEAST, DiagnosisOrigin, DiagnosisRequest, DiagnosisState, DiagnosisView, RUNS_MOST};
use api::experiment::SubmitRequest;
use api::problem::FieldProblem;
use api::run::RunState;
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use store::{DIAGNOSES_OPEN_MOST, DiagnosisCancelled, DiagnosisSubmitted, FileRecord, NewDiagnosis, Store};
use uuid::Uuid;

/// A request as it arrived.
#[derive(Debug, Clone)]
pub struct Asked {
    pub request: DiagnosisRequest,
    pub idempotency_key: Option<String>,
    /// SHA-256 of the body.
    pub request_hash: [u8; 32],
}

/// What became of a request.
#[derive(Debug, Clone, PartialEq)]
pub enum Taken {
    Created(DiagnosisView),
    /// The same key and body came before; this is what came of it.
    Before(DiagnosisView),
}

pub async fn submit(store: &Store, principal: &Principal, asked: Asked) -> Result<Taken, AppError> {
    let Asked {
        request,
        idempotency_key,
        request_hash,
    } = asked;
    if let Some(key) = &idempotency_key
        && let Some(before) = store
            .diagnosis_submitted_before(&principal.name, key, &request_hash)
            .await?
    {
        return taken(before, principal);
    }
    let (arena, floor) = match store.robot_place(&request.robot).await? {
        Some(place) => place,
        None => return Err(unknown_robot(store, &request.robot).await?),
    };
    check_roles(&request)?;
    check_runs(store, principal, &request, &floor).await?;
    let parent_model = match &request.model {
        None => store.robot_model(&request.robot, &floor).await?.model,
        Some(wanted) => models::named(store, "model", &request.robot, &floor, wanted)
            .await?
            .map(|model| model.id),
    };
    let stored = store
        .diagnosis_submit(NewDiagnosis {
            user: principal.name.clone(),
            robot: request.robot,
            arena,
            floor,
            origin: DiagnosisOrigin::Person,
            parent_model,
            reference_runs: request.reference_runs,
            changed_runs: request.changed_runs,
            locked_runs: request.locked_runs,
            idempotency_key,
            request_hash,
        })
        .await?;
    taken(stored, principal)
}

fn taken(stored: DiagnosisSubmitted, principal: &Principal) -> Result<Taken, AppError> {
    match stored {
        DiagnosisSubmitted::Created(view) => {
            tracing::info!(diagnosis.id = %view.id, robot = view.robot, user = principal.name, "diagnosis queued");
            Ok(Taken::Created(view))
        }
        DiagnosisSubmitted::Replayed(view) => Ok(Taken::Before(view)),
        DiagnosisSubmitted::Conflict => Err(AppError::Invalid {
            code: "idempotency_conflict",
            detail: "this Idempotency-Key came with another body in the last 24 h; use a new key".to_owned(),
            errors: Vec::new(),
        }),
        DiagnosisSubmitted::TooMany { open } => Err(AppError::Conflict {
            code: "too_many_diagnoses",
            detail: format!(
                "{open} diagnoses of this robot wait or run, and at most {DIAGNOSES_OPEN_MOST} may; cancel one or wait"
            ),
        }),
    }
}

async fn unknown_robot(store: &Store, robot: &str) -> Result<AppError, AppError> {
    let names: Vec<String> = store.robot_list().await?.into_iter().map(|robot| robot.name).collect();
    let limit = if names.is_empty() {
        "none is registered yet".to_owned()
    } else {
        names.join(", ")
    };
    Ok(invalid(
        "invalid_diagnosis",
        "robot",
        format!("there is no robot {robot:?}"),
        limit,
        "name a robot of this service",
    ))
}

/// Counts, and every run in one role only.
fn check_roles(request: &DiagnosisRequest) -> Result<(), AppError> {
    let changed = request.changed_runs.len();
    if changed < CHANGED_RUNS_LEAST {
        return Err(invalid(
            "invalid_diagnosis",
            "changed_runs",
            format!("{changed} runs are named; one run alone cannot tell an effect from chance"),
            format!("at least {CHANGED_RUNS_LEAST} runs, 6 or more for a proven result"),
            "drive and name more runs",
        ));
    }
    let mut errors = Vec::new();
    let mut seen: BTreeMap<Uuid, String> = BTreeMap::new();
    for (role, runs) in roles(request) {
        if runs.len() > RUNS_MOST {
            errors.push(FieldProblem {
                field: role.to_owned(),
                message: format!("{} runs are named", runs.len()),
                limit: format!("at most {RUNS_MOST} runs"),
                remedy: "leave the oldest ones out".to_owned(),
            });
        }
        for (place, run) in runs.iter().enumerate() {
            let field = format!("{role}[{place}]");
            if let Some(before) = seen.insert(*run, field.clone()) {
                errors.push(FieldProblem {
                    message: format!("the run {run} stands at {before} as well"),
                    limit: "every run once, in one role".to_owned(),
                    remedy: format!("remove it from {before} or from {field}"),
                    field,
                });
            }
        }
    }
    refuse(errors)
}

async fn check_runs(
    store: &Store,
    principal: &Principal,
    request: &DiagnosisRequest,
    floor: &str,
) -> Result<(), AppError> {
    let mut errors = Vec::new();
    for (role, runs) in roles(request) {
        for (place, run) in runs.iter().enumerate() {
            let field = format!("{role}[{place}]");
            errors.extend(run_problem(store, principal, &request.robot, floor, *run, field).await?);
        }
    }
    refuse(errors)
}

fn roles(request: &DiagnosisRequest) -> [(&'static str, &Vec<Uuid>); 3] {
    [
        ("reference_runs", &request.reference_runs),
        ("changed_runs", &request.changed_runs),
        ("locked_runs", &request.locked_runs),
    ]
}

fn refuse(errors: Vec<FieldProblem>) -> Result<(), AppError> {
    let Some(first) = errors.first() else { return Ok(()) };
    let more = if errors.len() > 1 {
        format!(" (and {} more)", errors.len() - 1)
    } else {
        String::new()
    };
    Err(AppError::Invalid {
        code: "invalid_diagnosis",
        detail: format!("{}: {}{more}", first.field, first.message),
        errors,
    })
}

/// A diagnosis, if the caller may see it.
pub async fn get(store: &Store, principal: &Principal, id: Uuid) -> Result<DiagnosisView, AppError> {
    let found = store.diagnosis_get(id).await?;
    let found = found.filter(|diagnosis| principal.may_see_what_belongs_to(&diagnosis.requested_by));
    found.ok_or_else(|| AppError::not_found("diagnosis", id))
}

/// Newest first.
pub async fn list(
    store: &Store,
    principal: &Principal,
    limit: i64,
    robot: Option<&str>,
) -> Result<Vec<DiagnosisView>, AppError> {
    Ok(store.diagnosis_list(limit, robot, owner_filter(principal)).await?)
}

/// `report.json` of a diagnosis that is done.
pub async fn report(store: &Store, principal: &Principal, id: Uuid) -> Result<String, AppError> {
    let view = get(store, principal, id).await?;
    let report = store.diagnosis_report(id).await?;
    report.ok_or_else(|| not_done(&view))
}

/// `report.html` of a diagnosis that is done.
pub async fn page(store: &Store, principal: &Principal, id: Uuid) -> Result<FileRecord, AppError> {
    let view = get(store, principal, id).await?;
    let page = store.diagnosis_page(id).await?;
    page.ok_or_else(|| not_done(&view))
}

fn not_done(view: &DiagnosisView) -> AppError {
    let detail = match &view.problem {
        Some(problem) => format!("the diagnosis ended without a result: {}", problem.message),
        None => format!("the diagnosis is `{}`; it has no result yet", view.state.as_str()),
    };
    AppError::Conflict {
        code: "diagnosis_not_done",
        detail,
    }
}

/// Ends a diagnosis at once while it waits, or asks its worker to stop. Asking twice is harmless.
pub async fn cancel(store: &Store, principal: &Principal, id: Uuid) -> Result<DiagnosisView, AppError> {
    get(store, principal, id).await?;
    match store.diagnosis_cancel(id, &principal.name).await? {
        DiagnosisCancelled::AtOnce | DiagnosisCancelled::Requested => get(store, principal, id).await,
        DiagnosisCancelled::Ended(state) => Err(AppError::Conflict {
            code: "diagnosis_ended",
            detail: format!(
                "the diagnosis has ended as `{}` and cannot be cancelled",
                state.as_str()
            ),
        }),
        DiagnosisCancelled::Unknown => Err(AppError::not_found("diagnosis", id)),
    }
}

/// Makes the model that came out the robot's current one.
pub async fn accept(store: &Store, principal: &Principal, id: Uuid) -> Result<DiagnosisView, AppError> {
    let view = get(store, principal, id).await?;
    let Some(version) = view.model.as_deref().filter(|_| view.state == DiagnosisState::Done) else {
        return Err(not_done(&view));
    };
    let model = store
        .model_find(version)
        .await?
        .ok_or_else(|| AppError::not_found("model", version))?;
    store
        .robot_model_set(&view.robot, &view.floor, Some(model.id), Some(id), &principal.name)
        .await?;
    tracing::info!(diagnosis.id = %id, robot = view.robot, model = version, user = principal.name, "model accepted");
    get(store, principal, id).await
}

/// Submits the experiment that the report proposes. A proposed run that is under way or done is not submitted again.
pub async fn next_experiment(store: &Store, principal: &Principal, id: Uuid) -> Result<Taken, AppError> {
    let view = get(store, principal, id).await?;
    let text = report(store, principal, id).await?;
    let ended_badly = |state: RunState| state.is_terminal() && state != RunState::Done;
    if let Some(run) = view.next_run
        && !store.run_get(run).await?.is_some_and(|run| ended_badly(run.state))
    {
        return Ok(Taken::Before(view));
    }
    let experiment = proposed(store, &view, &text).await?;
    // Two clicks are one run; after a run that failed a click is a new one.
    let key = format!("diagnosis {id} after {}", view.next_run.unwrap_or_default());
    let submission = Submission {
        request: SubmitRequest {
            experiment,
            claim: None,
            label: Some(format!("{}: proposed by a diagnosis", view.robot)),
        },
        request_hash: Sha256::digest(key.as_bytes()).into(),
        idempotency_key: Some(key),
    };
    let run = match experiments::submit(store, principal, submission).await? {
        Accepted::Created(made) | Accepted::Before(made) => made.run_id,
    };
    store.diagnosis_next_run_set(id, view.next_run, run).await?;
    Ok(Taken::Created(get(store, principal, id).await?))
}

async fn proposed(store: &Store, view: &DiagnosisView, report: &str) -> Result<api::experiment::Experiment, AppError> {
    let report: serde_json::Value =
        serde_json::from_str(report).map_err(|error| AppError::Internal(error.to_string()))?;
    let draft = report.get("next_experiment").and_then(|next| next.get("experiment"));
    let Some(draft) = draft.filter(|draft| !draft.is_null()) else {
        return Err(AppError::Conflict {
            code: "no_next_experiment",
            detail: "the report proposes no further experiment".to_owned(),
        });
    };
    let arenas = store.arena_list().await?;
    let arena = arenas.iter().find(|arena| arena.arena.name == view.arena);
    let robots = store.robot_list().await?;
    let robot = robots
        .iter()
        .find(|robot| robot.arena == view.arena && robot.name == view.robot);
    match (arena, robot) {
        (Some(arena), Some(robot)) => manoeuvre::experiment(draft, &arena.arena, &robot.robot),
        _ => Err(AppError::Conflict {
            code: "robot_not_registered",
            detail: format!(
                "no laboratory has the robot {} in the arena {} now",
                view.robot, view.arena
            ),
        }),
    }
}
