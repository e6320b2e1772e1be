//! Two model versions, or one and the nominal twin, on a stored run: checked here, computed away from the request threads.

use super::error::AppError;
use super::models::{invalid, measured_run};
use crate::access::Principal;
use crate::objects::{ObjectFolder, hex};
use crate::state::AppState;
use api::comparison::{
    ComparedModel, ComparisonMoment, ComparisonRatio, ComparisonRequest, ComparisonRow, ComparisonView, NearerModel,
};
use api::diagnosis::NOMINAL;
use api::model::ModelView;
use api::run::RunView;
use identify::bundle::Bundle;
use identify::compare::{CompareError, Comparison, Nearer, compare as compared};
use identify::hypothesis::Hypothesis;
use sha2::{Digest as _, Sha256};
use std::sync::Arc;
use std::time::Duration;
use store::FileRecord;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;
use twin::model_document::ModelDocument;

const CODE: &str = "invalid_comparison";
/// Longest wait for the comparisons before.
const TURN_LIMIT: Duration = Duration::from_secs(10);
/// Largest files of a run that are read while a person waits: half an hour of an eight-channel robot.
const RUN_BYTES_MOST: i64 = 128 << 20;

/// Compares two models on a run.
pub async fn compare(
    state: &AppState,
    principal: &Principal,
    request: ComparisonRequest,
) -> Result<ComparisonView, AppError> {
    let store = state.store();
    let field = "run".to_owned();
    let run = match measured_run(store, principal, &request.robot, request.run, field).await? {
        Ok(run) => run,
        Err(problem) => return Err(invalid(CODE, "run", problem.message, problem.limit, &problem.remedy)),
    };
    let mut models = Vec::with_capacity(2);
    for (field, wanted) in [("first", &request.first), ("second", &request.second)] {
        models.push(model_of(state, field, wanted, &request.robot).await?);
    }
    let files = store.run_bundle_files(run.id, &request.robot).await?;
    let bytes: i64 = files.iter().map(|file| file.bytes).sum();
    if bytes > RUN_BYTES_MOST {
        let message = format!("the records of this run have {bytes} bytes");
        let limit = format!("at most {RUN_BYTES_MOST} bytes");
        let remedy = "fetch the run and compare on your own machine with `robopheus simulate`";
        return Err(invalid(CODE, "run", message, limit, remedy));
    }
    let turn = turn(state.comparison_gate(), TURN_LIMIT).await?;
    let objects = state.objects().clone();
    let computing = tokio::task::spawn_blocking(move || {
        // The caller may have gone; the next comparison still waits for this one.
        let _turn = turn;
        compute(&objects, &run, &request.robot, &models, &files)
    });
    computing
        .await
        .map_err(|panic| AppError::Internal(format!("the comparison panicked: {panic}")))?
}

/// Waits for a turn to compute, no longer than the limit.
async fn turn(gate: &Arc<Semaphore>, limit: Duration) -> Result<OwnedSemaphorePermit, AppError> {
    match timeout(limit, Arc::clone(gate).acquire_owned()).await {
        Ok(Ok(turn)) => Ok(turn),
        _ => Err(AppError::Conflict {
            code: "comparison_busy",
            detail: "other comparisons are being computed; try again in a few seconds".to_owned(),
        }),
    }
}

/// A model by version or id; none is the nominal twin.
async fn model_of(state: &AppState, field: &str, wanted: &str, robot: &str) -> Result<Option<ModelView>, AppError> {
    if wanted == NOMINAL {
        return Ok(None);
    }
    if let Some(found) = state.store().model_find(wanted).await? {
        return Ok(Some(found));
    }
    let known = state.store().model_list(Some(robot)).await?;
    let names = std::iter::once(NOMINAL.to_owned()).chain(known.into_iter().map(|model| model.version));
    let limit = names.collect::<Vec<_>>().join(", ");
    let message = format!("there is no model {wanted:?}");
    Err(invalid(CODE, field, message, limit, "name one of these"))
}

/// Reads the run and compares. Blocks.
fn compute(
    objects: &ObjectFolder,
    run: &RunView,
    robot: &str,
    models: &[Option<ModelView>],
    files: &[FileRecord],
) -> Result<ComparisonView, AppError> {
    let file = bundles::of_run(format!("run {}", run.id), robot, |name| {
        let file = files.iter().find(|file| file.name == name);
        file.map(|file| bytes_of(objects, file)).transpose()
    });
    let bundle = match file {
        Ok(file) => file.bundle,
        Err(error) => {
            let limit = "runs with readable records of the robot";
            return Err(invalid(CODE, "run", format!("{error:#}"), limit, "take another run"));
        }
    };
    let mut sides = Vec::with_capacity(2);
    for (field, model) in ["first", "second"].into_iter().zip(models) {
        sides.push(side(field, model.as_ref(), &bundle, robot)?);
    }
    let [(first, first_model), (second, second_model)] = sides.as_slice() else {
        return Err(AppError::Internal("two models are compared".to_owned()));
    };
    let found = compared(&bundle, [first_model, second_model]).map_err(|error| match error {
        CompareError::Model(which) => {
            let limit = "models that can be simulated";
            invalid(CODE, which, error.to_string(), limit, "take another version")
        }
        CompareError::Gap(_) => {
            let limit = "runs of some seconds with measured poses and commands";
            invalid(CODE, "run", error.to_string(), limit, "take another run")
        }
    })?;
    Ok(view(run, robot, [first.clone(), second.clone()], &found))
}

