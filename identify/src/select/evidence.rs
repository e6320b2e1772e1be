//! What speaks for a fitted candidate, and what speaks against it.

use super::beyond::{beyond, sum};
use super::finalist::Finalist;
use super::in_turn::{in_turn, is_hardly_shown};
use super::round::{Fitted, Round, Side, VALIDATION_GAIN, difference, slices, weak_bar};
use crate::fit::{Bounded, with_members};
use crate::floor::{Floor, Metric};
use crate::hypothesis::{Axis, Hypothesis};
use crate::random::Random;
use crate::record::{CHANNELS, CLASSES, Record, Stages, residuals, residuals_with};
use twin::robot::RobotDescription;

/// Gain on validation runs over that of an effect of just this size, at least.
const CONSISTENT: f64 = 0.2;
/// A channel is worse when its energy rises by this share; so much of the whole gain may be lost in one channel, since effects that are
/// still missing may hide there.
pub(super) const WORSE: f64 = 0.1;
pub(super) const HARM: f64 = 0.25;
/// Share of the gain that runs on which an effect hardly acts may lose: real laws are off those of the library by that much.
const HARMLESS: f64 = 0.1;
/// Sizes beyond this many times the large one are believed at this many times the threshold.
const INCREDIBLE: f64 = 3.0;
const PROVEN: f64 = 10.0;
/// Of so many windows that it changes by as much energy one that loses says nothing against what is proven on the training runs.
const MANY_WINDOWS: usize = 10;
const CHANGED: f64 = 1.0;
/// Half-splits, and bootstrap replicates.
const REPLICATES: usize = 200;

/// Evidence on validation runs and references, and the first gate that it does not pass.
pub(super) fn judge(data: &Round, fitted: &Fitted, threshold: f64) -> Finalist {
    let mut finalist = Finalist {
        joint: fitted.joint.clone(),
        ..Finalist::of(fitted.position, &fitted.fit)
    };
    finalist.gain_train += sum(&beyond(data.floor, &data.train, &fitted.fit.residuals));
    if finalist.gain_train < weak_bar(data, threshold) {
        finalist.because = gate(data, &finalist, threshold);
        return finalist;
    }
    let model = if fitted.joint.is_empty() {
        with_members(data.model, core::slice::from_ref(&finalist.member))
    } else {
        with_members(&data.floor.model, &fitted.joint)
    };
    let own_stages = finalist.member.candidate.stages;
    let (stages, added) = if fitted.joint.is_empty() {
        (own_stages, 1)
    } else {
        (Stages::BOTH, 0)
    };
    let pairs = data.validation.records.iter().zip(data.validation.residuals);
    let changed: Option<Vec<Vec<f64>>> = pairs
        .map(|(record, base)| residuals_with(record, &model, added, stages, base))
        .collect();
    let Some(changed) = changed else {
        finalist.because = Some("cannot be simulated on the validation runs".to_owned());
        return finalist;
    };
    if !changed.is_empty() {
        validate(data, &data.validation, changed, &mut finalist, Some(threshold));
        let own = difference(data.train.residuals, &fitted.fit.residuals);
        let change_train = data.train.metric.gram(&[slices(&own)]).at(0, 0);
        finalist.is_unshown = is_hardly_shown(
            finalist.change_validation / data.validation.records.len() as f64,
            change_train / data.train.records.len() as f64,
        );
    }
    if let Some(metric) = data.reference_metric {
        let there = with_members(&data.floor.model, core::slice::from_ref(&finalist.member));
        let amplitude = amplitude_in_references(data.floor, metric, &there, own_stages);
        finalist.is_shown_by_references = amplitude.is_some();
        finalist.in_references = amplitude.unwrap_or(0.0);
    }
    finalist.because = gate(data, &finalist, threshold);
    let is_asked = finalist.because.is_some() && finalist.is_unshown && finalist.gain_train >= threshold;
    if let Some(changed) = is_asked.then(|| in_turn(data, fitted, threshold)).flatten() {
        // What the validation runs say stands in the report; it decides nothing.
        let mut asked = Finalist {
            is_in_turn: true,
            ..finalist.clone()
        };
        validate(data, &data.train, changed, &mut asked, None);
        let because = gate(data, &asked, threshold);
        finalist.because =
            because.map(|because| because.replace("the validation runs", "training runs with what the others say"));
        finalist.is_in_turn = finalist.because.is_none();
    }
    finalist.because = finalist.because.or_else(|| law_rest(data, fitted, threshold));
    finalist
}

