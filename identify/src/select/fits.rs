//! Fits of the short list.

use super::round::{Fitted, Round, Side, WANTED, slices};
use crate::fit::{Fit, Member, Problem, fit, is_rough};
use crate::screen::{Score, all_residuals};
use crate::workers::{Cancelled, Workers, gathered};
use std::collections::BTreeMap;

/// Starts that are fitted first, and the share of the best gain so far that the others must come near to be fitted to the end; laws with
/// corners, which take long, come last.
const FIRST: usize = 2;
const AGAINST_FIRST: f64 = 0.1;
const AGAINST_OTHERS: f64 = 0.25;
/// Gains on the training runs of two starts that differ by less than this share say nothing about which of them is right.
const ABOUT: f64 = 0.05;
/// The best that are fitted together with what the model has.
const FITTED_TOGETHER: usize = 3;

/// Fits candidates, each by itself.
pub(super) fn fits(
    workers: &dyn Workers,
    data: &Round,
    order: &[usize],
    scores: &[Score],
    threshold: f64,
) -> Result<Vec<Fitted>, Cancelled> {
    let mut starts: Vec<(usize, Vec<f64>)> = Vec::new();
    for candidate in order {
        starts.push((*candidate, scores[*candidate].start.clone()));
        starts.extend(
            scores[*candidate]
                .more_starts
                .iter()
                .map(|start| (*candidate, start.clone())),
        );
    }
    let (rough, mut first): (Vec<_>, Vec<_>) = starts
        .into_iter()
        .partition(|(position, _)| is_rough(&data.candidates[*position]));
    let others = first.split_off(FIRST.min(first.len()));
    let mut all: Vec<Fitted> = Vec::new();
    for (starts, against) in [(first, 0.0), (others, AGAINST_FIRST), (rough, AGAINST_OTHERS)] {
        let most = all.iter().map(|fitted| fitted.fit.gain).fold(0.0, f64::max);
        let least = WANTED * threshold * data.share();
        let problem = Problem {
            records: data.coarse.records,
            metric: data.coarse.metric,
            bounds: data.coarse.bounds,
            base: data.model,
            residuals: data.coarse.residuals,
            wanted_gain: least.max(against * most),
        };
        let results = gathered(workers, starts.len(), &|item| {
            let (position, values) = &starts[item];
            let member = Member {
                candidate: data.candidates[*position].clone(),
                values: values.clone(),
            };
            fit(&problem, vec![member])
        })?;
        let pairs = starts.iter().zip(results);
        all.extend(pairs.filter_map(|((position, _), fit)| {
            let mut fit = fit?;
            // What others explain does not make it vain.
            fit.is_given_up &= problem.wanted_gain > least;
            Some(Fitted::new(fit, *position))
        }));
    }
    let near = near_the_best(all);
    match data.is_thinned() {
        true => evaluated(workers, data, &near, WANTED * threshold),
        false => Ok(near),
    }
}

/// Of every candidate's starts those that led to about as much as its best: which of them is right other data tell.
fn near_the_best(all: Vec<Fitted>) -> Vec<Fitted> {
    let mut best: BTreeMap<usize, f64> = BTreeMap::new();
    for fitted in &all {
        let most = best.entry(fitted.position).or_insert(f64::NEG_INFINITY);
        *most = most.max(fitted.fit.gain);
    }
    let open: Vec<usize> = all
        .iter()
        .filter(|fitted| fitted.fit.is_given_up)
        .map(|fitted| fitted.position)
        .collect();
    let least = |position: usize| best.get(&position).map_or(0.0, |most| most - ABOUT * most.abs());
    all.into_iter()
        .filter(|fitted| fitted.fit.gain >= least(fitted.position))
        .map(|fitted| Fitted {
            is_open: open.contains(&fitted.position),
            ..fitted
        })
        .collect()
}

