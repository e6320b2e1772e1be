//! Score tests of all candidates.

use crate::hypothesis::{Candidate, Kind};
use crate::linear::{Factor, Square};
use crate::random::Random;

/// What a candidate could explain to first order.
#[derive(Debug, Clone)]
pub struct Score {
    /// Decrease of the whitened energy.
    pub gain: f64,
    /// Signal over noise of the effect at its practical size.
    pub sensitivity: f64,
    /// Values of the axes that the gain belongs to; where fits start.
    pub start: Vec<f64>,
    /// Other places and shapes that gain almost as much.
    pub more_starts: Vec<Vec<f64>>,
    /// The column that gained most, position among all columns.
    pub best_column: usize,
}

/// Share of the best gain from which another place is worth a start.
const WORTH_A_START: f64 = 0.6;
/// Gain from which a limit is one of several that are tried together.
const LIMIT_GAIN: f64 = 20.0;
/// Replicates for thresholds.
const REPLICATES: usize = 1500;

/// Scores in the order of the candidates.
///
/// - `gram`: products of the residual (row 0) and all columns of all candidates in order (rows 1..).
pub fn scores(candidates: &[Candidate], gram: &Square) -> Vec<Score> {
    let mut first = 1;
    let mut all = Vec::with_capacity(candidates.len());
    for candidate in candidates {
        let rows: Vec<usize> = (first..first + candidate.columns.len()).collect();
        all.push(score(candidate, gram, &rows));
        first += candidate.columns.len();
    }
    all
}

fn score(candidate: &Candidate, gram: &Square, rows: &[usize]) -> Score {
    let neutral: Vec<f64> = candidate.axes.iter().map(|axis| axis.neutral).collect();
    // Columns are taken at 1.5 practical sizes or at probes.
    let strength = |row: usize| gram.at(row, row).max(0.0).sqrt();
    match candidate.kind {
        Kind::Sum => {
            let (gain, coefficients) = joint(candidate, gram, rows);
            let mut start = neutral.clone();
            for (column, coefficient) in candidate.columns.iter().zip(&coefficients) {
                start[column.axis] += coefficient * (column.values[column.axis] - neutral[column.axis]);
            }
            let best = strongest(gram, rows);
            Score {
                gain,
                sensitivity: rows.iter().map(|row| strength(*row)).fold(0.0, f64::max) / 1.5,
                start,
                more_starts: Vec::new(),
                best_column: best,
            }
        }
        Kind::Phase => {
            let (gain, c) = joint(candidate, gram, rows);
            let amplitude = candidate.columns[0].values[0] * (c[0] * c[0] + c[1] * c[1]).sqrt();
            Score {
                gain,
                sensitivity: strength(rows[0]).min(strength(rows[1])) * candidate.axes[0].practical
                    / candidate.columns[0].values[0],
                start: vec![amplitude, libm::atan2(c[1], c[0])],
                more_starts: Vec::new(),
                best_column: strongest(gram, rows),
            }
        }
        Kind::OneOf => {
            let mut gains: Vec<(f64, f64, usize)> = Vec::new();
            for (position, row) in rows.iter().enumerate() {
                let (product, square) = (gram.at(*row, 0), gram.at(*row, *row));
                let coefficient = if square > 1e-9 { product / square } else { 0.0 };
                let coefficient = coefficient.max(0.0);
                gains.push((coefficient * product, coefficient, position));
            }
            gains.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
            let starts: Vec<Vec<f64>> = gains
                .iter()
                .take_while(|gain| gain.0 >= WORTH_A_START * gains[0].0 && gain.0 > 0.0)
                .take(3)
                .map(|(_, coefficient, position)| scaled(candidate, *position, *coefficient))
                .collect();
            let best = gains[0].2;
            let mut more_starts: Vec<Vec<f64>> = starts.iter().skip(1).cloned().collect();
            more_starts.extend(limits_together(candidate, &gains));
            Score {
                gain: gains[0].0,
                sensitivity: rows.iter().map(|row| strength(*row)).fold(0.0, f64::max),
                start: starts
                    .first()
                    .cloned()
                    .unwrap_or_else(|| candidate.columns[best].values.clone()),
                more_starts,
                best_column: rows[best],
            }
        }
    }
}

/// Several limits at once, each where its own probe gained most: fits do not move what is not limited.
fn limits_together(candidate: &Candidate, gains: &[(f64, f64, usize)]) -> Option<Vec<f64>> {
    let mut together: Vec<f64> = candidate.axes.iter().map(|axis| axis.neutral).collect();
    if together.len() < 2 || together.iter().any(|neutral| neutral.is_finite()) {
        return None;
    }
    let mut limited = 0;
    for (gain, _, position) in gains {
        let values = &candidate.columns[*position].values;
        let mut finite = (0..values.len()).filter(|axis| values[*axis].is_finite());
        if let (Some(axis), None, true) = (finite.next(), finite.next(), *gain > LIMIT_GAIN)
            && together[axis].is_infinite()
        {
            together[axis] = values[axis];
            limited += 1;
        }
    }
    (limited > 1).then_some(together)
}

