//! A claimed run from its lease to its delivered files, whatever drives in between.

use crate::clock::monotonic_us;
use crate::deliver;
use crate::desk::Desk;
use crate::lease::{Heart, Lease};
use crate::live::LivePicture;
use crate::record::{End, Record, Start};
use crate::recorder::{Recorder, RecorderHandle};
use crate::run::Conclusion;
use crate::safety::Ending;
use api::lab::{Assignment, Heartbeat, StateReport};
use api::run::{RunState, Whose};
use chrono::Utc;
use control::scenario::{FieldProblem, Scenario};
use std::path::Path;
use std::sync::Arc;
use tokio::task::spawn_blocking;

/// Holds the lease, records, lets `attempt` drive, and hands the files in. What cannot be handed in now is salvaged later.
///
/// - `tell`: hears the phases `preparing` and `uploading`.
/// - Returns how it ended.
pub async fn carry_out(
    desk: &Desk,
    assignment: &Assignment,
    tell: impl Fn(&'static str),
    attempt: impl AsyncFnOnce(&Arc<Lease>, &RecorderHandle) -> Conclusion,
) -> Conclusion {
    let (run_id, epoch) = (assignment.run_id, assignment.epoch);
    tracing::info!(run.id = %run_id, epoch, "run begins");
    tell("preparing");
    let lease = Arc::new(Lease::claimed(assignment.lease_s));
    let beat = Heartbeat {
        epoch,
        instance: desk.instance,
    };
    let _heart = Heart::start(desk.service.clone(), run_id, beat, lease.clone());
    let folder = desk.folder.join(format!("{run_id}-{epoch}"));
    match start_recorder(desk, assignment, &folder) {
        Ok(recorder) => {
            let conclusion = attempt(&lease, &recorder.handle()).await;
            tracing::info!(run.id = %run_id, state = conclusion.state.as_str(), fault = ?conclusion.fault, "run ended");
            let end = End {
                at_us: monotonic_us(),
                state: conclusion.state,
                fault: conclusion.fault.clone(),
                records_dropped: 0,
            };
            if let Ok(Err(error)) = spawn_blocking(move || recorder.finish(end)).await {
                tracing::error!(run.id = %run_id, %error, "the record is incomplete");
            }
            tell("uploading");
            deliver::deliver(desk, &deliver::Attempt { run_id, epoch, folder }, &conclusion, &lease).await;
            conclusion
        }
        Err(error) => {
            let message = format!("The laboratory cannot write its record: {error}.");
            let conclusion = Conclusion::failed(Whose::Platform, "recorder_failed", message);
            deliver::report_end(desk, run_id, epoch, &conclusion, None, &lease).await;
            conclusion
        }
    }
}

fn start_recorder(desk: &Desk, assignment: &Assignment, folder: &Path) -> std::io::Result<Recorder> {
    std::fs::create_dir(folder)?;
    crate::durable::sync_parent(folder)?;
    let robots: Vec<_> = assignment
        .robots
        .iter()
        .map(|robot| (robot.number, robot.description.name.clone()))
        .collect();
    let start = Start {
        assignment: assignment.clone(),
        wall: Utc::now(),
        at_us: monotonic_us(),
    };
    let live = LivePicture::new(assignment.run_id, assignment.epoch, &robots);
    Recorder::start(
        folder,
        Record::Start(Box::new(start)),
        live,
        desk.watchers.clone(),
        desk.hub.clone(),
    )
}

/// An end from outside: shutdown, lease, cancel.
pub fn outside_ending(desk: &Desk, lease: &Lease) -> Option<Ending> {
    if desk.shutdown.is_requested() {
        Some(Ending::LabStopped)
    } else if lease.is_stale() {
        Some(Ending::StaleEpoch)
    } else if monotonic_us() >= lease.until_us() {
        Some(Ending::LeaseLost)
    } else if lease.is_cancelled() {
        Some(Ending::Cancelled)
    } else {
        None
    }
}

/// The service must know that motion begins before it does.
///
/// - `ending`: an end from outside, looked for while the service is away.
pub async fn report_running(
    desk: &Desk,
    assignment: &Assignment,
    ending: impl Fn() -> Option<Conclusion>,
) -> Result<(), Conclusion> {
    let report = StateReport {
        epoch: assignment.epoch,
        instance: desk.instance,
        state: RunState::Running,
        fault: None,
        ticks_recorded: None,
        ticks_missed: None,
    };
    match deliver::report(desk, assignment.run_id, &report, || ending().is_some()).await {
        Ok(()) => Ok(()),
        Err(error) => Err(ending().unwrap_or_else(|| {
            if error.is_stale_epoch() {
                return Conclusion::of(Ending::StaleEpoch, &[]);
            }
            Conclusion::failed(
                Whose::Platform,
                "start_refused",
                format!("The service did not let the run begin: {error}."),
            )
        })),
    }
}

/// Experiment, robots, arena and models as the twin and the control laws take them.
///
/// - Errors: every rule of the twin that the experiment breaks.
pub fn scenario(assignment: &Assignment) -> Result<Scenario, Vec<FieldProblem>> {
    let document = serde_json::json!({
        "experiment": assignment.experiment,
        "robots": assignment.robots,
        "arena": assignment.arena,
        "models": assignment.models,
    });
    Scenario::from_json(&document.to_string())
}

/// The end of a run whose experiment breaks a rule after all.
pub fn refused(problems: Vec<FieldProblem>) -> Conclusion {
    let first = problems.into_iter().next();
    // What the service's rehearsal admitted and does not run here is the platform's fault, but for the user's own program.
    let own = first
        .as_ref()
        .is_some_and(|problem| problem.field.starts_with("control.parameters."));
    let whose = if own { Whose::User } else { Whose::Platform };
    let problem = first.map(|problem| format!("{}: {}", problem.field, problem.message));
    Conclusion::failed(
        whose,
        "experiment_refused",
        format!(
            "The laboratory cannot run this experiment: {}.",
            problem.unwrap_or_default()
        ),
    )
}
