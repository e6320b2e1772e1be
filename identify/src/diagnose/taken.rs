//! An effect that has been taken into the model, and what speaks against believing it.

use super::TINY;
use super::absorb::part_before;
use super::evenness::Evenness;
use super::trend::Trend;
use crate::fit::Member;
use crate::floor::Floor;
use crate::hypothesis::LOST;
use crate::select::{Finalist, Stop};
use twin::COULOMB_SCALE_RAD_PER_S;

/// Gain in thresholds from which an interval that reaches to no effect is the interval's fault.
pub(super) const SURELY: f64 = 10.0;

/// The effect whose speed may be below that over which the twin's own dry friction is smoothed.
const STRIBECK: &str = "stribeck_friction";

/// The effect of which every run may have another size.
const LOAD: &str = "payload";

/// An effect that has been taken into the model.
#[derive(Debug, Clone)]
pub(super) struct Taken {
    pub finalist: Finalist,
    pub alternatives: Vec<Finalist>,
    /// The alternatives as they fit all open runs in its place, beside what else is named; none before the final fit.
    pub rivals: Vec<Member>,
    pub excluded: Vec<Finalist>,
    pub threshold: f64,
    /// In the model, and no name: too small to matter, or a correction of a law of the twin.
    pub is_absorbed: bool,
    /// A correction of a law of the twin beside this name, which explains more.
    pub corrects_beside: Option<&'static str>,
    /// How far its size differs from window to window; unknown when few windows tell it.
    pub evenness: Option<Evenness>,
    /// What its size goes with.
    pub trend: Option<Trend>,
    /// What it gains on all open runs but for the window that gains most; unknown until they are fitted.
    pub but_best: Option<f64>,
    /// The intervals of all its sizes reach to no effect.
    pub may_be_none: bool,
    /// The same of the intervals of mean sizes.
    pub may_be_none_on_average: bool,
    /// Nothing passed, and this is what is suspected: why it is no more than that.
    pub suspected: Option<String>,
    /// Training runs do not show it by themselves as far as is asked.
    pub is_shown_together: bool,
    /// A name that explains more, and may be a law of another kind: what that law leaves may be all of this one.
    pub may_be_rest_of: Option<&'static str>,
    /// So much of what the runs are off by is left with all that is named that it may stand for something else.
    pub is_beside_a_large_rest: bool,
    /// What else speaks for another cause of what it explains, each in words after its name.
    pub reserved: Vec<String>,
}

impl Taken {
    /// What a round accepted.
    pub fn accepted(stop: &Stop, accepted: usize) -> Taken {
        let finalist = stop.finalists[accepted].clone();
        let alternatives: Vec<Finalist> = stop.alternatives.iter().map(|a| stop.finalists[*a].clone()).collect();
        let excluded = stop
            .finalists
            .iter()
            .enumerate()
            .filter(|(position, _)| *position != accepted && !stop.alternatives.contains(position))
            .map(|(_, finalist)| finalist.clone())
            .collect();
        Taken {
            is_absorbed: finalist.size < TINY,
            corrects_beside: None,
            finalist,
            alternatives,
            excluded,
            threshold: stop.threshold,
            evenness: None,
            but_best: None,
            may_be_none: false,
            may_be_none_on_average: false,
            trend: None,
            suspected: None,
            is_shown_together: false,
            may_be_rest_of: None,
            is_beside_a_large_rest: false,
            reserved: Vec::new(),
            rivals: Vec::new(),
        }
    }

    /// By how many times itself the size differs from window to window, when another law may be behind it.
    pub fn uneven(&self) -> Option<f64> {
        self.evenness.filter(Evenness::is_uneven).map(|even| even.spread)
    }

    /// Its size is not the same everywhere: a law of another kind may be behind it.
    pub fn may_be_another_law(&self) -> bool {
        let is_no_one_size = self.uneven().is_some() || self.trend.is_some_and(|trend| trend.is_sure());
        is_no_one_size && !self.is_reconciled() && self.finalist.member.candidate.entry.name != LOAD
    }

