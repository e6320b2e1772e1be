//! What is suspected when nothing passes: an effect that training runs show far beyond chance and the runs kept for checking hardly do, or one that both
//! show, but not at the sizes that the training runs alone give.
//!
//! One pass over a slippery place tells that there is one and little of where it ends; a second pass on another run then contradicts the sizes of the first
//! and not the effect. Fitted to both such an effect explains each of them as far as would be asked of it there alone. That is no proof, for nothing is left
//! that it was not fitted to, and so it is never confirmed; to deny it would be wrong as well.

use super::beyond::beyond;
use super::evidence::own_doubt;
use super::law_rest::energies;
use super::round::{Finalist, Side, Stop, slack_of};
use crate::fit::{Fit, Member, Problem, fit};
use crate::floor::Floor;
use crate::hypothesis::{Candidate, Hypothesis, Kind};
use crate::linear::Square;
use crate::screen::{Change, columns, scores};
use crate::workers::{Cancelled, Workers, gathered};

/// So many of what the training runs show most are fitted to both.
const MOST: usize = 4;
/// A channel may become louder by this share, or by this share of the whole gain.
const LOUDER: f64 = 0.1;
const HARM: f64 = 0.25;

/// Both sides of the data, and what the model has.
pub struct Question<'a> {
    pub floor: &'a Floor,
    pub model: &'a Hypothesis,
    /// Training runs, and after them the runs kept for checking.
    pub both: Side<'a>,
    pub training_runs: usize,
    /// In practical sizes.
    pub least_size: f64,
}

/// An effect that is suspected, and others that explain as much.
pub struct Suspect {
    pub finalist: Finalist,
    pub alternatives: Vec<Finalist>,
}

