//! What neither side of the data shows by itself, and both together do; and what only the runs kept for checking show.
//!
//! Some of the open runs are searched and others are kept for checking: an effect that all of them show just beyond chance is not seen on some of them, and a
//! law that is no straight line in its sizes may be fitted to some of them at sizes that the others contradict. When nothing else is found, all open runs are
//! searched together. What passes there has nothing left to be checked on but the runs that stay locked, so it is never confirmed; each side has to show
//! some of it for all that. A carpet that one run of six meets, or a seam that two cross, may be kept for checking by chance: what explains these runs far beyond
//! chance and says nothing of the others is listed the same way.

use super::evidence::wins;
use super::finalist::Finalist;
use super::lists::short_list;
use super::round::{FAR_BEYOND, Stop, VALIDATION_GAIN, WANTED, probes, slices};
use super::suspect::{PLACE, Question, Suspect};
use crate::fit::{Member, fit};
use crate::hypothesis::Candidate;
use crate::screen::{Score, columns, scores};
use crate::workers::{Cancelled, Workers, gathered};

/// Of candidates with this share of the threshold on the training runs, and of those with less, so many are fitted.
const SEEN_BEFORE: f64 = 0.2;
const MOST_SEEN: usize = 5;
const MOST_UNSEEN: usize = 3;

impl Question<'_> {
    /// What all open runs show together, if each side shows some of it, or the runs kept for checking far more than chance gives and the others nothing.
    ///
    /// - `stop`: the last round.
    /// - `denied`: names that are none.
    pub fn overlooked(
        &self,
        workers: &dyn Workers,
        stop: &Stop,
        denied: &[&str],
    ) -> Result<Option<Suspect>, Cancelled> {
        let is_open = |position: &usize| {
            let candidate = &self.candidates[*position];
            let name = candidate.entry.name;
            let is_member = |member: &Member| {
                let own = &member.candidate;
                own.entry.name == name && own.index == candidate.index
            };
            !denied.contains(&name) && !self.floor.has_absorbed(name) && !self.members.iter().any(is_member)
        };
        let open: Vec<usize> = (0..self.candidates.len()).filter(is_open).collect();
        let candidates: Vec<Candidate> = open.iter().map(|p| self.candidates[*p].clone()).collect();
        let scores = self.scores_of_all(workers, &candidates)?;
        let mut order: Vec<usize> = (0..open.len())
            .filter(|item| scores[*item].gain >= WANTED * stop.threshold)
            .collect();
        order.sort_by(|a, b| scores[*b].gain.total_cmp(&scores[*a].gain).then(a.cmp(b)));
        let is_seen = |item: &usize| stop.scores[open[*item]].gain >= SEEN_BEFORE * stop.threshold;
        let (seen, unseen): (Vec<usize>, Vec<usize>) = order.into_iter().partition(is_seen);
        let first = |order: &[usize], most: usize| -> Vec<usize> {
            let list = short_list(&candidates, order, &scores);
            list.into_iter().take(most).collect()
        };
        let list = [first(&seen, MOST_SEEN), first(&unseen, MOST_UNSEEN)].concat();
        let starts = list.iter().flat_map(|item| {
            let all = core::iter::once(&scores[*item].start).chain(&scores[*item].more_starts);
            all.map(|start| (*item, start.clone()))
        });
        let starts: Vec<(usize, Vec<f64>)> = starts.collect();
        let problem = self.problem(WANTED * stop.threshold);
        let judged = gathered(workers, starts.len(), &|item| {
            let (candidate, values) = &starts[item];
            let member = Member {
                candidate: candidates[*candidate].clone(),
                values: values.clone(),
            };
            let fit = fit(&problem, vec![member])?;
            self.judged(&Finalist::of(open[*candidate], &fit), &fit)
        })?;
        let chance = VALIDATION_GAIN * self.floor.inflation();
        let is_shown = |found: &Finalist| {
            let sides = [found.gain_train, found.gain_validation];
            (is_shown_together(sides, stop.threshold, chance) || is_shown_elsewhere(sides, stop.threshold, chance))
                && self.is_sound(found, stop.threshold)
                && (found.member.candidate.entry.name != PLACE || self.is_met_again(found))
        };
        let mut found: Vec<Finalist> = judged.into_iter().flatten().filter(is_shown).collect();
        for finalist in &mut found {
            finalist.is_unshown = finalist.gain_train < chance;
        }
        found.sort_by(Finalist::by_sides);
        let mut seen: Vec<usize> = Vec::new();
        found.retain(|finalist| {
            let is_best_start = !seen.contains(&finalist.position);
            seen.push(finalist.position);
            is_best_start
        });
        let gains: Vec<Vec<f64>> = found.iter().map(|finalist| self.gains(finalist).concat()).collect();
        let passes = vec![true; found.len()];
        for (finalist, share) in found.iter_mut().zip(wins(&gains, &passes, self.seed)) {
            finalist.stability = share;
        }
        let mut found = found.into_iter();
        Ok(found.next().map(|finalist| {
            let is_near = self.is_near(&finalist);
            let first = match finalist.is_unshown {
                true => "nothing".to_owned(),
                false => format!("{:.0}", finalist.gain_train),
            };
            Suspect {
                alternatives: found.filter(is_near).collect(),
                because: format!(
                    "fitted to both it explains {first} of the first and {:.0} of the others, the threshold being {:.0}",
                    finalist.gain_validation, stop.threshold
                ),
                is_shown_together: finalist.gain_train < stop.threshold,
                finalist,
            }
        }))
    }

    /// Scores of candidates on all open runs.
    fn scores_of_all(&self, workers: &dyn Workers, candidates: &[Candidate]) -> Result<Vec<Score>, Cancelled> {
        let changes = probes(self.model, candidates);
        let side = &self.fitted;
        let columns = columns(workers, side.records, side.residuals, &changes)?;
        let mut vectors: Vec<Vec<&[f64]>> = vec![slices(side.residuals)];
        vectors.extend(columns.iter().map(|column| slices(column)));
        let mut gram = side.metric.gram(&vectors);
        gram.scale(1.0 / self.share());
        Ok(scores(candidates, &gram))
    }
}

