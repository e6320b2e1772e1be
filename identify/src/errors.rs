//! Errors of a run under a model by channel and horizon: poses predicted from anchors, on-board channels in windows.

use crate::floor::NoiseModel;
use crate::gap::{GapSample, HORIZONS_S, RUN_IN_S};
use crate::hypothesis::Hypothesis;
use crate::record::{CLASSES, Quantity, Record, Stages, residuals};

/// Class of the pose; that of the yaw follows, those before are compared in windows.
pub const POSE: usize = 6;
/// Horizons of channels that are compared in windows.
const WINDOW_HORIZONS_S: [f64; 3] = [0.5, 1.0, 2.0];

/// An error, and how large it is to be expected where nothing is changed.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    pub square: f64,
    /// Of a window: variance by the floor's noise. Of an anchor: square of the harshness, (rad/s)^2.
    pub expected: f64,
}

/// Errors by (class, horizon): one entry an anchor or window, run after run.
pub type Errors = Vec<((usize, usize), Vec<Sample>)>;

/// Root of the mean square; 0 without samples.
pub fn rms(samples: &[Sample]) -> f64 {
    (samples.iter().map(|sample| sample.square).sum::<f64>() / samples.len().max(1) as f64).sqrt()
}

fn push(errors: &mut Errors, key: (usize, usize), sample: Sample) {
    match errors.iter_mut().find(|(other, _)| *other == key) {
        Some((_, samples)) => samples.push(sample),
        None => errors.push((key, vec![sample])),
    }
}

/// How harshly the wheels were driven over the time of a run.
struct Liveliness(Vec<(f64, f64)>);

impl Liveliness {
    fn of(record: &Record) -> Liveliness {
        let places = record.places();
        let lively = |wanted: &dyn Fn(Quantity) -> bool| -> Vec<(f64, f64)> {
            let pairs = places.iter().zip(record.activities());
            pairs
                .filter(|(place, _)| place.quantity.is_some_and(wanted))
                .map(|(place, activity)| (place.time_s, activity))
                .collect()
        };
        let mut cells = lively(&|quantity| matches!(quantity, Quantity::Wheel(_)));
        if cells.is_empty() {
            cells = lively(&|quantity| quantity == Quantity::Gyro);
        }
        cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Liveliness(cells)
    }

    /// Square of the largest activity in a span.
    fn squared(&self, from_s: f64, to_s: f64) -> f64 {
        let begin = self.0.partition_point(|cell| cell.0 < from_s);
        let end = self.0.partition_point(|cell| cell.0 <= to_s);
        let largest = self.0[begin..end].iter().fold(0.0_f64, |most, cell| most.max(cell.1));
        largest * largest
    }
}

/// Adds the mean squares of the on-board channels over each window's parts up to the horizons.
///
/// - `noise`: what the floor expects of the cells; without it nothing is expected.
pub fn add_windows(errors: &mut Errors, noise: Option<&NoiseModel>, record: &Record, model: &Hypothesis) {
    let Some(residual) = residuals(record, model, Stages::BOTH, None) else {
        return;
    };
    // Mean square of a window up to each horizon: sums of squares, of expected squares, and their number.
    let mut sums = vec![[[[0.0; 3]; WINDOW_HORIZONS_S.len()]; CLASSES]; record.windows.len()];
    for ((place, activity), value) in record.places().iter().zip(record.activities()).zip(&residual) {
        let Some(class) = place
            .quantity
            .map(|quantity| quantity.class())
            .filter(|class| *class < POSE)
        else {
            continue;
        };
        let noise = noise.map(|noise| &noise.classes[class]);
        let since_s = place.time_s - record.windows[place.window].from_s;
        for (horizon, limit_s) in WINDOW_HORIZONS_S.iter().enumerate() {
            let from_s = if horizon == 0 {
                0.0
            } else {
                WINDOW_HORIZONS_S[horizon - 1]
            };
            if since_s >= from_s && since_s < *limit_s {
                let [sum, expected, count] = &mut sums[place.window][class][horizon];
                *sum += value * value;
                *expected += noise.map_or(0.0, |noise| noise.at(activity));
                *count += 1.0;
            }
        }
    }
    for window in &sums {
        for (class, horizons) in window.iter().enumerate() {
            for (horizon, [sum, expected, count]) in horizons.iter().enumerate() {
                if *count > 0.0 {
                    let sample = Sample {
                        square: sum / count,
                        expected: expected / count,
                    };
                    push(errors, (class, horizon), sample);
                }
            }
        }
    }
}

/// Adds the squares of predicted poses against measured ones.
pub fn add_poses(errors: &mut Errors, record: &Record, samples: &[GapSample]) {
    let liveliness = Liveliness::of(record);
    for sample in samples {
        add_pose(errors, sample, &liveliness);
    }
}

fn add_pose(errors: &mut Errors, sample: &GapSample, liveliness: &Liveliness) {
    let Some(horizon) = HORIZONS_S.iter().position(|h| *h == sample.horizon_s) else {
        return;
    };
    let expected = liveliness.squared(sample.anchor_s - RUN_IN_S, sample.anchor_s + sample.horizon_s);
    let square = sample.forward_m * sample.forward_m + sample.left_m * sample.left_m;
    push(errors, (POSE, horizon), Sample { square, expected });
    let square = sample.yaw_rad * sample.yaw_rad;
    push(errors, (POSE + 1, horizon), Sample { square, expected });
}
