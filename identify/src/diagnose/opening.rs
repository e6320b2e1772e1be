//! What a search begins with, and when it begins again.

use super::arrived::Answer;
use super::prepared::{Prepared, compared_s, enough, prepare};
use super::{Case, DiagnoseError, TINY, hear, levels};
use crate::fit::Member;
use crate::floor::{Floor, HARDER_AND_CHANGED, Metric, Named};
use crate::hypothesis::{Candidate, Column};
use crate::locate::{Located, locate};
use crate::record::{Record, Stages};
use crate::select::{Finalist, PLACE, Role};
use crate::workers::Workers;
use twin::effect::Effect;

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
        add_places(&mut case.candidates, &case.located, &mut case.places_given);
        Ok(Opening {
            train,
            validation,
            coarse,
            reference_metric,
        })
    }
}

/// Product of the references, where there are some.
pub(super) fn reference_metric(floor: &Floor) -> Option<Metric> {
    (!floor.references.is_empty()).then(|| floor.metric(&floor.references, &floor.sensitivities))
}

/// Why an effect is not named that one calibration does without.
pub(super) const ALIKE: &str = "one calibration of tyres and floor explains references and runs as well";

/// Tyres and a floor that explain references and runs alike as well as what is about to be named on the floor: then the calibration was wrong, and the floor is that
/// of a healthy robot.
///
/// - `members`: all that is named so far.
pub(super) fn otherwise_calibrated(
    workers: &dyn Workers,
    case: &Case,
    stages: &[Stages],
    runs: &[Record],
    members: &[Member],
    (finalist, threshold): (&Finalist, f64),
) -> Result<Option<Floor>, DiagnoseError> {
    let without = effects(members);
    let with = match &finalist.joint[..] {
        [] => [&without[..], &[finalist.effect()]].concat(),
        joint => effects(joint),
    };
    asked(
        workers,
        case,
        stages,
        runs,
        &finalist.member,
        [&with, &without],
        threshold,
    )
}

/// The same of names on the floor that others were named after: what was better than one calibration without these need not be with them. The first such name.
pub(super) fn otherwise_calibrated_beside(
    workers: &dyn Workers,
    case: &Case,
    stages: &[Stages],
    runs: &[Record],
    members: &[Member],
) -> Result<Option<(&'static str, Floor)>, DiagnoseError> {
    if case.has_begun_again || members.len() != case.taken.len() {
        return Ok(None);
    }
    for (position, (member, taken)) in members.iter().zip(&case.taken).enumerate() {
        let is_tiny = |member: &Member| member.candidate.size(&member.values) < TINY;
        if is_tiny(member) || members[position + 1..].iter().all(is_tiny) {
            continue;
        }
        let mut others = members.to_vec();
        others.remove(position);
        let lists = [&effects(members)[..], &effects(&others)];
        if let Some(floor) = asked(workers, case, stages, runs, member, lists, taken.threshold)? {
            return Ok(Some((member.candidate.entry.name, floor)));
        }
    }
    Ok(None)
}

fn effects(members: &[Member]) -> Vec<Effect> {
    let of = |member: &Member| member.candidate.effect(&member.values);
    members.iter().map(of).collect()
}

/// - `member`: what is asked about; `None` for what does not act on the floor.
/// - `[with, without]`: all effects of the runs with it, and without.
fn asked(
    workers: &dyn Workers,
    case: &Case,
    stages: &[Stages],
    runs: &[Record],
    member: &Member,
    [with, without]: [&[Effect]; 2],
    threshold: f64,
) -> Result<Option<Floor>, DiagnoseError> {
    let values = &member.values;
    let friction = case.floor.model.description.floor_friction;
    let name = member.candidate.entry.name;
    let scale = match name {
        "floor_friction" => values[0],
        PLACE => values[3],
        "lateral_slip" => values[0] / friction,
        _ => return Ok(None),
    };
    if !case.arrived.is_empty() {
        return Ok(None);
    }
    // A place is met by few windows: none of them is left out.
    let few = match name {
        PLACE => runs.to_vec(),
        _ => enough(runs.to_vec()),
    };
    let seconds =
        |records: &[Record]| -> f64 { records.iter().flat_map(|record| &record.windows).map(compared_s).sum() };
    let least = threshold * seconds(&few) / seconds(runs).max(1e-9);
    let named = Named { with, without, scale };
    Ok(case.floor.alike(workers, stages, &few, named, least)?)
}

impl Case<'_> {
    /// Runs of a role.
    pub(super) fn of_role(&self, role: Role) -> Vec<Record> {
        let pairs = self.records.iter().zip(&self.roles);
        let own = pairs.filter(|(_, r)| **r == role);
        own.map(|(record, _)| record.clone()).collect()
    }

    /// Names that one calibration does without.
    pub(super) fn deny(&mut self, names: &[&'static str]) {
        self.withdrawn
            .extend(names.iter().map(|name| (*name, ALIKE.to_owned())));
    }

    /// Forgets what was found under another floor, and says so.
    ///
    /// - `name`: what the other floor does without.
    pub(super) fn begin_again(&mut self, name: &str, floor: Floor) {
        let stale = self.floor.tyres();
        self.remarks
            .retain(|remark| Some(remark) != stale.as_ref() && remark != HARDER_AND_CHANGED);
        self.withdrawn.retain(|pair| pair.1 != ALIKE);
        self.remarks.push(format!(
            "{name}: {ALIKE}, which the references alone had left open; they were calibrated anew, and references that are driven like the runs would show weaker effects"
        ));
        self.remarks.extend(floor.tyres());
        self.floor = floor;
        self.taken.clear();
        self.first_scores.clear();
        self.lost = Answer::NotAsked;
        self.has_begun_again = true;
    }
}

/// Where the gap is on the floor, as places of a patch.
///
/// - `given`: how many places there were without.
fn add_places(candidates: &mut [Candidate], located: &Located, given: &mut Option<usize>) {
    let Some(patch) = candidates.iter_mut().find(|candidate| candidate.entry.name == PLACE) else {
        return;
    };
    patch.columns.truncate(*given.get_or_insert(patch.columns.len()));
    for (x_m, y_m) in located.loud_places() {
        for radius_m in [0.3, 0.5] {
            patch.columns.push(Column {
                values: vec![x_m, y_m, radius_m, 0.4],
                axis: 0,
            });
        }
    }
}