/// What runs say of a candidate that was not fitted on them.
///
/// - `threshold`: of many windows one that loses does not count against what gains ten of them on the training runs; `None` where all count.
fn validate(data: &Round, side: &Side, changed: Vec<Vec<f64>>, finalist: &mut Finalist, threshold: Option<f64>) {
    let bounded = side.bounds.keep(side.metric, side.records, side.residuals, changed);
    let changed = &bounded.residuals;
    let own = difference(side.residuals, changed);
    let gram = side
        .metric
        .gram(&[slices(side.residuals), slices(changed), slices(&own)]);
    let weighed = gram.at(0, 0) - gram.at(1, 1);
    finalist.gain_validation = weighed + sum(&beyond(data.floor, side, changed));
    finalist.change_validation = gram.at(2, 2);
    finalist.harmful = harmful(data, side, changed, weighed, 0);
    finalist.worse = worse(data, side, &bounded, weighed, 0);
    let proven = threshold.filter(|threshold| finalist.gain_train >= PROVEN * threshold);
    let harmed = proven.filter(|threshold| is_harm(finalist, [*threshold, alone(data, *threshold)]));
    if harmed.is_some() && windows_changed(side, &own) >= MANY_WINDOWS {
        finalist.harmful = harmful(data, side, changed, weighed, 1);
        finalist.worse = worse(data, side, &bounded, weighed, 1);
        finalist.is_but_one = true;
    }
}

/// - `thresholds`: asked here, and of an effect alone.
fn is_harm(finalist: &Finalist, [asked, alone]: [f64; 2]) -> bool {
    finalist.is_harmful(asked, alone) || finalist.worse.is_some_and(|(_, share)| share > HARM)
}

/// Threshold of an effect alone.
fn alone(data: &Round, threshold: f64) -> f64 {
    threshold / data.thresholds_asked()
}

fn windows_changed(side: &Side, own: &[Vec<f64>]) -> usize {
    let runs = side.records.iter().enumerate();
    let energies = runs.flat_map(|(run, record)| rest_energies(side.metric, run, record, &own[run]));
    energies.filter(|energy| *energy >= CHANGED).count()
}

/// The laws of the named effects may have left what it explains.
fn law_rest(data: &Round, fitted: &Fitted, threshold: f64) -> Option<String> {
    if data.members.is_empty() {
        return None;
    }
    let own = data.own_part(fitted);
    (own < alone(data, threshold)).then(|| {
        format!(
            "all but {own:.0} of the {:.0} that it explains may be what the laws of the effects named so far leave where they act",
            fitted.fit.gain
        )
    })
}

/// Bootstrap of the validation windows: share of replicates with more energy than before. A run in which an effect does not act (a limit
/// that is not reached) is not made worse by it.
///
/// - `left_out`: so many windows that lose most do not count.
fn harmful(data: &Round, side: &Side, changed: &[Vec<f64>], gain: f64, left_out: usize) -> f64 {
    let nothing = (VALIDATION_GAIN * data.floor.inflation()).max(HARMLESS * gain);
    let mut random = Random::new(data.seed, 0x6861_726d);
    let mut runs: Vec<Vec<f64>> = Vec::new();
    for (run, record) in side.records.iter().enumerate() {
        runs.push(window_gains(
            side.metric,
            run,
            record,
            &side.residuals[run],
            &changed[run],
        ));
    }
    for _ in 0..left_out {
        if let Some(most) = runs.iter_mut().flatten().min_by(|a, b| a.total_cmp(b)) {
            *most = most.max(0.0);
        }
    }
    let mut worse = 0;
    for _ in 0..REPLICATES {
        let mut sum = 0.0;
        for _ in 0..runs.len() {
            let run = &runs[random.below(runs.len())];
            for _ in 0..run.len() {
                sum += run[random.below(run.len())];
            }
        }
        worse += usize::from(sum < -nothing);
    }
    worse as f64 / REPLICATES as f64
}

