//! How large residuals are where nothing is changed: sensor noise, and model error that grows with what happens.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use twin::robot::RobotDescription;

use super::modes::{Modes, Weighting};
use crate::record::{CLASSES, Place, Record};

/// Variance of a class of residuals: `level` + `slope` activity^2, and over how many cells it is correlated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassNoise {
    pub level: f64,
    pub slope: f64,
    /// Activity up to which the references reach; beyond it the slope is at least `beyond`.
    pub reach: f64,
    pub beyond: f64,
    pub correlation: f64,
}

impl ClassNoise {
    /// Variance at an activity.
    pub fn at(&self, activity: f64) -> f64 {
        let square = activity * activity;
        let unseen = (square - self.reach * self.reach).max(0.0);
        self.level + self.slope * square + (self.beyond - self.slope).max(0.0) * unseen
    }

    /// At least as loud in lively cells as other cells are, of more than chance.
    pub fn raised(self, cells: &mut [(f64, f64)]) -> ClassNoise {
        if cells.len() < 20 {
            return self;
        }
        let own = ClassNoise::fitted(cells, self.level, self.beyond);
        if own.slope <= self.slope {
            return self;
        }
        ClassNoise {
            slope: own.slope,
            reach: own.reach.max(self.reach),
            ..self
        }
    }

    /// From squares of residuals with the activities that they were at: `(activity, square)`.
    ///
    /// - `least`: smallest level.
    /// - `beyond`: slope where the cells say nothing.
    pub fn fitted(cells: &mut [(f64, f64)], least: f64, beyond: f64) -> ClassNoise {
        let (level, slope) = variance(cells, least);
        let reach = cells.get(cells.len() * 39 / 40).map_or(0.0, |cell| cell.0);
        ClassNoise {
            level,
            slope,
            reach,
            beyond,
            correlation: 1.0,
        }
    }
}

/// Noise of all classes.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    pub classes: [ClassNoise; CLASSES],
    /// Of classes with one quantity a wheel: directions in which wheels err independently.
    pub modes: Vec<Modes>,
    /// Taken from the description and a stated prior, not from references.
    pub is_prior: bool,
}

/// Laws of a twin are not those of a robot. Without references, and beyond where references reach, by class: standard deviation as
/// a share of the change of the channel around a cell; poses per rad/s by which a wheel's speed changed, m and rad.
const PRIOR_SLOPE: [f64; CLASSES] = [0.05, 0.2, 0.3, 0.3, 0.15, 0.25, 1e-4, 1.5e-4];
/// Without references: standard deviation in quiet cells over that of the sensor.
const PRIOR_LEVEL: [f64; CLASSES] = [2.0, 1.5, 2.0, 1.5, 1.7, 1.5, 1.5, 1.5];
/// Without references: error of a current as a share of the limit (friction, cogging and tyres that fight each other).
const PRIOR_CURRENT: f64 = 0.015;
/// Without references: model error of a position, m, and a yaw, rad, in a window.
const PRIOR_POSE_M: f64 = 0.001;
const PRIOR_YAW_RAD: f64 = 0.002;
/// Without references: cells over which an error lasts.
const PRIOR_CORRELATION: [f64; CLASSES] = [4.0, 3.0, 14.0, 5.0, 4.0, 3.0, 4.0, 3.0];
/// Cells that a sample's noise is averaged over at least once.
const SAMPLES_A_CELL: f64 = 5.0;
/// Where the description is silent about noise, by class.
const DEFAULT_NOISE: [f64; CLASSES] = [0.05, 0.002, 0.03, 0.05, 0.006, 0.06, 0.001, 0.003];
/// Longest correlation that is looked for, cells.
const MOST_LAGS: usize = 12;
/// Median of the square of a normal number of variance 1.
const MEDIAN_SQUARE: f64 = 0.455;
/// Squared residuals count up to this many times the median.
const WINSOR: f64 = 40.0;

/// Standard deviation of a sample of each channel's sensor.
pub fn sensor_sigmas(robot: &RobotDescription) -> [f64; CLASSES] {
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
    core::array::from_fn(|class| {
        given[class]
            .filter(|sigma| *sigma > 0.0)
            .unwrap_or(DEFAULT_NOISE[class])
    })
}

/// Sensor noise of a cell, by class.
fn sensor_variance(robot: &RobotDescription) -> [f64; CLASSES] {
    sensor_sigmas(robot).map(|sigma| sigma * sigma / SAMPLES_A_CELL)
}

