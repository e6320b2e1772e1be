//! What a search begins with, and when it begins again.

use super::prepared::{Prepared, enough, prepare};
use super::{Case, DiagnoseError, hear, levels, reference_metric};
use crate::floor::{Floor, Metric};
use crate::hypothesis::{Candidate, Column};
use crate::locate::{Located, locate};
use crate::record::{Record, Stages};
use crate::select::{Finalist, Role};
use crate::workers::Workers;

/// Training and validation runs under the floor's model.
pub(super) struct Opening {
    pub train: Prepared,
    pub validation: Prepared,
    /// Windows of the training runs that are enough to screen on, where there are more.
    pub coarse: Option<Prepared>,
    pub reference_metric: Option<Metric>,
}

impl Opening {
    pub fn of(workers: &dyn Workers, case: &mut Case, stages: &[Stages]) -> Result<Opening, DiagnoseError> {
        workers.progress("sensitivities", 0.15);
        let mut train = prepare(workers, &case.floor, case.of_role(Role::Train), stages)?;
        let mut validation = prepare(workers, &case.floor, case.of_role(Role::Validation), stages)?;
        hear(&mut case.floor, &mut train, &mut validation);
        let coarse = train.thinned(&case.floor);
        let reference_metric = reference_metric(&case.floor);
        case.located = locate(&case.floor, &train.records, &train.residuals);
        levels(case, reference_metric.as_ref(), &train, &validation);
        add_places(&mut case.candidates, &case.located);
        Ok(Opening {
            train,
            validation,
            coarse,
            reference_metric,
        })
    }
}

/// Why an effect is not named that one calibration does without.
pub(super) const ALIKE: &str = "one calibration of tyres and floor explains references and runs as well";

/// Tyres and a floor that explain references and runs alike as well as what is about to be named on the floor: then the calibration was wrong, and the runs
/// are those of a healthy robot.
pub(super) fn otherwise_calibrated(
    workers: &dyn Workers,
    case: &Case,
    stages: &[Stages],
    runs: &[Record],
    (finalist, threshold): (&Finalist, f64),
) -> Result<Option<Floor>, DiagnoseError> {
    let values = &finalist.member.values;
    let friction = case.floor.model.description.floor_friction;
    let scale = match finalist.member.candidate.entry.name {
        "floor_friction" => values[0],
        "low_friction_patch" => values[3],
        "lateral_slip" => values[0] / friction,
        _ => return Ok(None),
    };
    if case.taken.iter().any(|taken| !taken.tiny) || !case.arrived.is_empty() {
        return Ok(None);
    }
    let runs = enough(runs.to_vec());
    Ok(case
        .floor
        .common(workers, stages, &runs, (&finalist.effect(), scale), threshold)?)
}

impl Case<'_> {
    /// Runs of a role.
    pub(super) fn of_role(&self, role: Role) -> Vec<Record> {
        let pairs = self.records.iter().zip(&self.roles);
        let own = pairs.filter(|(_, r)| **r == role);
        own.map(|(record, _)| record.clone()).collect()
    }

    /// Forgets what was found under another floor.
    pub(super) fn begin_again(&mut self, floor: Floor) {
        self.floor = floor;
        self.taken.clear();
        self.first_scores.clear();
        self.has_begun_again = true;
    }
}

/// Where the gap is on the floor, as places of a patch.
fn add_places(candidates: &mut [Candidate], located: &Located) {
    let Some(patch) = candidates
        .iter_mut()
        .find(|candidate| candidate.entry.name == "low_friction_patch")
    else {
        return;
    };
    for (x_m, y_m) in located.loud_places() {
        for radius_m in [0.3, 0.5] {
            patch.columns.push(Column {
                values: vec![x_m, y_m, radius_m, 0.4],
                axis: 0,
            });
        }
    }
}
