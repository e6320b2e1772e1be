//! Wheels err together: the same quantity of all wheels, turned into directions whose errors are independent.
//!
//! Wheels that share a floor fight each other: on a robot with four driven wheels the currents of two sides are off by
//! half an ampere in opposite directions while their sum is right to a tenth of it. Taken wheel by wheel every current would be as
//! bad as the worst direction; turned into the principal directions of the references' residuals (Pearson 1901) each direction has its own
//! variance, and an effect that shows in a quiet one is seen.

use super::noise::{ClassNoise, correlation_of};
use crate::linear::{Square, principal};
use crate::record::{CLASSES, Place, Quantity, Record};

/// Classes with one quantity a wheel: wheel speed and current.
const CLASSES_OF_WHEELS: [usize; 2] = [0, 2];
/// Fewest cells with all wheels that directions are taken from.
const FEWEST: usize = 60;
/// Whitened values count up to this.
const CLAMP: f64 = 6.0;

/// Directions of one class.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    class: usize,
    wheels: Vec<usize>,
    /// Row = direction, column = wheel; orthonormal.
    basis: Square,
    noise: Vec<ClassNoise>,
}

/// Cells of all wheels at the same time, positions among a record's residuals.
struct Group {
    window: usize,
    positions: Vec<usize>,
}

/// Weights of a record's residuals after turning, and how to turn.
#[derive(Debug, Clone, Default)]
pub struct Weighting {
    /// One over variance and correlation length.
    pub weights: Vec<f64>,
    /// Weighted energy of residuals that are as large as the noise, by class.
    pub expected: [f64; CLASSES],
    groups: Vec<(usize, Vec<usize>)>,
    bases: Vec<Square>,
}

impl Weighting {
    /// Nothing is turned.
    pub fn diagonal(weights: Vec<f64>) -> Self {
        Self {
            weights,
            ..Self::default()
        }
    }

    /// A residual or sensitivity of the record in the directions of the weights.
    pub fn turned(&self, vector: &[f64]) -> Vec<f64> {
        let mut turned = vector.to_vec();
        for (basis, positions) in &self.groups {
            let basis = &self.bases[*basis];
            for (mode, place) in positions.iter().enumerate() {
                let terms = positions.iter().enumerate();
                turned[*place] = terms.map(|(wheel, from)| basis.at(mode, wheel) * vector[*from]).sum();
            }
        }
        turned
    }
}

fn wheel_of(quantity: Quantity) -> Option<usize> {
    match quantity {
        Quantity::Wheel(k) | Quantity::Current(k) => Some(k),
        _ => None,
    }
}

/// Wheels that have a class's quantity in a record.
fn wheels(places: &[Place], class: usize) -> Vec<usize> {
    let quantities = places.iter().filter_map(|place| place.quantity);
    let own = quantities.filter(|quantity| quantity.class() == class);
    let mut wheels: Vec<usize> = own.filter_map(wheel_of).collect();
    wheels.sort_unstable();
    wheels.dedup();
    wheels
}

/// Cells of a class that all wheels have at the same time.
fn groups(places: &[Place], class: usize, wheels: &[usize]) -> Vec<Group> {
    let mut cells: Vec<(usize, u64, usize, usize)> = Vec::new();
    for (position, place) in places.iter().enumerate() {
        let Some(quantity) = place.quantity.filter(|quantity| quantity.class() == class) else {
            continue;
        };
        if let Some(wheel) = wheel_of(quantity) {
            cells.push((place.window, place.time_s.to_bits(), wheel, position));
        }
    }
    cells.sort_unstable();
    let same = |a: &(usize, u64, usize, usize), b: &(usize, u64, usize, usize)| (a.0, a.1) == (b.0, b.1);
    let complete = |group: &&[(usize, u64, usize, usize)]| {
        group.len() == wheels.len() && group.iter().zip(wheels).all(|(cell, wheel)| cell.2 == *wheel)
    };
    cells
        .chunk_by(same)
        .filter(complete)
        .map(|group| Group {
            window: group[0].0,
            positions: group.iter().map(|cell| cell.3).collect(),
        })
        .collect()
}