    /// Neither another law nor what was there before.
    pub fn is_sure(&self, floor: &Floor) -> bool {
        let is_all = !self.is_beside_a_large_rest && self.reservations().is_empty();
        is_all && self.doubts().is_empty() && self.before(floor).is_none()
    }

    /// Why it may have been there before; lost set-points are no error of a description, and what gains ten thresholds is more than such errors come to.
    pub fn before(&self, floor: &Floor) -> Option<&'static str> {
        let is_lost = self.finalist.member.candidate.entry.name == LOST;
        let is_shown = self.finalist.is_shown_by_references || self.is_sure_by_gain();
        floor.may_have_had(self.finalist.size, is_shown).filter(|_| !is_lost)
    }

    /// It is the effect of such a name, and wheel.
    pub fn is(&self, name: &str, index: Option<usize>) -> bool {
        let own = &self.finalist.member.candidate;
        own.entry.name == name && own.index == index
    }

    /// Names that the data cannot tell from it.
    pub fn other_names(&self) -> Vec<String> {
        let own = self.finalist.member.candidate.entry.name;
        let mut names: Vec<String> = self
            .alternatives
            .iter()
            .map(|alternative| alternative.member.candidate.entry.name.to_owned())
            .filter(|name| name != own)
            .collect();
        names.sort();
        names.dedup();
        names
    }

    /// Both sides agree on it so surely that what it leaves is no reason to disbelieve it. Losses and what is only suspected were fitted to both.
    pub fn is_proven(&self) -> bool {
        let finalist = &self.finalist;
        let is_agreed = finalist.gain_train >= SURELY * self.threshold && finalist.is_agreed(self.threshold);
        self.is_held_out()
            && is_agreed
            && self.reserved.is_empty()
            && self.doubts().is_empty()
            && self.other_laws().is_empty()
    }

    /// The validation runs had no part in its sizes.
    pub fn is_held_out(&self) -> bool {
        self.suspected.is_none() && self.finalist.member.candidate.entry.name != LOST
    }

    /// What speaks against believing it, for the report.
    pub fn doubts(&self) -> Vec<String> {
        let name = self.finalist.member.candidate.entry.name;
        let uneven = self.uneven().filter(|_| !self.is_reconciled()).map(|spread| {
            let with = self.trend.map_or_else(String::new, |trend| format!(" (it {})", trend.words()));
            format!(
                "{name}: the size that explains most differs from stretch to stretch by {spread:.1} times itself{with}, so a law of another kind may be behind it"
            )
        });
        let in_turn = self.finalist.is_in_turn.then(|| {
            format!(
                "{name}: the runs kept for checking hardly show it, so it was checked on the training runs in turn; not confirmed without new runs that show it"
            )
        });
        let suspected = self.suspected.as_ref().map(|because| {
            let why = if self.finalist.is_shown_elsewhere() {
                "only some runs show it, and those that were searched hardly do"
            } else if self.is_shown_together {
                "neither the runs that were searched nor those kept for checking show it by themselves as far as is asked, so none are left to check it on"
            } else if self.finalist.is_unshown {
                "only some runs show it, and those kept for checking hardly do"
            } else {
                "training and validation runs show it, but not at the sizes that the training runs alone give"
            };
            format!("{name}: {why} ({because}); not confirmed without new runs that show it")
        });
        let doubts = uneven.into_iter().chain(in_turn).chain(self.nothing());
        doubts.chain(suspected).collect()
    }

    /// It gains so many thresholds that the rest of what speaks against it is at fault.
    pub fn is_sure_by_gain(&self) -> bool {
        self.finalist.gain() >= SURELY * self.threshold
    }

    /// Why there may be none of it.
    pub(super) fn nothing(&self) -> Option<String> {
        let name = self.finalist.member.candidate.entry.name;
        // A load may differ from run to run. Of what does not, and is only suspected, no gain makes up for a size that may be none on average; nor of
        // losses, which explain whatever set-points that are put elsewhere explain.
        let is_of_a_run = self.suspected.is_none() || name == LOAD || !self.may_be_none_on_average;
        let is_sure = is_of_a_run && name != LOST && self.is_sure_by_gain();
        (self.may_be_none && !is_sure).then(|| {
            format!(
                "{name}: by the interval of its size there may be none of it, although it explains what chance does not"
            )
        })
    }

    /// Number of its doubts of which none follows from another. An interval that is wide because stretches differ is no second doubt beside that they do, if
    /// there is some of it on average, where something else has surely changed; or where nothing else has a name, the runs kept for checking show by themselves
    /// what is asked, and stretches differ by less than the size.
    pub fn independent_doubts(&self, is_beside_sure: bool, is_alone: bool) -> usize {
        let uneven = self.uneven().filter(|_| !self.is_reconciled());
        let is_width_alone = uneven.is_some() && self.nothing().is_some() && !self.may_be_none_on_average;
        let is_checked = self.is_held_out() && self.finalist.gain_validation >= self.threshold;
        let is_there = is_beside_sure || (is_alone && is_checked && uneven.is_some_and(|spread| spread < 1.0));
        self.doubts().len() - usize::from(is_there && is_width_alone)
    }

    /// It is a change for sure, which vouches that this robot is not as it was.
    pub fn vouches(&self) -> bool {
        let is_change = !self.is_absorbed && self.finalist.size >= 1.0 && self.other_names().is_empty();
        is_change && self.doubts().is_empty() && self.reservations().is_empty()
    }

    /// Why it is not confirmed although nothing says that it is not there.
    pub fn reservations(&self) -> Vec<String> {
        let mut all = self.other_laws();
        all.extend(self.smoothed());
        all.extend(self.small());
        let name = self.finalist.member.candidate.entry.name;
        all.extend(self.reserved.iter().map(|why| format!("{name}: {why}")));
        all
    }

    /// Why less than a practical size is no news: that much may be another effect, or everyday. Of what the references have some of only the rest is new.
    fn small(&self) -> Option<String> {
        let (name, size) = (self.finalist.member.candidate.entry.name, self.finalist.size);
        let there = part_before(&self.finalist);
        let is_small = (1.0 - there) * size < 1.0 && name != LOST && !self.is_sure_by_gain();
        is_small.then(|| {
            let new = if size < 1.0 {
                format!("less than is practical to find ({size:.2} of it)")
            } else {
                format!(
                    "the references have {:.0} % of it, and what is new is less than is practical to find",
                    100.0 * there
                )
            };
            format!("{name}: {new} and not far beyond chance, so it may stand for another effect")
        })
    }

    /// Why its law may be another one.
    fn other_laws(&self) -> Vec<String> {
        let name = self.finalist.member.candidate.entry.name;
        let is_said = self.uneven().is_some() || self.is_reconciled();
        let trend = self.trend.filter(|trend| trend.is_sure() && !is_said).map(|trend| {
            format!(
                "{name}: the size that explains most {}, by {:.0} % per standard deviation of it, so a law of another kind may be behind it",
                trend.words(),
                100.0 * trend.slope.abs()
            )
        });
        let rest = self.may_be_rest_of.map(|other| {
            format!("{name}: may only make up for what {other}, whose law may be another one, gets wrong")
        });
        trend.into_iter().chain(rest).collect()
    }

    /// It is friction that rises towards standstill below the speed over which the twin's own dry friction changes its sign smoothly: it may be none of the robot.
    pub(super) fn is_smoothed(&self) -> bool {
        let member = &self.finalist.member;
        let axis = member.candidate.axes.iter().position(|axis| axis.name == "speed");
        let speed = axis.and_then(|axis| member.values.get(axis));
        member.candidate.entry.name == STRIBECK && speed.is_some_and(|speed| *speed < COULOMB_SCALE_RAD_PER_S)
    }

    /// Why it cannot be confirmed then.
    fn smoothed(&self) -> Option<String> {
        self.is_smoothed().then(|| {
            format!(
                "{}, so it may only make up for that; predictions are better with it, and this twin cannot confirm it",
                smoothed_at()
            )
        })
    }

    /// What a reader should know of a correction that is no name.
    pub fn correction(&self) -> Option<String> {
        self.corrects_beside.map(|other| {
            format!("{}, and {other} explains more; it is in the model as a correction of that, predictions are better with it, and it is not named", smoothed_at())
        })
    }

    /// All that a reader should know of it.
    ///
    /// - `before`: why it may have been there before, if so.
    pub fn remarks(&self, before: Option<&str>) -> Vec<String> {
        let name = self.finalist.member.candidate.entry.name;
        let but_one = self.finalist.is_but_one.then(|| {
            format!("{name}: one stretch of two seconds of the validation runs speaks against it and was left out, the others together speak for it")
        });
        let but_one: Vec<String> = but_one.into_iter().collect();
        let before: Vec<String> = before.iter().map(|why| format!("{name}: {why}")).collect();
        [self.doubts(), self.reservations(), but_one, before].concat()
    }

    /// Both sides do not agree on its size, which is doubt enough.
    fn is_reconciled(&self) -> bool {
        self.suspected.is_some() && !self.finalist.is_unshown
    }
}

