//! Two models on one run: which of them predicts it better, channel by channel.
//!
//! Both are started from the same measurements and driven by the same recorded commands ([`crate::gap`] for poses, windows of
//! [`crate::record`] for on-board channels), so that what differs is the model alone. Predictions overlap; which model is nearer is
//! told from differences over blocks of time, not from single predictions.

use crate::bundle::Bundle;
use crate::errors::{Errors, add_poses, add_windows, rms};
use crate::gap::{CLOSE_ANCHOR_PERIOD_S, GapError, GapSample, HORIZONS_S, RobotClock, end_to_end_with};
use crate::hypothesis::Hypothesis;
use crate::random::Random;
use crate::record::{CHANNELS, Record, UNITS};

/// Horizon that decides, s.
pub const DECIDING_S: f64 = 2.0;
/// Predictions that are drawn together: 5 s, longer than the horizon that decides.
const BLOCK: usize = 10;
/// Fewest predictions that tell more than chance.
const DECIDING_LEAST: usize = 2 * BLOCK;
const REPLICATES: usize = 1000;
/// Models closer than this share of their gap are alike to a person.
const LEAST_SHARE: f64 = 0.02;

/// Errors of both models in one channel at one horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// A name of [`CHANNELS`].
    pub channel: &'static str,
    pub horizon_s: f64,
    pub unit: &'static str,
    /// RMS.
    pub first: f64,
    pub second: f64,
    pub samples: usize,
}

/// Distance of both predictions from the measured position, one moment of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Time from the start of the run of the measured pose that was predicted [`DECIDING_S`] before.
    pub time_s: f64,
    pub first_m: f64,
    pub second_m: f64,
}

/// What the run says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nearer {
    First,
    Second,
    /// No difference beyond chance, or one too small to matter.
    Alike,
    /// Too short for a prediction that decides.
    Unknown,
}

/// RMS position gap of the second model over that of the first, [`DECIDING_S`] ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    pub value: f64,
    /// 95 % of resampled blocks of time.
    pub low: f64,
    pub high: f64,
}

/// Two models on one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Poses first, then by channel; horizons growing.
    pub rows: Vec<Row>,
    /// In order of time.
    pub course: Vec<Moment>,
    pub nearer: Nearer,
    /// Absent when too few predictions reach that far.
    pub ratio: Option<Ratio>,
}