impl NoiseModel {
    /// What is known before any reference.
    pub fn prior(robot: &RobotDescription) -> NoiseModel {
        let sensor = sensor_variance(robot);
        let limit_a = robot.motor.as_ref().map_or(0.0, |motor| {
            let stall_a = motor.supply_v / motor.resistance_ohm;
            motor.current_limit_a.map_or(stall_a, |limit| limit.min(stall_a))
        });
        let classes = core::array::from_fn(|class| {
            let error = match class {
                2 => PRIOR_CURRENT * limit_a,
                6 => PRIOR_POSE_M,
                7 => PRIOR_YAW_RAD,
                _ => 0.0,
            };
            let slope = PRIOR_SLOPE[class] * PRIOR_SLOPE[class];
            ClassNoise {
                level: PRIOR_LEVEL[class] * PRIOR_LEVEL[class] * sensor[class] + error * error,
                slope,
                reach: 0.0,
                beyond: slope,
                correlation: PRIOR_CORRELATION[class],
            }
        });
        NoiseModel {
            classes,
            modes: Vec::new(),
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
            let own = ClassNoise::fitted(&mut cells, 0.5 * sensor[class], noise.classes[class].beyond);
            noise.classes[class] = ClassNoise {
                correlation: PRIOR_CORRELATION[class],
                ..own
            };
        }
        for class in 0..CLASSES {
            if let Some(correlation) = correlation(&noise, class, records, residuals) {
                noise.classes[class].correlation = correlation;
            }
        }
        noise.modes = Modes::all(&noise.classes, &sensor, records, residuals);
        noise.is_prior = false;
        noise
    }

    /// Louder where half of the cells of a class are off by more than this noise has it: laws of a real robot are further from a twin's than sensors are from the truth.
    pub fn at_least(mut self, records: &[Record], residuals: &[Vec<f64>]) -> NoiseModel {
        let mut squares: [Vec<f64>; CLASSES] = Default::default();
        for (record, residual) in records.iter().zip(residuals) {
            let (places, weights) = (record.places(), self.weights(record));
            for ((place, weight), value) in places.iter().zip(weights).zip(residual) {
                if let Some(quantity) = place.quantity {
                    let class = quantity.class();
                    squares[class].push(weight * self.classes[class].correlation * value * value);
                }
            }
        }
        for (class, squares) in self.classes.iter_mut().zip(&mut squares) {
            squares.sort_by(f64::total_cmp);
            let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
            let louder = (median / MEDIAN_SQUARE).max(1.0);
            class.level *= louder;
            class.slope *= louder;
            class.beyond *= louder;
        }
        self
    }

    /// How unlikely residuals are when every cell may be off by more than this noise: the sum of ln(1 + r^2 / v), each divided by the cells over which an error
    /// lasts (Cauchy's distribution). A cell that is far off counts little, a channel that is off everywhere counts in full.
    pub fn surprise(&self, record: &Record, residual: &[f64]) -> f64 {
        let (places, weights) = (record.places(), self.weights(record));
        let cells = places.iter().zip(&weights).zip(residual);
        cells
            .filter_map(|((place, weight), value)| {
                let lasts = self.classes[place.quantity?.class()].correlation;
                Some(libm::log1p(weight * lasts * value * value) / lasts)
            })
            .sum()
    }

    /// Weights with which squares have the slope of [`Self::surprise`].
    pub fn robust_weighting(&self, record: &Record, residual: &[f64]) -> Weighting {
        let (places, mut weights) = (record.places(), self.weights(record));
        for ((place, weight), value) in places.iter().zip(&mut weights).zip(residual) {
            let lasts = place
                .quantity
                .map_or(1.0, |quantity| self.classes[quantity.class()].correlation);
            *weight /= 1.0 + *weight * lasts * value * value;
        }
        Weighting::diagonal(weights)
    }

    /// Weights of a record's residuals in the directions in which they are independent.
    pub fn weighting(&self, record: &Record) -> Weighting {
        let (places, activities) = (record.places(), record.activities());
        let mut weighting = Weighting::diagonal(self.weights_at(&places, &activities));
        let trust = |window: usize| record.windows[window].trust;
        for place in &places {
            let Some(class) = place.quantity.map(|quantity| quantity.class()) else {
                continue;
            };
            weighting.expected[class] += trust(place.window) / self.classes[class].correlation;
        }
        for modes in &self.modes {
            modes.weigh(&places, &self.classes, &activities, &trust, &mut weighting);
        }
        for (weight, place) in weighting.weights.iter_mut().zip(&places) {
            *weight *= trust(place.window);
        }
        weighting
    }

    /// Weights of a record's residuals taken one by one: one over variance and correlation length.
    pub fn weights(&self, record: &Record) -> Vec<f64> {
        self.weights_at(&record.places(), &record.activities())
    }