fn bytes_of(objects: &ObjectFolder, file: &FileRecord) -> anyhow::Result<Vec<u8>> {
    let bytes = std::fs::read(objects.path_of(&file.object_path)?)?;
    anyhow::ensure!(
        hex(&Sha256::digest(&bytes)) == file.sha256,
        "{} is damaged in the store",
        file.name
    );
    Ok(bytes)
}

/// What is simulated, and how it is shown; refuses models of robots of another kind.
fn side(
    field: &str,
    model: Option<&ModelView>,
    bundle: &Bundle,
    robot: &str,
) -> Result<(ComparedModel, Hypothesis), AppError> {
    let driven = &bundle.run.robot;
    let Some(model) = model else {
        let shown = ComparedModel {
            version: NOMINAL.to_owned(),
            id: None,
            robot: robot.to_owned(),
            floor: bundle.run.floor.clone(),
        };
        return Ok((shown, Hypothesis::nominal(driven)));
    };
    let version = &model.version;
    let document = ModelDocument::parse(&model.document.to_string()).map_err(|error| {
        let message = format!("the model {version} cannot be simulated: {error}");
        invalid(CODE, field, message, "`robopheus.model/1`", "take another version")
    })?;
    let kind = |chassis: &str, wheels: usize| format!("{chassis} with {wheels} wheels");
    let own = kind(&document.robot.chassis, document.robot.wheels.len());
    let of_run = kind(&driven.chassis, driven.wheels.len());
    if own != of_run {
        let message = format!("the model {version} is of another kind of robot, {own}; {robot} is {of_run}");
        let limit = format!("models of the kind {of_run}");
        return Err(invalid(CODE, field, message, limit, "name a version of this robot"));
    }
    let shown = ComparedModel {
        version: version.clone(),
        id: Some(model.id),
        robot: model.robot.clone(),
        floor: model.floor.clone(),
    };
    let hypothesis = Hypothesis {
        description: document.robot,
        effects: document.effects,
        residual: document.residual,
    };
    Ok((shown, hypothesis))
}

fn view(run: &RunView, robot: &str, [first, second]: [ComparedModel; 2], found: &Comparison) -> ComparisonView {
    let names = [&first, &second].map(|model| match model.id {
        Some(_) => model.version.as_str(),
        None => "the nominal twin",
    });
    ComparisonView {
        sentence: found.sentence(names),
        robot: robot.to_owned(),
        run: run.id,
        label: run.label.clone(),
        floor: run.experiment.floor.clone(),
        first,
        second,
        nearer: match found.nearer {
            Nearer::First => NearerModel::First,
            Nearer::Second => NearerModel::Second,
            Nearer::Alike => NearerModel::Alike,
            Nearer::Unknown => NearerModel::Unknown,
        },
        ratio: found.ratio.map(|ratio| ComparisonRatio {
            value: ratio.value,
            low: ratio.low,
            high: ratio.high,
        }),
        rows: found
            .rows
            .iter()
            .map(|row| ComparisonRow {
                channel: row.channel.to_owned(),
                horizon_s: row.horizon_s,
                unit: row.unit.to_owned(),
                first: row.first,
                second: row.second,
                samples: u32::try_from(row.samples).unwrap_or(u32::MAX),
            })
            .collect(),
        course: found
            .course
            .iter()
            .map(|moment| ComparisonMoment {
                time_s: moment.time_s,
                first_m: moment.first_m,
                second_m: moment.second_m,
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn whoever_waits_too_long_for_a_turn_is_told_so_and_gets_one_afterwards() {
        let gate = Arc::new(Semaphore::new(1));
        let short = Duration::from_millis(20);
        let first = turn(&gate, short).await.expect("nobody else computes");
        match turn(&gate, short).await {
            Err(AppError::Conflict { code, detail }) => {
                assert_eq!(code, "comparison_busy");
                assert!(detail.contains("try again"), "{detail}");
            }
            other => panic!("{other:?}"),
        }
        drop(first);
        assert!(turn(&gate, short).await.is_ok());
    }
}
