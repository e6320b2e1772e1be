//! Where fits of a patch begin: patches all over the places that were driven on, each simulated once.
//!
//! What a patch changes is no straight line in where it lies: a wheel slides there or does not. The few patches of the screening tell too little of one that
//! lies between them, and out of a wrong place no fit finds; neighbours of the right one do.

use super::evidence::rest_energies;
use super::round::{Round, Side, difference, slices};
use super::suspect::PLACE;
use crate::hypothesis::{Candidate, Hypothesis};
use crate::record::{Added, Record, residuals_with};
use crate::screen::Score;
use crate::workers::{Cancelled, Workers, gathered};

/// Distance of the centres, and most of them in a row over the places that the robot's middle was in: a larger one is surveyed with larger patches farther apart.
const APART_M: f64 = 0.25;
const MOST_IN_A_ROW: usize = 14;
/// Radius, in distances of the centres, that of larger ones, which are tried where so many of the others explain most, and the share of the friction that is left.
const RADIUS: f64 = 1.0;
const LARGER: f64 = 1.8;
const TRIED_LARGER: usize = 12;
const LEFT: f64 = 0.3;
/// Around so many of the best it is also looked half way to their neighbours.
const TRIED_BETWEEN: usize = 6;
/// Least part of such a patch that fits begin with: what slides at once says little of how far the friction has to fall for it.
const LEAST_PART: f64 = 0.3;
/// So many fits begin where patches explain most, their centres farther apart than neighbours are.
const STARTS: usize = 2;
const NEIGHBOURS: f64 = 1.5;

/// Windows are quiet up to so many times their median, which is no more than so many times what is expected of them: chance makes one in twenty louder.
const LOUDER: f64 = 1.3;
const QUIET: f64 = 1.5;

/// A patch, and by how much the part of it that explains most lowers the energy of the windows that are screened.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Patch {
    /// Along the axes of the candidate: centre and radius, m, and share of the friction that is left.
    pub values: Vec<f64>,
    pub gain: f64,
}

/// Position of the effect that acts in a place, when the robot may have it.
pub(super) fn candidate_of_patches(candidates: &[Candidate]) -> Option<usize> {
    candidates.iter().position(|candidate| candidate.entry.name == PLACE)
}

/// The patches that explain most, the best first. Their number raises no threshold: what fits make of them is held against chance on the validation runs.
///
/// - `least`: energy that the windows which a patch touches must have beyond that of quiet ones, for it to be simulated.
pub(super) fn survey(
    workers: &dyn Workers,
    data: &Round,
    candidate: &Candidate,
    least: f64,
) -> Result<Vec<Patch>, Cancelled> {
    let side = &data.coarse;
    let excesses = excess_of_windows(data);
    let Some((centres, apart_m)) = centres(side.records, data.model.reach_m()) else {
        return Ok(Vec::new());
    };
    let simulated = |patches: Vec<Vec<f64>>| -> Result<Vec<Patch>, Cancelled> {
        let parts = gathered(workers, patches.len(), &|item| {
            let model = data.model.with(candidate.effect(&patches[item]));
            let patch = Added::last(&model, 1);
            let windows = side.records.iter().flat_map(|record| &record.windows).zip(&excesses);
            let touched = windows.filter(|(window, _)| patch.may_touch(window));
            if touched.map(|(_, excess)| excess).sum::<f64>() < least {
                return None;
            }
            let own = difference(side.residuals, &changed(side, &model, candidate)?);
            let gram = side.metric.gram(&[slices(side.residuals), slices(&own)]);
            Some(best_part(gram.at(0, 1), gram.at(1, 1)))
        })?;
        let found = patches.into_iter().zip(parts).filter_map(|(mut values, found)| {
            let (part, gain) = found?;
            values[3] = 1.0 - part * (1.0 - LEFT);
            (gain > 0.0).then_some(Patch { values, gain })
        });
        let mut found: Vec<Patch> = found.collect();
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok(found)
    };
    let patch = |centre: [f64; 2], radius: f64| vec![centre[0], centre[1], radius * apart_m, LEFT];
    let mut found = simulated(centres.into_iter().map(|centre| patch(centre, RADIUS)).collect())?;
    let best: Vec<[f64; 2]> = found.iter().map(|small| [small.values[0], small.values[1]]).collect();
    let larger = best.iter().take(TRIED_LARGER).map(|centre| patch(*centre, LARGER));
    found.extend(simulated(larger.collect())?);
    let between = between(&best[..best.len().min(TRIED_BETWEEN)], 0.5 * apart_m);
    let between = simulated(between.into_iter().map(|centre| patch(centre, RADIUS)).collect())?;
    Ok(with_one_between(
        of_neighbourhoods(found, NEIGHBOURS * apart_m),
        between,
    ))
}