    fn weights_at(&self, places: &[Place], activities: &[f64]) -> Vec<f64> {
        let pairs = places.iter().zip(activities);
        pairs
            .map(|(place, activity)| {
                place.quantity.map_or(0.0, |quantity| {
                    let class = &self.classes[quantity.class()];
                    1.0 / (class.at(*activity) * class.correlation)
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
        top += (mean(group) - level) * activity2;
        bottom += activity2 * activity2;
    }
    (level, (top / f64::max(bottom, 1e-60)).max(0.0))
}

/// Integrated correlation of the whitened residuals of neighbouring cells in a window.
fn correlation(noise: &NoiseModel, class: usize, records: &[Record], residuals: &[Vec<f64>]) -> Option<f64> {
    let own = &noise.classes[class];
    let mut series: Vec<Vec<f64>> = Vec::new();
    for (record, residual) in records.iter().zip(residuals) {
        let places = record.places();
        let activities = record.activities();
        // One series a quantity and window. Poses stand in triplets: three passes.
        for wanted in record
            .quantities()
            .into_iter()
            .filter(|quantity| quantity.class() == class)
        {
            let mut last = None;
            for ((place, activity), value) in places.iter().zip(&activities).zip(residual) {
                if place.quantity != Some(wanted) {
                    continue;
                }
                if last != Some(place.window) {
                    series.push(Vec::new());
                    last = Some(place.window);
                }
                let whitened = value / own.at(*activity).sqrt();
                if let Some(open) = series.last_mut() {
                    open.push(whitened.clamp(-6.0, 6.0));
                }
            }
        }
    }
    correlation_of(&series)
}

/// Cells over which whitened series are correlated, once for each side; `None` without values.
pub(super) fn correlation_of(series: &[Vec<f64>]) -> Option<f64> {
    let mut sums = [0.0; MOST_LAGS + 1];
    for values in series {
        for lag in 0..=MOST_LAGS.min(values.len().saturating_sub(1)) {
            sums[lag] += values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Quantity;
    use crate::record::made::series;

    /// Slope of the surprise by one cell's residual is twice its robust weight times the residual, however far off the cell is.
    #[test]
    fn robust_weights_are_the_slopes_of_the_surprise() {
        let noise = NoiseModel::prior(&twin::golden::reference_robot("diff2"));
        let record = series(Quantity::Gyro, 3);
        let residual = [0.001, -0.02, 0.7];
        let weights = noise.robust_weighting(&record, &residual).weights;
        for k in 0..3 {
            let at = |change: f64| {
                let mut moved = residual;
                moved[k] += change;
                noise.surprise(&record, &moved)
            };
            let step = 1e-6;
            let slope = (at(step) - at(-step)) / (2.0 * step);
            assert!(
                (slope / (2.0 * weights[k] * residual[k]) - 1.0).abs() < 1e-4,
                "{k}: {slope}"
            );
        }
        assert!(weights[2] < 1e-3 * weights[0], "a wild cell counts little");
    }

    /// Half of the cells decide how loud a class is taken to be: a few wild ones do not, and nothing is quieter than stated.
    #[test]
    fn a_yardstick_is_what_half_of_the_cells_exceed() {
        let stated = NoiseModel::prior(&twin::golden::reference_robot("diff2"));
        let level = |residual: Vec<f64>| {
            let record = series(Quantity::Gyro, residual.len());
            let class = stated.clone().at_least(&[record], &[residual]).classes[4];
            class.level / stated.classes[4].level
        };
        let sigma = stated.classes[4].level.sqrt();
        let mut random = crate::random::Random::new(3, 1);
        let mut normal = |scale: f64| -> Vec<f64> { (0..2000).map(|_| scale * sigma * random.normal()).collect() };
        assert!((level(normal(10.0)) / 100.0 - 1.0).abs() < 0.15);
        assert!((level(normal(0.1)) - 1.0).abs() < 1e-12);
        let mut few = normal(0.9);
        few.iter_mut().step_by(20).for_each(|value| *value *= 1000.0);
        assert!(level(few) < 1.1);
    }

    /// Where references reach, their slope counts; beyond, at least the stated one, and the variance has no step.
    #[test]
    fn what_references_did_not_see_is_not_taken_for_exact() {
        let noise = ClassNoise {
            level: 2.0,
            slope: 0.1,
            reach: 3.0,
            beyond: 0.5,
            correlation: 1.0,
        };
        assert!((noise.at(2.0) - 2.4).abs() < 1e-12);
        assert!((noise.at(3.0) - 2.9).abs() < 1e-12);
        assert!((noise.at(5.0) - (2.0 + 0.1 * 25.0 + 0.4 * 16.0)).abs() < 1e-12);
        let steep = ClassNoise { slope: 0.8, ..noise };
        assert!((steep.at(5.0) - 22.0).abs() < 1e-12);
    }

    /// Standard deviation 0.3 + a part that grows as 0.2 activity: found within a tenth; reach is the largest activity but a few.
    #[test]
    fn level_and_slope_are_found() {
        let mut random = crate::random::Random::new(7, 1);
        let mut cells: Vec<(f64, f64)> = (0..4000)
            .map(|k| {
                let activity = if k % 2 == 0 { 0.0 } else { 5.0 * random.uniform() };
                let sigma = (0.09 + 0.04 * activity * activity).sqrt();
                let value = sigma * random.normal();
                (activity, value * value)
            })
            .collect();
        let noise = ClassNoise::fitted(&mut cells, 0.0, 0.0);
        assert!((noise.level / 0.09 - 1.0).abs() < 0.1, "{noise:?}");
        assert!((noise.slope / 0.04 - 1.0).abs() < 0.15, "{noise:?}");
        assert!((4.5..5.0).contains(&noise.reach), "{noise:?}");
    }
}
