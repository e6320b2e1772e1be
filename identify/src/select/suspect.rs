//! What is suspected when nothing passes: an effect that training runs show far beyond chance and the runs kept for checking hardly do, or one that both
//! sides show, but not at the sizes that the training runs alone give.
//!
//! One pass over a slippery place tells that there is one and little of where it ends; a second pass on another run then contradicts the sizes of the first
//! and not the effect. Fitted to both sides such an effect explains each of them as far as would be asked of it there alone. That is no proof, for nothing is
//! left that it was not fitted to, and so it is never confirmed; to deny it would be wrong as well.

use super::beyond::{beyond, sum};
use super::evidence::{HARM, WORSE, amplitude_in_references, own_doubt, window_energies};
use super::finalist::Finalist;
use super::in_turn::HARDLY;
use super::law_rest::energies;
use super::round::{Side, Stop, VALIDATION_GAIN, probes, slack_of, slices};
use crate::fit::{EDGE_SHARE, Fit, Member, Problem, fit, larger_patches, with_members};
use crate::floor::{Floor, Metric};
use crate::hypothesis::{Candidate, Hypothesis, Kind};
use crate::record::{Record, residuals_with};
use crate::screen::{columns, scores};
use crate::workers::{Cancelled, Workers, gathered};

/// A place on the floor fits whatever happens once: it has to be met by two runs.
pub const PLACE: &str = "low_friction_patch";
/// So many of what the training runs show most are fitted to both sides.
const MOST: usize = 4;

/// Both sides of the data, and what the model has.
pub struct Question<'a> {
    pub floor: &'a Floor,
    pub reference_metric: &'a Metric,
    pub model: &'a Hypothesis,
    pub candidates: &'a [Candidate],
    /// What the model has beyond the floor's.
    pub members: &'a [Member],
    pub train: Side<'a>,
    pub validation: Side<'a>,
    /// Windows of both that are fitted to; all of them when there are few.
    pub fitted: Side<'a>,
    /// In practical sizes.
    pub least_size: f64,
    pub seed: u64,
}

/// An effect that is suspected, others that explain as much, and why it is no more than that.
pub struct Suspect {
    pub finalist: Finalist,
    pub alternatives: Vec<Finalist>,
    pub because: String,
    /// The training runs do not show it by themselves as far as is asked.
    pub is_shown_together: bool,
}

