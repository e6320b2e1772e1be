//! A name that was taken while others were still missing may have stood in for them: its rivals are tried in its place.

use super::Case;
use super::prepared::Prepared;
use super::taken::Taken;
use crate::fit::{Fit, Member, Problem, fit, with_members};
use crate::floor::Metric;
use crate::hypothesis::{Candidate, Hypothesis};
use crate::screen::all_residuals;
use crate::select::{Explained, Finalist, Kept, Round, Side, decrease, energies, in_place, scores_beside, slack_of};
use crate::workers::{Cancelled, Workers, gathered};

/// A rival is tried when it alone gained this share of the winner's gain, and at most so many for each name.
const RIVAL_SHARE: f64 = 0.6;
const MOST_RIVALS: usize = 3;
/// What was refused alone, or never fitted, is tried where it shows beside the other names as much as this share of the name itself, at
/// most so many for each name.
const SHOWS_AS_MUCH: f64 = 0.9;
const MOST_SEEN: usize = 2;

/// Names, and the data that they are held against.
pub(super) struct Exchange<'a> {
    pub workers: &'a dyn Workers,
    pub case: &'a Case<'a>,
    pub problem: &'a Problem<'a>,
    pub train: &'a Prepared,
    /// Windows that candidates are screened on; the training runs when there are few.
    pub coarse: &'a Prepared,
    pub validation: &'a Prepared,
    pub reference_metric: Option<&'a Metric>,
    pub kept: &'a Kept,
}

/// Another effect in the place of a name.
struct Trial {
    place: usize,
    rival: Rival,
}

enum Rival {
    /// It passed by itself when the name was taken.
    Passed(Box<Finalist>),
    /// Position of the candidate, and where its fit begins.
    Seen(usize, Member),
}

impl Rival {
    fn member(&self) -> &Member {
        match self {
            Rival::Passed(finalist) => &finalist.member,
            Rival::Seen(_, member) => member,
        }
    }
}

