//! Job kind `rehearse`: the twin carries a submitted experiment out and says whether the robots may.
//!
//! At least once: a lost worker's job is repeated. The twin is deterministic, so a repetition writes the same bytes.

use super::Ending;
use crate::decide::{self, Decision};
use crate::objects::{self, NewObject};
use anyhow::Context;
use api::run::{Fault, Whose};
use api::verdict::{Replay, Verdict};
use control::rehearsal::Outcome;
use control::scenario::{FieldProblem, Scenario};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use store::{JobFailure, JobLease, RehearsalInput, Store, VerdictRecord};

pub const KIND: &str = "rehearse";
/// Tries before the run fails.
pub const ATTEMPTS: i32 = 3;
/// Longest rehearsal.
pub const TIMEOUT: Duration = Duration::from_secs(300);
/// A worker that says nothing for this long has lost its job.
pub const LEASE: Duration = Duration::from_secs(15);
/// Time between two heartbeats.
pub const BEAT: Duration = Duration::from_secs(3);

/// Ticks between two looks at the stop flag and the clock.
const TICKS_PER_LOOK: u32 = 16;

/// Set from outside when nobody wants the result any more.
pub type Abandon = Arc<AtomicBool>;

#[derive(Serialize)]
struct ScenarioDocument<'a> {
    experiment: &'a api::experiment::Experiment,
    robots: &'a [api::robot::LabRobot],
    arena: &'a api::arena::Arena,
    models: &'a BTreeMap<String, serde_json::Value>,
}

enum Rehearsed {
    Outcome(Box<Outcome>),
    Problems(Vec<FieldProblem>),
    TooLong,
    Abandoned,
}

/// Carries one leased job out; writes the replay file but no row.
pub async fn run(store: &Store, objects: PathBuf, job: &JobLease, abandon: Abandon) -> Ending {
    let input = match store.rehearsal_input(job.run_id).await {
        Ok(Some(input)) => input,
        Ok(None) => return Ending::Nothing,
        Err(error) => return unexpected(job, &anyhow::Error::from(error).context("cannot read the experiment")),
    };
    let scenario = match scenario_json(&input, job) {
        Ok(text) => text,
        Err(ending) => return *ending,
    };
    let work = move || conclude(&objects, &input, rehearse(&scenario, &abandon));
    match tokio::task::spawn_blocking(work).await {
        Ok(Ok(ending)) => ending,
        Ok(Err(error)) => unexpected(job, &error),
        Err(panic) => unexpected(job, &anyhow::anyhow!("the rehearsal panicked: {panic}")),
    }
}

/// The document that the twin reads, or why there is none.
fn scenario_json(input: &RehearsalInput, job: &JobLease) -> Result<String, Box<Ending>> {
    let Some(arena) = &input.arena else {
        // The laboratory may be about to register: at start, everything comes up at once.
        let message = format!("No laboratory has registered the arena {}.", input.experiment.arena);
        let fault = Fault {
            whose: Whose::User,
            code: "unknown_arena".to_owned(),
            message: message.clone(),
        };
        return Err(Box::new(retry_or(job, message, fault)));
    };
    if !input.robots_missing.is_empty() {
        let message = format!(
            "The arena {} has no robot named {}.",
            arena.name,
            input.robots_missing.join(", ")
        );
        let fault = Fault {
            whose: Whose::User,
            code: "unknown_robot".to_owned(),
            message: message.clone(),
        };
        return Err(Box::new(Ending::Failed {
            error: message,
            then: JobFailure::Final { fault },
        }));
    }
    let document = ScenarioDocument {
        experiment: &input.experiment,
        robots: &input.robots,
        arena,
        models: &input.models,
    };
    serde_json::to_string(&document).map_err(|error| Box::new(unexpected(job, &error.into())))
}

/// The twin at work, as far as somebody wants to know.
fn rehearse(scenario_json: &str, abandon: &AtomicBool) -> Rehearsed {
    let begun = Instant::now();
    let mut rehearsal =
        match Scenario::from_json(scenario_json).and_then(|scenario| sandbox::start::rehearsal(&scenario)) {
            Ok(rehearsal) => rehearsal,
            Err(problems) => return Rehearsed::Problems(problems),
        };
    loop {
        for _ in 0..TICKS_PER_LOOK {
            if !rehearsal.step() {
                return Rehearsed::Outcome(Box::new(rehearsal.finish()));
            }
        }
        if abandon.load(Ordering::Relaxed) {
            return Rehearsed::Abandoned;
        }
        if begun.elapsed() > TIMEOUT {
            return Rehearsed::TooLong;
        }
    }
}

fn conclude(objects: &Path, input: &RehearsalInput, rehearsed: Rehearsed) -> anyhow::Result<Ending> {
    let outcome = match rehearsed {
        Rehearsed::Outcome(outcome) => outcome,
        Rehearsed::Abandoned => return Ok(Ending::Stopped),
        Rehearsed::Problems(problems) => {
            let fault = decide::invalid_experiment(
                problems
                    .iter()
                    .map(|problem| (problem.field.as_str(), problem.message.as_str())),
            );
            return Ok(Ending::Failed {
                error: fault.message.clone(),
                then: JobFailure::Final { fault },
            });
        }
        Rehearsed::TooLong => {
            let message = format!("The twin did not finish within {} s.", TIMEOUT.as_secs());
            let fault = Fault {
                whose: Whose::Platform,
                code: "rehearsal_timeout".to_owned(),
                message: message.clone(),
            };
            return Ok(Ending::Failed {
                error: message,
                then: JobFailure::Final { fault },
            });
        }
    };
    // Model types and wire types are different types with one JSON form.
    let verdict: Verdict =
        serde_json::from_str(&serde_json::to_string(&outcome.verdict)?).context("the verdict has another form")?;
    let replay_json = serde_json::to_vec(&outcome.replay)?;
    let _: Replay = serde_json::from_slice(&replay_json).context("the replay has another form")?;
    let object_path = format!("runs/{}/0/replay.json", input.run_id);
    let new = NewObject {
        name: "replay.json",
        media_type: "application/json",
        object_path: &object_path,
        bytes: &replay_json,
    };
    let replay = objects::write(objects, &new).context("cannot write the replay")?;
    let (accepted, fault) = match decide::after_rehearsal(&verdict, input.claim.as_ref()) {
        Decision::Queue => (true, None),
        Decision::Reject(fault) => (false, Some(fault)),
    };
    Ok(Ending::Verdict(Box::new(VerdictRecord {
        verdict,
        accepted,
        fault,
        replay,
    })))
}

fn unexpected(job: &JobLease, error: &anyhow::Error) -> Ending {
    let error = format!("{error:#}");
    let message = "The check by the twin failed inside the service.".to_owned();
    retry_or(
        job,
        error,
        Fault {
            whose: Whose::Platform,
            code: "rehearsal_failed".to_owned(),
            message,
        },
    )
}

fn retry_or(job: &JobLease, error: String, fault: Fault) -> Ending {
    let then = if job.tries < ATTEMPTS {
        JobFailure::Retry {
            after: decide::retry_pause(u32::try_from(job.tries).unwrap_or(0), decide::random()),
        }
    } else {
        JobFailure::Final { fault }
    };
    Ending::Failed { error, then }
}