/// The channel of the validation runs that loses most, and its loss as a share of the whole gain, everyday differences taken out of both:
/// what the gain does not count is no loss.
///
/// - `left_out`: so many windows of every channel that lose most do not count.
fn worse(data: &Round, side: &Side, bounded: &Bounded, gain: f64, left_out: usize) -> Option<(usize, f64)> {
    let mut windows: [Vec<Energies>; CLASSES] = Default::default();
    for (run, record) in side.records.iter().enumerate() {
        let first = windows[0].len();
        for class in &mut windows {
            class.resize(first + record.windows.len(), Energies::default());
        }
        let (base, changed) = (&side.residuals[run], &bounded.residuals[run]);
        let metric = side.metric;
        let rests = metric.rest(run, base).into_iter().zip(metric.rest(run, changed));
        let residuals = base.iter().zip(changed);
        for ((place, rest), (before, after)) in record.places().iter().zip(rests).zip(residuals) {
            if let Some(quantity) = place.quantity {
                let own = &mut windows[quantity.class()][first + place.window];
                own.weighted[0] += rest.0 * rest.0;
                own.weighted[1] += rest.1 * rest.1;
                if bounded.shares[run][place.window] == 1.0 {
                    own.plain[0] += before * before;
                    own.plain[1] += after * after;
                }
            }
        }
    }
    let energies = windows.map(|class| without_worst(class, left_out));
    worst_channel(&energies, gain, VALIDATION_GAIN * data.floor.inflation())
}

/// Sum over the windows but for those that lose most: one start of a wheel that stood a moment longer outvotes all that was driven.
fn without_worst(mut windows: Vec<Energies>, left_out: usize) -> Energies {
    let loss = |of: &Energies| of.weighted[1] - of.weighted[0];
    windows.sort_by(|a, b| loss(b).total_cmp(&loss(a)));
    let counted = windows.iter().skip(left_out);
    counted.fold(Energies::default(), |sum, of| Energies {
        weighted: [0, 1].map(|side| sum.weighted[side] + of.weighted[side]),
        plain: [0, 1].map(|side| sum.plain[side] + of.plain[side]),
    })
}

/// Energy of a channel before and after.
#[derive(Debug, Clone, Copy, Default)]
struct Energies {
    weighted: [f64; 2],
    /// In the channel's own unit, squared, of the windows in which all of the candidate's change counts.
    plain: [f64; 2],
}

