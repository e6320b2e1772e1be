//! What was named is held against runs that nothing was fitted or chosen on: names that make them worse are no confirmed ones.

use crate::report::schema::Gap;

/// A row is worse when its error has risen by this share, and for sure.
const WORSE: f64 = 0.05;
/// Floors from which a row has a gap at all, as in the overall fraction.
const A_GAP: f64 = 1.5;
/// Share of the gap that proves names although a row is worse: laws are off, and other effects may hide there.
const PROVEN: f64 = 0.5;
/// Share by which the whole gap may grow by chance although no row is surely worse.
const GROWN: f64 = 0.1;
/// Share that a single name must explain to be listed then.
const WITHDRAWN: f64 = 0.1;

/// An error of so many floors, for sure, is a disagreement whatever other runs say.
const FAR: f64 = 3.0;

/// An error of so many floors for sure, and [`FAR`] of them in all, is left of a gap.
const SURELY_LEFT: f64 = 2.0;

/// So much grow the squared errors in floors, on the average of all rows, where names do more harm than good.
const HARM: f64 = 0.1;

/// What the unused runs say.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Verified {
    /// No row is surely worse, or most of the gap is gone nevertheless.
    Holds,
    /// One is, or the whole gap grows: something is missing or is another law.
    InPart(String),
    /// The same, and the only name explains next to nothing, or all names together do more harm than good.
    Not(String),
}

/// What is known of the names before unused runs are asked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Names {
    /// Of several some may be right: which of them do harm unused runs must not decide.
    pub count: usize,
    /// Something else speaks against one of them. A whole gap that grows, no row of it surely, may be chance and withdraws nothing by itself.
    pub is_any_doubted: bool,
    /// One of them is proven by itself ([`super::taken::Taken::is_proven`]): laws are off elsewhere then.
    pub is_any_proven: bool,
}

/// - `explained`: overall fraction of the gap.
pub(super) fn verified(gaps: &[Gap], explained: Option<f64>, names: Names) -> Verified {
    if explained.is_some_and(|explained| explained >= PROVEN) {
        return Verified::Holds;
    }
    // Names that make up for nothing have no credit: what the references have of a row is then all that it may have.
    let floors = if explained.is_some_and(|explained| explained < 0.0) {
        1.0
    } else {
        A_GAP
    };
    // The interval of the error afterwards lies above the error before, and the error above what the references have of it.
    let worse = gaps
        .iter()
        .filter(|gap| gap.low > gap.before && gap.after > (1.0 + WORSE) * gap.before && gap.after > floors * gap.floor);
    let share = |gap: &Gap| gap.after / gap.before.max(1e-300);
    let is_surely_worse = worse.clone().next().is_some();
    let is_harm = is_surely_worse && !names.is_any_proven && growth(gaps) > HARM;
    let (words, is_nothing) = match worse.max_by(|a, b| share(a).total_cmp(&share(b))) {
        Some(worst) => (
            format!(
                "on runs that were not used the error of {} {:.1} s ahead rises from {:.4} to {:.4} {} with what is named",
                worst.channel, worst.horizon_s, worst.before, worst.after, worst.unit
            ),
            explained.unwrap_or(0.0) < WITHDRAWN,
        ),
        None => match explained.filter(|explained| *explained < -GROWN) {
            Some(grown) => (
                format!(
                    "on runs that were not used the gap is larger by {:.0} % with what is named",
                    -100.0 * grown
                ),
                names.is_any_doubted,
            ),
            None => return Verified::Holds,
        },
    };
    // Where rows that get worse outweigh those that get better nothing is chosen either: none of the names is believed.
    if names.count == 1 && is_nothing || is_harm {
        Verified::Not(words)
    } else {
        Verified::InPart(words)
    }
}

/// Squared errors in floors after less those before, a row.
fn growth(gaps: &[Gap]) -> f64 {
    let rows = gaps.iter().filter(|gap| gap.floor > 0.0);
    let squares = |gap: &Gap| (gap.after * gap.after - gap.before * gap.before) / (gap.floor * gap.floor);
    rows.clone().map(squares).sum::<f64>() / rows.count().max(1) as f64
}