/// A probe with its size scaled by what the data ask for.
fn scaled(candidate: &Candidate, position: usize, coefficient: f64) -> Vec<f64> {
    let values = &candidate.columns[position].values;
    let coefficient = coefficient.clamp(0.3, 1.6);
    candidate
        .axes
        .iter()
        .zip(values)
        .map(|(axis, value)| {
            if axis.carries_size && axis.neutral.is_finite() {
                let scaled = axis.neutral + coefficient * (value - axis.neutral);
                // Factors of friction and gains end at nothing.
                if axis.neutral == 1.0 && value < &1.0 {
                    scaled.max(0.5 * value)
                } else {
                    scaled
                }
            } else {
                *value
            }
        })
        .collect()
}

fn strongest(gram: &Square, rows: &[usize]) -> usize {
    let gain = |row: usize| gram.at(row, 0) * gram.at(row, 0) / gram.at(row, row).max(1e-9);
    rows.iter()
        .copied()
        .max_by(|a, b| gain(*a).total_cmp(&gain(*b)))
        .unwrap_or(rows[0])
}

/// Gain and coefficients of columns together; those that would leave their side are dropped.
fn joint(candidate: &Candidate, gram: &Square, rows: &[usize]) -> (f64, Vec<f64>) {
    let mut used: Vec<usize> = (0..rows.len()).filter(|i| gram.at(rows[*i], rows[*i]) > 1e-9).collect();
    loop {
        let chosen: Vec<usize> = used.iter().map(|i| rows[*i]).collect();
        let right: Vec<f64> = chosen.iter().map(|row| gram.at(*row, 0)).collect();
        let mut part = gram.part(&chosen);
        for i in 0..chosen.len() {
            let ridge = 1e-6 * part.at(i, i) + 1e-9;
            part.add(i, i, ridge);
        }
        let solved = part.cholesky().solve(&right);
        let wrong = used.iter().zip(&solved).position(|(i, coefficient)| {
            let axis = candidate.columns[*i].axis;
            candidate.kind == Kind::Sum && candidate.is_one_sided(axis) && *coefficient < 0.0
        });
        if let Some(position) = wrong {
            used.remove(position);
            continue;
        }
        let mut coefficients = vec![0.0; rows.len()];
        let mut gain = 0.0;
        for ((i, value), product) in used.iter().zip(&solved).zip(&right) {
            coefficients[*i] = *value;
            gain += value * product;
        }
        return (gain, coefficients);
    }
}

/// The largest gain that chance gives, over all candidates: value that a share `level` of null replicates stays below.
///
/// Scores of a null replicate are normal with the covariance of the columns' products.
pub fn thresholds(candidates: &[Candidate], gram: &Square, level: f64, seed: u64) -> f64 {
    let rows: Vec<usize> = (1..gram.size).collect();
    let mut covariance = gram.part(&rows);
    for i in 0..covariance.size {
        let ridge = 1e-9 * covariance.at(i, i) + 1e-12;
        covariance.add(i, i, ridge);
    }
    let factor: Factor = covariance.cholesky();
    let mut replicate = gram.clone();
    let mut random = Random::new(seed, 0x7468_7265_7368);
    let mut largest: Vec<f64> = Vec::with_capacity(REPLICATES);
    for _ in 0..REPLICATES {
        let draw: Vec<f64> = (0..rows.len()).map(|_| random.normal()).collect();
        for (row, value) in factor.times(&draw).into_iter().enumerate() {
            replicate.set(row + 1, 0, value);
            replicate.set(0, row + 1, value);
        }
        let best = scores(candidates, &replicate)
            .iter()
            .map(|score| score.gain)
            .fold(0.0, f64::max);
        largest.push(best);
    }
    largest.sort_by(f64::total_cmp);
    largest[((level * REPLICATES as f64) as usize).min(REPLICATES - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates};

    fn body_limits() -> Candidate {
        let excitation = Excitation {
            wheel_rad_per_s: 20.0,
            twist: [1.0, 0.0, 3.0],
            extent_m: [-1.0, 1.0, -1.0, 1.0],
        };
        let all = candidates(&twin::golden::reference_robot("diff2"), &excitation);
        let found = all
            .into_iter()
            .find(|candidate| candidate.entry.name == "body_speed_saturation");
        found.unwrap_or_else(|| panic!("a diff2 may have limits"))
    }

    /// Forward alone and yaw rate alone each gained: the start has both, each from the probe that gained most of its own.
    #[test]
    fn limits_that_each_gained_are_tried_together() {
        let candidate = body_limits();
        let is_alone = |c: usize, axis: usize| {
            let values = &candidate.columns[c].values;
            (0..values.len()).all(|a| values[a].is_finite() == (a == axis))
        };
        let alone =
            |axis: usize| -> Vec<usize> { (0..candidate.columns.len()).filter(|c| is_alone(*c, axis)).collect() };
        let (forward, yaw) = (alone(0), alone(2));
        assert!(forward.len() > 1 && yaw.len() > 1);
        let gains = [(90.0, 1.0, forward[1]), (80.0, 1.0, yaw[0]), (70.0, 1.0, forward[0])];
        let together = limits_together(&candidate, &gains).unwrap_or_default();
        assert_eq!(together[0], candidate.columns[forward[1]].values[0]);
        assert_eq!(together[2], candidate.columns[yaw[0]].values[2]);
        assert!(together[1].is_infinite());
        // One limit is no company, and a gain of chance is none.
        assert_eq!(limits_together(&candidate, &gains[..1]), None);
        assert_eq!(
            limits_together(&candidate, &[gains[0], (LIMIT_GAIN, 1.0, yaw[0])]),
            None
        );
    }
}
