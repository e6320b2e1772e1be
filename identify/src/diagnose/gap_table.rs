//! Gap of locked runs before and after, by channel and horizon.

use crate::bundle::Bundle;
use crate::errors::{Errors, POSE, Sample, add_poses, add_windows, rms};
use crate::floor::{ClassNoise, Floor, NoiseModel};
use crate::gap::{CLOSE_ANCHOR_PERIOD_S, HORIZONS_S, RobotClock, end_to_end_with};
use crate::hypothesis::Hypothesis;
use crate::random::Random;
use crate::record::{CHANNELS, Record, UNITS};
use crate::report::schema::{Gap, rounded};
use crate::select::Role;

use super::Case;

/// Bootstrap replicates of an interval.
const REPLICATES: usize = 300;
/// The table and the mean explained fraction; both empty without locked runs.
pub(super) fn gap_table(case: &Case, after: &Hypothesis) -> (Vec<Gap>, Option<f64>) {
    let given = case.input.locked.iter().map(|run| &run.bundle);
    let held_back = case
        .input
        .runs
        .iter()
        .zip(&case.roles)
        .filter(|(_, role)| **role == Role::Locked);
    let bundles: Vec<_> = given.chain(held_back.map(|(run, _)| &run.bundle)).collect();
    if bundles.is_empty() || case.locked.is_empty() {
        return (Vec::new(), None);
    }
    // What was lost is read from the wheels of these runs as well; before anything is named all was sent that was.
    let as_sent = if case.arrived.is_empty() {
        &case.locked
    } else {
        &case.locked_as_sent
    };
    let known = Known::new(case, &bundles, &as_sent.iter().collect::<Vec<_>>());
    let records: Vec<&Record> = case.locked.iter().collect();
    let arrived: Vec<&Bundle> = records
        .iter()
        .zip(&bundles)
        .map(|(record, bundle)| case.arrived(record, bundle))
        .collect();
    gaps(case, &known, &errors(&case.floor, &arrived, &records, after))
}

/// Part of the gap of the validation runs that models explain, remembered while nothing but the model changes.
#[derive(Default)]
pub(super) struct ValidationGap {
    /// Of the floor that it was asked with, and how many runs had set-points that never arrived.
    asked: Option<(Hypothesis, NoiseModel, usize)>,
    known: Known,
    explained: Vec<(Hypothesis, Option<f64>)>,
}

impl ValidationGap {
    /// Part that each model explains; unknown when there is none to speak of.
    pub fn explained(&mut self, case: &Case, models: &[Hypothesis]) -> Vec<Option<f64>> {
        let runs = case.input.runs.iter().zip(&case.records).zip(&case.roles);
        let (bundles, records): (Vec<_>, Vec<_>) = runs
            .filter(|(_, role)| **role == Role::Validation)
            .map(|((run, record), _)| (case.arrived(record, &run.bundle), record))
            .unzip();
        let floor = &case.floor;
        let is_alike = |asked: &(Hypothesis, NoiseModel, usize)| {
            asked.0 == floor.model && asked.1 == floor.noise && asked.2 == case.arrived.len()
        };
        if !self.asked.as_ref().is_some_and(is_alike) {
            self.asked = Some((floor.model.clone(), floor.noise.clone(), case.arrived.len()));
            self.known = Known::new(case, &bundles, &records);
            self.explained.clear();
        }
        let mut explained = Vec::with_capacity(models.len());
        for model in models {
            let before = self.explained.iter().find(|(other, _)| other == model);
            let own = match before {
                Some((_, explained)) => *explained,
                None => {
                    let own = gaps(case, &self.known, &errors(floor, &bundles, &records, model)).1;
                    self.explained.push((model.clone(), own));
                    own
                }
            };
            explained.push(own);
        }
        explained
    }
}

/// Errors under the floor's model, of the runs and of the references.
#[derive(Default)]
struct Known {
    before: Errors,
    references: Errors,
}

impl Known {
    /// - `bundles`, `records`: of the same runs.
    fn new(case: &Case, bundles: &[&Bundle], records: &[&Record]) -> Known {
        let floor = &case.floor;
        let reference_records: Vec<&Record> = floor.references.iter().collect();
        let reference_bundles: Vec<_> = floor
            .references
            .iter()
            .filter_map(|record| case.input.references.iter().find(|run| run.path == record.name))
            .map(|run| &run.bundle)
            .collect();
        Known {
            before: errors(floor, bundles, records, floor.before()),
            references: errors(floor, &reference_bundles, &reference_records, &floor.model),
        }
    }
}

