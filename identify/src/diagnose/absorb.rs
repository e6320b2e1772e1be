//! What the references have of an effect is no difference to them: it goes into the floor's model.

use crate::fit::{Bounds, Fit, Problem, fit, with_members};
use crate::floor::{Floor, Metric};
use crate::hypothesis::Knob;
use crate::record::{Record, Stages, residuals};
use crate::select::{Finalist, Stop};

/// An effect is in the references when it gains this much there, and a run this part of what it gains in the runs.
const SEEN: f64 = 6.6;
const BACKGROUND: f64 = 0.35;
/// Share of its size in the runs that it has in the references at least.
const ALIKE: f64 = 0.4;
/// An accepted effect of which the references have less than this part is not looked for in them.
const PERHAPS_SEEN: f64 = 0.1;

/// Part of an effect that the references have, up to all of it; none where that is too little to be told.
pub(super) fn part_before(finalist: &Finalist) -> f64 {
    let part = finalist.in_references;
    if part > PERHAPS_SEEN { part.min(1.0) } else { 0.0 }
}

/// Takes into the floor's model what the references have of the accepted effect, or, when none is accepted, the best of what they have as well.
pub(super) fn absorb_one(floor: &mut Floor, metric: &Metric, stop: &Stop, runs: &[Record]) -> bool {
    let is_there = |(position, finalist): &(usize, &Finalist)| match stop.accepted {
        Some(accepted) => *position == accepted && finalist.in_references > PERHAPS_SEEN,
        None => finalist.is_background(),
    };
    let there = stop.finalists.iter().enumerate().filter(is_there);
    let quick = there
        .map(|(_, finalist)| finalist)
        .filter(|finalist| !finalist.is_slow());
    let mut found_alone: Option<Fit> = None;
    for finalist in quick {
        let Some(fit) = there_as_well(floor, metric, finalist) else {
            continue;
        };
        // For as much of each as is trusted.
        let there = fit.gain / trusted(&floor.references);
        let here = finalist.weighed / trusted(runs);
        if there >= BACKGROUND * here {
            if absorb(floor, &fit) {
                return true;
            }
        } else if fit.gain >= stop.threshold && found_alone.is_none() {
            found_alone = Some(fit);
        }
    }
    // What would be found in the references alone is there, however much more evidence of it the runs have.
    let found_alone = found_alone.filter(|_| stop.accepted.is_none());
    found_alone.is_some_and(|fit| absorb(floor, &fit))
}

/// An effect fitted to the references from where the runs have it, if it is there in like size.
fn there_as_well(floor: &Floor, metric: &Metric, finalist: &Finalist) -> Option<Fit> {
    // The calibration of the references had its say on what is a knob of its own.
    let candidate = &finalist.member.candidate;
    let is_knob = |knob: &Knob| candidate.axes.iter().any(|axis| knob.is(candidate, axis.name));
    if floor.knobs.iter().any(is_knob) {
        return None;
    }
    let problem = Problem {
        records: &floor.references,
        metric,
        bounds: &Bounds::of(floor, &floor.references),
        base: &floor.model,
        residuals: &floor.residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    let fit = fit(&problem, vec![finalist.member.clone()])?;
    let member = &fit.members[0];
    let size = member.candidate.size(&member.values);
    let is_alike = !size.is_finite() || size > ALIKE * finalist.size;
    (fit.gain >= SEEN && is_alike).then_some(fit)
}

/// Takes an effect into the floor's model.
fn absorb(floor: &mut Floor, fit: &Fit) -> bool {
    let member = &fit.members[0];
    let effect = member.candidate.effect(&member.values);
    // What is left of the references counts whole, not as far as a fit believes it.
    let model = with_members(&floor.model, &fit.members);
    let left: Option<Vec<Vec<f64>>> = floor
        .references
        .iter()
        .map(|record| residuals(record, &model, Stages::BOTH, None))
        .collect();
    let Some(left) = left else { return false };
    floor.absorb(vec![effect], left);
    true
}

/// So many runs with all of their windows are worth what is trusted of some.
fn trusted(records: &[Record]) -> f64 {
    let of = |record: &Record| {
        let trust: f64 = record.windows.iter().map(|window| window.trust).sum();
        trust / record.windows.len().max(1) as f64
    };
    records.iter().map(of).sum::<f64>().max(1e-9)
}
