//! Names are held against the gap of the validation runs as well, in which every channel and horizon counts. Of the residuals' energy, by
//! which effects are found, a few loud moments may be most: a wheel that slips a little earlier than in the twin.

use super::exchange::is_same;
use super::gap_table::ValidationGap;
use super::prepared::Prepared;
use super::taken::SURELY;
use super::{Case, TINY};
use crate::fit::{Member, with_members};
use crate::hypothesis::Hypothesis;
use crate::record::CLASSES;
use crate::screen::all_residuals;
use crate::select::{Energies, Finalist, Stop, energies, expected};
use crate::workers::{Cancelled, Workers};

/// So much more of the gap is explained with one more effect, at least.
const ADDS: f64 = 0.01;
/// Or so much of the energy beyond the noise that the others leave on the validation runs: the gap counts only channels on which much is wrong, and a first
/// effect may be all of that. A rest of its law is spread over more than one effect takes.
const ADDS_OF_REST: f64 = 0.5;
/// Or, when it is more than calibration, so much of it on one channel: what is left on others may be of something else.
const ADDS_OF_CHANNEL: f64 = 1.0 / 3.0;
/// The gap that is left may grow by this share of itself then.
const GROWS: f64 = 0.05;
/// What both sides agree on ([`Finalist::is_agreed`]) need not: of a gap over whole stretches most may be of something else, by which it may grow by this
/// share of itself.
const AGREED_GROWS: f64 = 0.2;
/// Standard deviations of the noise's energy (chi-squared) that such an effect takes at least.
const CHANCE: f64 = 3.0;
/// Of names that the residuals cannot tell apart one that explains so much more of the gap is preferred, and those that explain so much less
/// than the best are no alternatives.
const CLEARLY_MORE: f64 = 0.1;
const FAR_LESS: f64 = 0.25;

/// Why an effect beside others is none: it leaves the gap as it is.
///
/// - `validation`: under the model without it.
/// - `before`, `after`: what is in the model without it and with it.
/// - `is_agreed`: training and validation runs ask for the same size of it, beside the names of `before`.
pub(super) fn adds_nothing(
    workers: &dyn Workers,
    case: &Case,
    gap: &mut ValidationGap,
    validation: &Prepared,
    [before, after]: [&[Member]; 2],
    is_agreed: bool,
) -> Result<Option<String>, Cancelled> {
    if before.is_empty() {
        return Ok(None);
    }
    let models = [before, after].map(|members| with_members(&case.floor.model, members));
    let explained: Option<Vec<f64>> = gap.explained(case, &models).into_iter().collect();
    let Some([old, new]) = explained.and_then(|explained| <[f64; 2]>::try_from(explained).ok()) else {
        return Ok(None);
    };
    if is_agreed && is_as_agreed(before, after) && grows_little(old, new) {
        return Ok(None);
    }
    let is_change = after.last().is_some_and(|own| own.candidate.size(&own.values) >= TINY);
    let ask = Asked {
        of_all: new >= old - ADDS,
        of_channel: is_change && new >= old - ADDS.max(GROWS * (1.0 - old)),
    };
    let adds = new >= old + ADDS || takes_the_rest(workers, validation, &models[1], ask)?;
    Ok((!adds).then(|| {
        format!(
            "of the gap of the validation runs {:.1} % is explained with it and {:.1} % without",
            100.0 * new,
            100.0 * old
        )
    }))
}

/// A fit of all left the names before it, and a change of the newest: of others, or of another size, nobody agreed.
fn is_as_agreed(before: &[Member], after: &[Member]) -> bool {
    let is_change = after.last().is_some_and(|own| own.candidate.size(&own.values) >= 1.0);
    let mut earlier = before.iter().zip(after);
    is_change && earlier.all(|(before, after)| is_same(&before.candidate, &after.candidate))
}

/// - `old`, `new`: shares of the gap that are explained.
fn grows_little(old: f64, new: f64) -> bool {
    new >= old - ADDS.max(AGREED_GROWS * (1.0 - old))
}

/// What counts of the energy that an effect takes: by how much the gap grows, and by its size.
#[derive(Debug, Clone, Copy)]
struct Asked {
    of_all: bool,
    of_channel: bool,
}

