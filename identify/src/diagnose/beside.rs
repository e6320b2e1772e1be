//! What is named beside each other: what is calibration, what is the rest of another law, and what stands for something that is missing.

use super::louder::Louder;
use super::taken::Taken;
use crate::hypothesis::LOST;
use crate::select::Finalist;
use twin::effect::library::Hook;

/// What is below its practical size, and by its interval may be none, is calibration; losses are not, nor what gains so much that the interval is at fault
/// while there is some of it on average. Beside what surely is a change it is one only if there may be none of it on average: what every stretch may lack, the
/// whole of them may show.
pub(super) fn calibrate_small(all: &mut [Taken]) {
    let is_small = |taken: &Taken| {
        let is_there = !taken.may_be_none_on_average && taken.is_sure_by_gain();
        let may_be_none = taken.may_be_none && !is_there;
        may_be_none && taken.finalist.size < 1.0 && taken.finalist.member.candidate.entry.name != LOST
    };
    let is_beside = all.iter().any(|taken| !taken.is_absorbed && !is_small(taken));
    for taken in all {
        taken.is_absorbed |= is_small(taken) && (taken.may_be_none_on_average || !is_beside);
    }
}

/// Friction below the speed over which the twin smooths its own is a correction of that law where another name explains more: a robot that was changed sticks
/// and creeps where it did not before, and the twin does so otherwise. Nothing else is an alternative of it or has it for one then: both are in the model.
pub(super) fn correct_smoothed(all: &mut [Taken]) {
    let name = |taken: &Taken| taken.finalist.member.candidate.entry.name;
    let names = all
        .iter()
        .filter(|taken| !taken.is_absorbed && !taken.is_smoothed() && name(taken) != LOST);
    let most = names.max_by(|a, b| a.finalist.gain().total_cmp(&b.finalist.gain()));
    let most = most.map(|taken| (name(taken), taken.finalist.gain()));
    let mut corrected = None;
    for taken in &mut *all {
        taken.corrects_beside = None;
        let is_asked = taken.is_smoothed() && !taken.is_absorbed && taken.suspected.is_none();
        if let Some((other, _)) = most.filter(|(_, gain)| is_asked && taken.finalist.gain() < *gain) {
            (taken.is_absorbed, taken.corrects_beside) = (true, Some(other));
            corrected = Some(name(taken));
        }
    }
    let is_corrected = |other: &Finalist| Some(other.member.candidate.entry.name) == corrected;
    for taken in all.iter_mut().filter(|_| corrected.is_some()) {
        taken.alternatives.retain(|other| !is_corrected(other));
        taken.excluded.retain(|other| !is_corrected(other));
    }
}

/// What acts in the same part of the robot as a name that may be another law, and explains less, is not confirmed beside it: of a law and of what it lacks two
/// names are made.
pub(super) fn reserve_rests(all: &mut [Taken]) {
    let part = |taken: &Taken| taken.finalist.member.candidate.entry.hook;
    let laws: Vec<(f64, Hook, &'static str)> = all
        .iter()
        .filter(|taken| !taken.is_absorbed && taken.may_be_another_law())
        .map(|taken| {
            (
                taken.finalist.gain(),
                part(taken),
                taken.finalist.member.candidate.entry.name,
            )
        })
        .collect();
    for taken in all {
        let (own, part) = (taken.finalist.gain(), part(taken));
        let louder = laws.iter().filter(|(gain, other, _)| *gain > own && *other == part);
        taken.may_be_rest_of = louder.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, _, name)| *name);
    }
}

/// What explains less than another name and may be none by its interval is not confirmed beside it, however much it gains: gains beside what is large count
/// what its law leaves.
pub(super) fn reserve_wide(all: &mut [Taken]) {
    let names: Vec<(f64, String)> = all
        .iter()
        .filter(|taken| !taken.is_absorbed)
        .map(|taken| (taken.finalist.gain(), taken.finalist.member.candidate.label()))
        .collect();
    for taken in all {
        taken.reserved.clear();
        // Where gains do not outvote the interval it is a doubt already.
        if !taken.may_be_none || taken.is_absorbed || taken.nothing().is_some() {
            continue;
        }
        let own = taken.finalist.gain();
        let louder = names.iter().filter(|(gain, _)| *gain > own);
        if let Some((_, other)) = louder.max_by(|a, b| a.0.total_cmp(&b.0)) {
            taken.reserved.push(format!(
                "by the interval of its size there may be none of it, and it may make up for what {other}, which explains more, leaves"
            ));
        }
    }
}

/// Losses are read from the wheels' own speeds: while these are still louder than in the references something else may be behind them.
///
/// - `wheels`: how much louder they are, if they are.
pub(super) fn reserve_losses(all: &mut [Taken], wheels: Option<Louder>) {
    let Some(louder) = wheels else { return };
    let is_lost = |taken: &&mut Taken| taken.finalist.member.candidate.entry.name == LOST;
    for taken in all.iter_mut().filter(is_lost) {
        taken.reserved.push(format!(
            "wheels still err with {:.1} times the energy that they have in the references, so something else may be behind it",
            louder.ratio
        ));
    }
}

