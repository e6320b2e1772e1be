//! Submitting an experiment: checked completely before anything is stored.

use super::error::AppError;
use super::runs::owner_filter;
use crate::access::Principal;
use api::arena::ArenaView;
use api::diagnosis::NOMINAL;
use api::experiment::{ExperimentView, SubmitRequest};
use api::model::ModelView;
use api::problem::FieldProblem;
use api::robot::RobotView;
use control::scenario::Scenario;
use store::{NewSubmission, Store, Submitted};
use uuid::Uuid;

/// Longest label.
const LABEL_LIMIT_CHARACTERS: usize = 200;
/// Problems reported at once; a document with more is wrong altogether.
const PROBLEMS_LIMIT: usize = 64;

/// A submission as it arrived.
#[derive(Debug, Clone)]
pub struct Submission {
    pub request: SubmitRequest,
    pub idempotency_key: Option<String>,
    /// SHA-256 of the body.
    pub request_hash: [u8; 32],
}

/// What became of a submission.
#[derive(Debug, Clone, PartialEq)]
pub enum Accepted {
    Created(ExperimentView),
    /// The same key and body came before; this is what came of it.
    Before(ExperimentView),
}

pub async fn submit(store: &Store, principal: &Principal, submission: Submission) -> Result<Accepted, AppError> {
    let Submission {
        request,
        idempotency_key,
        request_hash,
    } = submission;
    // A repetition gets its answer even when the laboratory has changed meanwhile.
    if let Some(key) = &idempotency_key
        && let Some(before) = store
            .experiment_submitted_before(&principal.name, key, &request_hash)
            .await?
    {
        return accepted(before, principal);
    }
    let laboratory = Laboratory {
        robots: store.robot_list().await?,
        arenas: store.arena_list().await?,
    };
    let models = if request.experiment.model.is_some() {
        store.model_list(None).await?
    } else {
        Vec::new()
    };
    let mut errors = problems(&request, &laboratory, &models);
    if !errors.is_empty() {
        let count = errors.len();
        errors.truncate(PROBLEMS_LIMIT);
        let first = errors
            .first()
            .map(|first| format!("{}: {}", first.field, first.message))
            .unwrap_or_default();
        let more = if count > 1 {
            format!(" (and {} more)", count - 1)
        } else {
            String::new()
        };
        return Err(AppError::Invalid {
            code: "invalid_experiment",
            detail: format!("{first}{more}"),
            errors,
        });
    }
    let stored = store
        .experiment_submit(NewSubmission {
            user: principal.name.clone(),
            label: request.label.unwrap_or_default(),
            experiment: request.experiment,
            claim: request.claim,
            idempotency_key,
            request_hash,
        })
        .await?;
    accepted(stored, principal)
}

fn accepted(stored: Submitted, principal: &Principal) -> Result<Accepted, AppError> {
    match stored {
        Submitted::Created(view) => {
            tracing::info!(experiment.id = %view.id, run.id = %view.run_id, user = principal.name, "experiment submitted");
            Ok(Accepted::Created(view))
        }
        Submitted::Replayed(view) => Ok(Accepted::Before(view)),
        Submitted::Conflict => Err(AppError::Invalid {
            code: "idempotency_conflict",
            detail: "this Idempotency-Key came with another body in the last 24 h; use a new key".to_owned(),
            errors: Vec::new(),
        }),
    }
}

pub async fn get(store: &Store, principal: &Principal, id: Uuid) -> Result<ExperimentView, AppError> {
    let found = store.experiment_get(id).await?;
    let found = found.filter(|experiment| principal.may_see_what_belongs_to(&experiment.submitted_by));
    found.ok_or_else(|| AppError::not_found("experiment", id))
}

/// Newest first.
pub async fn list(store: &Store, principal: &Principal, limit: i64) -> Result<Vec<ExperimentView>, AppError> {
    Ok(store.experiment_list(limit, owner_filter(principal)).await?)
}

/// What can be experimented with.
#[derive(Debug, Clone, Default)]
struct Laboratory {
    robots: Vec<RobotView>,
    arenas: Vec<ArenaView>,
}

/// Every rule that the submission breaks; paths are those of the experiment document.
fn problems(request: &SubmitRequest, laboratory: &Laboratory, models: &[ModelView]) -> Vec<FieldProblem> {
    let mut found = Vec::new();
    check_envelope(request, &mut found);
    check_offer(request, models, &mut found);
    check_rules(request, laboratory, &mut found);
    found
}