/// Activity of a group: root mean square over the wheels.
fn activity(activities: &[f64], positions: &[usize]) -> f64 {
    let sum: f64 = positions.iter().map(|p| activities[*p] * activities[*p]).sum();
    (sum / positions.len() as f64).sqrt()
}

impl Modes {
    /// From residuals of references; `None` for classes with fewer than two wheels or too few cells.
    ///
    /// - `own`: noise of the class taken wheel by wheel.
    /// - `least`: smallest variance.
    pub fn fitted(
        class: usize,
        own: &ClassNoise,
        least: f64,
        records: &[Record],
        residuals: &[Vec<f64>],
    ) -> Option<Modes> {
        let wheels = records.first().map(|record| self::wheels(&record.places(), class))?;
        let count = wheels.len();
        if count < 2 {
            return None;
        }
        // (group's number in its window's series, activity, residuals)
        let mut cells: Vec<(bool, f64, Vec<f64>)> = Vec::new();
        for (record, residual) in records.iter().zip(residuals) {
            let activities = record.activities();
            let mut window = None;
            for group in groups(&record.places(), class, &wheels) {
                let starts = window != Some(group.window);
                window = Some(group.window);
                let values = group.positions.iter().map(|p| residual[*p]).collect();
                cells.push((starts, activity(&activities, &group.positions), values));
            }
        }
        if cells.len() < FEWEST {
            return None;
        }
        let mut covariance = Square::zero(count);
        for (_, activity, values) in &cells {
            let sigma = own.at(*activity).sqrt();
            let whitened: Vec<f64> = values.iter().map(|v| (v / sigma).clamp(-CLAMP, CLAMP)).collect();
            for row in 0..count {
                for column in 0..count {
                    covariance.add(row, column, whitened[row] * whitened[column] / cells.len() as f64);
                }
            }
        }
        let basis = principal(&covariance);
        let noise = (0..count)
            .map(|mode| {
                let turned: Vec<f64> = cells
                    .iter()
                    .map(|(_, _, values)| values.iter().enumerate().map(|(k, v)| basis.at(mode, k) * v).sum())
                    .collect();
                let mut squares: Vec<(f64, f64)> = cells.iter().zip(&turned).map(|(cell, v)| (cell.1, v * v)).collect();
                let noise = ClassNoise::fitted(&mut squares, least, own.beyond);
                let mut series: Vec<Vec<f64>> = Vec::new();
                for ((starts, activity, _), value) in cells.iter().zip(&turned) {
                    let whitened = value / noise.at(*activity).sqrt();
                    if *starts || series.is_empty() {
                        series.push(Vec::new());
                    }
                    if let Some(last) = series.last_mut() {
                        last.push(whitened.clamp(-CLAMP, CLAMP));
                    }
                }
                ClassNoise {
                    correlation: correlation_of(&series).unwrap_or(own.correlation),
                    ..noise
                }
            })
            .collect();
        Some(Modes {
            class,
            wheels,
            basis,
            noise,
        })
    }

    /// Louder in lively cells where other residuals are.
    pub fn raise(&mut self, records: &[Record], residuals: &[Vec<f64>]) {
        let mut squares: Vec<Vec<(f64, f64)>> = vec![Vec::new(); self.wheels.len()];
        for (record, residual) in records.iter().zip(residuals) {
            let (places, activities) = (record.places(), record.activities());
            if wheels(&places, self.class) != self.wheels {
                continue;
            }
            for group in groups(&places, self.class, &self.wheels) {
                let activity = activity(&activities, &group.positions);
                for (mode, squares) in squares.iter_mut().enumerate() {
                    let terms = group.positions.iter().enumerate();
                    let turned: f64 = terms.map(|(k, p)| self.basis.at(mode, k) * residual[*p]).sum();
                    squares.push((activity, turned * turned));
                }
            }
        }
        for (noise, squares) in self.noise.iter_mut().zip(&mut squares) {
            *noise = noise.raised(squares);
        }
    }