impl Exchange<'_> {
    /// Tries the rivals of all but the newest effect in its place, all effects fitted anew, and keeps the best exchange that
    /// explains more of the training and of the validation runs. Rivals that explain less by more than the slack of a gain are told
    /// apart. Returns the fit that stands then.
    pub fn best(&self, taken: &mut [Taken], joint: Fit) -> Result<Fit, Cancelled> {
        let slack = slack_of(&self.case.floor);
        let mut trials = passed(taken, &joint.members);
        self.seen(&joint.members, &mut trials)?;
        if trials.is_empty() {
            return Ok(joint);
        }
        let gains = taken.iter().map(|own| slack(own.finalist.weighed));
        let problem = Problem {
            wanted_gain: joint.gain - gains.fold(0.0, f64::max),
            ..*self.problem
        };
        let fits = gathered(self.workers, trials.len(), &|item| {
            let trial = &trials[item];
            let mut members = joint.members.clone();
            members[trial.place] = trial.rival.member().clone();
            fit(&problem, members)
        })?;
        let mut better: Vec<(&Trial, Fit)> = Vec::new();
        for (trial, found) in trials.iter().zip(fits) {
            let Some(found) = found else { continue };
            let own = &mut taken[trial.place];
            let slack = slack(own.finalist.weighed);
            if let (Rival::Passed(rival), true) = (&trial.rival, joint.gain - found.gain > slack) {
                tell_apart(own, rival);
            }
            if found.gain > joint.gain + slack {
                better.push((trial, found));
            }
        }
        better.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
        // Of the newest, which joined others.
        let threshold = taken.last().map_or(f64::INFINITY, |newest| newest.threshold);
        for (trial, found) in better {
            let before = self.energy(&joint.members)?;
            let after = self.energy(&found.members)?;
            if !matches!((before, after), (Some(before), Some(after)) if after < before) {
                continue;
            }
            if let Some(rival) = self.judged(trial, &found, &joint, threshold)? {
                replace(&mut taken[trial.place], &rival);
                return Ok(found);
            }
        }
        Ok(joint)
    }

    /// What shows beside all names but one at least as much as that one does, and is none of the trials yet.
    fn seen(&self, members: &[Member], trials: &mut Vec<Trial>) -> Result<(), Cancelled> {
        let candidates = &self.case.candidates;
        let earlier = members.len().saturating_sub(1);
        for place in 0..earlier {
            // Lost set-points are no candidate.
            let Some(own) = self.position(&members[place].candidate) else {
                continue;
            };
            let others = without(members, place);
            let Some(alone) = self.of_round(&others)? else { continue };
            let round = alone.round(self, &others);
            let scores = scores_beside(self.workers, &round, self.kept)?;
            // Of a large effect slopes say little; what it explains is known.
            let known = self.gain_in_place(&round, members)?;
            let least = SHOWS_AS_MUCH * scores[own].gain.max(known);
            let is_tried = |position: usize| {
                let mut here = trials.iter().filter(|trial| trial.place == place);
                here.any(|trial| is_same(&candidates[position], &trial.rival.member().candidate))
            };
            let mut found: Vec<usize> = (0..scores.len())
                .filter(|position| scores[*position].gain > least && !self.kept.is_left(*position))
                .filter(|position| {
                    !members
                        .iter()
                        .any(|member| is_same(&candidates[*position], &member.candidate))
                })
                .filter(|position| !is_tried(*position))
                .collect();
            found.sort_by(|a, b| scores[*b].gain.total_cmp(&scores[*a].gain).then(a.cmp(b)));
            trials.extend(found.into_iter().take(MOST_SEEN).map(|position| {
                let member = Member {
                    candidate: candidates[position].clone(),
                    values: scores[position].start.clone(),
                };
                Trial {
                    place,
                    rival: Rival::Seen(position, member),
                }
            }));
        }
        Ok(())
    }

    /// What all names gain on the windows that candidates are screened on over those of a round, scaled to all windows.
    fn gain_in_place(&self, without: &Round, members: &[Member]) -> Result<f64, Cancelled> {
        let side = &without.coarse;
        let model = with_members(self.problem.base, members);
        let simulated = all_residuals(self.workers, side.records, &model)?;
        let simulated: Option<Vec<Vec<f64>>> = simulated.into_iter().collect();
        let energy = |residuals: &[Vec<f64>]| {
            let vectors = residuals.iter().map(Vec::as_slice).collect();
            side.metric.gram(&[vectors]).at(0, 0)
        };
        Ok(simulated.map_or(f64::INFINITY, |with| {
            let kept = side.bounds.keep(side.metric, side.records, side.residuals, with);
            (energy(side.residuals) - energy(&kept.residuals)) / without.share()
        }))
    }

    fn position(&self, candidate: &Candidate) -> Option<usize> {
        let mut all = self.case.candidates.iter();
        all.position(|other| is_same(other, candidate))
    }

    /// What takes the place of a name; `None` when it would not have passed a round of the other names.
    ///
    /// - `joint`: with the name in its place.
    /// - `threshold`: of an effect beside others.
    fn judged(&self, trial: &Trial, found: &Fit, joint: &Fit, threshold: f64) -> Result<Option<Finalist>, Cancelled> {
        let position = match &trial.rival {
            Rival::Passed(finalist) => return Ok(Some((**finalist).clone())),
            Rival::Seen(position, _) => *position,
        };
        let Some(own) = self.position(&joint.members[trial.place].candidate) else {
            return Ok(None);
        };
        // The others as they would be without either.
        let Some(others) = fit(self.problem, without(&found.members, trial.place)) else {
            return Ok(None);
        };
        let Some(beside) = self.of_round(&others.members)? else {
            return Ok(None);
        };
        let of = |residuals: &[Vec<f64>]| energies(self.problem.metric, self.problem.records, residuals);
        let round = Round {
            explained: Explained {
                gain: decrease(&of(self.problem.residuals), &of(&beside.train)),
            },
            ..beside.round(self, &others.members)
        };
        let rivals = [(found, position), (joint, own)];
        let mut finalist = in_place(&round, rivals, trial.place, threshold);
        finalist.joint.clear();
        Ok(Some(finalist).filter(|finalist| finalist.because.is_none()))
    }

    fn of_round(&self, members: &[Member]) -> Result<Option<Beside>, Cancelled> {
        let model = with_members(self.problem.base, members);
        let of = |side: &Prepared| -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
            Ok(all_residuals(self.workers, &side.records, &model)?
                .into_iter()
                .collect())
        };
        let is_thinned = !core::ptr::eq(self.train, self.coarse);
        let coarse = if is_thinned { of(self.coarse)? } else { None };
        let sides = (of(self.train)?, of(self.validation)?);
        Ok(match sides {
            (Some(train), Some(validation)) if !is_thinned || coarse.is_some() => Some(Beside {
                model,
                train,
                coarse,
                validation,
            }),
            _ => None,
        })
    }

    fn energy(&self, members: &[Member]) -> Result<Option<f64>, Cancelled> {
        let model = with_members(self.problem.base, members);
        let side = self.validation;
        let simulated = all_residuals(self.workers, &side.records, &model)?;
        let simulated: Option<Vec<Vec<f64>>> = simulated.into_iter().collect();
        Ok(simulated.map(|residuals| {
            let kept = side
                .bounds
                .keep(&side.metric, &side.records, &side.residuals, residuals);
            let vectors = kept.residuals.iter().map(Vec::as_slice).collect();
            side.metric.gram(&[vectors]).at(0, 0)
        }))
    }
}