/// Beyond the threshold together, and on each side more than chance gives one candidate.
fn is_shown_together(sides: [f64; 2], threshold: f64, chance: f64) -> bool {
    sides[0] + sides[1] >= threshold && sides.iter().all(|gain| *gain >= chance)
}

/// Far beyond the threshold on the runs kept for checking, and no more than chance gives, either way, on the others.
fn is_shown_elsewhere(sides: [f64; 2], threshold: f64, chance: f64) -> bool {
    sides[1] >= FAR_BEYOND * threshold && sides[0].abs() < chance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_only_the_runs_kept_for_checking_show_is_far_beyond_chance() {
        let is_shown = |train: f64, validation: f64| is_shown_elsewhere([train, validation], 34.0, 14.0);
        assert!(is_shown(0.0, 103.0) && is_shown(-13.0, 400.0));
        assert!(!is_shown(0.0, 101.0), "less than three thresholds");
        assert!(!is_shown(-15.0, 400.0), "the runs that were searched say no");
        assert!(!is_shown(40.0, 400.0), "both sides show it");
    }

    #[test]
    fn both_sides_have_to_show_some_of_it() {
        let is_shown = |train: f64, validation: f64| is_shown_together([train, validation], 34.0, 14.0);
        assert!(is_shown(20.0, 15.0));
        assert!(!is_shown(17.0, 16.0), "not beyond chance together");
        assert!(!is_shown(400.0, 13.0), "the runs kept for checking say nothing of it");
        assert!(!is_shown(13.0, 400.0));
    }
}
