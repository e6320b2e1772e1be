//! How large residuals are where nothing is changed: sensor noise, and model error that grows with what happens.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use twin::robot::RobotDescription;

use crate::record::{CLASSES, Record};

/// Variance of a class of residuals: `level` + `slope` activity^2, and over how many cells it is correlated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassNoise {
    pub level: f64,
    pub slope: f64,
    pub correlation: f64,
}

/// Noise of all classes.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    pub classes: [ClassNoise; CLASSES],
    /// Taken from the description and a stated prior, not from references.
    pub is_prior: bool,
}

/// Without references: model error as a share of the change of a channel around a cell.
const PRIOR_SLOPE: f64 = 0.03;
/// Without references: model error of a position, m, and a yaw, rad, in a window.
const PRIOR_POSE_M: f64 = 0.002;
const PRIOR_YAW_RAD: f64 = 0.004;
const PRIOR_CORRELATION: f64 = 4.0;
/// Cells that a sample's noise is averaged over at least once.
const SAMPLES_A_CELL: f64 = 5.0;
/// Where the description is silent about noise, by class.
const DEFAULT_NOISE: [f64; CLASSES] = [0.05, 0.002, 0.03, 0.05, 0.006, 0.06, 0.001, 0.003];
/// Longest correlation that is looked for, cells.
const MOST_LAGS: usize = 12;
/// Squared residuals count up to this many times the median.
const WINSOR: f64 = 40.0;

/// Sensor noise of a cell, by class.
fn sensor_variance(robot: &RobotDescription) -> [f64; CLASSES] {
    let noise = robot.noise.clone().unwrap_or_default();
    let given = [
        noise.wheel_rad_per_s,
        noise.steering_rad,
        noise.current_a,
        noise.bus_v,
        noise.gyro_rad_per_s,
        noise.accel_m_per_s2,
        noise.pose_xy_m,
        noise.pose_yaw_rad,
    ];
    let mut variance = [0.0; CLASSES];
    for (class, value) in variance.iter_mut().enumerate() {
        let sigma = given[class]
            .filter(|sigma| *sigma > 0.0)
            .unwrap_or(DEFAULT_NOISE[class]);
        *value = sigma * sigma / SAMPLES_A_CELL;
    }
    variance
}

impl NoiseModel {
    /// What is known before any reference.
    pub fn prior(robot: &RobotDescription) -> NoiseModel {
        let sensor = sensor_variance(robot);
        let classes = core::array::from_fn(|class| {
            let error = match class {
                6 => PRIOR_POSE_M,
                7 => PRIOR_YAW_RAD,
                _ => 0.0,
            };
            ClassNoise {
                level: 2.0 * sensor[class] + error * error,
                slope: PRIOR_SLOPE * PRIOR_SLOPE,
                correlation: PRIOR_CORRELATION,
            }
        });
        NoiseModel {
            classes,
            is_prior: true,
        }
    }

    /// From residuals of references under the calibrated model.
    pub fn fitted(robot: &RobotDescription, records: &[Record], residuals: &[Vec<f64>]) -> NoiseModel {
        let sensor = sensor_variance(robot);
        let mut noise = NoiseModel::prior(robot);
        for class in 0..CLASSES {
            let mut cells: Vec<(f64, f64)> = Vec::new();
            for (record, residual) in records.iter().zip(residuals) {
                let places = record.places();
                let activities = record.activities();
                for ((place, activity), value) in places.iter().zip(activities).zip(residual) {
                    if place.quantity.is_some_and(|quantity| quantity.class() == class) {
                        cells.push((activity, value * value));
                    }
                }
            }
            if cells.len() < 20 {
                continue;
            }
            let (level, slope) = variance(&mut cells, 0.5 * sensor[class]);
            noise.classes[class] = ClassNoise {
                level,
                slope,
                correlation: PRIOR_CORRELATION,
            };
        }
        for class in 0..CLASSES {
            if let Some(correlation) = correlation(&noise, class, records, residuals) {
                noise.classes[class].correlation = correlation;
            }
        }
        noise.is_prior = false;
        noise
    }

    /// Weights of a record's residuals: one over variance and correlation length.
    pub fn weights(&self, record: &Record) -> Vec<f64> {
        let places = record.places();
        let activities = record.activities();
        places
            .iter()
            .zip(activities)
            .map(|(place, activity)| {
                place.quantity.map_or(0.0, |quantity| {
                    let class = &self.classes[quantity.class()];
                    1.0 / ((class.level + class.slope * activity * activity) * class.correlation)
                })
            })
            .collect()
    }
}

/// Level from the quiet half, slope from the rest; medians, so that a few wild cells do not count.
fn variance(cells: &mut [(f64, f64)], least: f64) -> (f64, f64) {
    cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = cells.len() / 2;
    let mean = |cells: &[(f64, f64)]| {
        let mut squares: Vec<f64> = cells.iter().map(|cell| cell.1).collect();
        squares.sort_by(f64::total_cmp);
        let cap = WINSOR * squares[squares.len() / 2];
        squares.iter().map(|square| square.min(cap)).sum::<f64>() / squares.len() as f64
    };
    if cells[cells.len() - 1].0 == 0.0 {
        return (mean(cells).max(least), 0.0);
    }
    let level = mean(&cells[..half]).max(least);
    // Three groups of the livelier half, by least squares through the level.
    let (mut top, mut bottom) = (0.0, 0.0);
    let lively = &cells[half..];
    for group in lively.chunks(lively.len().div_ceil(3).max(1)) {
        let activity2 = group.iter().map(|cell| cell.0 * cell.0).sum::<f64>() / group.len() as f64;
        top += (mean(group) - level) / activity2.max(1e-30);
        bottom += 1.0;
    }
    (level, (top / bottom).max(0.0))
}

/// Integrated correlation of the whitened residuals of neighbouring cells in a window.
fn correlation(noise: &NoiseModel, class: usize, records: &[Record], residuals: &[Vec<f64>]) -> Option<f64> {
    let mut sums = [0.0; MOST_LAGS + 1];
    let own = &noise.classes[class];
    for (record, residual) in records.iter().zip(residuals) {
        let places = record.places();
        let activities = record.activities();
        let mut series: Vec<f64> = Vec::new();
        let mut last = None;
        let mut add = |series: &mut Vec<f64>| {
            for lag in 0..=MOST_LAGS.min(series.len().saturating_sub(1)) {
                sums[lag] += series.iter().zip(&series[lag..]).map(|(a, b)| a * b).sum::<f64>();
            }
            series.clear();
        };
        // One series a quantity and window. Poses stand in triplets: three passes.
        for wanted in record
            .quantities()
            .into_iter()
            .filter(|quantity| quantity.class() == class)
        {
            for ((place, activity), value) in places.iter().zip(&activities).zip(residual) {
                if place.quantity != Some(wanted) {
                    continue;
                }
                if last != Some((wanted, place.window)) {
                    add(&mut series);
                    last = Some((wanted, place.window));
                }
                let whitened = value / (own.level + own.slope * activity * activity).sqrt();
                series.push(whitened.clamp(-6.0, 6.0));
            }
            add(&mut series);
        }
    }
    if sums[0] <= 0.0 {
        return None;
    }
    let mut length = 1.0;
    for lag in 1..=MOST_LAGS {
        let share = sums[lag] / sums[0];
        if share < 0.05 {
            break;
        }
        length += 2.0 * share;
    }
    Some(length)
}