/// All runs under a model of some names.
struct Beside {
    model: Hypothesis,
    train: Vec<Vec<f64>>,
    /// Of the windows that candidates are screened on, where these are not all.
    coarse: Option<Vec<Vec<f64>>>,
    validation: Vec<Vec<f64>>,
}

impl Beside {
    fn round<'a>(&'a self, about: &'a Exchange, members: &'a [Member]) -> Round<'a> {
        fn of<'a>(side: &'a Prepared, residuals: &'a [Vec<f64>]) -> Side<'a> {
            Side {
                residuals,
                ..side.side()
            }
        }
        let train = || of(about.train, &self.train);
        Round {
            floor: &about.case.floor,
            reference_metric: about.reference_metric,
            train: train(),
            coarse: self
                .coarse
                .as_ref()
                .map_or_else(train, |residuals| of(about.coarse, residuals)),
            validation: of(about.validation, &self.validation),
            model: &self.model,
            candidates: &about.case.candidates,
            members,
            explained: Explained::default(),
            seed: about.case.input.seed,
        }
    }
}

fn without(members: &[Member], place: usize) -> Vec<Member> {
    let others = members.iter().enumerate().filter(|(other, _)| *other != place);
    others.map(|(_, member)| member.clone()).collect()
}

pub(super) fn is_same(a: &Candidate, b: &Candidate) -> bool {
    a.entry.name == b.entry.name && a.index == b.index
}

/// Rivals that passed when the names were taken, best first.
fn passed(taken: &[Taken], members: &[Member]) -> Vec<Trial> {
    let mut trials = Vec::new();
    let earlier = taken.len().saturating_sub(1);
    for (place, own) in taken.iter().enumerate().take(earlier) {
        let mut rivals: Vec<&Finalist> = own
            .alternatives
            .iter()
            .chain(&own.excluded)
            .filter(|rival| {
                rival.because.is_none()
                    && rival.weighed > RIVAL_SHARE * own.finalist.weighed
                    && !members
                        .iter()
                        .any(|member| is_same(&member.candidate, &rival.member.candidate))
            })
            .collect();
        rivals.sort_by(|a, b| b.weighed.total_cmp(&a.weighed).then(a.position.cmp(&b.position)));
        trials.extend(rivals.into_iter().take(MOST_RIVALS).map(|rival| Trial {
            place,
            rival: Rival::Passed(Box::new(rival.clone())),
        }));
    }
    trials
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
    own.is_absorbed = own.finalist.size < super::TINY;
}