/// Where references were driven less hard and something has changed, nobody knows the tyres and the floor of harsh moments: only the name that explains most is
/// confirmed, the others may make up for these.
pub(super) fn reserve_untold(all: &mut [Taken]) {
    let gain = |taken: &Taken| taken.finalist.gain();
    let most = all
        .iter()
        .filter(|taken| !taken.is_absorbed)
        .map(gain)
        .fold(0.0, f64::max);
    for taken in all.iter_mut().filter(|taken| !taken.is_absorbed && gain(taken) < most) {
        let why = "the references, driven less hard, do not show tyres and floor in harsh moments, and it may make up for these";
        taken.reserved.push(why.to_owned());
    }
}

/// What is found under a calibration in which the runs kept for checking had a part was not checked on them alone.
pub(super) fn reserve_calibrated(all: &mut [Taken]) {
    for taken in all.iter_mut().filter(|taken| !taken.is_absorbed) {
        let why =
            "the runs kept for checking had a part in the calibration of tyres and floor under which it was found";
        taken.reserved.push(why.to_owned());
    }
}

/// Where much is left names that are not proven by themselves may stand for what is missing. Those that nothing else speaks against, in words.
pub(super) fn doubt_beside_a_rest(all: &mut [Taken]) -> Option<String> {
    let mut names = Vec::new();
    for taken in all.iter_mut().filter(|taken| !taken.is_absorbed && !taken.is_proven()) {
        let name = taken.finalist.member.candidate.entry.name;
        let is_unquestioned = taken.doubts().is_empty() && taken.reservations().is_empty();
        if is_unquestioned && taken.other_names().is_empty() && !names.contains(&name) {
            names.push(name);
        }
        taken.is_beside_a_large_rest = true;
    }
    (!names.is_empty()).then(|| format!("{}: not confirmed while so much is missing", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::super::trend::Trend;
    use super::*;

    const OFFSET: &str = "center_of_mass_offset";

    #[test]
    fn what_explains_less_than_another_law_may_be_its_rest() {
        let law = Taken {
            trend: Some(Trend {
                variable: 0,
                slope: 0.3,
                surprise: 16.0,
            }),
            ..Taken::sample("viscous_friction", 20.0)
        };
        let mut all = [
            Taken::sample(OFFSET, 40.0),
            law,
            Taken::sample("stribeck_friction", 4.0),
            Taken::sample("gyro_bias", 4.0),
        ];
        reserve_rests(&mut all);
        let rest_of = all.clone().map(|taken| taken.may_be_rest_of);
        assert_eq!(rest_of, [None, None, Some("viscous_friction"), None]);
        assert!(all[2].doubts().is_empty(), "not withdrawn for it");
        assert!(matches!(&all[2].reservations()[..], [one] if one.contains("make up for what viscous_friction")));
        all[1].trend = None;
        reserve_rests(&mut all);
        assert!(all.iter().all(|taken| taken.reservations().is_empty()));
    }

    #[test]
    fn under_a_calibration_of_all_open_runs_names_are_told_why_they_are_not_confirmed() {
        let mut all = [Taken::sample(OFFSET, 40.0), Taken::sample("gyro_bias", 40.0)];
        all[1].is_absorbed = true;
        reserve_calibrated(&mut all);
        let told = all[0].reservations();
        assert!(
            matches!(&told[..], [one] if one.contains("had a part in the calibration")),
            "{told:?}"
        );
        assert!(!all[0].is_proven(), "whatever it gains");
        assert!(all[1].reservations().is_empty(), "calibration itself");
    }

    #[test]
    fn beside_tyres_that_nobody_knows_only_what_explains_most_is_confirmed() {
        let small = Taken {
            is_absorbed: true,
            ..Taken::sample("motor_lag", 90.0)
        };
        let mut all = [
            Taken::sample("floor_friction", 20.0),
            Taken::sample(OFFSET, 40.0),
            small,
        ];
        reserve_untold(&mut all);
        let reservations = all.each_ref().map(|taken| taken.reservations().len());
        assert_eq!(reservations, [1, 0, 0]);
        assert!(!all[0].is_proven() && all[0].doubts().is_empty());
    }

    #[test]
    fn what_may_be_none_is_not_confirmed_beside_what_explains_more() {
        let wide = |thresholds: f64| Taken {
            may_be_none: true,
            ..Taken::sample("floor_friction", thresholds)
        };
        let reserved = |mut all: Vec<Taken>| -> Vec<usize> {
            reserve_wide(&mut all);
            all.iter().map(|taken| taken.reservations().len()).collect()
        };
        assert_eq!(reserved(vec![wide(30.0)]), [0], "alone");
        assert_eq!(reserved(vec![Taken::sample(OFFSET, 40.0), wide(30.0)]), [0, 1]);
        assert_eq!(reserved(vec![Taken::sample(OFFSET, 20.0), wide(30.0)]), [0, 0]);
        let calibration = Taken {
            is_absorbed: true,
            ..Taken::sample(OFFSET, 40.0)
        };
        assert_eq!(
            reserved(vec![calibration, wide(30.0)]),
            [0, 0],
            "nothing is named beside it"
        );
        let narrow = Taken::sample("floor_friction", 30.0);
        assert_eq!(reserved(vec![Taken::sample(OFFSET, 40.0), narrow]), [0, 0]);
    }

    #[test]
    fn losses_are_not_confirmed_while_wheels_are_louder_than_in_the_references() {
        let Some(candidate) = crate::hypothesis::lost_set_points(&twin::golden::reference_robot("diff2")) else {
            panic!("a robot with set-points may lose them");
        };
        let mut losses = Taken::sample(OFFSET, 200.0);
        losses.finalist.member = crate::fit::Member {
            values: vec![0.3, 0.03],
            candidate,
        };
        let reserved = |wheels: Option<Louder>| {
            let mut all = [losses.clone(), Taken::sample(OFFSET, 40.0)];
            reserve_losses(&mut all, wheels);
            all.map(|taken| taken.reservations().len())
        };
        let louder = Louder {
            class: 0,
            ratio: 12.0,
            score: 9.0,
        };
        assert_eq!((reserved(Some(louder)), reserved(None)), ([1, 0], [0, 0]));
    }

    #[test]
    fn beside_a_large_rest_only_what_is_proven_stays_confirmed() {
        let mut proven = Taken::sample(OFFSET, 20.0);
        proven.finalist.change_validation = proven.finalist.gain_validation;
        let in_turn = {
            let mut in_turn = Taken::sample("gear_backlash", 20.0);
            in_turn.finalist.is_in_turn = true;
            in_turn
        };
        let calibration = Taken {
            is_absorbed: true,
            ..Taken::sample("motor_lag", 4.0)
        };
        let mut all = [
            proven,
            Taken::sample("payload", 4.0),
            Taken::sample("payload", 4.0),
            in_turn,
            calibration,
        ];
        let words = doubt_beside_a_rest(&mut all).unwrap_or_default();
        assert_eq!(words, "payload: not confirmed while so much is missing");
        let is_doubted = all.each_ref().map(|taken| taken.is_beside_a_large_rest);
        assert_eq!(is_doubted, [false, true, true, true, false]);
        assert_eq!(doubt_beside_a_rest(&mut all[..1]), None);
    }

    /// Below its practical size, and any stretch may have none of it.
    fn small(on_average: bool) -> Taken {
        let mut small = Taken {
            may_be_none: true,
            may_be_none_on_average: on_average,
            ..Taken::sample(OFFSET, 4.0)
        };
        small.finalist.size = 0.9;
        small
    }

    #[test]
    fn only_a_sure_change_vouches_for_a_small_one_and_not_for_one_of_which_there_may_be_none() {
        let absorbed = |mut all: Vec<Taken>| {
            calibrate_small(&mut all);
            all.iter().map(|taken| taken.is_absorbed).collect::<Vec<bool>>()
        };
        assert_eq!(absorbed(vec![small(false)]), [true], "alone");
        let surely = |on_average: bool| Taken {
            threshold: small(on_average).threshold / 3.0,
            ..small(on_average)
        };
        assert_eq!(absorbed(vec![surely(false)]), [false], "twelve thresholds");
        assert_eq!(absorbed(vec![surely(true)]), [true], "of nothing on average");
        assert_eq!(
            absorbed(vec![Taken::sample("payload", 4.0), small(false)]),
            [false, false]
        );
        assert_eq!(
            absorbed(vec![Taken::sample("payload", 4.0), small(true)]),
            [false, true]
        );
        assert_eq!(
            absorbed(vec![small(false), small(false)]),
            [true, true],
            "none vouches for the other"
        );
        let calibrated = Taken {
            is_absorbed: true,
            ..Taken::sample("payload", 4.0)
        };
        assert_eq!(absorbed(vec![calibrated, small(false)]), [true, true]);
    }

    #[test]
    fn friction_below_the_twins_own_smoothing_is_calibration_beside_what_explains_more() {
        let absorbed = |mut all: Vec<Taken>| {
            correct_smoothed(&mut all);
            all.iter().map(|taken| taken.is_absorbed).collect::<Vec<bool>>()
        };
        let name = |thresholds| Taken::sample("coulomb_friction", thresholds);
        assert_eq!(absorbed(vec![name(40.0), Taken::stribeck(20.0, 0.15)]), [false, true]);
        assert_eq!(
            absorbed(vec![name(40.0), Taken::stribeck(20.0, 0.6)]),
            [false, false],
            "faster"
        );
        assert_eq!(
            absorbed(vec![name(10.0), Taken::stribeck(20.0, 0.15)]),
            [false, false],
            "explains most"
        );
        assert_eq!(
            absorbed(vec![Taken::stribeck(20.0, 0.15)]),
            [false],
            "nothing else is named"
        );
        let mut all = vec![name(40.0), Taken::stribeck(20.0, 0.15)];
        assert_eq!(all[1].correction(), None, "a name");
        correct_smoothed(&mut all);
        assert!(
            all[1]
                .correction()
                .is_some_and(|words| words.contains("below 0.3 rad/s"))
        );
        assert_eq!(all[0].correction(), None);
    }
}
