//! What is known of a candidate once it is fitted and judged.

use core::cmp::Ordering;
use twin::effect::Effect;

use crate::fit::{Fit, Member};
#[cfg(test)]
use crate::hypothesis::Candidate;

/// Gain on the validation runs over that of an effect of just the fitted size, between which both sides agree on it: they ask for that size within an eighth.
const AGREED: core::ops::RangeInclusive<f64> = 0.75..=1.25;
/// Share of bootstrap replicates of the validation runs that may be worse; of what the training runs show at so many thresholds and the validation runs at the
/// same size, more: of two runs one that hardly shows it is all of every fourth replicate.
const HARMFUL: f64 = 0.05;
const PLAIN: f64 = 2.0;
const HARMFUL_OF_PLAIN: f64 = 0.15;
/// Slow to simulate.
const SLOW: &str = "longitudinal_slip";
/// Amplitude in the references from which an effect is no difference to them.
pub(super) const ALSO_THERE: f64 = 0.5;

/// A fitted candidate with its evidence.
#[derive(Debug, Clone)]
pub struct Finalist {
    pub position: usize,
    pub member: Member,
    pub gain_train: f64,
    /// The same with every window at its weight ([`super::beyond`]).
    pub weighed: f64,
    pub gain_validation: f64,
    /// What it changes on the validation runs: the gain there if it has just the fitted size.
    pub change_validation: f64,
    /// Amplitude at which the same change is in the references; 1 = just as much.
    pub in_references: f64,
    /// The references would show it at this size.
    pub is_shown_by_references: bool,
    pub stability: f64,
    /// One side hardly shows it: the validation runs, or the training runs ([`Finalist::is_shown_elsewhere`]).
    pub is_unshown: bool,
    /// It was checked on the training runs, each with what the others say.
    pub is_in_turn: bool,
    /// One window that it makes worse is left out of what speaks against it.
    pub is_but_one: bool,
    /// Share of bootstrap replicates of the validation runs that it makes worse; of what is proven on the training runs without one window.
    pub harmful: f64,
    /// Channel of the validation runs that it makes worse, by how much of what it gains in all; likewise.
    pub worse: Option<(usize, f64)>,
    /// Size in practical sizes.
    pub size: f64,
    /// The same as far as it is sure ([`Fit::sure_size`]).
    pub sure_size: f64,
    pub because: Option<String>,
    /// Cosine to the accepted one, after projection.
    pub cosine: f64,
    /// All members as they are fitted together with this one, it being the last; empty when the others stayed as they were.
    pub joint: Vec<Member>,
}

impl Finalist {
    /// What a fit found, of which nothing else is known yet: its first member.
    pub(super) fn of(position: usize, fit: &Fit) -> Finalist {
        let member = fit.members[0].clone();
        Finalist {
            position,
            size: member.candidate.size(&member.values),
            sure_size: fit.sure_size(0),
            gain_train: fit.gain,
            weighed: fit.gain,
            is_unshown: false,
            gain_validation: 0.0,
            change_validation: 0.0,
            in_references: 0.0,
            is_shown_by_references: false,
            stability: 0.0,
            is_in_turn: false,
            is_but_one: false,
            harmful: 1.0,
            worse: None,
            because: None,
            cosine: 0.0,
            member,
            joint: Vec::new(),
        }
    }

    pub fn gain(&self) -> f64 {
        self.gain_train + self.gain_validation
    }

    /// What both sides show comes before what one of them says alone, however much that is; then by gain.
    pub(super) fn by_sides(&self, other: &Finalist) -> Ordering {
        let by_gain = other.gain().total_cmp(&self.gain());
        let by_side = self.is_unshown.cmp(&other.is_unshown);
        by_side.then(by_gain).then(self.position.cmp(&other.position))
    }

    /// The runs kept for checking show it, and those that were searched hardly do.
    pub fn is_shown_elsewhere(&self) -> bool {
        self.is_unshown && self.gain_validation > self.gain_train
    }