impl Question<'_> {
    /// Of what a round refused.
    ///
    /// - `denied`: names that are none.
    pub fn suspect(&self, workers: &dyn Workers, stop: &Stop, denied: &[&str]) -> Result<Option<Suspect>, Cancelled> {
        let is_open = |finalist: &&Finalist| {
            // What the references have some of may be there in any measure: more of it is no news that goes without proof.
            finalist.gain_train >= stop.threshold
                && !denied.contains(&finalist.member.candidate.entry.name)
                && !self.floor.has_absorbed(finalist.member.candidate.entry.name)
                && self.is_sound(finalist, stop.threshold)
        };
        let mut open: Vec<&Finalist> = stop.finalists.iter().filter(is_open).collect();
        open.sort_by(|a, b| b.gain_train.total_cmp(&a.gain_train).then(a.position.cmp(&b.position)));
        open.truncate(MOST);
        let mut found: Vec<Finalist> = Vec::new();
        for finalist in open {
            if finalist.is_unshown {
                let is_suspect = stop.is_far_beyond(finalist) && self.is_unopposed(finalist);
                found.extend(is_suspect.then(|| finalist.clone()));
            } else {
                found.extend(self.reconciled(workers, finalist, stop.threshold)?);
            }
        }
        found.retain(|finalist| finalist.member.candidate.entry.name != PLACE || self.is_met_again(finalist));
        found.sort_by(Finalist::by_sides);
        let mut found = found.into_iter();
        let Some(mut finalist) = found.next() else {
            return Ok(None);
        };
        let because = finalist.because.take();
        let alternatives = found.filter(self.is_near(&finalist)).collect();
        Ok(Some(Suspect {
            finalist,
            alternatives,
            because: because.unwrap_or_else(|| "others explain more in too many half-splits".to_owned()),
            is_shown_together: false,
        }))
    }

    /// Gains do not tell another from it.
    pub(super) fn is_near(&self, finalist: &Finalist) -> impl Fn(&Finalist) -> bool + use<> {
        let gain = finalist.gain();
        let slack = slack_of(self.floor)(gain);
        move |other| gain - other.gain() < slack
    }

    pub(super) fn is_sound(&self, finalist: &Finalist, threshold: f64) -> bool {
        finalist.size >= self.least_size && own_doubt(&self.floor.given.description, finalist, threshold).is_none()
    }

    /// The validation runs say no more against it than chance may.
    fn is_unopposed(&self, finalist: &Finalist) -> bool {
        finalist.gain_validation > -VALIDATION_GAIN * self.floor.inflation()
    }

    /// Two runs or more show it, each more than a small part of what the first of them does.
    pub(super) fn is_met_again(&self, finalist: &Finalist) -> bool {
        let mut gains: Vec<f64> = self
            .gains(finalist)
            .iter()
            .map(|windows| windows.iter().sum())
            .collect();
        gains.sort_by(|a, b| b.total_cmp(a));
        let chance = VALIDATION_GAIN * self.floor.inflation();
        gains.len() > 1 && gains[1] >= (HARDLY * gains[0]).max(chance)
    }

    /// What it explains of every window of every open run.
    pub(super) fn gains(&self, finalist: &Finalist) -> Vec<Vec<f64>> {
        let model = with_members(self.model, core::slice::from_ref(&finalist.member));
        let stages = finalist.member.candidate.stages;
        let gains = |side: &Side| -> Vec<Vec<f64>> {
            let pairs = side.records.iter().zip(side.residuals);
            let changed = pairs
                .map(|(record, base)| residuals_with(record, &model, 1, stages, base).unwrap_or_else(|| base.clone()));
            let kept = side
                .bounds
                .keep(side.metric, side.records, side.residuals, changed.collect());
            let of = |run: usize, vector: &[f64]| window_energies(side.metric, run, &side.records[run], vector);
            let runs = 0..side.records.len();
            runs.map(|run| {
                let pairs = of(run, &side.residuals[run])
                    .into_iter()
                    .zip(of(run, &kept.residuals[run]));
                pairs.map(|(before, after)| before - after).collect()
            })
            .collect()
        };
        [gains(&self.train), gains(&self.validation)].concat()
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
        let as_found = starts.len();
        if candidate.entry.name == PLACE {
            // The training runs may have met one side of it alone; the others were elsewhere.
            let positions = self.train.records.iter().flat_map(Record::positions_m);
            starts.extend(larger_patches(&finalist.member.values, positions, self.model.reach_m()));
        }
        let mut shown = self.shown(workers, finalist, &starts, threshold)?;
        // Windows that err by much count little: where training runs have twice of what the others have, a fit that begins at theirs may stay there.
        if candidate.entry.name != PLACE && shown.iter().all(Option::is_none) {
            let halved = candidate.halved(&finalist.member.values);
            if halved != finalist.member.values {
                shown = self.shown(workers, finalist, &[halved], threshold)?;
            }
        }
        let larger = shown.split_off(as_found.min(shown.len()));
        let mut best = shown.into_iter().flatten().max_by(|a, b| a.gain().total_cmp(&b.gain()));
        for patch in larger.into_iter().flatten() {
            let is_better = |best: &Finalist| patch.gain() > (1.0 + EDGE_SHARE) * best.gain();
            if best.as_ref().is_none_or(is_better) {
                best = Some(patch);
            }
        }
        Ok(best)
    }

    /// Fits to both sides from `starts`, where they explain each of them.
    fn shown(
        &self,
        workers: &dyn Workers,
        finalist: &Finalist,
        starts: &[Vec<f64>],
        threshold: f64,
    ) -> Result<Vec<Option<Finalist>>, Cancelled> {
        let problem = self.problem(2.0 * threshold);
        let judged = gathered(workers, starts.len(), &|item| {
            let member = Member {
                candidate: finalist.member.candidate.clone(),
                values: starts[item].clone(),
            };
            self.judged(finalist, &fit(&problem, vec![member])?)
        })?;
        let is_shown = |judged: &Finalist| {
            judged.gain_train >= threshold && judged.gain_validation >= threshold && self.is_sound(judged, threshold)
        };
        Ok(judged.into_iter().map(|judged| judged.filter(is_shown)).collect())
    }

    /// To be fitted to both sides.
    ///
    /// - `wanted_gain`: on all of their windows; fits that cannot come near it are not finished.
    pub(super) fn problem(&self, wanted_gain: f64) -> Problem<'_> {
        let few = &self.fitted;
        Problem {
            records: few.records,
            metric: few.metric,
            bounds: few.bounds,
            base: self.model,
            residuals: few.residuals,
            wanted_gain: wanted_gain * self.share(),
        }
    }

    /// Windows that are fitted to, as a share of all.
    pub(super) fn share(&self) -> f64 {
        let count = |side: &Side| side.residuals.iter().map(Vec::len).sum::<usize>() as f64;
        count(&self.fitted) / (count(&self.train) + count(&self.validation)).max(1.0)
    }

    /// Where the runs kept for checking would begin, of an effect whose place or shape slopes do not tell.
    fn starts_of_validation(&self, workers: &dyn Workers, candidate: &Candidate) -> Result<Vec<Vec<f64>>, Cancelled> {
        if candidate.kind != Kind::OneOf || candidate.columns.len() < 2 {
            return Ok(Vec::new());
        }
        let changes = probes(self.model, core::slice::from_ref(candidate));
        let side = &self.validation;
        let columns = columns(workers, side.records, side.residuals, &changes)?;
        let mut vectors: Vec<Vec<&[f64]>> = vec![slices(side.residuals)];
        vectors.extend(columns.iter().map(|column| slices(column)));
        let scores = scores(core::slice::from_ref(candidate), &side.metric.gram(&vectors));
        let starts = scores
            .into_iter()
            .flat_map(|score| core::iter::once(score.start).chain(score.more_starts));
        Ok(starts.collect())
    }

    /// The finalist with the sizes of a fit and what they gain on either side; `None` when they cannot be simulated or make a channel louder.
    pub(super) fn judged(&self, finalist: &Finalist, fit: &Fit) -> Option<Finalist> {
        let member = fit.members.first()?.clone();
        let model = with_members(self.model, core::slice::from_ref(&member));
        let stages = member.candidate.stages;
        let gain = |side: &Side| -> Option<f64> {
            let pairs = side.records.iter().zip(side.residuals);
            let changed: Option<Vec<Vec<f64>>> = pairs
                .map(|(record, base)| residuals_with(record, &model, 1, stages, base))
                .collect();
            let kept = side.bounds.keep(side.metric, side.records, side.residuals, changed?);
            let gram = side.metric.gram(&[slices(side.residuals), slices(&kept.residuals)]);
            let weighed = gram.at(0, 0) - gram.at(1, 1);
            let of = |residuals: &[Vec<f64>]| energies(side.metric, side.records, residuals);
            let mut pairs = of(side.residuals).into_iter().zip(of(&kept.residuals));
            let is_harmful = pairs.any(|(before, after)| {
                let more = after - before;
                more > WORSE * before && more > HARM * weighed
            });
            (!is_harmful).then(|| weighed + sum(&beyond(self.floor, side, &kept.residuals)))
        };
        let there = with_members(&self.floor.model, core::slice::from_ref(&member));
        let amplitude = amplitude_in_references(self.floor, self.reference_metric, &there, stages);
        Some(Finalist {
            size: member.candidate.size(&member.values),
            sure_size: fit.sure_size(0),
            gain_train: gain(&self.train)?,
            gain_validation: gain(&self.validation)?,
            in_references: amplitude.unwrap_or(0.0),
            is_shown_by_references: amplitude.is_some(),
            is_unshown: false,
            joint: Vec::new(),
            member,
            ..finalist.clone()
        })
    }
}