/// Where such friction acts.
fn smoothed_at() -> String {
    format!(
        "{STRIBECK}: most of it acts below {COULOMB_SCALE_RAD_PER_S} rad/s, where the twin lets dry friction fall smoothly to nothing"
    )
}

#[cfg(test)]
impl Taken {
    /// An effect that gains so many thresholds.
    pub fn sample(name: &str, thresholds: f64) -> Taken {
        let robot = twin::golden::reference_robot("diff2");
        let all = crate::hypothesis::candidates(&robot, &crate::hypothesis::Excitation::default());
        let Some(position) = all.iter().position(|candidate| candidate.entry.name == name) else {
            panic!("no {name} in the library");
        };
        let finalist = Finalist {
            gain_train: 20.0 * thresholds,
            weighed: 20.0 * thresholds,
            gain_validation: 10.0 * thresholds,
            ..Finalist::sample(position, &all[position])
        };
        Taken {
            finalist,
            alternatives: Vec::new(),
            excluded: Vec::new(),
            threshold: 30.0,
            is_absorbed: false,
            corrects_beside: None,
            evenness: None,
            but_best: None,
            may_be_none: false,
            may_be_none_on_average: false,
            trend: None,
            suspected: None,
            is_shown_together: false,
            may_be_rest_of: None,
            is_beside_a_large_rest: false,
            reserved: Vec::new(),
            rivals: Vec::new(),
        }
    }

