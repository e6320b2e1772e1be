//! One round: screen, fit the short list, judge on validation runs, keep at most one effect.

use super::evidence::{judge, stability};
use super::finalist::Finalist;
use super::fits::{fits, together};
use super::kept::{Kept, remembered_of};
use super::law_rest::{Explained, decrease, energies, expected};
use super::lists::{further_list, short_list};
use super::loud_starts::add_loud_starts;
use super::survey::{begin_at, candidate_of_patches, survey};
use crate::fit::{Bounds, Fit, Member};
use crate::floor::{Floor, Metric};
use crate::hypothesis::{Candidate, Hypothesis};
use crate::record::Record;
use crate::screen::{Change, Score, columns, scores, thresholds};
use crate::workers::{Cancelled, Workers, gathered};

/// So many lists of candidates are fitted, while none of the first passes and nothing is named yet.
const LISTS: usize = 3;
/// So many are fitted when none is above the threshold.
const WEAK_FITTED: usize = 3;
/// Fits that cannot reach this share of the threshold are not finished.
pub(super) const WANTED: f64 = 0.5;
/// Share of the threshold below which old sensitivities are enough to stop.
const NOTHING_LEFT: f64 = 0.7;
/// Share of null replicates below the threshold.
const LEVEL: f64 = 0.995;
/// Decrease on validation runs that chance does not give, for one candidate (chi^2 of one, 99 %).
pub(super) const VALIDATION_GAIN: f64 = 6.6;
/// A winner that is the best in a smaller share of half-splits has rivals: those that are the best in this share of them.
const STABLE: f64 = 0.8;
const RIVAL: f64 = 0.2;
/// A winner without rivals that pass needs this share of them.
pub(super) const MAJORITY: f64 = 0.5;
/// Cosine from which two effects are one to these runs.
const SAME: f64 = 0.95;
/// Difference of gains, as a share, that the laws' own inaccuracy makes.
pub(super) const LAW_SHARE: f64 = 0.02;
/// Gain over the threshold of what nobody would call chance.
pub(super) const FAR_BEYOND: f64 = 3.0;
/// An effect beside others needs this many thresholds: what their laws leave passes a threshold that knows chance alone. Of the part that
/// these cannot have left one is enough. Without references several are expected.
const BESIDE_OTHERS: f64 = 1.5;

/// Training and validation side of the data.
pub struct Side<'a> {
    pub records: &'a [Record],
    pub metric: &'a Metric,
    pub bounds: &'a Bounds,
    /// The product in which loud windows count like all others; `None` where they do anyway.
    pub whole: Option<&'a Metric>,
    /// Residuals under the model of the round.
    pub residuals: &'a [Vec<f64>],
}

/// What a round knows.
pub struct Round<'a> {
    pub floor: &'a Floor,
    pub reference_metric: Option<&'a Metric>,
    pub train: Side<'a>,
    /// Windows of the training runs that candidates are screened and first fitted on; all of them when there are few.
    pub coarse: Side<'a>,
    pub validation: Side<'a>,
    pub model: &'a Hypothesis,
    pub candidates: &'a [Candidate],
    /// What the model has beyond the floor's.
    pub members: &'a [Member],
    /// What is already in the model explains so much of the training runs.
    pub explained: Explained,
    pub seed: u64,
}

impl Round<'_> {
    pub(super) fn is_thinned(&self) -> bool {
        !core::ptr::eq(self.train.records, self.coarse.records)
    }

    /// Thresholds that a candidate needs.
    pub(super) fn thresholds_asked(&self) -> f64 {
        let is_alone = self.members.is_empty() || self.floor.references.is_empty();
        if is_alone { 1.0 } else { BESIDE_OTHERS }
    }

    /// Part of a fitted candidate's gain on the training runs that cannot be what the laws of the named effects leave.
    pub(super) fn own_part(&self, fitted: &Fitted) -> f64 {
        let metric = self.train.metric;
        let before = energies(metric, self.train.records, self.train.residuals);
        let after = energies(metric, self.train.records, &fitted.fit.residuals);
        let members = self.members.iter().map(|member| member.candidate.entry.name);
        let candidate = self.candidates[fitted.position].entry.name;
        let left = decrease(&before, &expected(metric));
        self.explained
            .own_part(&decrease(&before, &after), &left, candidate, members)
    }

    /// Residuals of the windows that candidates are screened on, as a share of all.
    pub fn share(&self) -> f64 {
        let count = |side: &Side| side.residuals.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        count(&self.coarse) / count(&self.train)
    }
}