    /// All classes that have directions.
    pub fn all(classes: &[ClassNoise], sensor: &[f64], records: &[Record], residuals: &[Vec<f64>]) -> Vec<Modes> {
        CLASSES_OF_WHEELS
            .into_iter()
            .filter_map(|class| Modes::fitted(class, &classes[class], 0.5 * sensor[class], records, residuals))
            .collect()
    }

    /// Replaces the weights of whole groups of a record.
    pub fn weigh(
        &self,
        places: &[Place],
        classes: &[ClassNoise],
        activities: &[f64],
        trust: &dyn Fn(usize) -> f64,
        weighting: &mut Weighting,
    ) {
        if wheels(places, self.class) != self.wheels {
            return;
        }
        let basis = weighting.bases.len();
        weighting.bases.push(self.basis.clone());
        for group in groups(places, self.class, &self.wheels) {
            let activity = activity(activities, &group.positions);
            for (place, noise) in group.positions.iter().zip(&self.noise) {
                weighting.weights[*place] = 1.0 / (noise.at(activity) * noise.correlation);
                weighting.expected[self.class] +=
                    trust(group.window) * (1.0 / noise.correlation - 1.0 / classes[self.class].correlation);
            }
            weighting.groups.push((basis, group.positions));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::NoiseModel;
    use crate::random::Random;
    use crate::record::made::{self, cell, window};

    const TIMES: usize = 400;

    /// Two motors at the same times, nothing else.
    fn record() -> Record {
        let of = |wheel| (0..TIMES).map(move |k| cell(Quantity::Current(wheel), 0.05 * k as f64, 0.0));
        made::record(vec![window(of(0).chain(of(1)).collect(), Vec::new(), Vec::new())])
    }

    /// Motors that fight with 0.5 A in opposite directions and are off together by 0.02 A: a common change of 0.02 A on both is
    /// one standard deviation of its direction in every cell, where wheel by wheel it would be 0.04.
    #[test]
    fn what_wheels_do_together_is_seen_beside_their_fight() {
        let mut random = Random::new(3, 1);
        let pairs: Vec<(f64, f64)> = (0..TIMES)
            .map(|_| {
                let (fight, together) = (0.5 * random.normal(), 0.02 * random.normal());
                (together + fight, together - fight)
            })
            .collect();
        let residual: Vec<f64> = pairs.iter().map(|p| p.0).chain(pairs.iter().map(|p| p.1)).collect();
        let record = record();
        let robot = twin::robot::RobotDescription {
            noise: Some(twin::robot::Noise {
                current_a: Some(1e-3),
                ..twin::robot::Noise::default()
            }),
            ..twin::golden::reference_robot("diff2")
        };
        let noise = NoiseModel::fitted(&robot, core::slice::from_ref(&record), core::slice::from_ref(&residual));
        let weighting = noise.weighting(&record);
        let energy = |vector: &[f64]| -> f64 {
            let turned = weighting.turned(vector);
            weighting.weights.iter().zip(&turned).map(|(w, v)| w * v * v).sum()
        };
        let own: f64 = noise.weights(&record).iter().map(|w| w * 0.02 * 0.02).sum();
        let change = vec![0.02; 2 * TIMES];
        let expected = TIMES as f64;
        assert!(
            energy(&change) > 0.6 * expected && energy(&change) < 1.4 * expected,
            "{}",
            energy(&change)
        );
        assert!(own < 0.01 * expected, "{own}");
        // Noise itself has the energy that is expected of it.
        assert!((energy(&residual) / weighting.expected.iter().sum::<f64>() - 1.0).abs() < 0.2);
    }
}