/// - `after`: errors of the same runs under another model.
fn gaps(case: &Case, known: &Known, after: &Errors) -> (Vec<Gap>, Option<f64>) {
    let floor = &case.floor;
    let mut gaps = Vec::new();
    let (mut weight_sum, mut weighted) = (0.0, 0.0);
    for (key, samples) in &known.before {
        let Some((_, samples_after)) = after.iter().find(|(other, _)| other == key) else {
            continue;
        };
        let (class, horizon) = *key;
        let references = comparable(&known.references, class, horizon);
        let floor_rms = if references.is_empty() {
            stated(floor, class)
        } else {
            floor_of(&references, samples, class)
        };
        let squares_after: Vec<f64> = samples_after.iter().map(|sample| sample.square).collect();
        let (before, now) = (rms(samples), rms(samples_after));
        let block = if class < POSE {
            1
        } else {
            overlapping(HORIZONS_S[horizon])
        };
        let seed = case.input.seed ^ (class as u64 * 16 + horizon as u64);
        let (low, high) = interval(&squares_after, block, seed);
        let room = before * before - floor_rms * floor_rms;
        let explained = (room > 0.0).then(|| (before * before - now * now) / room);
        if let (Some(explained), true) = (explained, before > 1.5 * floor_rms) {
            let weight = libm::log(before / floor_rms.max(1e-12));
            weight_sum += weight;
            weighted += weight * explained;
        }
        gaps.push(Gap {
            channel: CHANNELS[class].to_owned(),
            horizon_s: HORIZONS_S[horizon],
            unit: UNITS[class].to_owned(),
            floor: rounded(floor_rms),
            before: rounded(before),
            after: rounded(now),
            low: rounded(low),
            high: rounded(high),
            explained_fraction: explained.map(rounded),
        });
    }
    gaps.sort_by(|a, b| a.channel.cmp(&b.channel).then(a.horizon_s.total_cmp(&b.horizon_s)));
    (gaps, (weight_sum > 0.0).then(|| rounded(weighted / weight_sum)))
}

/// Errors that a channel's floor at a horizon is estimated from. On board all parts of the windows together, few as they are: such a channel
/// is compared over a span, its error does not grow from part to part.
fn comparable(errors: &Errors, class: usize, horizon: usize) -> Vec<Sample> {
    let alike = errors
        .iter()
        .filter(|(key, _)| key.0 == class && (class < POSE || key.1 == horizon));
    alike.flat_map(|(_, samples)| samples.iter().copied()).collect()
}

/// What the references' errors are where it is as lively as in the locked runs.
fn floor_of(references: &[Sample], locked: &[Sample], class: usize) -> f64 {
    let mean = |samples: &[Sample], value: &dyn Fn(&Sample) -> f64| {
        samples.iter().map(value).sum::<f64>() / samples.len().max(1) as f64
    };
    if class < POSE {
        // Every window alike: were it a ratio of sums, a few lively windows that the floor expects too much of would speak for all.
        let share = mean(references, &|sample| sample.square / sample.expected.max(1e-300));
        return (share * mean(locked, &|sample| sample.expected)).sqrt();
    }
    let own = mean(references, &|sample| sample.square);
    let mut cells: Vec<(f64, f64)> = references.iter().map(|s| (s.expected.sqrt(), s.square)).collect();
    let noise = ClassNoise::fitted(&mut cells, 1e-12, 0.0);
    let model = |samples: &[Sample]| mean(samples, &|sample| noise.at(sample.expected.sqrt()));
    (own * model(locked) / model(references).max(1e-300)).sqrt()
}

/// Floor of a channel without references.
fn stated(floor: &Floor, class: usize) -> f64 {
    floor.noise.classes[class].level.sqrt()
}