/// Fits of some windows on all of them; those that promise less than `least` there are left at that, as if they changed nothing.
fn evaluated(workers: &dyn Workers, data: &Round, fitted: &[Fitted], least: f64) -> Result<Vec<Fitted>, Cancelled> {
    let problem = Problem {
        records: data.train.records,
        metric: data.train.metric,
        bounds: data.train.bounds,
        base: data.model,
        residuals: data.train.residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    let fits = gathered(workers, fitted.len(), &|item| {
        let fit = &fitted[item].fit;
        let gain = fit.gain / data.share();
        if gain < least {
            let residuals = data.train.residuals.to_vec();
            return Some(Fit {
                gain,
                residuals,
                ..fit.clone()
            });
        }
        fit.evaluated(&problem)
    })?;
    let pairs = fitted.iter().zip(fits);
    Ok(pairs
        .filter_map(|(fitted, fit)| {
            Some(Fitted {
                is_open: fitted.is_open,
                ..Fitted::new(fit?, fitted.position)
            })
        })
        .collect())
}

/// Fits the best candidates together with what the model has: a member that stood in for the candidate makes room.
pub(super) fn together(workers: &dyn Workers, data: &Round, fitted: &mut [Fitted]) -> Result<(), Cancelled> {
    if data.members.is_empty() {
        return Ok(());
    }
    let mut order = best_of_each(fitted);
    // A law with corners that makes all windows together worse takes long to fit beside others, and seldom comes back.
    order.retain(|item| fitted[*item].fit.gain > 0.0 || !is_rough(&data.candidates[fitted[*item].position]));
    if order.is_empty() {
        return Ok(());
    }
    let Some(residuals) = under_the_floor(workers, data, &data.train)? else {
        return Ok(());
    };
    let problem = Problem {
        records: data.train.records,
        metric: data.train.metric,
        bounds: data.train.bounds,
        base: &data.floor.model,
        residuals: &residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    let coarse = match data.is_thinned() {
        true => under_the_floor(workers, data, &data.coarse)?,
        false => None,
    };
    let energy = |residuals: &[Vec<f64>]| data.train.metric.gram(&[slices(residuals)]).at(0, 0);
    let now = energy(data.train.residuals);
    let results = gathered(workers, order.len(), &|item| {
        let mut members = data.members.to_vec();
        members.push(fitted[order[item]].fit.members[0].clone());
        match &coarse {
            Some(residuals) => {
                let few = Problem {
                    records: data.coarse.records,
                    metric: data.coarse.metric,
                    bounds: data.coarse.bounds,
                    residuals,
                    ..problem
                };
                fit(&few, members)?.evaluated(&problem)
            }
            None => fit(&problem, members),
        }
    })?;
    for (item, result) in order.into_iter().zip(results) {
        let alone = &mut fitted[item];
        alone.is_tried_together = true;
        let Some(mut joint) = result else { continue };
        let gain = now - energy(&joint.residuals);
        if gain > alone.fit.gain {
            alone.joint.clone_from(&joint.members);
            joint = joint.only(data.members.len());
            joint.gain = gain;
            joint.simulations += alone.fit.simulations;
            alone.fit = joint;
            alone.finalist = None;
        }
    }
    Ok(())
}

/// The best fit of each of the candidates that gain most, but for those that have been fitted together with the others.
fn best_of_each(fitted: &[Fitted]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..fitted.len()).collect();
    order.sort_by(|a, b| {
        let (a, b) = (&fitted[*a], &fitted[*b]);
        b.fit.gain.total_cmp(&a.fit.gain).then(a.position.cmp(&b.position))
    });
    let mut seen: Vec<usize> = Vec::new();
    order.retain(|item| {
        let is_new = !seen.contains(&fitted[*item].position);
        seen.push(fitted[*item].position);
        is_new
    });
    order.truncate(FITTED_TOGETHER);
    order.retain(|item| !fitted[*item].is_tried_together);
    order
}

fn under_the_floor(workers: &dyn Workers, data: &Round, side: &Side) -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
    let simulated = all_residuals(workers, side.records, &data.floor.model)?;
    Ok(simulated.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::Square;

    fn fitted(position: usize, gain: f64) -> Fitted {
        let fit = Fit {
            members: Vec::new(),
            gain,
            residuals: Vec::new(),
            covariance: Square::zero(0),
            free: Vec::new(),
            jacobian: Vec::new(),
            simulations: 0,
            is_given_up: false,
        };
        Fitted::new(fit, position)
    }

    #[test]
    fn starts_that_gained_about_as_much_as_the_best_of_their_candidate_stay() {
        let mut given_up = fitted(5, -6.0);
        given_up.fit.is_given_up = true;
        let all = vec![
            given_up,
            fitted(3, 100.0),
            fitted(3, 96.0),
            fitted(3, 94.0),
            fitted(5, 10.0),
            fitted(5, -4.0),
            fitted(7, -8.0),
        ];
        let near = near_the_best(all);
        let kept: Vec<(usize, f64)> = near.iter().map(|one| (one.position, one.fit.gain)).collect();
        assert_eq!(kept, [(3, 100.0), (3, 96.0), (5, 10.0), (7, -8.0)]);
        let open: Vec<bool> = near.iter().map(|one| one.is_open).collect();
        assert_eq!(open, [false, false, true, false], "another start of it was given up");
    }
}
