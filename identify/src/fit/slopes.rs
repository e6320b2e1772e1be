//! Slopes of a fit: how the prediction changes with its axes, and what a step does by them.

use super::search::Search;
use super::{Member, clamped};
use crate::hypothesis::Axis;
use crate::linear::Square;

/// Length of a difference quotient, and of a search step.
fn step_of(axis: &Axis, value: f64) -> f64 {
    if axis.neutral.is_infinite() {
        return 0.04 * value.abs().max(1e-3);
    }
    let near = if axis.carries_size {
        0.25 * axis.practical
    } else {
        0.4 * axis.practical
    };
    near.max(0.04 * (value - axis.neutral).abs())
}

/// Change of the prediction per practical size of each free axis.
pub(super) fn jacobian(
    search: &mut Search,
    members: &[Member],
    free: &[(usize, usize)],
    now: &[Vec<f64>],
) -> Vec<Vec<Vec<f64>>> {
    let mut columns = Vec::with_capacity(free.len());
    for (m, a) in free {
        let axis = members[*m].candidate.axes[*a];
        let value = members[*m].values[*a];
        let step = step_of(&axis, value);
        let ahead = if value + step <= axis.high { step } else { -step };
        let mut changed = members.to_vec();
        changed[*m].values[*a] = value + ahead;
        let per = ahead / scale(&axis, value);
        let column = match search.simulate(&changed) {
            Some(other) => now
                .iter()
                .zip(&other)
                .map(|(n, o)| n.iter().zip(o).map(|(n, o)| (n - o) / per).collect())
                .collect(),
            None => now.iter().map(|n| vec![0.0; n.len()]).collect(),
        };
        columns.push(column);
    }
    columns
}

/// A step in the units of the normal equations.
pub(super) fn made(before: &[Member], after: &[Member], free: &[(usize, usize)]) -> Vec<f64> {
    let step = |(m, a): &(usize, usize)| {
        let (from, to) = (before[*m].values[*a], after[*m].values[*a]);
        (to - from) / scale(&before[*m].candidate.axes[*a], from)
    };
    free.iter().map(step).collect()
}

/// Decrease of the energy that the slopes tell for a step.
pub(super) fn told(normal: &Square, right: &[f64], step: &[f64]) -> f64 {
    let mut told = 0.0;
    for (i, (a, right)) in step.iter().zip(right).enumerate() {
        let curved: f64 = step.iter().enumerate().map(|(j, b)| normal.at(i, j) * b).sum();
        told += a * (2.0 * right - curved);
    }
    told
}

/// Broyden's correction of slopes: the smallest change with which they tell what a step did (Broyden 1965, equation 4.5).
pub(super) fn correct(slopes: &mut [Vec<Vec<f64>>], before: &[Vec<f64>], after: &[Vec<f64>], step: &[f64]) {
    let square: f64 = step.iter().map(|part| part * part).sum();
    if square == 0.0 {
        return;
    }
    for (record, (before, after)) in before.iter().zip(after).enumerate() {
        for (row, (before, after)) in before.iter().zip(after).enumerate() {
            let told: f64 = slopes
                .iter()
                .zip(step)
                .map(|(column, part)| column[record][row] * part)
                .sum();
            let missing = (before - after - told) / square;
            for (column, part) in slopes.iter_mut().zip(step) {
                column[record][row] += missing * part;
            }
        }
    }
}

/// Unit of an axis in the normal equations.
pub(super) fn scale(axis: &Axis, value: f64) -> f64 {
    if axis.neutral.is_infinite() {
        0.1 * value.abs().max(1e-3)
    } else {
        axis.practical
    }
}

pub(super) fn moved(members: &[Member], free: &[(usize, usize)], step: &[f64]) -> Vec<Member> {
    let mut moved = members.to_vec();
    for ((m, a), step) in free.iter().zip(step) {
        let axis = members[*m].candidate.axes[*a];
        let value = &mut moved[*m].values[*a];
        let unit = scale(&axis, *value);
        // A limit does not fall by more than 40 % at once, a place does not jump.
        let most = if axis.neutral.is_infinite() {
            4.0 * unit
        } else if axis.carries_size {
            20.0 * unit
        } else {
            2.0 * unit
        };
        *value = clamped(&axis, *value + (step * unit).clamp(-most, most));
    }
    moved
}

/// Levenberg's term on the diagonal.
pub(super) fn regularised(normal: &Square, damping: f64) -> Square {
    let mut system = normal.clone();
    for k in 0..system.size {
        let more = (damping + 1e-9) * system.at(k, k) + 1e-9;
        system.add(k, k, more);
    }
    system
}
