//! Gap of locked runs before and after, by channel and horizon.

use crate::floor::Floor;
use crate::gap::{GapSample, HORIZONS_S, end_to_end_with};
use crate::hypothesis::Hypothesis;
use crate::random::Random;
use crate::record::{CHANNELS, CLASSES, Record, Stages, UNITS, residuals};
use crate::report::schema::{Gap, rounded};
use crate::select::Role;

use super::Case;

/// Bootstrap replicates of an interval.
const REPLICATES: usize = 300;
/// Horizons of channels that are compared in windows.
const WINDOW_HORIZONS_S: [f64; 3] = [0.5, 1.0, 2.0];

/// Squared errors by (class, horizon): one entry an anchor or window, run after run.
type Errors = Vec<((usize, usize), Vec<f64>)>;

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
    let floor = &case.floor;
    let reference_bundles: Vec<_> = case.input.references.iter().map(|run| &run.bundle).collect();
    let before_errors = errors(&bundles, &case.locked, &floor.model);
    let after_errors = errors(&bundles, &case.locked, after);
    let floor_errors = errors(&reference_bundles, &floor.references, &floor.model);
    let mut gaps = Vec::new();
    let (mut weight_sum, mut weighted) = (0.0, 0.0);
    for (key, squares) in &before_errors {
        let Some((_, squares_after)) = after_errors.iter().find(|(other, _)| other == key) else {
            continue;
        };
        let (class, horizon) = *key;
        let floor_rms = floor_errors
            .iter()
            .find(|(other, _)| other == key)
            .map_or_else(|| stated(floor, class), |(_, squares)| rms(squares));
        let (before, now) = (rms(squares), rms(squares_after));
        let (low, high) = interval(squares_after, case.input.seed ^ (class as u64 * 16 + horizon as u64));
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

/// Floor of a channel without references.
fn stated(floor: &Floor, class: usize) -> f64 {
    floor.noise.classes[class].level.sqrt()
}

fn rms(squares: &[f64]) -> f64 {
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

fn interval(squares: &[f64], seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed, 0x6761_7073);
    let mut values: Vec<f64> = (0..REPLICATES)
        .map(|_| {
            let drawn: Vec<f64> = (0..squares.len())
                .map(|_| squares[random.below(squares.len())])
                .collect();
            rms(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    (values[REPLICATES / 40], values[REPLICATES - 1 - REPLICATES / 40])
}

fn push(errors: &mut Errors, key: (usize, usize), square: f64) {
    match errors.iter_mut().find(|(other, _)| *other == key) {
        Some((_, squares)) => squares.push(square),
        None => errors.push((key, vec![square])),
    }
}

fn errors(bundles: &[&crate::bundle::Bundle], records: &[Record], model: &Hypothesis) -> Errors {
    let mut errors: Errors = Vec::new();
    if let Some(robot) = model.robot() {
        for bundle in bundles {
            let Ok(gap) = end_to_end_with(bundle, &robot) else {
                continue;
            };
            for sample in &gap.samples {
                add_pose(&mut errors, sample);
            }
        }
    }
    for record in records {
        let Some(residual) = residuals(record, model, Stages::BOTH, None) else {
            continue;
        };
        // Mean square of a window up to each horizon.
        let mut sums = vec![[[(0.0, 0.0); WINDOW_HORIZONS_S.len()]; CLASSES]; record.windows.len()];
        for (place, value) in record.places().iter().zip(&residual) {
            let Some(class) = place.quantity.map(|quantity| quantity.class()) else {
                continue;
            };
            if class >= 6 {
                continue;
            }
            let since_s = place.time_s - record.windows[place.window].from_s;
            for (horizon, limit_s) in WINDOW_HORIZONS_S.iter().enumerate() {
                let from_s = if horizon == 0 {
                    0.0
                } else {
                    WINDOW_HORIZONS_S[horizon - 1]
                };
                if since_s >= from_s && since_s < *limit_s {
                    let (sum, count) = &mut sums[place.window][class][horizon];
                    *sum += value * value;
                    *count += 1.0;
                }
            }
        }
        for window in &sums {
            for (class, horizons) in window.iter().enumerate() {
                for (horizon, (sum, count)) in horizons.iter().enumerate() {
                    if *count > 0.0 {
                        push(&mut errors, (class, horizon), sum / count);
                    }
                }
            }
        }
    }
    errors
}

fn add_pose(errors: &mut Errors, sample: &GapSample) {
    let Some(horizon) = HORIZONS_S.iter().position(|h| *h == sample.horizon_s) else {
        return;
    };
    let square = sample.forward_m * sample.forward_m + sample.left_m * sample.left_m;
    push(errors, (6, horizon), square);
    push(errors, (7, horizon), sample.yaw_rad * sample.yaw_rad);
}