/// How a round ended.
pub struct Stop {
    pub scores: Vec<Score>,
    pub threshold: f64,
    /// By gain; accepted first when there is one.
    pub finalists: Vec<Finalist>,
    /// Position in `finalists`.
    pub accepted: Option<usize>,
    /// Positions of those that the data cannot tell from the accepted one.
    pub alternatives: Vec<usize>,
    /// Columns' products with the residual of the training runs.
    pub simulations: usize,
}

impl Stop {
    /// The training runs show it far beyond chance.
    pub fn is_far_beyond(&self, finalist: &Finalist) -> bool {
        finalist.gain_train > FAR_BEYOND * self.threshold
    }

    /// What training runs show far beyond chance and the runs kept for checking hardly do.
    ///
    /// - `least_size`: in practical sizes.
    pub fn unchecked(&self, least_size: f64) -> Option<&Finalist> {
        let is_unchecked = |finalist: &&Finalist| {
            finalist.because.is_some()
                && !finalist.is_background()
                && self.is_far_beyond(finalist)
                && finalist.is_unshown
                && finalist.size >= least_size
        };
        let found = self.finalists.iter().filter(is_unchecked);
        found.max_by(|a, b| a.gain_train.total_cmp(&b.gain_train))
    }
}

#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub fit: Fit,
    pub position: usize,
    pub joint: Vec<Member>,
    /// It was fitted together with what the model has.
    pub is_tried_together: bool,
    /// A start of the same candidate was given up: another round may have to finish it.
    pub is_open: bool,
    /// What was judged of it.
    pub finalist: Option<Finalist>,
}

impl Fitted {
    pub(super) fn new(fit: Fit, position: usize) -> Fitted {
        Fitted {
            fit,
            position,
            joint: Vec::new(),
            is_tried_together: false,
            is_open: false,
            finalist: None,
        }
    }

    /// Neither it nor another start of its candidate was given up.
    pub(super) fn is_finished(&self) -> bool {
        !self.fit.is_given_up && !self.is_open
    }
}