fn check_envelope(request: &SubmitRequest, found: &mut Vec<FieldProblem>) {
    let label = request.label.as_deref().unwrap_or_default();
    if label.chars().count() > LABEL_LIMIT_CHARACTERS || label.chars().any(char::is_control) {
        found.push(problem(
            "label",
            "the label is too long or has control characters",
            format!("at most {LABEL_LIMIT_CHARACTERS} characters on one line"),
            "shorten the label",
        ));
    }
    if let Some(claim) = &request.claim {
        let is_hex = claim
            .digest
            .bytes()
            .all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte));
        if claim.digest.len() != 32 || !is_hex {
            found.push(problem(
                "claim.digest",
                "the digest is not one of the twin",
                "32 lower-case hexadecimal characters",
                "send the digest as the twin prints it, or leave the claim out",
            ));
        }
        if claim.twin_version.is_empty() || claim.twin_version.len() > 64 {
            found.push(problem(
                "claim.twin_version",
                "the version is empty or too long",
                "1 to 64 characters",
                "send the twin's version",
            ));
        }
        if !["browser", "client"].contains(&claim.engine.as_str()) {
            found.push(problem(
                "claim.engine",
                format!("{:?} is not known", claim.engine),
                "browser, client",
                "use one of these",
            ));
        }
    }
}

/// What the service has.
fn check_offer(request: &SubmitRequest, models: &[ModelView], found: &mut Vec<FieldProblem>) {
    let experiment = &request.experiment;
    let takes_part = |model: &&ModelView| experiment.robots.iter().any(|robot| robot.name == model.robot);
    if let Some(wanted) = experiment.model.as_ref().filter(|wanted| *wanted != NOMINAL)
        && !models
            .iter()
            .filter(takes_part)
            .any(|model| &model.version == wanted || model.id.to_string() == *wanted)
    {
        let known: Vec<_> = models
            .iter()
            .filter(takes_part)
            .map(|model| model.version.as_str())
            .collect();
        found.push(problem(
            "model",
            format!("there is no model {wanted:?}"),
            if known.is_empty() {
                "null, nominal (these robots have no model version yet)".to_owned()
            } else {
                format!("null, nominal, {}", known.join(", "))
            },
            "leave it null for the current models of the robots",
        ));
    }
}

/// The rules of `control`, applied to the laboratory as it is registered.
fn check_rules(request: &SubmitRequest, laboratory: &Laboratory, found: &mut Vec<FieldProblem>) {
    let experiment = &request.experiment;
    let Some(arena) = laboratory
        .arenas
        .iter()
        .find(|arena| arena.arena.name == experiment.arena)
    else {
        let names: Vec<_> = laboratory
            .arenas
            .iter()
            .map(|arena| arena.arena.name.as_str())
            .collect();
        found.push(problem(
            "arena",
            format!("there is no arena {:?}", experiment.arena),
            list_of(&names),
            "name an arena of this service",
        ));
        return;
    };
    let here: Vec<_> = laboratory
        .robots
        .iter()
        .filter(|robot| robot.arena == experiment.arena)
        .collect();
    let mut robots = Vec::new();
    let mut unknown = Vec::new();
    for (index, wanted) in experiment.robots.iter().enumerate() {
        match here.iter().find(|robot| robot.name == wanted.name).or_else(|| {
            unknown.push(index);
            here.first() // keeps the others in their places; its name differs, so it is never taken for the wanted one
        }) {
            Some(robot) => robots.push(&robot.robot),
            None => break,
        }
    }
    let names: Vec<_> = here.iter().map(|robot| robot.name.as_str()).collect();
    for index in &unknown {
        found.push(problem(
            format!("robots[{index}].name"),
            format!(
                "the arena {:?} has no robot {:?}",
                experiment.arena, experiment.robots[*index].name
            ),
            list_of(&names),
            "name a robot of the arena",
        ));
    }
    let told: Vec<_> = unknown
        .iter()
        .flat_map(|i| ["name", "chassis", "controller"].map(|f| format!("robots[{i}].{f}")))
        .collect();
    let scenario = serde_json::json!({"experiment": experiment, "robots": robots, "arena": arena.arena});
    let rules = match Scenario::parse(&scenario.to_string()) {
        Ok(scenario) => scenario.check(),
        Err(problems) => problems,
    };
    let rules = rules.into_iter().filter(|rule| !told.contains(&rule.field));
    found.extend(rules.map(|rule| problem(rule.field, rule.message, rule.limit, rule.remedy)));
    // The number of robots first: with too many, most of the rest follows from it.
    found.sort_by_key(|problem| problem.field != "robots");
}

fn list_of(names: &[&str]) -> String {
    if names.is_empty() {
        "none is registered yet".to_owned()
    } else {
        names.join(", ")
    }
}

fn problem(
    field: impl Into<String>,
    message: impl Into<String>,
    limit: impl Into<String>,
    remedy: impl Into<String>,
) -> FieldProblem {
    FieldProblem {
        field: field.into(),
        message: message.into(),
        limit: limit.into(),
        remedy: remedy.into(),
    }
}