fn rms_of(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// Predictions so far ahead that share a part of their way with one of them.
fn overlapping(horizon_s: f64) -> usize {
    libm::ceil(horizon_s / CLOSE_ANCHOR_PERIOD_S) as usize
}

/// Parts that an interval needs, at least: fewer say nothing of chance.
const FEWEST_BLOCKS: usize = 4;

/// Of the root mean square, 95 %: drawn in blocks of neighbours, which err together, in a circle (Politis and Romano 1992).
fn interval(squares: &[f64], block: usize, seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed, 0x6761_7073);
    let count = squares.len();
    let block = block.min(count / FEWEST_BLOCKS).max(1);
    let mut values: Vec<f64> = (0..REPLICATES)
        .map(|_| {
            let mut drawn = Vec::with_capacity(count + block);
            while drawn.len() < count {
                let first = random.below(count);
                drawn.extend((first..first + block).map(|k| squares[k % count]));
            }
            drawn.truncate(count);
            rms_of(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    (values[REPLICATES / 40], values[REPLICATES - 1 - REPLICATES / 40])
}

/// Errors of runs under a model, with what the floor expects of them. `bundles` and `records` are of the same runs.
fn errors(floor: &Floor, bundles: &[&Bundle], records: &[&Record], model: &Hypothesis) -> Errors {
    let mut errors: Errors = Vec::new();
    if let Some(robot) = model.robot() {
        for (bundle, record) in bundles.iter().zip(records) {
            let clock = RobotClock::of(&model.effects);
            let Ok(gap) = end_to_end_with(bundle, &robot, clock, CLOSE_ANCHOR_PERIOD_S) else {
                continue;
            };
            add_poses(&mut errors, record, &gap.samples);
        }
    }
    for record in records {
        add_windows(&mut errors, Some(&floor.noise), record, model);
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(square: f64, expected: f64) -> Sample {
        Sample { square, expected }
    }

    /// Windows of which the floor expects twice the standard deviation of the references' have twice their floor.
    #[test]
    fn floor_follows_what_windows_are_expected_to_err() {
        let references = [sample(4.0, 1.0), sample(2.0, 1.0)];
        let alike = floor_of(&references, &[sample(0.0, 1.0)], 0);
        let livelier = floor_of(&references, &[sample(0.0, 4.0), sample(9.0, 4.0)], 0);
        assert!((alike - 3.0_f64.sqrt()).abs() < 1e-12);
        assert!((livelier / alike - 2.0).abs() < 1e-12);
    }

    /// Of a lively window the floor expected sixteen times too much.
    #[test]
    fn a_lively_window_does_not_speak_for_the_quiet_ones() {
        let references = [&[sample(1.0, 1.0); 9][..], &[sample(100.0, 1600.0)]].concat();
        let quiet = floor_of(&references, &[sample(0.0, 1.0)], 0);
        assert!((quiet - 1.0).abs() < 0.1, "{quiet}");
    }

    /// Ten predictions of 5 s begin on the way of one: their errors are one error.
    #[test]
    fn errors_of_overlapping_predictions_count_once() {
        let squares: Vec<f64> = (0..60).map(|k| if k / 10 % 3 == 0 { 9.0 } else { 1.0 }).collect();
        let (apart, together) = (interval(&squares, 1, 3), interval(&squares, overlapping(5.0), 3));
        assert_eq!((overlapping(5.0), overlapping(0.5)), (10, 1));
        let rms = rms_of(&squares);
        assert!(together.0 < apart.0 && together.1 > apart.1 && apart.0 < rms && rms < apart.1);
        let few = interval(&squares[5..15], overlapping(5.0), 3);
        assert!(few.1 - few.0 > 0.3, "ten are no single block: {few:?}");
        assert!(
            together.1 - together.0 > 1.5 * (apart.1 - apart.0),
            "{together:?} {apart:?}"
        );
    }

    #[test]
    fn channels_on_board_share_their_parts_and_poses_do_not() {
        let errors: Errors = vec![
            ((0, 0), vec![sample(1.0, 1.0)]),
            ((0, 1), vec![sample(2.0, 1.0)]),
            ((1, 1), vec![sample(3.0, 1.0)]),
            ((POSE, 0), vec![sample(4.0, 1.0)]),
            ((POSE, 1), vec![sample(5.0, 1.0)]),
        ];
        let squares = |class, horizon| -> Vec<f64> {
            let samples = comparable(&errors, class, horizon);
            samples.iter().map(|sample| sample.square).collect()
        };
        assert_eq!(squares(0, 1), [1.0, 2.0]);
        assert_eq!(squares(1, 0), [3.0]);
        assert_eq!(squares(POSE, 1), [5.0]);
        assert!(squares(2, 0).is_empty());
    }

    /// Poses that err by 1 mm + 1 mm per rad/s of harshness: locked runs at twice the unit of harshness are allowed as much as references as harsh were off.
    #[test]
    fn floor_of_poses_follows_how_harshly_wheels_were_driven() {
        let reference = |k: usize| {
            let harshness = 4.0 * (k % 40) as f64 / 39.0;
            sample(1e-6 + 1e-6 * harshness * harshness, harshness * harshness)
        };
        let references: Vec<Sample> = (0..400).map(reference).collect();
        let locked = [sample(0.0, 4.0)];
        let floor_m = floor_of(&references, &locked, POSE);
        assert!((floor_m - 5e-6_f64.sqrt()).abs() < 0.3e-3, "{floor_m}");
        let quiet_m = floor_of(&references, &[sample(0.0, 0.0)], POSE);
        assert!(quiet_m < 0.7 * floor_m, "{quiet_m}");
    }
}