/// Runs a round.
pub fn round(workers: &dyn Workers, data: &Round, kept: &mut Kept) -> Result<Stop, Cancelled> {
    let mut gram = None;
    if !kept.columns.is_empty() {
        let old = products(data, data.coarse.metric, &kept.columns);
        let most = scores(data.candidates, &old)
            .iter()
            .map(|score| score.gain)
            .fold(0.0, f64::max);
        let threshold = thresholds(data.candidates, &old, LEVEL, data.seed) * data.floor.inflation();
        if kept.is_fresh || most < NOTHING_LEFT * threshold {
            gram = Some(old);
        }
    }
    let gram = match gram {
        Some(gram) => gram,
        None => {
            kept.columns = sensitivities(workers, data)?;
            kept.is_fresh = true;
            products(data, data.coarse.metric, &kept.columns)
        }
    };
    let mut scores = scores(data.candidates, &gram);
    let threshold = thresholds(data.candidates, &gram, LEVEL, data.seed) * data.floor.inflation();
    // What the model has already is fitted anew with what joins it.
    let is_member = |candidate: &Candidate| {
        let own = |member: &Member| {
            member.candidate.entry.name == candidate.entry.name && member.candidate.index == candidate.index
        };
        data.members.iter().any(own)
    };
    let weak = weak_bar(data, data.thresholds_asked() * threshold);
    let mut order: Vec<usize> = (0..data.candidates.len())
        .filter(|c| scores[*c].gain > weak && !is_member(&data.candidates[*c]))
        .filter(|c| !kept.is_vain(*c, scores[*c].gain))
        .collect();
    order.sort_by(|a, b| scores[*b].gain.total_cmp(&scores[*a].gain).then(a.cmp(b)));
    let mut list = short_list(data.candidates, &order, &scores);
    if list.first().is_some_and(|best| scores[*best].gain <= threshold) {
        list.truncate(WEAK_FITTED);
    }
    let may_join = |position: usize| {
        scores[position].gain > weak
            && !is_member(&data.candidates[position])
            && !kept.is_vain(position, scores[position].gain)
    };
    let joining: Vec<bool> = (0..data.candidates.len()).map(may_join).collect();
    if !list.is_empty() {
        add_loud_starts(data, &kept.columns, &mut scores, &mut list, |position| {
            joining[position]
        });
    }
    let mut stop = Stop {
        scores,
        threshold,
        finalists: Vec::new(),
        accepted: None,
        alternatives: Vec::new(),
        simulations: 0,
    };
    let is_alone = data.thresholds_asked() == 1.0;
    let threshold = data.thresholds_asked() * threshold;
    let patch = candidate_of_patches(data.candidates).filter(|patch| !is_member(&data.candidates[*patch]));
    let mut fitted: Vec<Fitted> = Vec::new();
    let mut remembered = core::mem::take(&mut kept.fitted);
    for lists_left in (0..LISTS).rev() {
        if list.is_empty() {
            break;
        }
        stop.threshold = threshold;
        let (known, unknown) = remembered_of(&mut remembered, &list);
        hear(workers, data, &mut stop, &mut fitted, (known, &unknown))?;
        list = further_list(data.candidates, &mut order, &list, &stop.scores, threshold);
        if stop.accepted.is_some() || !is_alone || lists_left == 0 {
            break;
        }
    }
    // Where nothing passes a patch may lie between those that were screened.
    if let (None, Some(patch)) = (stop.accepted, patch) {
        let weak = data.thresholds_asked() * weak_bar(data, threshold);
        let patches = kept.patches_or(|| survey(workers, data, &data.candidates[patch], weak * data.share()))?;
        let is_seen = begin_at(&mut stop.scores[patch], patches, data.share());
        if is_seen && stop.scores[patch].gain > weak && !kept.is_vain(patch, stop.scores[patch].gain) {
            stop.threshold = threshold;
            let known = kept.take_surveyed();
            let unknown: &[usize] = if known.is_empty() { &[patch] } else { &[] };
            let before = fitted.len();
            hear(workers, data, &mut stop, &mut fitted, (known, unknown))?;
            forget_slopes(&mut fitted);
            kept.surveyed = fitted[before..].to_vec();
        }
    }
    let is_vain = |fitted: &&Fitted| fitted.fit.gain < WANTED * threshold && !fitted.fit.is_given_up;
    for fitted in fitted.iter().filter(is_vain) {
        kept.vain.push((fitted.position, stop.scores[fitted.position].gain));
    }
    let is_unwanted = |finalist: &&Finalist| finalist.is_slow() && finalist.is_background();
    for finalist in stop.finalists.iter().filter(is_unwanted) {
        kept.vain.push((finalist.position, stop.scores[finalist.position].gain));
    }
    forget_slopes(&mut fitted);
    kept.fitted = if fitted.is_empty() { remembered } else { fitted };
    Ok(stop)
}

/// What is judged does without its slopes, which are most of a fit's memory.
fn forget_slopes(fitted: &mut [Fitted]) {
    for fitted in fitted {
        fitted.fit.jacobian = Vec::new();
    }
}

/// Fits and judges a list, and chooses anew among all that was fitted.
///
/// - `known`, `unknown`: fits that are remembered, and candidates that are to be fitted.
fn hear(
    workers: &dyn Workers,
    data: &Round,
    stop: &mut Stop,
    fitted: &mut Vec<Fitted>,
    (known, unknown): (Vec<Fitted>, &[usize]),
) -> Result<(), Cancelled> {
    let mut more = known;
    more.extend(fits(workers, data, unknown, &stop.scores, stop.threshold)?);
    together(workers, data, &mut more)?;
    stop.simulations += more.iter().map(|fitted| fitted.fit.simulations).sum::<usize>();
    let judged = gathered(workers, more.len(), &|f| match &more[f].finalist {
        Some(finalist) => finalist.clone(),
        None => judge(data, &more[f], stop.threshold),
    })?;
    for (fitted, finalist) in more.iter_mut().zip(judged) {
        fitted.finalist = Some(finalist);
    }
    fitted.extend(more);
    choose(data, stop, fitted);
    Ok(())
}