/// Places half way from some of the grid to their neighbours, each once.
fn between(centres: &[[f64; 2]], half_m: f64) -> Vec<[f64; 2]> {
    let mut all: Vec<[f64; 2]> = Vec::new();
    for [x, y] in centres {
        let around = [-1.0, 0.0, 1.0].map(|i| [-1.0, 0.0, 1.0].map(|j| (i, j)));
        for (i, j) in around.into_iter().flatten().filter(|step| *step != (0.0, 0.0)) {
            let place = [x + i * half_m, y + j * half_m];
            let is_there = |other: &[f64; 2]| {
                let [dx, dy] = [0, 1].map(|axis| (other[axis] - place[axis]).abs());
                dx.max(dy) < 0.5 * half_m
            };
            if !all.iter().any(is_there) {
                all.push(place);
            }
        }
    }
    all
}

/// A fit begins also between the places of the grid, where one there explains more than all of these.
fn with_one_between(chosen: Vec<Patch>, between: Vec<Patch>) -> Vec<Patch> {
    let most = chosen.first().map_or(0.0, |patch| patch.gain);
    let best = between.into_iter().next().filter(|patch| patch.gain > most);
    best.into_iter().chain(chosen).collect()
}

/// The part of a change that lowers the energy most, and by how much.
///
/// - `along`: its product with the residual; `own`: with itself.
fn best_part(along: f64, own: f64) -> (f64, f64) {
    let part = if own > 0.0 {
        (along / own).clamp(LEAST_PART, 1.0)
    } else {
        1.0
    };
    (part, part * (2.0 * along - part * own))
}

/// Fits of the candidate begin there, and it promises what the best of them does; false when there are none.
///
/// - `share`: of the residuals, those of the windows that are screened.
pub(super) fn begin_at(score: &mut Score, patches: &[Patch], share: f64) -> bool {
    let Some((best, others)) = patches.split_first() else {
        return false;
    };
    score.gain = score.gain.max(best.gain / share);
    score.start.clone_from(&best.values);
    score.more_starts = others.iter().map(|patch| patch.values.clone()).collect();
    true
}

/// Energy of every window beyond that of a quiet one.
fn excess_of_windows(data: &Round) -> Vec<f64> {
    let side = &data.coarse;
    let mut windows = Vec::new();
    for (run, record) in side.records.iter().enumerate() {
        let energies = rest_energies(side.metric, run, record, &side.residuals[run]);
        windows.extend(energies.into_iter().zip(data.floor.expected_of_windows(record)));
    }
    beyond_quiet(&windows)
}

/// - `windows`: energy and what is expected of it.
fn beyond_quiet(windows: &[(f64, f64)]) -> Vec<f64> {
    let ratios = windows.iter().filter(|(_, expected)| *expected > 0.0);
    let mut ratios: Vec<f64> = ratios.map(|(energy, expected)| energy / expected).collect();
    ratios.sort_by(f64::total_cmp);
    let quiet = LOUDER * ratios.get(ratios.len() / 2).map_or(1.0, |middle| middle.min(QUIET));
    windows
        .iter()
        .map(|(energy, expected)| (energy - quiet * expected).max(0.0))
        .collect()
}

