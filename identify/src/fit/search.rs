//! Simulations of a fit, and searches along its axes.

use super::edge::{Edge, Move};
use super::slopes::scale;
use super::{LEAST_GAIN, Member, Problem, clamped, with_members};
use crate::hypothesis::Axis;
use crate::record::{Record, Stages, residuals_with};

/// Most steps of a pattern search along an axis.
const MOST_MOVES: usize = 4;
/// Its steps as parts of a practical size: for laws with corners, and for others, whose slopes may lie where a robot just slips or just
/// does not.
const FINER: [f64; 5] = [1.0, 0.5, 0.25, 0.12, 0.06];
pub(super) const NEAR: [f64; 1] = [0.25];
/// The same in control ticks for what shifts time.
pub(super) const TICKS: [f64; 2] = [1.0, 0.5];
pub(super) const TICK_S: f64 = 1.0 / twin::CONTROL_RATE_HZ as f64;
/// Share of what a patch explains that a move about its edge has to add, and one that makes it larger: the law of a tyre is off by as much, and of patches that
/// explain the same the smallest claims least of what nobody drove on.
pub(crate) const EDGE_SHARE: f64 = 0.01;
const LARGER_SHARE: f64 = 0.05;
/// Most times that the sizes of a start are halved.
const MOST_HALVINGS: usize = 4;
/// Share of the time that runs must have been beside a patch.
const BESIDE: f64 = 0.03;

/// Steps of a pattern search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Steps {
    /// Along all axes, a part of a practical size.
    Sizes(f64),
    /// Along the axes that shift time, s.
    Seconds(f64),
}

/// Steps of the pattern searches of a fit.
///
/// - `ticks`: steps for members that shift time. Set-points act at control ticks, so that the energy is wavy over a shift, with the period of a tick: slopes
///   lead to the bottom of a wave.
pub(super) fn steps_of_search(rough: bool, limited: bool, ticks: &[f64], searches: usize) -> Vec<Steps> {
    let sizes: &[f64] = match (rough, limited, searches) {
        (true, _, 0) => &FINER,
        (false, true, 0) => &FINER[..3],
        (false, false, 0) => &NEAR,
        _ => &[],
    };
    let ticks = if searches == 0 { ticks } else { &[] };
    let seconds = ticks.iter().map(|ticks| Steps::Seconds(ticks * TICK_S));
    seconds.chain(sizes.iter().map(|size| Steps::Sizes(*size))).collect()
}

/// Sizes of a single member halved until they no longer make everything worse: where a law is no straight line a start by slopes may lie beyond
/// everything that its own slopes lead out of. True when there was need.
pub(super) fn come_nearer(
    search: &mut Search,
    members: &mut [Member],
    now: &mut Vec<Vec<f64>>,
    base_energy: f64,
) -> bool {
    let mut came = false;
    for _ in 0..MOST_HALVINGS {
        let [member] = members else { return false };
        if search.energy(now) <= base_energy {
            break;
        }
        let mut trial = member.clone();
        halve(&trial.candidate.axes, &mut trial.values);
        let Some(residuals) = search.simulate(core::slice::from_ref(&trial)) else {
            break;
        };
        *member = trial;
        *now = residuals;
        came = true;
    }
    came
}

/// Half way to where the effect is none.
pub(super) fn halve(axes: &[Axis], values: &mut [f64]) {
    for (axis, value) in axes.iter().zip(values) {
        if axis.carries_size && axis.neutral.is_finite() && value.is_finite() {
            *value = axis.neutral + 0.5 * (*value - axis.neutral);
        }
    }
}

/// Shifts time.
pub(super) fn is_shift(axis: &Axis) -> bool {
    axis.unit == "s" && ["offset", "delay", "latency"].contains(&axis.name)
}

pub(super) struct Search<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) stages: Stages,
    pub(super) simulations: usize,
}

impl<'a> Search<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, members: &[Member]) -> Search<'a> {
        let nothing = Stages {
            drive: false,
            rolling: false,
        };
        let stages = members.iter().fold(nothing, |all, member| Stages {
            drive: all.drive || member.candidate.stages.drive,
            rolling: all.rolling || member.candidate.stages.rolling,
        });
        Search {
            problem,
            stages,
            simulations: 0,
        }
    }

    pub(super) fn simulate(&mut self, members: &[Member]) -> Option<Vec<Vec<f64>>> {
        let model = with_members(self.problem.base, members);
        model.robot()?;
        self.simulations += 1;
        let problem = self.problem;
        let pairs = problem.records.iter().zip(problem.residuals);
        let changed: Option<Vec<Vec<f64>>> = pairs
            .map(|(record, base)| residuals_with(record, &model, members.len(), self.stages, base))
            .collect();
        let kept = problem
            .bounds
            .keep(problem.metric, problem.records, problem.residuals, changed?);
        Some(kept.residuals)
    }

    /// A patch that all wheels were on, but for a rest of the time.
    pub(super) fn is_the_whole_floor(&self, members: &[Member]) -> bool {
        let reach_m = self.problem.base.reach_m();
        let is_inside = |member: &Member| {
            let [x_m, y_m, radius_m, ..] = &member.values[..] else {
                return false;
            };
            let positions = self.problem.records.iter().flat_map(Record::positions_m);
            covers([*x_m, *y_m], radius_m - reach_m, positions)
        };
        let mut patches = members.iter().filter(|member| is_patch(member));
        patches.any(is_inside)
    }

    pub(super) fn energy(&self, residuals: &[Vec<f64>]) -> f64 {
        let vector = residuals.iter().map(Vec::as_slice).collect();
        self.problem.metric.gram(&[vector]).at(0, 0)
    }
}