/// Orders what was fitted by its gain, and accepts at most one, with the names that the data cannot tell from it.
fn choose(data: &Round, stop: &mut Stop, fitted: &[Fitted]) {
    let judged = fitted
        .iter()
        .filter_map(|fitted| Some((fitted.finalist.clone()?, fitted)));
    let mut pairs: Vec<(Finalist, &Fitted)> = judged.collect();
    pairs.sort_by(|a, b| b.0.gain().total_cmp(&a.0.gain()).then(a.0.position.cmp(&b.0.position)));
    let mut seen: Vec<usize> = Vec::new();
    pairs.retain(|(finalist, _)| {
        let is_best_start = !seen.contains(&finalist.position);
        seen.push(finalist.position);
        is_best_start
    });
    stability(data, &mut pairs);
    stop.alternatives.clear();
    stop.accepted = simplest(&pairs, slack_of(data.floor));
    if let Some(best) = stop.accepted {
        let own: Vec<Vec<f64>> = difference(data.train.residuals, &pairs[best].1.fit.residuals);
        for (finalist, fitted) in &mut pairs {
            let other = difference(data.train.residuals, &fitted.fit.residuals);
            finalist.cosine = cosine(data.train.metric, &own, &other);
        }
        let best_gain = pairs[best].0.gain();
        let slack = slack_of(data.floor)(best_gain);
        let name = pairs[best].0.member.candidate.entry.name;
        for (position, (finalist, _)) in pairs.iter().enumerate() {
            // A more complicated one may gain a little more.
            let deficit = (best_gain - finalist.gain()).max(0.0);
            let alike = finalist.cosine > SAME && deficit < slack + 0.03 * best_gain;
            let other = finalist.member.candidate.entry.name != name
                || finalist.member.candidate.index != pairs[best].0.member.candidate.index;
            let plausible = finalist.because.is_none() && finalist.size >= 0.5;
            let rival = pairs[best].0.stability < STABLE && finalist.stability > RIVAL;
            if position != best && other && plausible && (deficit < slack || alike || rival) {
                stop.alternatives.push(position);
            }
        }
    }
    if let Some(best) = stop.accepted.filter(|_| stop.alternatives.is_empty()) {
        let winner = &mut pairs[best].0;
        if winner.stability < MAJORITY {
            let share = 100.0 * winner.stability;
            winner.because = Some(format!(
                "explains most in {share:.0} % of the half-splits only, and what explains more in the others does not pass"
            ));
            stop.accepted = None;
        }
    }
    stop.finalists = pairs.into_iter().map(|pair| pair.0).collect();
}

/// Gain on the training runs from which a candidate is looked at although it is below the threshold: what the threshold would be had the
/// references no excess of their own. Such a candidate is believed when the validation runs speak for it so much the more. Beside an effect that is named
/// already, the rest of whose law would pass as one, it is the threshold of an effect alone.
pub(super) fn weak_bar(data: &Round, threshold: f64) -> f64 {
    if data.validation.records.is_empty() {
        threshold
    } else if data.members.is_empty() {
        threshold / data.floor.inflation()
    } else {
        threshold / data.thresholds_asked()
    }
}

/// Difference of gains that says nothing, for a gain.
pub fn slack_of(floor: &Floor) -> impl Fn(f64) -> f64 {
    let chance = VALIDATION_GAIN * floor.inflation();
    move |gain| chance + LAW_SHARE * gain
}

/// The best that passes; of those that the gain cannot tell from it the one with the fewest sizes, the choice of a wheel among them, unless half-splits tell
/// it from another.
fn simplest(pairs: &[(Finalist, &Fitted)], slack: impl Fn(f64) -> f64) -> Option<usize> {
    let best = pairs.iter().position(|(finalist, _)| finalist.because.is_none())?;
    let best_gain = pairs[best].0.gain();
    let choices = |finalist: &Finalist| finalist.member.candidate.choices(&finalist.member.values);
    let near = |finalist: &Finalist| finalist.because.is_none() && best_gain - finalist.gain() < slack(best_gain);
    let is_steady = pairs
        .iter()
        .any(|(finalist, _)| near(finalist) && finalist.stability >= STABLE);
    let is_told_apart = |finalist: &Finalist| is_steady && finalist.stability < RIVAL;
    (0..pairs.len())
        .filter(|position| near(&pairs[*position].0) && !is_told_apart(&pairs[*position].0))
        .min_by_key(|position| (choices(&pairs[*position].0), *position))
}

/// The columns of candidates as changes of a model, in order.
pub(super) fn probes(model: &Hypothesis, candidates: &[Candidate]) -> Vec<Change> {
    let of = |candidate: &Candidate, values: &[f64]| Change {
        hypothesis: model.with(candidate.effect(values)),
        added: 1,
        stages: candidate.stages,
        step: 1.0,
    };
    let all = candidates.iter();
    all.flat_map(|candidate| {
        candidate
            .columns
            .iter()
            .map(move |column| of(candidate, &column.values))
    })
    .collect()
}

fn sensitivities(workers: &dyn Workers, data: &Round) -> Result<Vec<Vec<Vec<f64>>>, Cancelled> {
    let changes = probes(data.model, data.candidates);
    columns(workers, data.coarse.records, data.coarse.residuals, &changes)
}