fn changed(side: &Side, model: &Hypothesis, candidate: &Candidate) -> Option<Vec<Vec<f64>>> {
    let pairs = side.records.iter().zip(side.residuals);
    let changed: Option<Vec<Vec<f64>>> = pairs
        .map(|(record, base)| residuals_with(record, model, 1, candidate.stages, base))
        .collect();
    let kept = side.bounds.keep(side.metric, side.records, side.residuals, changed?);
    Some(kept.residuals)
}

/// Centres of a grid from which patches reach all places where a wheel may have been, and their distance, m: a robot that turns at the edge of a patch has
/// a wheel on it and its middle beside it.
///
/// - `reach_m`: distance of the farthest wheel from the middle, which is what was measured.
fn centres(records: &[Record], reach_m: f64) -> Option<(Vec<[f64; 2]>, f64)> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for place in records.iter().flat_map(Record::positions_m) {
        for axis in 0..2 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    if !extent.is_finite() {
        return None;
    }
    let apart = APART_M.max(extent / (MOST_IN_A_ROW - 1) as f64);
    // Beside the outermost wheel by one radius, which is of the distance.
    let beside = (reach_m / apart + RADIUS) as usize;
    let along = |axis: usize| {
        let count = (((high[axis] - low[axis]) / apart) as usize + 1).min(MOST_IN_A_ROW);
        let first = 0.5 * (low[axis] + high[axis] - apart * (count - 1) as f64) - apart * beside as f64;
        (0..count + 2 * beside).map(move |i| first + apart * i as f64)
    };
    let all = along(0).flat_map(|x| along(1).map(move |y| [x, y])).collect();
    Some((all, apart))
}

