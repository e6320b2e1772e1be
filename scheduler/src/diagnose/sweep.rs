//! The reconciler of diagnoses: lost workers, gaps of finished runs, and the diagnoses that follow from both. It needs no
//! input, and what it does may be done twice.

use super::bundle_of;
use crate::stop::Stop;
use crate::{STORE_CALL_LIMIT, decide};
use api::model::HorizonGap;
use identify::gap::{ANCHOR_PERIOD_S, EndToEndGap, RobotClock, end_to_end, end_to_end_with};
use std::path::{Path, PathBuf};
use std::time::Duration;
use store::{GapWork, MeasuredGap, Store};
use tokio::time::timeout;
use twin::model_document::ModelDocument;
use twin::robot::Robot;

/// Time between two sweeps.
const PERIOD: Duration = Duration::from_secs(1);
/// Gaps computed in one sweep.
const GAPS_MOST: i64 = 8;

/// Sweeps until told to stop.
pub async fn sweep(store: Store, objects: PathBuf, mut stop: Stop) {
    let mut failures = 0;
    loop {
        let swept = tokio::select! {
            () = stop.requested() => return,
            swept = once(&store, &objects) => swept,
        };
        let pause = match swept {
            Ok(()) => {
                failures = 0;
                PERIOD
            }
            Err(error) => {
                tracing::warn!(error = format!("{error:#}"), "the sweep of diagnoses failed");
                failures += 1;
                decide::outage_pause(failures, decide::random())
            }
        };
        if stop.sleep(pause).await {
            return;
        }
    }
}

async fn once(store: &Store, objects: &Path) -> anyhow::Result<()> {
    for id in timeout(STORE_CALL_LIMIT, store.diagnoses_reap()).await?? {
        tracing::warn!(diagnosis.id = %id, "a worker lost its diagnosis");
    }
    for id in timeout(STORE_CALL_LIMIT, store.diagnoses_follow_up()).await?? {
        tracing::info!(diagnosis.id = %id, "the proposed run is done: diagnosis queued");
    }
    let work = timeout(STORE_CALL_LIMIT, store.gap_work(GAPS_MOST)).await??;
    for one in &work {
        let gap = gap_of(store, objects, one).await?;
        timeout(STORE_CALL_LIMIT, store.gap_put(one, &gap)).await??;
    }
    // With all gaps known: a reference that is still to come could move the floor.
    if work.is_empty() {
        for id in timeout(STORE_CALL_LIMIT, store.diagnoses_of_gaps()).await?? {
            tracing::info!(diagnosis.id = %id, "a gap is above that of the references: diagnosis queued");
        }
    }
    Ok(())
}

/// The gap, or why this run has none. Errors are those of the database.
async fn gap_of(store: &Store, objects: &Path, work: &GapWork) -> anyhow::Result<MeasuredGap> {
    let bundle = match bundle_of(store, objects, work.run, &work.robot).await {
        Ok(file) => file.bundle,
        Err(error) if error.chain().any(|cause| cause.is::<store::StoreError>()) => return Err(error),
        Err(error) => return Ok(Err(format!("{error:#}"))),
    };
    let document = work.document.clone();
    let computing = tokio::task::spawn_blocking(move || -> MeasuredGap {
        let gap = match document {
            None => end_to_end(&bundle),
            Some(text) => {
                let model =
                    ModelDocument::parse(&text).map_err(|error| format!("the model cannot be read: {error}"))?;
                let clock = RobotClock::of(&model.effects);
                let robot = Robot::with_model(model.robot, &model.effects, model.residual.as_ref())
                    .map_err(|error| format!("the model cannot be simulated: {error}"))?;
                end_to_end_with(&bundle, &robot, clock, ANCHOR_PERIOD_S)
            }
        };
        gap.map(horizons).map_err(|error| error.to_string())
    });
    Ok(computing
        .await
        .unwrap_or_else(|panic| Err(format!("the prediction panicked: {panic}"))))
}

fn horizons(gap: EndToEndGap) -> Vec<HorizonGap> {
    let wire = |gap: identify::gap::HorizonGap| HorizonGap {
        horizon_s: gap.horizon_s,
        position_m: gap.position_m,
        yaw_rad: gap.yaw_rad,
        samples: gap.samples,
    };
    gap.horizons.into_iter().map(wire).collect()
}