impl Question<'_> {
    /// Of what a round refused.
    pub fn suspect(&self, workers: &dyn Workers, stop: &Stop) -> Result<Option<Suspect>, Cancelled> {
        let robot = &self.floor.given.description;
        // What the references have some of may be there in any measure: more of it is no news that goes without proof.
        let is_known = |finalist: &Finalist| {
            let name = finalist.member.candidate.entry.name;
            self.floor.absorbed.iter().any(|effect| effect.name == name)
        };
        let is_open = |finalist: &&Finalist| {
            finalist.because.is_some()
                && !is_known(finalist)
                && finalist.gain_train >= stop.threshold
                && finalist.size >= self.least_size
                && own_doubt(robot, finalist, stop.threshold).is_none()
        };
        let mut open: Vec<&Finalist> = stop.finalists.iter().filter(is_open).collect();
        open.sort_by(|a, b| b.gain_train.total_cmp(&a.gain_train).then(a.position.cmp(&b.position)));
        open.truncate(MOST);
        let mut found: Vec<Finalist> = Vec::new();
        for finalist in open {
            if finalist.is_unshown {
                found.extend(stop.is_far_beyond(finalist).then(|| finalist.clone()));
            } else {
                found.extend(self.reconciled(workers, finalist, stop.threshold)?);
            }
        }
        found.sort_by(|a, b| b.gain().total_cmp(&a.gain()).then(a.position.cmp(&b.position)));
        let mut found = found.into_iter();
        let Some(mut finalist) = found.next() else {
            return Ok(None);
        };
        finalist.because = None;
        let slack = slack_of(self.floor)(finalist.gain());
        let is_near = |other: &Finalist| finalist.gain() - other.gain() < slack;
        let alternatives = found.filter(is_near).collect();
        Ok(Some(Suspect { finalist, alternatives }))
    }

    /// Fitted to both sides, if that explains each of them.
    fn reconciled(
        &self,
        workers: &dyn Workers,
        finalist: &Finalist,
        threshold: f64,
    ) -> Result<Option<Finalist>, Cancelled> {
        let candidate = &finalist.member.candidate;
        let mut starts = vec![finalist.member.values.clone()];
        starts.extend(self.starts_of_validation(workers, candidate)?);
        let both = &self.both;
        let problem = Problem {
            records: both.records,
            metric: both.metric,
            bounds: both.bounds,
            base: self.model,
            residuals: both.residuals,
            wanted_gain: 2.0 * threshold,
        };
        let fits = gathered(workers, starts.len(), &|item| {
            let member = Member {
                candidate: candidate.clone(),
                values: starts[item].clone(),
            };
            fit(&problem, vec![member])
        })?;
        let judged = fits.into_iter().flatten().filter_map(|fit| {
            let judged = self.judged(finalist, &fit);
            let is_shown = judged.gain_train >= threshold && judged.gain_validation >= threshold;
            let is_sound = judged.size >= self.least_size
                && own_doubt(&self.floor.given.description, &judged, threshold).is_none();
            (is_shown && is_sound && !self.is_harmful(&fit)).then_some(judged)
        });
        Ok(judged.max_by(|a, b| a.gain().total_cmp(&b.gain())))
    }

    /// Where the runs kept for checking would begin, of an effect whose place or shape slopes do not tell.
    fn starts_of_validation(&self, workers: &dyn Workers, candidate: &Candidate) -> Result<Vec<Vec<f64>>, Cancelled> {
        if candidate.kind != Kind::OneOf || candidate.columns.len() < 2 {
            return Ok(Vec::new());
        }
        let probe = |values: &[f64]| Change {
            hypothesis: self.model.with(candidate.effect(values)),
            stages: candidate.stages,
            step: 1.0,
        };
        let changes: Vec<Change> = candidate.columns.iter().map(|column| probe(&column.values)).collect();
        let runs = self.training_runs..self.both.records.len();
        let (records, residuals) = (&self.both.records[runs.clone()], &self.both.residuals[runs.clone()]);
        let columns = columns(workers, records, residuals, &changes)?;
        let mut gram = Square::zero(1 + columns.len());
        for (position, run) in runs.enumerate() {
            let mut vectors: Vec<&[f64]> = vec![&residuals[position]];
            vectors.extend(columns.iter().map(|column| column[position].as_slice()));
            let own = self.both.metric.gram_of_run(run, &vectors);
            gram.values
                .iter_mut()
                .zip(&own.values)
                .for_each(|(sum, own)| *sum += own);
        }
        let score = scores(core::slice::from_ref(candidate), &gram).swap_remove(0);
        Ok(core::iter::once(score.start).chain(score.more_starts).collect())
    }

    /// The finalist with a fit's sizes and what they gain on either side.
    fn judged(&self, finalist: &Finalist, fit: &Fit) -> Finalist {
        let both = &self.both;
        let beyond = beyond(self.floor, both, &fit.residuals);
        let gain = |run: usize| {
            let energy = |vector: &[f64]| both.metric.gram_of_run(run, &[vector]).at(0, 0);
            energy(&both.residuals[run]) - energy(&fit.residuals[run]) + beyond[run].iter().sum::<f64>()
        };
        let (train, validation): (Vec<usize>, Vec<usize>) =
            (0..both.records.len()).partition(|run| *run < self.training_runs);
        let member = fit.members[0].clone();
        Finalist {
            size: member.candidate.size(&member.values),
            member,
            gain_train: train.into_iter().map(gain).sum(),
            gain_validation: validation.into_iter().map(gain).sum(),
            weighed: fit.gain,
            is_unshown: false,
            ..finalist.clone()
        }
    }

    /// Makes a channel louder than its gain is worth.
    fn is_harmful(&self, fit: &Fit) -> bool {
        let both = &self.both;
        let of = |residuals: &[Vec<f64>]| energies(both.metric, both.records, residuals);
        let pairs = of(both.residuals).into_iter().zip(of(&fit.residuals));
        let mut louder = pairs.map(|(before, after)| (after - before, before));
        louder.any(|(more, before)| more > LOUDER * before && more > HARM * fit.gain)
    }
}
