//! What was named, fitted on all open runs.

use super::beside::{calibrate_small, correct_smoothed, reserve_rests, reserve_wide};
use super::evenness::evenness;
use super::interval::may_be_none;
use super::prepared::{Prepared, prepare};
use super::range_end::reserve_ends;
use super::taken::Taken;
use super::trend::trend;
use super::{Case, DiagnoseError, TINY, loudness};
use crate::fit::{Member, Problem, fit, with_members};
use crate::hypothesis::LOST;
use crate::locate::states;
use crate::record::{Record, Stages};
use crate::screen::all_residuals;
use crate::select::{PLACE, Role, difference, window_energies};
use crate::workers::{Cancelled, Workers, gathered};

/// The final numbers on training and validation runs together.
///
/// - `train`, `validation`: these runs, as they were searched.
pub(super) fn finish(
    workers: &dyn Workers,
    case: &mut Case,
    stages: &[Stages],
    members: Vec<Member>,
    [train, validation]: [&Prepared; 2],
) -> Result<(), DiagnoseError> {
    if members.is_empty() {
        return Ok(());
    }
    workers.progress("final fit", 0.9);
    let mut both = if case.arrived.is_empty() && train.is_of(&case.floor) && validation.is_of(&case.floor) {
        train.joined(workers, validation, &case.floor)?
    } else {
        let pairs = case.records.iter().zip(&case.roles);
        let open = pairs.filter(|(_, role)| **role != Role::Locked);
        prepare(workers, &case.floor, open.map(|pair| pair.0.clone()).collect(), stages)?
    };
    both.doubt(workers, &case.floor, &with_members(&case.floor.model, &members))?;
    let problem = Problem {
        records: &both.records,
        metric: &both.metric,
        bounds: &both.bounds,
        base: &case.floor.model,
        residuals: &both.residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    case.fit = fit(&problem, members);
    if let Some(fit) = &case.fit {
        let left = both
            .metric
            .gram(&[fit.residuals.iter().map(Vec::as_slice).collect()])
            .at(0, 0);
        let noise: f64 = (0..both.records.len()).map(|run| both.metric.expected(run)).sum();
        case.law_rest = (left - noise).max(0.0) / fit.gain.max(1.0);
        case.scatter = fit
            .free
            .iter()
            .map(|(m, a)| ((*m, *a), fit.scatter(&both.metric, *m, *a)))
            .collect();
        let robot = case.floor.model.robot();
        let states: Option<Vec<_>> =
            robot.map(|robot| both.records.iter().map(|record| states(&robot, record)).collect());
        for (position, taken) in case.taken.iter_mut().enumerate().take(fit.members.len()) {
            let mut others = fit.members.clone();
            others.remove(position);
            let model = with_members(&case.floor.model, &others);
            let without: Option<Vec<Vec<f64>>> = all_residuals(workers, &both.records, &model)?.into_iter().collect();
            if let Some(without) = &without {
                let beside = Problem {
                    base: &model,
                    residuals: without,
                    ..problem
                };
                taken.rivals = in_place(workers, &beside, &others, taken)?;
            }
            taken.evenness = without.and_then(|without| {
                let without = both.bounds.keep(&both.metric, &both.records, &both.residuals, without);
                let changes = difference(&without.residuals, &fit.residuals);
                taken.but_best = Some(gain_but_best(&both, &without.residuals, &fit.residuals));
                taken.trend = states
                    .as_ref()
                    .and_then(|states| trend(&both.metric, &both.records, states, &changes, &fit.residuals));
                evenness(&both.metric, &both.records, &changes, &fit.residuals)
            });
        }
        for (taken, member) in case.taken.iter_mut().zip(&fit.members) {
            taken.finalist.member = member.clone();
            taken.finalist.size = member.candidate.size(&member.values);
            // What a model says of losses already is no news whatever its size.
            if member.candidate.entry.name != LOST {
                taken.is_absorbed = taken.finalist.size < TINY;
            }
        }
        for position in 0..fit.members.len() {
            let anywhere = may_be_none(case, position, |even| even.spread);
            let on_average = anywhere && may_be_none(case, position, |even| even.of_mean);
            case.taken[position].may_be_none = anywhere;
            case.taken[position].may_be_none_on_average = on_average;
        }
        calibrate_small(&mut case.taken);
        correct_smoothed(&mut case.taken);
        reserve_rests(&mut case.taken);
        reserve_wide(&mut case.taken);
        reserve_ends(&mut case.taken);
        let after = with_members(&case.floor.model, &fit.members);
        let records: Vec<&Record> = both.records.iter().collect();
        let shares = loudness::shares(&case.input.runs, &records, &case.floor.model, &after);
        if !shares.is_empty() {
            case.located.rank(shares, records.len());
        }
    }
    Ok(())
}

/// Alternatives of a name fitted in its place; none where one of them or the name acts somewhere alone, which no trial would tell.
///
/// - `beside`: all open runs, with what else is named in the model.
/// - `others`: that; what is among it already is no alternative.
fn in_place(
    workers: &dyn Workers,
    beside: &Problem,
    others: &[Member],
    taken: &Taken,
) -> Result<Vec<Member>, Cancelled> {
    let all = || taken.alternatives.iter().chain([&taken.finalist]);
    if all().any(|finalist| finalist.member.candidate.entry.name == PLACE) {
        return Ok(Vec::new());
    }
    let is_there = |member: &Member| others.iter().any(|other| other.candidate.is_same(&member.candidate));
    let open: Vec<&Member> = taken
        .alternatives
        .iter()
        .map(|other| &other.member)
        .filter(|member| !is_there(member))
        .collect();
    let fits = gathered(workers, open.len(), &|k| fit(beside, vec![open[k].clone()]))?;
    Ok(fits.into_iter().flatten().flat_map(|fit| fit.members).collect())
}

/// Gain on all runs but for the window that gains most.
fn gain_but_best(both: &Prepared, before: &[Vec<f64>], after: &[Vec<f64>]) -> f64 {
    let gains = both.records.iter().enumerate().flat_map(|(run, record)| {
        let of = |residuals: &[Vec<f64>]| window_energies(&both.metric, run, record, &residuals[run]);
        let pairs = of(before).into_iter().zip(of(after));
        pairs.map(|(before, after)| before - after).collect::<Vec<f64>>()
    });
    but_best(gains)
}

/// Sum but for the largest; one that is not positive stays.
fn but_best(gains: impl Iterator<Item = f64>) -> f64 {
    let (sum, most) = gains.fold((0.0, 0.0_f64), |(sum, most), gain| (sum + gain, most.max(gain)));
    sum - most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_that_gains_most_is_left_out() {
        assert_eq!(but_best([5.0, 80.0, -2.0].into_iter()), 3.0);
        assert_eq!(but_best([-5.0, -2.0].into_iter()), -7.0);
        assert_eq!(but_best(core::iter::empty()), 0.0);
    }
}