    pub fn effect(&self) -> Effect {
        self.member.candidate.effect(&self.member.values)
    }

    /// A change that the validation runs show by themselves, at about the size that the training runs ask for.
    ///
    /// - `least_change`: energy by which it changes the validation runs, at least.
    pub fn is_agreed(&self, least_change: f64) -> bool {
        let is_whole = !self.is_in_turn && !self.is_but_one && self.size >= 1.0;
        let is_shown = self.change_validation >= least_change;
        is_whole && is_shown && AGREED.contains(&(self.gain_validation / self.change_validation))
    }

    /// It makes more of the replicates worse than it may.
    ///
    /// - `asked`, `alone`: thresholds of it here, and of an effect alone.
    pub(super) fn is_harmful(&self, asked: f64, alone: f64) -> bool {
        let is_plain = self.gain_train >= PLAIN * asked && self.is_agreed(alone);
        self.harmful > if is_plain { HARMFUL_OF_PLAIN } else { HARMFUL }
    }

    /// The references have it as well.
    pub fn is_background(&self) -> bool {
        self.in_references > ALSO_THERE
    }

    /// Slow to simulate: no part of the floor's model.
    pub fn is_slow(&self) -> bool {
        self.member.candidate.entry.name == SLOW
    }
}

#[cfg(test)]
impl Finalist {
    /// One of practical size that gains something on both sides and has nothing against it.
    pub(crate) fn sample(position: usize, candidate: &Candidate) -> Finalist {
        let values = candidate
            .axes
            .iter()
            .map(|axis| axis.neutral + axis.practical)
            .collect();
        Finalist {
            position,
            member: Member {
                candidate: candidate.clone(),
                values,
            },
            gain_train: 200.0,
            weighed: 200.0,
            gain_validation: 100.0,
            change_validation: 100.0,
            in_references: 0.0,
            is_shown_by_references: true,
            stability: 1.0,
            is_unshown: false,
            is_in_turn: false,
            is_but_one: false,
            harmful: 0.0,
            worse: None,
            size: 1.0,
            sure_size: 1.0,
            because: None,
            cosine: 1.0,
            joint: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates};
    use twin::golden::reference_robot;

    const ALONE: f64 = 35.0;

    fn sample() -> Finalist {
        let all = candidates(&reference_robot("diff2"), &Excitation::default());
        Finalist::sample(0, &all[0])
    }

    #[test]
    fn both_sides_agree_on_a_change_that_validation_runs_show_at_its_size() {
        assert!(sample().is_agreed(ALONE));
        let differs = |change: &dyn Fn(&mut Finalist)| {
            let mut other = sample();
            change(&mut other);
            !other.is_agreed(ALONE)
        };
        assert!(
            differs(&|other| other.gain_validation = 60.0),
            "eight tenths of the size"
        );
        assert!(
            differs(&|other| other.gain_validation = 130.0),
            "more of it than a larger size is, whatever else is in it"
        );
        assert!(differs(&|other| other.change_validation = 30.0), "hardly shown there");
        assert!(differs(&|other| other.size = 0.9), "would be calibration");
        assert!(differs(&|other| other.is_but_one = true), "a window was left out");
        assert!(differs(&|other| other.is_in_turn = true), "they were not asked");
    }

    #[test]
    fn replicates_of_two_runs_say_less_against_what_both_sides_agree_on() {
        let with = |harmful: f64, gain_train: f64, gain_validation: f64| {
            let finalist = Finalist {
                harmful,
                gain_train,
                gain_validation,
                ..sample()
            };
            finalist.is_harmful(1.5 * ALONE, ALONE)
        };
        assert!(!with(0.04, 60.0, 20.0), "hardly any");
        assert!(with(0.08, 200.0, 60.0), "they do not agree");
        assert!(with(0.08, 104.0, 100.0), "less than two of the thresholds asked");
        assert!(!with(0.08, 106.0, 100.0));
        assert!(
            with(0.16, 1000.0, 100.0),
            "more than a run that hardly shows it explains"
        );
    }
}