/// - `chance`: weighted energy that a channel may gain without a cause.
fn worst_channel(energies: &[Energies], gain: f64, chance: f64) -> Option<(usize, f64)> {
    let shares = energies.iter().enumerate().filter_map(|(class, energies)| {
        let ([old, new], [plain_old, plain_new]) = (energies.weighted, energies.plain);
        let share = (new - old) / gain.max(1.0);
        // Twice as bad in the channel's own unit is harm, however little the floor expects of the channel.
        let is_doubled = plain_new > 4.0 * plain_old;
        let is_worse = new > (1.0 + WORSE) * old && new - old > chance;
        is_worse.then_some((class, if is_doubled { share.max(1.0) } else { share }))
    });
    shares.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Decrease of the energy of every window of a run, everyday differences taken out: they are turned as is likeliest for the whole run, and what they cost by
/// their own likelihood is shared by all windows. The sum is the run's gain.
fn window_gains(metric: &Metric, run: usize, record: &Record, before: &[f64], after: &[f64]) -> Vec<f64> {
    let (before, after) = (
        window_energies(metric, run, record, before),
        window_energies(metric, run, record, after),
    );
    before.iter().zip(after).map(|(before, after)| before - after).collect()
}

/// Energy of every window of a run, everyday differences taken out as in a run's gain.
pub fn window_energies(metric: &Metric, run: usize, record: &Record, vector: &[f64]) -> Vec<f64> {
    let mut energies = rest_energies(metric, run, record, vector);
    let whole = metric.gram_of_run(run, &[vector]).at(0, 0);
    let cost = (whole - energies.iter().sum::<f64>()) / energies.len().max(1) as f64;
    energies.iter_mut().for_each(|energy| *energy += cost);
    energies
}

/// The same without the cost of everyday differences, which is the run's and not the windows'.
pub(super) fn rest_energies(metric: &Metric, run: usize, record: &Record, vector: &[f64]) -> Vec<f64> {
    let rest = metric.rest(run, vector);
    let cells = record.cells_of_windows().into_iter();
    cells
        .map(|cells| rest[cells].iter().map(|value| value * value).sum())
        .collect()
}

/// How much of an effect the references have, 1 for all of it; `None` when they would hardly show it.
///
/// - `model`: the floor's with the effect alone; what else is named was not there when they were driven.
pub(super) fn amplitude_in_references(
    floor: &Floor,
    metric: &Metric,
    model: &Hypothesis,
    stages: Stages,
) -> Option<f64> {
    let pairs = floor.references.iter().zip(&floor.residuals);
    let changed: Option<Vec<Vec<f64>>> = pairs
        .map(|(record, base)| residuals(record, model, stages, Some(base)))
        .collect();
    let own = difference(&floor.residuals, &changed?);
    let gram = metric.gram(&[slices(&floor.residuals), slices(&floor.left_out), slices(&own)]);
    // Too weak on the references to say. What was calibrated on them may have taken it up.
    (gram.at(2, 2) > 9.0).then(|| gram.at(0, 2).max(gram.at(1, 2)) / gram.at(2, 2))
}

fn gate(data: &Round, finalist: &Finalist, threshold: f64) -> Option<String> {
    let least = VALIDATION_GAIN * data.floor.inflation();
    let alone = alone(data, threshold);
    // Beside others nothing weak counts that both sides do not agree on.
    let may_be_weak = data.members.is_empty() || finalist.is_agreed(alone);
    let weak = if may_be_weak {
        weak_bar(data, threshold)
    } else {
        threshold
    };
    let bars = [weak, threshold, threshold + least];
    if !is_seen(finalist.gain_train, finalist.gain_validation, bars) {
        return Some(format!(
            "gain {:.0} on the training runs is below the threshold {threshold:.0}",
            finalist.gain_train
        ));
    }
    if !data.validation.records.is_empty() {
        if finalist.gain_validation < least {
            return Some(format!(
                "gain {:.0} on the validation runs is below {least:.0}",
                finalist.gain_validation
            ));
        }
        if finalist.gain_validation < CONSISTENT * finalist.change_validation {
            return Some("changes the validation runs more than it explains of them".to_owned());
        }
        if let Some((class, share)) = finalist.worse.filter(|worse| worse.1 > HARM) {
            return Some(format!(
                "makes {} worse by {:.0} % of what it gains",
                CHANNELS[class],
                100.0 * share
            ));
        }
        if finalist.is_harmful(threshold, alone) {
            return Some(format!(
                "makes {:.0} % of the bootstrap replicates worse",
                100.0 * finalist.harmful
            ));
        }
    }
    own_doubt(&data.floor.given.description, finalist, threshold)
}

/// Why an effect would not be believed whatever runs say for it.
pub(super) fn own_doubt(robot: &RobotDescription, finalist: &Finalist, threshold: f64) -> Option<String> {
    if finalist.is_background() {
        return Some(format!(
            "is in the references as well, at {:.0} % of its size",
            100.0 * finalist.in_references
        ));
    }
    let candidate = &finalist.member.candidate;
    if candidate.entry.name == "weak_motor" && finalist.member.values.iter().any(|gain| *gain > 1.0) {
        return Some("its best value is a motor stronger than described".to_owned());
    }
    let large = candidate.large_size(robot);
    if is_incredible(finalist.sure_size, large, finalist.gain_train, threshold) {
        return Some(format!(
            "explains next to nothing for its size, {:.1} times what is large",
            finalist.sure_size / large
        ));
    }
    let mut axes = finalist.member.candidate.axes.iter().zip(&finalist.member.values);
    axes.any(|(axis, value)| is_at_an_end(axis, *value))
        .then(|| "its best value is at the end of the possible range".to_owned())
}

/// A size, or a time or a speed that shapes a law, at the end of its range: a law of another kind is imitated. A place there is far away.
fn is_at_an_end(axis: &Axis, value: f64) -> bool {
    let is_between = axis.neutral.is_finite() && axis.low != axis.neutral && axis.high != axis.neutral;
    let is_shape = !axis.carries_size && axis.unit != "m" && axis.unit != "rad";
    (is_shape || (axis.carries_size && is_between)) && (value <= axis.low || value >= axis.high)
}

/// Above the threshold on the training runs; or weaker there, as much stronger on the validation runs as that is below it.
///
/// - `bars`: for weak ones on the training runs, for all others, and for weak ones on both together.
fn is_seen(train: f64, validation: f64, bars: [f64; 3]) -> bool {
    let [weak, threshold, both] = bars;
    train >= threshold || (train >= weak && train + validation >= both)
}

/// A size far beyond the large one of the library needs evidence as large: what hardly shows may be turned to any size to fit a rest.
fn is_incredible(size: f64, large: f64, gain: f64, threshold: f64) -> bool {
    size.is_finite() && size > INCREDIBLE * large && gain < PROVEN * threshold
}

/// Share of half-splits of all windows in which a finalist, or one just like it, gains most.
pub(super) fn stability(data: &Round, pairs: &mut [(Finalist, &Fitted)]) {
    let gains: Vec<Vec<f64>> = pairs
        .iter()
        .map(|(_, fitted)| {
            let beyond = beyond(data.floor, &data.train, &fitted.fit.residuals);
            let mut all = Vec::new();
            for (run, record) in data.train.records.iter().enumerate() {
                let (before, after) = (&data.train.residuals[run], &fitted.fit.residuals[run]);
                let gains = window_gains(data.train.metric, run, record, before, after);
                all.extend(gains.iter().zip(&beyond[run]).map(|(gain, more)| gain + more));
            }
            all
        })
        .collect();
    let passes: Vec<bool> = pairs.iter().map(|(finalist, _)| finalist.because.is_none()).collect();
    for ((finalist, _), share) in pairs.iter_mut().zip(wins(&gains, &passes, data.seed)) {
        finalist.stability = share;
    }
}

/// Share of half-splits in which each gains as much as the best of those that pass.
///
/// - `gains`: of each, by window.
pub(super) fn wins(gains: &[Vec<f64>], passes: &[bool], seed: u64) -> Vec<f64> {
    let mut wins = vec![0.0; gains.len()];
    let windows = gains.first().map_or(0, Vec::len);
    if windows == 0 {
        return wins;
    }
    let mut random = Random::new(seed, 0x6861_6c66);
    for _ in 0..REPLICATES {
        let half: Vec<usize> = (0..windows).filter(|_| random.uniform() < 0.5).collect();
        let sums: Vec<f64> = gains.iter().map(|gain| half.iter().map(|w| gain[*w]).sum()).collect();
        let open = sums.iter().zip(passes).filter(|(_, passes)| **passes);
        let best = open.map(|(sum, _)| *sum).fold(f64::NEG_INFINITY, f64::max);
        for (win, sum) in wins.iter_mut().zip(&sums) {
            *win += f64::from(u8::from(*sum >= 0.95 * best && *sum > 0.0));
        }
    }
    wins.iter_mut().for_each(|win| *win /= REPLICATES as f64);
    wins
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(old: f64, new: f64) -> Energies {
        Energies {
            weighted: [old, new],
            plain: [old, new],
        }
    }

    #[test]
    fn the_channel_that_loses_most_is_told_with_its_share_of_the_gain() {
        let energies = [channel(100.0, 20.0), channel(50.0, 70.0), channel(10.0, 40.0)];
        assert_eq!(worst_channel(&energies, 60.0, 5.0), Some((2, 0.5)));
        assert_eq!(worst_channel(&energies, 60.0, 25.0), Some((2, 0.5)));
        assert_eq!(worst_channel(&energies, 60.0, 31.0), None, "by chance");
        assert_eq!(
            worst_channel(&[channel(100.0, 109.0)], 60.0, 5.0),
            None,
            "a tenth is allowed"
        );
    }

    #[test]
    fn one_window_may_be_left_out_of_what_a_channel_loses() {
        let windows = vec![channel(20.0, 10.0), channel(40.0, 300.0), channel(30.0, 35.0)];
        let all = without_worst(windows.clone(), 0);
        assert_eq!((all.weighted, all.plain), ([90.0, 345.0], [90.0, 345.0]));
        let most = without_worst(windows, 1);
        assert_eq!((most.weighted, most.plain), ([50.0, 45.0], [50.0, 45.0]));
        assert_eq!(without_worst(Vec::new(), 1).weighted, [0.0, 0.0]);
    }

    #[test]
    fn what_is_weak_on_the_training_runs_is_seen_when_the_others_make_up_for_it() {
        let bars = [17.0, 34.0, 48.0];
        assert!(is_seen(34.0, 0.0, bars), "above the threshold");
        assert!(is_seen(28.0, 20.0, bars), "made up for");
        assert!(!is_seen(28.0, 19.0, bars), "not quite made up for");
        assert!(!is_seen(16.0, 500.0, bars), "nothing on the training runs");
        assert!(
            !is_seen(33.0, 500.0, [34.0, 34.0, 48.0]),
            "beside another effect nothing weak"
        );
    }

    /// A motor that heats up in half a second is friction that grows with the load.
    #[test]
    fn shapes_at_the_end_of_their_range_are_another_law() {
        let axis = |name: &'static str, unit: &'static str, carries_size: bool, low: f64, neutral: f64| Axis {
            name,
            unit,
            neutral,
            low,
            high: 50.0,
            practical: 0.1,
            carries_size,
        };
        let heating = axis("time_constant", "s", false, 0.5, 30.0);
        assert!(is_at_an_end(&heating, 0.5) && is_at_an_end(&heating, 50.0) && !is_at_an_end(&heating, 0.6));
        let place = axis("x", "m", false, -50.0, 0.0);
        assert!(!is_at_an_end(&place, -50.0) && !is_at_an_end(&place, 50.0));
        let one_sided = axis("torque", "N m", true, 0.0, 0.0);
        assert!(!is_at_an_end(&one_sided, 0.0) && !is_at_an_end(&one_sided, 50.0));
        let size = axis("relative", "1", true, -0.3, 0.0);
        assert!(is_at_an_end(&size, -0.3) && !is_at_an_end(&size, -0.29));
    }

    #[test]
    fn a_size_beyond_belief_needs_evidence() {
        assert!(
            is_incredible(91.0, 15.0, 72.0, 34.0),
            "a wheel 18 % smaller that hardly shows"
        );
        assert!(!is_incredible(91.0, 15.0, 400.0, 34.0) && !is_incredible(44.0, 15.0, 72.0, 34.0));
        assert!(!is_incredible(f64::INFINITY, 15.0, 72.0, 34.0), "limits have no size");
    }

    #[test]
    fn twice_the_error_in_the_channels_own_unit_is_harm_whatever_the_gain() {
        let doubled = Energies {
            weighted: [10.0, 42.0],
            plain: [1.0, 4.2],
        };
        assert_eq!(worst_channel(&[doubled], 1e6, 5.0), Some((0, 1.0)));
    }
}