/// What is left of the gap of unused runs although something was named: most of a row that is far from its floor. Names that are right do not make
/// a report complete then; where half of the whole gap is explained they do.
///
/// - `explained`: overall fraction of the gap.
pub(super) fn leaves(gaps: &[Gap], explained: Option<f64>) -> Option<String> {
    if explained.is_some_and(|explained| explained >= PROVEN) {
        return None;
    }
    let share = |gap: &Gap| gap.after / gap.floor.max(1e-300);
    let is_left = |gap: &&Gap| {
        let is_far = gap.floor > 0.0 && gap.after > FAR * gap.floor && gap.low > SURELY_LEFT * gap.floor;
        is_far && gap.explained_fraction.is_some_and(|explained| explained < PROVEN)
    };
    let most = gaps
        .iter()
        .filter(is_left)
        .max_by(|a, b| share(a).total_cmp(&share(b)))?;
    Some(format!(
        "something is missing: on runs that were not used, predictions of {} over {:.1} s are off by {:.4} {} even with what is named; the floor is {:.4}",
        most.channel, most.horizon_s, most.after, most.unit, most.floor
    ))
}

/// What runs that were not used say against open ones that agree with the twin: a place that only they cross, a limit that only they reach.
///
/// - `gaps`: of the unused runs under the model that explains the open ones.
/// - `are_given`: whoever asked told which runs to lock; the diagnosis kept them back otherwise.
pub(super) fn disagree_alone(gaps: &[Gap], are_given: bool) -> Option<String> {
    let share = |gap: &Gap| gap.after / gap.floor.max(1e-300);
    let far = gaps.iter().filter(|gap| gap.floor > 0.0 && gap.low > FAR * gap.floor);
    let most = far.max_by(|a, b| share(a).total_cmp(&share(b)))?;
    let runs = if are_given {
        "locked ones"
    } else {
        "ones kept back for the gap table"
    };
    Some(format!(
        "The runs that were searched agree with the twin, the {runs} do not: {} {:.1} s ahead is off by {:.4} {} where references leave {:.4}. Diagnose again with these among the runs and others locked.",
        most.channel, most.horizon_s, most.after, most.unit, most.floor
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(count: usize, is_any_doubted: bool) -> Names {
        Names {
            count,
            is_any_doubted,
            is_any_proven: false,
        }
    }

    fn row(channel: &str, floor: f64, before: f64, after: f64) -> Gap {
        Gap {
            channel: channel.to_owned(),
            horizon_s: 0.5,
            unit: "A".to_owned(),
            floor,
            before,
            after,
            low: 0.9 * after,
            high: 1.1 * after,
            explained_fraction: None,
        }
    }

    #[test]
    fn names_that_make_unused_runs_worse_are_withdrawn_or_unproven() {
        let better = row("pose", 0.004, 0.02, 0.005);
        let worse = row("current", 0.09, 0.10, 0.17);
        assert_eq!(
            verified(core::slice::from_ref(&better), Some(0.9), of(1, false)),
            Verified::Holds
        );
        let both = [better, worse.clone()];
        assert!(
            matches!(verified(&both, Some(0.4), of(1, false)), Verified::InPart(words) if words.contains("current"))
        );
        assert_eq!(
            verified(&both, Some(0.7), of(1, false)),
            Verified::Holds,
            "most of the gap is gone"
        );
        assert!(matches!(verified(&both, Some(-0.2), of(1, false)), Verified::Not(_)));
        assert!(matches!(verified(&both, Some(-0.2), of(2, false)), Verified::InPart(_)));
        assert!(matches!(verified(&[worse], None, of(1, false)), Verified::Not(_)));
    }

    /// A healthy robot on which a clock and a play in gears were seen.
    #[test]
    fn names_that_do_more_harm_than_good_are_withdrawn_however_many() {
        let better = row("pose", 0.0033, 0.0059, 0.0054);
        let worse = row("wheel", 0.22, 0.18, 0.35);
        let both = [better, worse];
        assert!(matches!(verified(&both, Some(0.16), of(2, false)), Verified::Not(words) if words.contains("wheel")));
        let proven = Names {
            is_any_proven: true,
            ..of(2, false)
        };
        assert!(
            matches!(verified(&both, Some(0.16), proven), Verified::InPart(_)),
            "laws are off elsewhere"
        );
        let little = [row("pose", 0.0033, 0.0080, 0.0054), both[1].clone()];
        assert!(
            matches!(verified(&little, Some(0.4), of(2, false)), Verified::InPart(_)),
            "as much good"
        );
        let chance = [both[0].clone(), row("wheel", 0.22, 0.18, 0.19)];
        assert_eq!(
            verified(&chance, Some(0.16), of(2, false)),
            Verified::Holds,
            "not for sure"
        );
    }

    #[test]
    fn unused_runs_that_are_far_off_speak_although_the_open_ones_agree() {
        let agrees = row("current", 0.09, 0.12, 0.12);
        assert_eq!(disagree_alone(core::slice::from_ref(&agrees), true), None);
        let patch = row("pose", 0.004, 0.13, 0.13);
        let mut unsure = patch.clone();
        unsure.low = 0.011;
        assert_eq!(
            disagree_alone(&[agrees.clone(), unsure], true),
            None,
            "one moment of one run"
        );
        let words = |are_given| disagree_alone(&[agrees.clone(), patch.clone()], are_given).unwrap_or_default();
        assert!(
            words(true).contains("pose 0.5 s ahead is off by 0.1300"),
            "{}",
            words(true)
        );
        assert!(words(true).contains("locked ones") && words(false).contains("kept back"));
    }

    #[test]
    fn a_gap_that_is_left_is_told_although_a_name_is_right() {
        let mut left = row("yaw", 0.072, 0.45, 0.45);
        (left.low, left.explained_fraction) = (0.17, Some(0.0));
        let small = row("pose", 0.02, 0.03, 0.029);
        let words = leaves(&[small.clone(), left.clone()], Some(0.05)).unwrap_or_default();
        assert!(
            words.contains("predictions of yaw over 0.5 s are off by 0.4500"),
            "{words}"
        );
        assert_eq!(
            leaves(core::slice::from_ref(&small), Some(0.05)),
            None,
            "near its floor"
        );
        assert_eq!(
            leaves(core::slice::from_ref(&left), Some(0.7)),
            None,
            "most is explained"
        );
        let mut unsure = left.clone();
        unsure.low = 0.1;
        assert_eq!(leaves(&[unsure], Some(0.05)), None, "one moment of one run");
        left.explained_fraction = Some(0.8);
        assert_eq!(leaves(&[left], Some(0.4)), None, "this row is explained");
    }

    /// No row is worse for sure, all are a little.
    #[test]
    fn names_with_which_the_whole_gap_grows_are_unproven_and_a_single_doubted_one_is_withdrawn() {
        let mut row = row("wheel", 0.22, 0.40, 0.56);
        row.low = 0.2;
        let gaps = [row];
        assert!(
            matches!(verified(&gaps, Some(-0.48), of(2, false)), Verified::InPart(words) if words.contains("48 %"))
        );
        assert!(
            matches!(verified(&gaps, Some(-0.48), of(1, false)), Verified::InPart(words) if words.contains("48 %"))
        );
        assert!(matches!(verified(&gaps, Some(-0.48), of(1, true)), Verified::Not(words) if words.contains("48 %")));
        assert_eq!(verified(&gaps, Some(-0.05), of(1, false)), Verified::Holds, "chance");
    }

    #[test]
    fn what_may_be_chance_or_is_at_the_floor_is_not_worse() {
        assert_eq!(
            verified(&[row("current", 0.09, 0.10, 0.11)], None, of(1, false)),
            Verified::Holds,
            "chance"
        );
        assert_eq!(
            verified(&[row("current", 0.12, 0.10, 0.17)], None, of(1, false)),
            Verified::Holds,
            "at the floor"
        );
        let above = row("pose", 0.006, 0.0046, 0.0086);
        assert_eq!(
            verified(core::slice::from_ref(&above), Some(0.2), of(1, false)),
            Verified::Holds
        );
        assert!(
            matches!(verified(&[above], Some(-0.2), of(1, false)), Verified::Not(_)),
            "nothing is explained, and the error rises above the floor"
        );
    }
}
