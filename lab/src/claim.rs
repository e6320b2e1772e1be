//! The laboratory's main loop: register, close what was left behind, take the next run.

use crate::backoff::Backoff;
use crate::homeward::WayHome;
use crate::lab::Lab;
use crate::ladder::Finding;
use crate::rack;
use crate::run;
use crate::salvage;
use crate::service::ServiceError;
use api::lab::{Assignment, ClaimRequest, Side};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::time::Instant;

/// How long the service may hold a claim.
const WAIT_S: f64 = 20.0;
/// An empty answer that came sooner than this was not a long poll: the service is ending.
const SHORT_POLL: Duration = Duration::from_secs(1);
/// Between two status reports.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Takes and carries out runs until the process is to end.
pub async fn keep_claiming(lab: Arc<Lab>) {
    let mut home = None;
    claim_runs(&lab, &mut home).await;
    end(&mut home).await;
}

/// - `home`: robots of the last run on their way home, while the next run is looked for.
async fn claim_runs(lab: &Arc<Lab>, home: &mut Option<WayHome>) {
    let mut backoff = Backoff::default();
    let mut latch = lab.latch.subscribe();
    while !lab.desk.shutdown.is_requested() {
        let pressed = lab.latch.is_pressed();
        let next = tokio::select! {
            biased;
            () = lab.desk.shutdown.requested() => return,
            // While stopped nothing is claimed; a press during a claim abandons it, and its lease runs out unused.
            _ = latch.wait_for(|now_pressed| *now_pressed != pressed) => continue,
            next = next_run(lab), if !pressed => next,
        };
        match next {
            Ok(assignment) => {
                backoff.reset();
                if let Some(assignment) = assignment.filter(|assignment| is_fit(lab, assignment)) {
                    // Two loops on one floor would not know of each other.
                    end(home).await;
                    let conclusion = run::run(lab, &assignment).await;
                    *home = WayHome::begin(lab, &assignment, &conclusion);
                }
            }
            Err(error) => {
                lab.registered.store(false, Ordering::Relaxed);
                let wait = backoff.next_wait();
                tracing::warn!(%error, cause = ?std::error::Error::source(&error).map(ToString::to_string), ?wait, "no claim");
                tokio::select! {
                    () = lab.desk.shutdown.requested() => return,
                    () = tokio::time::sleep(wait) => {}
                }
            }
        }
    }
}

async fn end(home: &mut Option<WayHome>) {
    if let Some(home) = home.take() {
        home.end().await;
    }
}

/// False when a robot of the run got unfit during the claim: then the claim is abandoned, and its lease runs out unused.
fn is_fit(lab: &Lab, assignment: &Assignment) -> bool {
    let finding = |number| lab.link.robot(number).map_or(Finding::Fine, |robot| robot.finding());
    let unfit = assignment
        .robots
        .iter()
        .find(|robot| finding(robot.number) != Finding::Fine);
    if let Some(robot) = unfit {
        let (name, finding) = (&robot.description.name, finding(robot.number).code());
        tracing::warn!(run.id = %assignment.run_id, robot.id = %name, finding, "claim abandoned");
    }
    unfit.is_none()
}

async fn next_run(lab: &Lab) -> Result<Option<Assignment>, ServiceError> {
    if !lab.registered.load(Ordering::Relaxed) {
        lab.desk.service.register(&lab.registration()).await?;
        lab.registered.store(true, Ordering::Relaxed);
        tracing::info!(lab = lab.description.name, "registered");
    }
    salvage::sweep(&lab.desk).await?;
    rack::clear_floor(lab).await;
    // The service must not hand out a run for a robot whose trouble it has not heard of yet.
    lab.desk.service.status(&lab.status()).await?;
    let request = ClaimRequest {
        lab: lab.description.name.clone(),
        arena: lab.description.arena.name.clone(),
        instance: lab.desk.instance,
        wait_s: WAIT_S,
        side: Side::Physical,
    };
    let asked = Instant::now();
    let assignment = lab.desk.service.claim(&request).await?;
    if assignment.is_none() && asked.elapsed() < SHORT_POLL {
        tokio::time::sleep(SHORT_POLL).await;
    }
    Ok(assignment)
}

/// Reports robots' health every second until the process ends.
pub async fn keep_status(lab: Arc<Lab>) {
    let mut ticks = tokio::time::interval(STATUS_PERIOD);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        match lab.desk.service.status(&lab.status()).await {
            Ok(()) => {}
            Err(ServiceError::Refused { status, .. }) if status == reqwest::StatusCode::NOT_FOUND => {
                // The service lost this laboratory, for example with a new database.
                if lab.registered.swap(false, Ordering::Relaxed)
                    && let Err(error) = lab.desk.service.register(&lab.registration()).await
                {
                    tracing::warn!(%error, "registering again");
                }
            }
            Err(error) => tracing::debug!(%error, "status"),
        }
    }
}
