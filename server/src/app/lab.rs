//! The laboratory's side: claim, beat, report, salvage.

use super::archives;
use super::error::AppError;
use super::files::stale_epoch;
use crate::state::AppState;
use crate::stop_pages;
use api::lab::{
    Assignment, ClaimRequest, Heartbeat, HeartbeatReply, LabDescription, LabStatus, SalvageReport, Side, StateReport,
};
use api::problem::FieldProblem;
use api::run::RunView;
use std::time::Duration;
use store::{Beat, Change, Claim, ClaimedRun, Fence, Reported, Salvaged};
use tokio::sync::broadcast::Receiver;
use tokio::time::Instant;
use uuid::Uuid;

/// How long a laboratory owns a run without a word.
pub const LEASE: Duration = Duration::from_secs(15);
/// Longest a claim may wait.
pub const WAIT_LIMIT: Duration = Duration::from_secs(30);
/// The queue is looked at this often; a notification only makes it sooner.
const POLL: Duration = Duration::from_millis(500);

pub async fn register(state: &AppState, lab: &LabDescription) -> Result<(), AppError> {
    if lab.format != "robopheus.lab/1" {
        return Err(invalid("format", &lab.format, "`robopheus.lab/1`"));
    }
    if let Some(problem) = lab.stop_url.as_deref().and_then(stop_pages::problem) {
        return Err(AppError::Invalid {
            code: "invalid_request",
            detail: problem.message.clone(),
            errors: vec![problem],
        });
    }
    for (index, robot) in lab.robots.iter().enumerate() {
        let name = &robot.description.name;
        if lab.robots[..index]
            .iter()
            .any(|other| other.number == robot.number || &other.description.name == name)
        {
            return Err(invalid(
                &format!("robots[{index}]"),
                name,
                "numbers and names that occur once",
            ));
        }
    }
    Ok(state.store().lab_register(lab).await?)
}

pub async fn status(state: &AppState, status: &LabStatus) -> Result<(), AppError> {
    if state.store().lab_status_put(status).await? {
        Ok(())
    } else {
        Err(AppError::not_found("laboratory", &status.lab))
    }
}

/// The next run for this laboratory, waiting for one as long as the laboratory wishes.
pub async fn claim(state: &AppState, request: &ClaimRequest) -> Result<Option<Assignment>, AppError> {
    let wait = Duration::try_from_secs_f64(request.wait_s)
        .map_err(|_| invalid("wait_s", &request.wait_s.to_string(), "0 to 30 s"))?
        .min(WAIT_LIMIT);
    let claim = Claim {
        lab: request.lab.clone(),
        arena: request.arena.clone(),
        instance: request.instance,
        side: request.side,
    };
    if claim.side == Side::Virtual {
        state.store().simulator_seen(&claim.lab, &claim.arena).await?;
    }
    let deadline = Instant::now() + wait;
    let mut changes = state.store().listen(); // interest first, then the query: nothing is missed in between
    loop {
        if state.shutdown().is_cancelled() {
            return Ok(None);
        }
        if let Some(run) = state.store().run_claim(&claim, LEASE).await? {
            tracing::info!(run.id = %run.run_id, epoch = run.epoch, lab = request.lab, "run leased");
            return Ok(Some(assignment(run)));
        }
        if Instant::now() >= deadline {
            return Ok(None);
        }
        tokio::select! {
            () = tokio::time::sleep_until(deadline.min(Instant::now() + POLL)) => {}
            () = any_change(&mut changes) => {}
            () = state.shutdown().cancelled() => {}
        }
    }
}

/// Returns when something may have changed; never when the source of hints has gone, polling goes on.
pub async fn any_change(changes: &mut Receiver<Change>) {
    use tokio::sync::broadcast::error::RecvError;
    match changes.recv().await {
        Ok(_) | Err(RecvError::Lagged(_)) => {}
        Err(RecvError::Closed) => std::future::pending().await,
    }
}

pub async fn heartbeat(state: &AppState, run_id: Uuid, beat: &Heartbeat) -> Result<HeartbeatReply, AppError> {
    let fence = Fence {
        run_id,
        epoch: beat.epoch,
        instance: beat.instance,
    };
    match state.store().run_heartbeat(fence, LEASE).await? {
        Beat::Ok { cancel_requested } => Ok(HeartbeatReply {
            lease_s: LEASE.as_secs_f64(),
            cancel_requested,
        }),
        Beat::Stale => Err(stale_epoch()),
    }
}

/// Moves a run on; when it has ended, its watchers are let go and its archive is made.
pub async fn report(state: &AppState, run_id: Uuid, report: &StateReport) -> Result<RunView, AppError> {
    match state.store().run_state_report(run_id, report).await? {
        Reported::Ok => {}
        Reported::Stale => return Err(stale_epoch()),
        Reported::NotAllowed { from } => {
            return Err(AppError::Conflict {
                code: "transition_refused",
                detail: format!(
                    "a run that is `{}` does not become `{}`",
                    from.as_str(),
                    report.state.as_str()
                ),
            });
        }
    }
    tracing::info!(run.id = %run_id, epoch = report.epoch, state = report.state.as_str(), "run moved on");
    if report.state.is_terminal() {
        ended(state, run_id);
    }
    state
        .store()
        .run_get(run_id)
        .await?
        .ok_or_else(|| AppError::not_found("run", run_id))
}

/// Closes an attempt that a crashed laboratory left behind. Its files are still accepted.
pub async fn salvage(state: &AppState, run_id: Uuid, report: &SalvageReport) -> Result<RunView, AppError> {
    match state.store().run_salvage(run_id, report).await? {
        Salvaged::Ok { state: now } => {
            tracing::info!(run.id = %run_id, epoch = report.epoch, state = now.as_str(), "attempt salvaged");
            if now.is_terminal() {
                ended(state, run_id);
            }
            state
                .store()
                .run_get(run_id)
                .await?
                .ok_or_else(|| AppError::not_found("run", run_id))
        }
        Salvaged::Stale => Err(stale_epoch()),
    }
}

fn ended(state: &AppState, run_id: Uuid) {
    state.live().close(run_id);
    archives::prepare(state, run_id);
}

fn assignment(run: ClaimedRun) -> Assignment {
    Assignment {
        run_id: run.run_id,
        epoch: run.epoch,
        experiment: run.experiment,
        arena: run.arena,
        robots: run.robots,
        models: run.models,
        verdict: run.verdict,
        lease_s: run.lease_s,
    }
}

fn invalid(field: &str, value: &str, limit: &str) -> AppError {
    AppError::Invalid {
        code: "invalid_request",
        detail: format!("{field}: `{value}` is refused"),
        errors: vec![FieldProblem {
            field: field.to_owned(),
            message: format!("`{value}` is refused"),
            limit: limit.to_owned(),
            remedy: format!("correct `{field}`"),
        }],
    }
}