/// Whether a model explains much of what the present one leaves beyond the noise, in all or on one channel.
fn takes_the_rest(
    workers: &dyn Workers,
    validation: &Prepared,
    model: &Hypothesis,
    ask: Asked,
) -> Result<bool, Cancelled> {
    if !ask.of_all && !ask.of_channel {
        return Ok(false);
    }
    let simulated = all_residuals(workers, &validation.records, model)?;
    let Some(changed) = simulated.into_iter().collect::<Option<Vec<Vec<f64>>>>() else {
        return Ok(false);
    };
    let bounds = &validation.bounds;
    let kept = bounds.keep(&validation.metric, &validation.records, &validation.residuals, changed);
    let of = |residuals: &[Vec<f64>]| energies(&validation.metric, &validation.records, residuals);
    let (old, new) = (of(&validation.residuals), of(&kept.residuals));
    Ok(takes(&old, &new, &expected(&validation.metric), ask))
}

/// - `noise`: energies without any gap.
fn takes(old: &Energies, new: &Energies, noise: &Energies, ask: Asked) -> bool {
    let sum = |energies: &Energies| energies.iter().sum::<f64>();
    let all = || is_most(sum(old), sum(new), sum(noise), ADDS_OF_REST);
    let channel = |class: usize| is_most(old[class], new[class], noise[class], ADDS_OF_CHANNEL);
    ask.of_all && all() || ask.of_channel && (0..CLASSES).any(channel)
}

/// - `noise`: it is uncertain by its own scatter, so that a part of a small rest says nothing.
fn is_most(old: f64, new: f64, noise: f64, share: f64) -> bool {
    let chance = CHANCE * (2.0 * noise).sqrt();
    old - new >= (share * (old - noise)).max(chance)
}

/// Chooses among the accepted effect and those that the residuals cannot tell from it.
///
/// - `members`: what is named already.
pub(super) fn prefer(case: &Case, gap: &mut ValidationGap, members: &[Member], stop: &mut Stop) {
    let Some(accepted) = stop.accepted.filter(|_| !stop.alternatives.is_empty()) else {
        return;
    };
    let model = |finalist: &Finalist| {
        let all = if finalist.joint.is_empty() {
            let own = core::iter::once(&finalist.member);
            members.iter().chain(own).cloned().collect()
        } else {
            finalist.joint.clone()
        };
        with_members(&case.floor.model, &all)
    };
    let mut rivals: Vec<usize> = core::iter::once(accepted)
        .chain(stop.alternatives.iter().copied())
        .collect();
    by_size(&mut rivals, !members.is_empty(), |position| {
        let finalist = &stop.finalists[*position];
        (finalist.size, finalist.gain() >= SURELY * stop.threshold)
    });
    let models: Vec<_> = rivals
        .iter()
        .map(|position| model(&stop.finalists[*position]))
        .collect();
    let explained = gap.explained(case, &models);
    let pairs = rivals.into_iter().zip(explained);
    let known: Option<Vec<(usize, f64)>> = pairs
        .map(|(position, explained)| Some((position, explained?)))
        .collect();
    let Some(known) = known else { return };
    let (chosen, alternatives) = choice(&known);
    stop.accepted = Some(chosen);
    stop.alternatives = alternatives;
}

/// Those of a size that is a change come before those of one that would be calibration: to absorb the small one would be to deny the other, which explains
/// as much.
///
/// - `is_beside`: something is named already, so that less than a practical size is a change.
/// - `about`: size in practical sizes, and whether it gains so much that less than one is a change as well.
fn by_size(rivals: &mut [usize], is_beside: bool, about: impl Fn(&usize) -> (f64, bool)) {
    rivals.sort_by_key(|position| match about(position) {
        (size, _) if size < TINY => 2,
        (size, is_sure) => u8::from(!is_beside && !is_sure && size < 1.0),
    });
}