    /// A Stribeck curve of such a speed, rad/s.
    pub fn stribeck(thresholds: f64, speed: f64) -> Taken {
        let mut stribeck = Taken::sample(STRIBECK, thresholds);
        let axes = &stribeck.finalist.member.candidate.axes;
        let Some(axis) = axes.iter().position(|axis| axis.name == "speed") else {
            panic!("a Stribeck curve has a speed");
        };
        stribeck.finalist.member.values[axis] = speed;
        stribeck
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::lost_set_points;

    const OFFSET: &str = "center_of_mass_offset";

    #[test]
    fn evidence_makes_up_for_a_wide_interval_and_for_a_suspicion_only_of_what_is_there_on_average() {
        assert!(Taken::sample(OFFSET, 2.0).doubts().is_empty());
        let weak = Taken {
            may_be_none: true,
            ..Taken::sample(OFFSET, 2.0)
        };
        assert!(matches!(&weak.doubts()[..], [doubt] if doubt.contains("there may be none of it")));
        let strong = Taken {
            may_be_none: true,
            ..Taken::sample(OFFSET, 20.0)
        };
        assert!(strong.doubts().is_empty());
        let suspected = Taken {
            suspected: Some("makes 9 % of the bootstrap replicates worse".to_owned()),
            ..Taken::sample(OFFSET, 20.0)
        };
        assert_eq!(suspected.doubts().len(), 1);
        let on_average = Taken {
            may_be_none: true,
            ..suspected
        };
        assert_eq!(on_average.doubts().len(), 1, "all stretches together have some of it");
        let none = Taken {
            may_be_none_on_average: true,
            ..on_average
        };
        assert_eq!(none.doubts().len(), 2, "such a name is withdrawn");
        let load = Taken {
            finalist: Taken::sample(LOAD, 20.0).finalist,
            ..none
        };
        assert_eq!(load.doubts().len(), 1, "runs may have had other loads");
    }

    #[test]
    fn of_what_the_references_have_only_the_rest_is_new() {
        let of = |thresholds: f64, size: f64, in_references: f64| {
            let mut taken = Taken::sample(OFFSET, thresholds);
            (taken.finalist.size, taken.finalist.in_references) = (size, in_references);
            taken.reservations()
        };
        assert!(of(3.0, 1.2, 0.0).is_empty());
        let some = of(3.0, 1.2, 0.48);
        assert!(
            matches!(&some[..], [why] if why.contains("the references have 48 % of it")),
            "{some:?}"
        );
        assert!(of(3.0, 2.5, 0.48).is_empty(), "more than a practical size is new");
        assert!(of(20.0, 1.2, 0.48).is_empty(), "so much is not chance");
        assert!(of(3.0, 1.02, 0.08).is_empty(), "so little may be chance");
        assert!(of(3.0, 1.2, -0.4).is_empty(), "the other way round in the references");
        assert!(matches!(&of(3.0, 0.9, 0.0)[..], [why] if why.contains("0.90 of it")));
    }

    #[test]
    fn a_wide_interval_is_no_second_doubt_beside_what_made_it_wide() {
        let mut uneven = Taken {
            may_be_none: true,
            evenness: Some(Evenness {
                spread: 0.8,
                surprise: 7.5,
                of_mean: 0.15,
            }),
            ..Taken::sample(OFFSET, 5.0)
        };
        uneven.finalist.gain_validation = 0.9 * uneven.threshold;
        assert_eq!(uneven.doubts().len(), 2, "both are told");
        assert_eq!(uneven.independent_doubts(true, false), 1);
        assert_eq!(uneven.independent_doubts(false, true), 2, "nothing vouches for it");
        assert!(!uneven.vouches() && Taken::sample(OFFSET, 5.0).vouches());
        let mut checked = uneven.clone();
        checked.finalist.gain_validation = checked.threshold;
        assert_eq!(
            checked.independent_doubts(false, true),
            1,
            "the runs kept for checking vouch for it"
        );
        assert_eq!(
            checked.independent_doubts(false, false),
            2,
            "another name may have taken its gain over"
        );
        if let Some(evenness) = &mut checked.evenness {
            evenness.spread = 1.1;
        }
        assert_eq!(
            checked.independent_doubts(false, true),
            2,
            "some stretches have it the other way round"
        );
        let none_on_average = Taken {
            may_be_none_on_average: true,
            ..uneven.clone()
        };
        assert_eq!(none_on_average.independent_doubts(true, true), 2);
        let mut in_turn = Taken {
            may_be_none: false,
            ..uneven
        };
        in_turn.finalist.is_in_turn = true;
        assert_eq!(
            in_turn.independent_doubts(true, true),
            2,
            "neither follows from the other"
        );
    }

    /// Held set-points that are placed where they explain most explain other faults as well.
    #[test]
    fn losses_of_which_there_may_be_none_are_doubted_whatever_they_gain() {
        let Some(candidate) = lost_set_points(&twin::golden::reference_robot("diff2")) else {
            panic!("a robot with set-points may lose them");
        };
        let mut losses = Taken::sample(OFFSET, 200.0);
        losses.finalist.member = Member {
            values: vec![0.3, 0.03],
            candidate,
        };
        assert!(losses.doubts().is_empty());
        losses.may_be_none = true;
        assert!(matches!(&losses.doubts()[..], [doubt] if doubt.contains("there may be none of it")));
    }

    #[test]
    fn a_size_that_differs_from_stretch_to_stretch_is_doubted_once() {
        let uneven = Taken {
            evenness: Some(Evenness {
                spread: 0.8,
                surprise: 9.0,
                of_mean: 0.1,
            }),
            ..Taken::sample(OFFSET, 2.0)
        };
        assert!(matches!(&uneven.doubts()[..], [doubt] if doubt.contains("0.8 times itself, so")));
        let with_speed = Taken {
            trend: Some(Trend {
                variable: 0,
                slope: 0.3,
                surprise: 12.0,
            }),
            ..uneven.clone()
        };
        assert!(
            matches!(&with_speed.doubts()[..], [doubt] if doubt.contains("(it grows with the commanded forward speed), so"))
        );
        let even = Taken {
            evenness: None,
            ..with_speed.clone()
        };
        assert!(even.doubts().is_empty(), "it is there");
        assert!(
            matches!(&even.reservations()[..], [one] if one.contains("grows with the commanded forward speed, by 30 % per"))
        );
        assert!(with_speed.reservations().is_empty(), "said among the doubts");
        let by_chance = Taken {
            trend: even.trend.map(|trend| Trend { surprise: 8.0, ..trend }),
            ..even
        };
        assert!(by_chance.reservations().is_empty());
        let reconciled = Taken {
            suspected: Some("is at an end".to_owned()),
            ..uneven
        };
        assert!(matches!(&reconciled.doubts()[..], [doubt] if doubt.contains("is at an end")));
    }

    #[test]
    fn friction_slower_than_the_twins_own_smoothing_is_not_confirmed() {
        let of = |speed: f64| Taken::stribeck(20.0, speed).reservations();
        assert!(matches!(&of(0.2)[..], [one] if one.contains("below 0.3 rad/s")));
        assert!(of(0.5).is_empty());
    }

    /// What makes up for the twin's own smoothing is no reason to drop a right name beside it.
    #[test]
    fn friction_that_is_smoothed_may_be_proven_and_does_not_vouch() {
        let mut stribeck = Taken::stribeck(20.0, 0.2);
        stribeck.finalist.change_validation = stribeck.finalist.gain_validation;
        assert!(stribeck.is_proven() && !stribeck.vouches());
    }

    #[test]
    fn what_both_sides_agree_on_at_ten_thresholds_is_proven() {
        let of = |thresholds: f64| {
            let mut agreed = Taken::sample(OFFSET, thresholds);
            agreed.finalist.change_validation = agreed.finalist.gain_validation;
            agreed
        };
        assert!(of(20.0).is_proven() && !of(10.0).is_proven());
        assert!(!Taken::sample(OFFSET, 20.0).is_proven(), "more than its size explains");
        let suspected = Taken {
            suspected: Some("at another size".to_owned()),
            ..of(20.0)
        };
        assert!(!suspected.is_proven(), "fitted to both sides");
        let rest = Taken {
            may_be_rest_of: Some("viscous_friction"),
            ..of(20.0)
        };
        assert!(!rest.is_proven());
        let mut losses = of(20.0);
        if let Some(candidate) = lost_set_points(&twin::golden::reference_robot("diff2")) {
            losses.finalist.member.candidate = candidate;
        }
        assert!(!losses.is_proven(), "they are read from every run");
    }

    #[test]
    fn less_than_a_practical_size_is_not_confirmed_unless_it_gains_ten_thresholds() {
        let small = |thresholds: f64| {
            let mut small = Taken::sample(OFFSET, thresholds);
            small.finalist.size = 0.8;
            small
        };
        assert!(matches!(&small(9.0).reservations()[..], [one] if one.contains("0.80 of it")));
        assert!(small(9.0).doubts().is_empty(), "not withdrawn for it");
        assert!(small(11.0).reservations().is_empty());
        assert!(
            Taken::sample(OFFSET, 2.0).reservations().is_empty(),
            "of a practical size"
        );
    }

    #[test]
    fn a_stretch_that_was_left_out_is_told_and_is_no_doubt() {
        let mut but_one = Taken::sample(OFFSET, 20.0);
        assert!(but_one.remarks(None).is_empty());
        assert_eq!(but_one.remarks(Some("was there")), [format!("{OFFSET}: was there")]);
        but_one.finalist.is_but_one = true;
        assert!(but_one.doubts().is_empty() && but_one.reservations().is_empty());
        assert!(matches!(&but_one.remarks(None)[..], [one] if one.contains("was left out")));
    }
}