/// Why two models cannot be compared on a run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CompareError {
    #[error("the {0} model cannot be simulated: a number is out of the library's range")]
    Model(&'static str),
    #[error(transparent)]
    Gap(#[from] GapError),
}

/// Compares two models on a run.
///
/// - Errors: a model that cannot be simulated; a run without poses or commands, or too short for one prediction.
pub fn compare(bundle: &Bundle, models: [&Hypothesis; 2]) -> Result<Comparison, CompareError> {
    let record = Record::of("", bundle);
    let mut poses = Vec::with_capacity(2);
    for (model, which) in models.iter().zip(["first", "second"]) {
        let robot = model.robot().ok_or(CompareError::Model(which))?;
        let clock = RobotClock::of(&model.effects);
        poses.push(end_to_end_with(bundle, &robot, clock, CLOSE_ANCHOR_PERIOD_S)?.samples);
    }
    let [first, second] = [(0, 1), (1, 0)].map(|(own, other)| shared(&poses[own], &poses[other]));
    let [first_errors, second_errors] = [(models[0], &first), (models[1], &second)].map(|(model, samples)| {
        let mut errors = Errors::new();
        add_poses(&mut errors, &record, samples);
        add_windows(&mut errors, None, &record, model);
        errors
    });
    let course = course(&first, &second);
    let ratio = ratio(&course);
    let nearer = match ratio {
        None => Nearer::Unknown,
        Some(ratio) if ratio.high < 1.0 && ratio.value < 1.0 - LEAST_SHARE => Nearer::Second,
        Some(ratio) if ratio.low > 1.0 && ratio.value * (1.0 - LEAST_SHARE) > 1.0 => Nearer::First,
        Some(_) => Nearer::Alike,
    };
    Ok(Comparison {
        rows: rows(&first_errors, &second_errors),
        course,
        nearer,
        ratio,
    })
}

/// Those predictions that the other model has as well: clocks of robots may shift where one can start.
fn shared(own: &[GapSample], other: &[GapSample]) -> Vec<GapSample> {
    let key = |sample: &GapSample| (sample.anchor_s, sample.horizon_s);
    let order = |a: &GapSample, b: &GapSample| {
        a.anchor_s
            .total_cmp(&b.anchor_s)
            .then(a.horizon_s.total_cmp(&b.horizon_s))
    };
    let has = |sample: &&GapSample| {
        let found = other.binary_search_by(|probe| order(probe, sample));
        found.is_ok_and(|place| key(&other[place]) == key(sample))
    };
    own.iter().filter(has).copied().collect()
}

fn course(first: &[GapSample], second: &[GapSample]) -> Vec<Moment> {
    let pairs = first.iter().zip(second);
    let distance_m = |sample: &GapSample| (sample.forward_m * sample.forward_m + sample.left_m * sample.left_m).sqrt();
    pairs
        .filter(|(sample, _)| sample.horizon_s == DECIDING_S)
        .map(|(first, second)| Moment {
            time_s: first.anchor_s + DECIDING_S,
            first_m: distance_m(first),
            second_m: distance_m(second),
        })
        .collect()
}

/// Ratio of the RMS distances, with the spread over blocks that are drawn with replacement, both models' together.
fn ratio(course: &[Moment]) -> Option<Ratio> {
    if course.len() < DECIDING_LEAST {
        return None;
    }
    let of = |sums: [f64; 2]| (sums[1] / sums[0].max(1e-18)).sqrt();
    let add = |sums: [f64; 2], one: &Moment| {
        [
            sums[0] + one.first_m * one.first_m,
            sums[1] + one.second_m * one.second_m,
        ]
    };
    let value = of(course.iter().fold([0.0; 2], add));
    let mut random = Random::new(1, 0x636f_6d70);
    let blocks = course.len().div_ceil(BLOCK);
    let mut drawn: Vec<f64> = (0..REPLICATES)
        .map(|_| {
            let sums = (0..blocks).fold([0.0; 2], |sums, _| {
                let from = random.below(course.len() - BLOCK + 1);
                course[from..from + BLOCK].iter().fold(sums, add)
            });
            of(sums)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    Some(Ratio {
        value,
        low: drawn[REPLICATES / 40],
        high: drawn[REPLICATES - 1 - REPLICATES / 40],
    })
}

/// Order of the channels in the table: what people look at first.
const ORDER: [&str; 8] = ["pose", "yaw", "wheel", "gyro", "accel", "current", "bus", "steering"];

fn rows(first: &Errors, second: &Errors) -> Vec<Row> {
    let place = |class: usize| ORDER.iter().position(|name| *name == CHANNELS[class]);
    let mut keys: Vec<(usize, usize)> = first.iter().map(|(key, _)| *key).collect();
    keys.sort_by_key(|(class, horizon)| (place(*class), *horizon));
    let of = |errors: &Errors, key: (usize, usize)| {
        let found = errors.iter().find(|(other, _)| *other == key);
        found.map(|(_, samples)| (rms(samples), samples.len()))
    };
    let row = |key: (usize, usize)| {
        let ((first, samples), (second, _)) = (of(first, key)?, of(second, key)?);
        Some(Row {
            channel: CHANNELS[key.0],
            horizon_s: HORIZONS_S[key.1],
            unit: UNITS[key.0],
            first,
            second,
            samples,
        })
    };
    keys.into_iter().filter_map(row).collect()
}

impl Comparison {
    /// The result in a sentence, with both models by name.
    pub fn sentence(&self, names: [&str; 2]) -> String {
        let row = self
            .rows
            .iter()
            .find(|row| row.channel == "pose" && row.horizon_s == DECIDING_S);
        let Some(row) = row else {
            return "The run is too short for a prediction 2 s ahead: the two cannot be told apart by it.".to_owned();
        };
        let [first, second] = [row.first, row.second].map(millimetres);
        let measured = |near: &str, far: &str| format!("{near} from the measured position 2 s ahead instead of {far}");
        match self.nearer {
            Nearer::First => format!(
                "{} is nearer to this run than {}: {}.",
                names[0],
                names[1],
                measured(&first, &second)
            ),
            Nearer::Second => format!(
                "{} is nearer to this run than {}: {}.",
                names[1],
                names[0],
                measured(&second, &first)
            ),
            Nearer::Alike => format!(
                "This run does not tell {} from {}: {first} and {second} from the measured position 2 s ahead, no more apart than chance.",
                names[0], names[1]
            ),
            Nearer::Unknown => format!(
                "The run is too short to tell {} from {}: {first} and {second} from the measured position 2 s ahead, in {} predictions.",
                names[0], names[1], row.samples
            ),
        }
    }
}

/// Tenths below ten millimetres.
fn millimetres(value_m: f64) -> String {
    let value_mm = 1000.0 * value_m;
    if value_mm < 9.95 {
        format!("{value_mm:.1} mm")
    } else {
        format!("{value_mm:.0} mm")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(count: usize, first_m: impl Fn(usize) -> f64, second_m: impl Fn(usize) -> f64) -> Vec<Moment> {
        let moment = |k: usize| Moment {
            time_s: 0.5 * k as f64,
            first_m: first_m(k),
            second_m: second_m(k),
        };
        (0..count).map(moment).collect()
    }

    #[test]
    fn a_steady_difference_is_told_and_one_lucky_stretch_is_not() {
        let wobble = |k: usize| 0.010 + 0.002 * ((k / 7) % 3) as f64;
        let half = ratio(&moments(100, wobble, |k| 0.5 * wobble(k))).expect("long enough");
        assert!((half.value - 0.5).abs() < 1e-12 && half.high < 0.51, "{half:?}");
        let lucky = |k: usize| if (40..50).contains(&k) { 0.0 } else { 1.01 * wobble(k) };
        let chance = ratio(&moments(100, wobble, lucky)).expect("long enough");
        assert!(chance.low < 1.0 && chance.high > 1.0, "{chance:?}");
        assert_eq!(ratio(&moments(DECIDING_LEAST - 1, wobble, wobble)), None);
    }

    #[test]
    fn predictions_that_only_one_model_has_are_left_out_of_both() {
        let sample = |anchor_s: f64| GapSample {
            anchor_s,
            horizon_s: DECIDING_S,
            forward_m: anchor_s,
            left_m: 0.0,
            yaw_rad: 0.0,
        };
        let (first, second) = (
            [sample(1.0), sample(2.0), sample(3.0)],
            [sample(2.0), sample(3.0), sample(4.0)],
        );
        let (first, second) = (shared(&first, &second), shared(&second, &first));
        assert_eq!(first, second);
        assert_eq!(
            course(&first, &second).iter().map(|m| m.time_s).collect::<Vec<_>>(),
            [4.0, 5.0]
        );
    }
}