/// One round of steps along the axes; true when one of them gained.
pub(super) fn pattern(
    search: &mut Search,
    members: &mut Vec<Member>,
    free: &[(usize, usize)],
    now: &mut Vec<Vec<f64>>,
    energy: &mut f64,
    steps: Steps,
) -> bool {
    let before = *energy;
    for (m, a) in free {
        let axis = members[*m].candidate.axes[*a];
        if matches!(steps, Steps::Seconds(_)) && !is_shift(&axis) {
            continue;
        }
        let mut direction = 1.0;
        let mut turned = false;
        let mut moves = 0;
        while moves < MOST_MOVES {
            let mut trial = members.clone();
            let value = trial[*m].values[*a];
            let step = match steps {
                Steps::Sizes(part) => part * scale(&axis, value),
                Steps::Seconds(seconds) => seconds,
            };
            trial[*m].values[*a] = clamped(&axis, value + direction * step);
            let better = search
                .simulate(&trial)
                .filter(|residuals| search.energy(residuals) < *energy);
            match better {
                Some(residuals) => {
                    *energy = search.energy(&residuals);
                    (*members, *now) = (trial, residuals);
                    moves += 1;
                    turned = true;
                }
                None if turned => break,
                None => {
                    direction = -direction;
                    turned = true;
                }
            }
        }
    }
    if let Steps::Sizes(part) = steps {
        about_edges(search, members, now, energy, part);
    }
    before - *energy > LEAST_GAIN
}

/// Moves that leave the edge of a patch where it is of which one side is met. What they add is held against what the patch explains beside the other members.
fn about_edges(search: &mut Search, members: &mut Vec<Member>, now: &mut Vec<Vec<f64>>, energy: &mut f64, part: f64) {
    let patches: Vec<usize> = (0..members.len()).filter(|m| is_patch(&members[*m])).collect();
    for m in patches {
        let positions = search.problem.records.iter().flat_map(Record::positions_m);
        let edge = Edge::of(&members[m].values, positions, search.problem.base.reach_m());
        let Some(mut edge) = edge else { continue };
        let Some(without) = energy_without(search, members, m) else {
            continue;
        };
        for way in Move::ALL {
            for _ in 0..MOST_MOVES {
                let own = &members[m];
                let axes = &own.candidate.axes;
                let step_m = part * scale(&axes[0], own.values[0]);
                let moved = edge.moved(&own.values, way, step_m);
                let mut trial = members.clone();
                trial[m].values = axes
                    .iter()
                    .zip(&moved)
                    .map(|(axis, value)| clamped(axis, *value))
                    .collect();
                let share = if way == Move::Larger { LARGER_SHARE } else { EDGE_SHARE };
                let least = (share * (without - *energy)).max(LEAST_GAIN);
                let Some(residuals) = search.simulate(&trial) else {
                    break;
                };
                let trial_energy = search.energy(&residuals);
                let is_better = trial_energy < *energy - least;
                if !is_better {
                    break;
                }
                (*members, *now, *energy) = (trial, residuals, trial_energy);
                edge = edge.after(&members[m].values);
            }
        }
    }
}

/// Energy under the other members alone.
fn energy_without(search: &mut Search, members: &[Member], m: usize) -> Option<f64> {
    let mut others = members.to_vec();
    others.remove(m);
    if others.is_empty() {
        return Some(search.energy(search.problem.residuals));
    }
    let residuals = search.simulate(&others)?;
    Some(search.energy(&residuals))
}

fn is_patch(member: &Member) -> bool {
    member.candidate.entry.name == "low_friction_patch"
}

/// A circle has all positions inside, but for a rest of the time.
pub(super) fn covers(centre_m: [f64; 2], radius_m: f64, positions_m: impl Iterator<Item = [f64; 2]>) -> bool {
    let (mut all, mut beside) = (0, 0);
    for [x_m, y_m] in positions_m {
        all += 1;
        beside += i32::from(libm::hypot(x_m - centre_m[0], y_m - centre_m[1]) > radius_m);
    }
    all > 0 && f64::from(beside) <= BESIDE * f64::from(all)
}