/// Products of the residual and all columns on the training runs, of all of which the windows that were simulated are a share.
pub(super) fn products(data: &Round, metric: &Metric, columns: &[Vec<Vec<f64>>]) -> crate::linear::Square {
    let mut vectors: Vec<Vec<&[f64]>> = vec![slices(data.coarse.residuals)];
    vectors.extend(columns.iter().map(|column| slices(column)));
    let mut gram = metric.gram(&vectors);
    gram.scale(1.0 / data.share());
    gram
}

/// What changed residuals lack of those of a base.
pub fn difference(base: &[Vec<f64>], changed: &[Vec<f64>]) -> Vec<Vec<f64>> {
    base.iter()
        .zip(changed)
        .map(|(b, c)| b.iter().zip(c).map(|(b, c)| b - c).collect())
        .collect()
}

pub(super) fn slices(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}

fn cosine(metric: &Metric, a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let gram = metric.gram(&[slices(a), slices(b)]);
    gram.at(0, 1) / (gram.at(0, 0) * gram.at(1, 1)).sqrt().max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates};
    use twin::golden::reference_robot;

    /// Motors score best, the true one third of four: two wheels of an effect are all that a list takes.
    #[test]
    fn a_third_wheel_is_fitted_when_nothing_of_the_first_list_passes() {
        let driven = Excitation {
            wheel_rad_per_s: 20.0,
            twist: [0.8, 0.6, 2.0],
            extent_m: [-1.0, 1.0, -1.0, 1.0],
        };
        let all = candidates(&reference_robot("diff4"), &driven);
        let motors: Vec<usize> = (0..all.len()).filter(|c| all[*c].entry.name == "weak_motor").collect();
        let gain = |position: usize| match motors.iter().position(|motor| *motor == position) {
            Some(rank) => 1000.0 - 100.0 * rank as f64,
            None => 200.0 - position as f64,
        };
        let scores: Vec<Score> = (0..all.len())
            .map(|position| Score {
                gain: gain(position),
                sensitivity: 100.0,
                start: Vec::new(),
                more_starts: Vec::new(),
                best_column: 0,
            })
            .collect();
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by(|a, b| scores[*b].gain.total_cmp(&scores[*a].gain));
        let first = short_list(&all, &order, &scores);
        assert_eq!(first[..2], motors[..2]);
        assert!(!first.contains(&motors[2]));
        let second = further_list(&all, &mut order, &first, &scores, 34.0);
        assert_eq!(second[..2], motors[2..]);
        assert!(second.iter().all(|position| !first.contains(position)));
        // What scores no more than chance is in no list.
        assert!(further_list(&all, &mut order, &second, &scores, 1000.0).is_empty());
    }

    fn finalist(position: usize, candidate: &Candidate, gain: f64, stability: f64) -> Finalist {
        Finalist {
            gain_train: gain,
            gain_validation: 0.0,
            stability,
            ..Finalist::sample(position, candidate)
        }
    }

    /// A centre of mass has two sizes, a play of gears one.
    #[test]
    fn fewer_sizes_decide_unless_half_splits_do() {
        let all = candidates(&reference_robot("diff2"), &Excitation::default());
        let named = |name: &str| {
            let found = all.iter().find(|candidate| candidate.entry.name == name);
            found.unwrap_or_else(|| panic!("no {name} in the library"))
        };
        let (two, one) = (named("center_of_mass_offset"), named("gear_backlash"));
        let fit = Fit {
            members: Vec::new(),
            gain: 0.0,
            residuals: Vec::new(),
            covariance: crate::linear::Square::zero(0),
            free: Vec::new(),
            jacobian: Vec::new(),
            simulations: 0,
            is_given_up: false,
        };
        let fitted = Fitted::new(fit, 0);
        let chosen = |steady: f64, other: f64, gain: f64| {
            let pairs = [
                (finalist(0, two, 374.0, steady), &fitted),
                (finalist(1, one, gain, other), &fitted),
            ];
            simplest(&pairs, |_| 10.0)
        };
        assert_eq!(chosen(0.97, 0.04, 373.0), Some(0));
        assert_eq!(chosen(0.97, 0.30, 373.0), Some(1), "it explains most often enough");
        assert_eq!(chosen(0.60, 0.04, 373.0), Some(1), "no half-splits decide");
        assert_eq!(chosen(0.60, 0.60, 360.0), Some(0), "gains tell them apart");
    }
}
