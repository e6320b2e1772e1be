//! A name that was taken while others were still missing may have stood in for them: its rivals are tried in its place.

use super::prepared::Prepared;
use super::taken::Taken;
use crate::fit::{Fit, Member, Problem, fit, with_members};
use crate::floor::Metric;
use crate::hypothesis::Hypothesis;
use crate::screen::all_residuals;
use crate::select::Finalist;
use crate::workers::{Cancelled, Workers, gathered};

/// A rival is tried when it alone gained this share of the winner's gain, and at most so many for each name.
const RIVAL_SHARE: f64 = 0.6;
const MOST_RIVALS: usize = 3;

/// Tries the rivals of all but the newest effect in its place, all effects fitted anew, and keeps the best exchange that
/// explains more of the training and of the validation runs. Rivals that explain less by more than `slack` of a gain are told
/// apart. Returns the fit that stands then.
pub(super) fn exchange(
    workers: &dyn Workers,
    problem: &Problem,
    validation: &Prepared,
    taken: &mut [Taken],
    slack: impl Fn(f64) -> f64,
    joint: Fit,
) -> Result<Fit, Cancelled> {
    let trials = trials(taken, &joint.members);
    if trials.is_empty() {
        return Ok(joint);
    }
    let gains = taken.iter().map(|own| slack(own.finalist.weighed));
    let trial = Problem {
        wanted_gain: joint.gain - gains.fold(0.0, f64::max),
        ..*problem
    };
    let fits = gathered(workers, trials.len(), &|item| {
        let (position, rival) = &trials[item];
        let mut members = joint.members.clone();
        members[*position] = rival.member.clone();
        fit(&trial, members)
    })?;
    let mut best: Option<(usize, Fit)> = None;
    for (item, found) in fits.into_iter().enumerate() {
        let Some(found) = found else { continue };
        let (position, rival) = &trials[item];
        let own = &mut taken[*position];
        if joint.gain - found.gain > slack(own.finalist.weighed) {
            tell_apart(own, rival);
        }
        let least = joint.gain + slack(own.finalist.weighed);
        if found.gain > least && best.as_ref().is_none_or(|(_, other)| found.gain > other.gain) {
            best = Some((item, found));
        }
    }
    let Some((item, found)) = best else { return Ok(joint) };
    let before = energy(workers, validation, problem.base, &joint.members)?;
    let after = energy(workers, validation, problem.base, &found.members)?;
    match (before, after) {
        (Some(before), Some(after)) if after < before => {
            let (position, rival) = &trials[item];
            replace(&mut taken[*position], rival);
            Ok(found)
        }
        _ => Ok(joint),
    }
}

/// Positions and rivals, best first.
fn trials(taken: &[Taken], members: &[Member]) -> Vec<(usize, Finalist)> {
    let mut trials = Vec::new();
    let earlier = taken.len().saturating_sub(1);
    for (position, own) in taken.iter().enumerate().take(earlier) {
        let mut rivals: Vec<&Finalist> = own
            .alternatives
            .iter()
            .chain(&own.excluded)
            .filter(|rival| {
                let is_member = |member: &Member| {
                    member.candidate.entry.name == rival.member.candidate.entry.name
                        && member.candidate.index == rival.member.candidate.index
                };
                rival.because.is_none()
                    && rival.weighed > RIVAL_SHARE * own.finalist.weighed
                    && !members.iter().any(is_member)
            })
            .collect();
        rivals.sort_by(|a, b| b.weighed.total_cmp(&a.weighed).then(a.position.cmp(&b.position)));
        trials.extend(
            rivals
                .into_iter()
                .take(MOST_RIVALS)
                .map(|rival| (position, rival.clone())),
        );
    }
    trials
}

fn energy(
    workers: &dyn Workers,
    side: &Prepared,
    base: &Hypothesis,
    members: &[Member],
) -> Result<Option<f64>, Cancelled> {
    let model = with_members(base, members);
    let simulated: Option<Vec<Vec<f64>>> = all_residuals(workers, &side.records, &model)?.into_iter().collect();
    let metric: &Metric = &side.metric;
    Ok(simulated.map(|residuals| {
        let kept = side.bounds.keep(metric, &side.records, &side.residuals, residuals);
        let vectors = kept.residuals.iter().map(Vec::as_slice).collect();
        metric.gram(&[vectors]).at(0, 0)
    }))
}

/// A rival that could not be told from a name by itself explains less than it among the others.
fn tell_apart(own: &mut Taken, rival: &Finalist) {
    let Some(at) = own
        .alternatives
        .iter()
        .position(|other| other.position == rival.position)
    else {
        return;
    };
    let mut other = own.alternatives.remove(at);
    other.because = Some("together with the other names it explains less".to_owned());
    own.excluded.push(other);
}

/// The rival takes the name; the name that stood there is one that others explain better.
fn replace(own: &mut Taken, rival: &Finalist) {
    let mut stood = core::mem::replace(&mut own.finalist, rival.clone());
    stood.because = Some("others together explain more without it".to_owned());
    let is_rival = |other: &Finalist| other.position == rival.position;
    own.alternatives.retain(|other| !is_rival(other));
    own.excluded.retain(|other| !is_rival(other));
    // What could not be told from the name that went says nothing about the one that came.
    own.excluded.append(&mut own.alternatives);
    own.excluded.push(stood);
    own.tiny = own.finalist.size < super::TINY;
}
