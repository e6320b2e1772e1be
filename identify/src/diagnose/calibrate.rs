//! The nominal model calibrated on references, without a search for effects.

use twin::model_document::ModelDocument;

use super::{DiagnoseError, Run, excited, knob_stages, usable};
use crate::floor::Floor;
use crate::hypothesis::{Hypothesis, candidates, knobs};
use crate::record::Stages;
use crate::workers::Workers;

/// What a diagnosis starts from: the description (or a model) with the knobs of everyday differences turned until the
/// references agree.
///
/// - `references`: runs of one robot with nothing changed.
/// - Errors: no reference, one that gives no window, cancelled.
pub fn calibrated(
    workers: &dyn Workers,
    references: &[Run],
    model: Option<&ModelDocument>,
) -> Result<Hypothesis, DiagnoseError> {
    Ok(calibrated_floor(workers, references, model)?.model)
}

/// The same with everything that is known about its errors.
pub fn calibrated_floor(
    workers: &dyn Workers,
    references: &[Run],
    model: Option<&ModelDocument>,
) -> Result<Floor, DiagnoseError> {
    let first = references.first().ok_or(DiagnoseError::NoRuns)?;
    let given = Hypothesis {
        description: model.map_or_else(|| first.bundle.run.robot.clone(), |model| model.robot.clone()),
        effects: model.map_or_else(Vec::new, |model| model.effects.clone()),
        residual: model.and_then(|model| model.residual.clone()),
    };
    let records = usable(references)?.0;
    let excitation = excited::excitation(&records, &given);
    let candidates = candidates(&given.description, &excitation);
    let knobs = knobs(&candidates, &given.description);
    let stages: Vec<Stages> = knobs.iter().map(|knob| knob_stages(knob, &candidates)).collect();
    Ok(Floor::calibrated(workers, given, knobs, &stages, records)?)
}