/// The best, of neighbours the best alone.
fn of_neighbourhoods(mut patches: Vec<Patch>, neighbours_m: f64) -> Vec<Patch> {
    patches.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut chosen: Vec<Patch> = Vec::new();
    for patch in patches {
        let is_apart = |other: &Patch| {
            let [x, y] = [0, 1].map(|axis| patch.values[axis] - other.values[axis]);
            libm::sqrt(x * x + y * y) > neighbours_m
        };
        if chosen.len() < STARTS && chosen.iter().all(is_apart) {
            chosen.push(patch);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::PoseCell;
    use crate::record::made::{pose, record, window};

    fn place(x: f64, y: f64, gain: f64) -> Patch {
        Patch {
            values: vec![x, y, 0.25, LEFT],
            gain,
        }
    }

    #[test]
    fn fits_begin_at_the_best_of_each_neighbourhood() {
        let all = vec![
            place(0.0, 0.0, 50.0),
            place(0.25, 0.0, 80.0),
            place(1.0, 0.0, 60.0),
            place(-1.0, 0.0, 5.0),
            place(-1.0, 1.0, 4.0),
        ];
        let chosen: Vec<f64> = of_neighbourhoods(all, 0.375).iter().map(|place| place.gain).collect();
        assert_eq!(chosen, [80.0, 60.0]);
    }

    #[test]
    fn places_half_way_to_neighbours_are_tried_once_each() {
        let around = between(&[[1.0, 2.0]], 0.1);
        assert_eq!(around.len(), 8);
        let far = |place: &[f64; 2]| (place[0] - 1.0).abs().max((place[1] - 2.0).abs());
        assert!(
            around.iter().all(|place| (far(place) - 0.1).abs() < 1e-12),
            "{around:?}"
        );
        // Two neighbours of the grid share the three places between them.
        assert_eq!(between(&[[1.0, 2.0], [1.2, 2.0]], 0.1).len(), 8 + 5);
        assert!(between(&[], 0.1).is_empty());
    }

    #[test]
    fn a_fit_begins_between_the_grid_where_that_explains_more() {
        let grid = || vec![place(0.0, 0.0, 2.3), place(1.0, 0.0, 1.0)];
        let gains = |of: Vec<Patch>| of.iter().map(|patch| patch.gain).collect::<Vec<_>>();
        let found = with_one_between(grid(), vec![place(0.125, 0.125, 76.0), place(0.0, 0.125, 59.0)]);
        assert_eq!(gains(found), [76.0, 2.3, 1.0], "the best promises most");
        assert_eq!(
            gains(with_one_between(grid(), vec![place(0.125, 0.0, 2.0)])),
            [2.3, 1.0]
        );
        assert_eq!(gains(with_one_between(grid(), Vec::new())), [2.3, 1.0]);
    }

    #[test]
    fn all_that_was_driven_on_is_surveyed_and_a_larger_place_more_coarsely() {
        let at = |x_m: f64, y_m: f64| PoseCell { x_m, y_m, ..pose(0.6) };
        let run = |places: Vec<PoseCell>| [record(vec![window(Vec::new(), Vec::new(), places)])];
        let reach_m = 0.25;
        assert_eq!(centres(&run(Vec::new()), reach_m), None, "no camera saw it");
        let (small, apart) = centres(&run(vec![at(-0.5, 0.0), at(0.5, 0.625)]), reach_m).unwrap_or_default();
        assert_eq!((small.len(), apart), (9 * 7, APART_M));
        // Patches that reach the outermost wheels from beside them.
        assert_eq!((small[0], small[62]), ([-1.0, -0.4375], [1.0, 1.0625]));
        let (large, apart) = centres(&run(vec![at(0.0, 0.0), at(26.0, 0.0)]), reach_m).unwrap_or_default();
        assert_eq!((large.len(), apart), ((MOST_IN_A_ROW + 2) * 3, 2.0));
    }

    #[test]
    fn a_patch_that_is_too_strong_counts_by_the_part_that_explains_most() {
        assert_eq!(best_part(40.0, 40.0), (1.0, 40.0));
        assert_eq!(best_part(20.0, 40.0), (0.5, 10.0));
        assert!(best_part(-20.0, 40.0).1 < 0.0, "the other way");
        assert_eq!(best_part(90.0, 40.0), (1.0, 140.0), "no stronger than it was simulated");
        assert_eq!(best_part(0.0, 0.0), (1.0, 0.0), "nobody drove there");
    }

    #[test]
    fn fits_begin_at_the_patches_that_were_found_and_a_higher_promise_stays() {
        let screened = Score {
            gain: 11.0,
            sensitivity: 1.0,
            start: vec![0.0, 0.0, 0.4, 0.4],
            more_starts: vec![vec![1.0, 0.0, 0.4, 0.4]],
            best_column: 3,
        };
        let mut score = screened.clone();
        assert!(!begin_at(&mut score, &[], 0.5));
        assert_eq!((score.gain, &score.start), (11.0, &screened.start), "nothing was found");
        assert!(begin_at(
            &mut score,
            &[place(0.5, 0.5, 80.0), place(-1.0, 0.0, 20.0)],
            0.5
        ));
        assert_eq!(score.gain, 160.0);
        assert_eq!(score.start, [0.5, 0.5, 0.25, LEFT]);
        assert_eq!(score.more_starts, [[-1.0, 0.0, 0.25, LEFT]]);
        assert!(begin_at(&mut score, &[place(0.5, 0.5, 70.0)], 0.5));
        assert_eq!(score.gain, 160.0, "more was promised before");
    }

    #[test]
    fn windows_that_are_as_loud_as_most_have_no_energy_beyond() {
        let all_alike = [(64.0, 100.0), (128.0, 100.0), (100.0, 100.0), (150.0, 100.0)];
        let quiet: Vec<(f64, f64)> = all_alike[..3].to_vec();
        assert_eq!(beyond_quiet(&quiet), [0.0, 0.0, 0.0], "by chance");
        let found = beyond_quiet(&[all_alike[0], all_alike[2], all_alike[3]]);
        assert_eq!(found, [0.0, 0.0, 150.0 - LOUDER * 100.0]);
        let loud = beyond_quiet(&[(640.0, 64.0), (768.0, 64.0), (80.0, 64.0), (0.0, 0.0)]);
        let level = LOUDER * QUIET * 64.0;
        assert_eq!(loud, [640.0 - level, 768.0 - level, 0.0, 0.0], "most are loud");
        assert!(beyond_quiet(&[]).is_empty());
    }
}