/// The preferred position and those that are alternatives to it.
///
/// - `known`: positions with what they explain; the first one is preferred unless another explains clearly more.
fn choice(known: &[(usize, f64)]) -> (usize, Vec<usize>) {
    let best = known.iter().copied().fold(
        (0, f64::NEG_INFINITY),
        |best, other| {
            if other.1 > best.1 { other } else { best }
        },
    );
    let first = known.first().copied().unwrap_or_default();
    let (chosen, _) = if best.1 > first.1 + CLEARLY_MORE { best } else { first };
    let alternatives = known
        .iter()
        .filter(|(position, explained)| *position != chosen && *explained >= best.1 - FAR_LESS)
        .map(|(position, _)| *position)
        .collect();
    (chosen, alternatives)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates};
    use twin::golden::reference_robot;

    /// Energies of validation runs of cars with two effects, the second of which shows on currents alone, and of rests of their laws.
    #[test]
    fn half_of_what_is_left_is_an_effect_of_its_own_and_a_quarter_is_a_rest() {
        let is_half = |old: f64, new: f64, noise: f64| is_most(old, new, noise, ADDS_OF_REST);
        assert!(is_half(3363.0, 2505.0, 2792.0));
        assert!(!is_half(3363.0, 3229.0, 2792.0));
        assert!(!is_half(3757.0, 3670.0, 3409.0));
        assert!(!is_half(2852.0, 2800.0, 2792.0), "half of next to nothing");
        assert!(!is_half(2700.0, 2600.0, 2792.0), "nothing is left");
    }

    #[test]
    fn an_effect_of_one_channel_is_not_asked_to_explain_another() {
        let takes = |old: &Energies, new: &Energies, noise: &Energies, of_channel: bool| {
            let ask = Asked {
                of_all: true,
                of_channel,
            };
            takes(old, new, noise, ask)
        };
        let noise: Energies = core::array::from_fn(|_| 200.0);
        let mut old = noise;
        (old[0], old[2]) = (900.0, 600.0);
        let mut new = old;
        new[2] = 420.0;
        assert!(
            takes(&old, &new, &noise, true),
            "45 % of what is left on one, 16 % of all"
        );
        assert!(!takes(&old, &new, &noise, false), "calibration");
        new[2] = 500.0;
        assert!(!takes(&old, &new, &noise, true), "a quarter of one");
        new[0] = 300.0;
        assert!(takes(&old, &new, &noise, false), "most of all");
        let grown = Asked {
            of_all: false,
            of_channel: false,
        };
        assert!(!super::takes(&old, &new, &noise, grown), "with a gap that grows");
        new[0] = old[0];
        (old[2], new[2]) = (250.0, 210.0);
        assert!(!takes(&old, &new, &noise, true), "most of next to nothing");
    }

    #[test]
    fn with_what_both_sides_agree_on_the_gap_may_grow_a_little() {
        assert!(grows_little(0.551, 0.490), "an eighth of what is left");
        assert!(!grows_little(0.551, 0.450), "more than a fifth");
        assert!(
            grows_little(1.02, 1.011) && !grows_little(1.02, 1.0),
            "nothing is left to grow"
        );
    }

    #[test]
    fn agreed_is_a_change_beside_the_names_that_were_there() {
        let all = candidates(&reference_robot("diff2"), &Excitation::default());
        let member = |name: &str, practical: f64| {
            let Some(candidate) = all.iter().find(|candidate| candidate.entry.name == name) else {
                panic!("no {name} in the library");
            };
            let axes = candidate.axes.iter();
            Member {
                values: axes.map(|axis| axis.neutral + practical * axis.practical).collect(),
                candidate: candidate.clone(),
            }
        };
        let [latency, radius, scale] =
            ["localization_latency", "wheel_radius", "pose_scale"].map(|name| member(name, 2.0));
        let joint = [latency.clone(), radius.clone()];
        assert!(is_as_agreed(&joint[..1], &joint));
        assert!(!is_as_agreed(&[scale], &joint), "an earlier name was exchanged");
        let small = [latency, member("wheel_radius", 0.9)];
        assert!(
            !is_as_agreed(&joint[..1], &small),
            "beside the others it would be calibration"
        );
    }

    #[test]
    fn what_would_be_calibration_gives_way_to_a_change() {
        let sizes = [0.6, 3.2, f64::INFINITY, 0.5];
        let mut rivals = [0, 3, 1, 2];
        by_size(&mut rivals, true, |position| (sizes[*position], false));
        assert_eq!(rivals, [1, 2, 0, 3]);
        let ordered = |is_beside: bool, first: (f64, bool), second: f64| {
            let mut rivals = [0, 1];
            by_size(&mut rivals, is_beside, |position| [first, (second, false)][*position]);
            rivals
        };
        assert_eq!(ordered(true, (0.9, false), 1.9), [0, 1]);
        assert_eq!(
            ordered(false, (0.9, false), 1.9),
            [1, 0],
            "alone it would hardly be a change"
        );
        assert_eq!(ordered(false, (0.9, true), 1.9), [0, 1], "ten thresholds");
        assert_eq!(
            ordered(false, (0.6, true), 1.9),
            [1, 0],
            "would be absorbed all the same"
        );
        assert_eq!(ordered(false, (0.6, false), 0.8), [1, 0]);
    }

    #[test]
    fn the_name_that_explains_clearly_more_is_preferred_and_what_explains_far_less_is_no_alternative() {
        assert_eq!(choice(&[(3, 0.9), (1, 0.95)]), (3, vec![1]));
        assert_eq!(choice(&[(3, 0.7), (1, 0.9), (5, -0.2)]), (1, vec![3]));
        assert_eq!(choice(&[(3, 0.05), (1, 0.95)]), (1, Vec::new()));
        assert_eq!(choice(&[(3, 0.9), (1, 0.1)]), (3, Vec::new()));
    }
}
