//! Bounded Levenberg-Marquardt on simulations, with a pattern search where a law is not smooth.

use crate::floor::Metric;
use crate::hypothesis::{Axis, Candidate, Hypothesis};
use crate::linear::Square;
use crate::record::{Record, Stages, residuals};

/// Runs, product and the model that effects are added to.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    pub records: &'a [Record],
    pub metric: &'a Metric,
    pub base: &'a Hypothesis,
    /// Residuals under the base.
    pub residuals: &'a [Vec<f64>],
    /// Fits that cannot come near this gain are not finished; `-inf`: all are.
    pub wanted_gain: f64,
}

/// An effect with values of its axes.
#[derive(Debug, Clone)]
pub struct Member {
    pub candidate: Candidate,
    pub values: Vec<f64>,
}

/// The result.
#[derive(Debug, Clone)]
pub struct Fit {
    pub members: Vec<Member>,
    /// Decrease of the whitened energy against the base.
    pub gain: f64,
    /// Residuals under the fit, per record.
    pub residuals: Vec<Vec<f64>>,
    /// Covariance of the free axes, in the order of [`Fit::free`].
    pub covariance: Square,
    /// Position of the member and of its axis.
    pub free: Vec<(usize, usize)>,
    /// Change of the prediction per unit of every free axis, `[axis][record]`.
    pub jacobian: Vec<Vec<Vec<f64>>>,
    pub simulations: usize,
    /// It was given up: it would not have come near the gain that was wanted.
    pub is_given_up: bool,
}

const MOST_ITERATIONS: usize = 8;
/// A step that gains less than this and this share of the gain ends the fit.
const LEAST_GAIN: f64 = 0.3;
const LEAST_SHARE: f64 = 0.002;
/// Most steps of a pattern search along an axis.
const MOST_MOVES: usize = 4;
/// Its steps as parts of a practical size: for laws with corners, and for others, whose slopes may lie where a robot just slips or just
/// does not.
const FINER: [f64; 5] = [1.0, 0.5, 0.25, 0.12, 0.06];
const NEAR: [f64; 1] = [0.25];
/// The same in control ticks for what shifts time.
const TICKS: [f64; 2] = [1.0, 0.5];
const TICK_S: f64 = 1.0 / twin::CONTROL_RATE_HZ as f64;
/// Dampings that are tried for a step.
const TRIALS: usize = 4;
/// A limit that is far too low is raised by this factor, so many times.
const RAISED: f64 = 1.3;
const MOST_RAISES: usize = 6;
/// A law is not linear: a fit may gain this many times what its slopes promise.
const HOPE: f64 = 4.0;
/// Share of the time that runs must have been beside a patch.
const BESIDE: f64 = 0.03;
/// Slopes serve for a further step when the last one gained this part of what they told.
const BORNE_OUT: core::ops::Range<f64> = 0.8..1.25;
/// Steps after which a fit must be better than nothing.
const PATIENCE: usize = 3;

/// The hypothesis with all members.
pub fn with_members(base: &Hypothesis, members: &[Member]) -> Hypothesis {
    let mut model = base.clone();
    for member in members {
        model.effects.push(member.candidate.effect(&member.values));
    }
    model
}

/// Axes that a fit may move: those with finite values.
fn free_axes(members: &[Member]) -> Vec<(usize, usize)> {
    let mut free = Vec::new();
    for (m, member) in members.iter().enumerate() {
        for (a, axis) in member.candidate.axes.iter().enumerate() {
            let fixed_shape = member.candidate.entry.name == "caster_swivel" && !axis.carries_size;
            let foot = member.candidate.entry.name == "lens_distortion" && !axis.carries_size;
            if member.values[a].is_finite() && !fixed_shape && !foot {
                free.push((m, a));
            }
        }
    }
    free
}

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

/// Steps of a pattern search.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Steps {
    /// Along all axes, a part of a practical size.
    Sizes(f64),
    /// Along the axes that shift time, s.
    Seconds(f64),
}

/// Steps of the pattern searches of a fit.
///
/// - `ticks`: steps for members that shift time. Set-points act at control ticks, so that the energy is wavy over a shift, with the period of a tick: slopes
///   lead to the bottom of a wave.
fn steps_of_search(rough: bool, limited: bool, ticks: &[f64], searches: usize) -> Vec<Steps> {
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

/// Shifts time.
fn is_shift(axis: &Axis) -> bool {
    axis.unit == "s" && ["offset", "delay", "latency"].contains(&axis.name)
}

fn clamped(axis: &Axis, value: f64) -> f64 {
    value.clamp(axis.low, axis.high.min(1e6))
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    stages: Stages,
    simulations: usize,
}

impl<'a> Search<'a> {
    fn new(problem: &'a Problem<'a>, members: &[Member]) -> Search<'a> {
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

    fn simulate(&mut self, members: &[Member]) -> Option<Vec<Vec<f64>>> {
        let model = with_members(self.problem.base, members);
        model.robot()?;
        self.simulations += 1;
        let pairs = self.problem.records.iter().zip(self.problem.residuals);
        pairs
            .map(|(record, base)| residuals(record, &model, self.stages, Some(base)))
            .collect()
    }

    /// A patch that all wheels were on, but for a rest of the time.
    fn is_the_whole_floor(&self, members: &[Member]) -> bool {
        let wheels = &self.problem.base.description.wheels;
        let reach_m = wheels
            .iter()
            .map(|wheel| libm::hypot(wheel.x_m, wheel.y_m))
            .fold(0.0, f64::max);
        let is_inside = |member: &Member| {
            let [x_m, y_m, radius_m, ..] = &member.values[..] else {
                return false;
            };
            let (mut all, mut beside) = (0, 0);
            for [x, y] in self.problem.records.iter().flat_map(Record::positions_m) {
                all += 1;
                beside += i32::from(libm::hypot(x - x_m, y - y_m) + reach_m > *radius_m);
            }
            all > 0 && f64::from(beside) <= BESIDE * f64::from(all)
        };
        let mut patches = members
            .iter()
            .filter(|member| member.candidate.entry.name == "low_friction_patch");
        patches.any(is_inside)
    }

    fn energy(&self, residuals: &[Vec<f64>]) -> f64 {
        let vector = residuals.iter().map(Vec::as_slice).collect();
        self.problem.metric.gram(&[vector]).at(0, 0)
    }
}

/// Where a fit stands, and what its slopes promise.
struct Outlook {
    iteration: usize,
    gain: f64,
    promised: f64,
}

impl Outlook {
    /// The slopes promise nothing more.
    fn is_best(&self) -> bool {
        self.promised < LEAST_GAIN || self.promised < LEAST_SHARE * self.gain
    }

    /// More steps would not make a name of it.
    fn is_hopeless(&self, wanted_gain: f64) -> bool {
        let is_far = self.iteration > 0 && self.gain + HOPE * self.promised < wanted_gain;
        let is_late = wanted_gain > 0.0 && self.iteration >= PATIENCE && self.gain <= 0.0;
        is_far || is_late
    }
}

/// Fits all finite axes of the members, started at their values. `None` when the start cannot be simulated, or when a patch grows over
/// everything that the runs drove on: that is another floor, no patch.
pub fn fit(problem: &Problem, start: Vec<Member>) -> Option<Fit> {
    let mut search = Search::new(problem, &start);
    let free = free_axes(&start);
    let mut members = start;
    for member in &mut members {
        for (axis, value) in member.candidate.axes.iter().zip(&mut member.values) {
            *value = if value.is_finite() {
                clamped(axis, *value)
            } else {
                *value
            };
        }
    }
    let base_energy = search.energy(problem.residuals);
    let mut now = search.simulate(&members)?;
    let mut energy = search.energy(&now);
    if raise_limits(&mut search, &mut members, &mut now, base_energy) {
        energy = search.energy(&now);
    }
    let mut damping = 1e-2;
    let mut covariance = Square::zero(free.len());
    let mut slopes = Vec::new();
    let mut searches = 0;
    let rough = members.iter().any(|member| is_rough(&member.candidate));
    let limited = members.iter().any(has_limit);
    let shifts = free.iter().any(|(m, a)| is_shift(&members[*m].candidate.axes[*a]));
    // Slopes that a step has borne out serve on, corrected by what it showed.
    let secant_may_do = !rough && !limited && !shifts;
    let mut serve_on = false;
    // What joins others has been searched for alone.
    let ticks: &[f64] = match (shifts, members.len()) {
        (false, _) => &[],
        (true, 1) => &TICKS,
        (true, _) => &TICKS[1..],
    };
    // A limit that makes the runs worse however high it is raised is none.
    let mut is_given_up = limited && problem.wanted_gain > 0.0 && energy > base_energy;
    let iterations = if is_given_up { 0 } else { MOST_ITERATIONS };
    for iteration in 0..iterations {
        if !serve_on {
            slopes = jacobian(&mut search, &members, &free, &now);
        }
        serve_on = false;
        let mut vectors: Vec<Vec<&[f64]>> = vec![now.iter().map(Vec::as_slice).collect()];
        vectors.extend(
            slopes
                .iter()
                .map(|column| column.iter().map(Vec::as_slice).collect::<Vec<_>>()),
        );
        let gram = problem.metric.gram(&vectors);
        let rows: Vec<usize> = (1..=free.len()).collect();
        let normal = gram.part(&rows);
        let inverse = regularised(&normal, 0.0).cholesky();
        covariance = inverse.inverse();
        let right: Vec<f64> = rows.iter().map(|row| gram.at(*row, 0)).collect();
        let promised: f64 = inverse.solve(&right).iter().zip(&right).map(|(s, r)| s * r).sum();
        let outlook = Outlook {
            iteration,
            gain: base_energy - energy,
            promised,
        };
        let is_flat = promised <= 0.0;
        let may_be_told = !rough || iteration > 1;
        is_given_up = may_be_told && outlook.is_hopeless(problem.wanted_gain);
        if (is_flat && !rough) || is_given_up {
            break;
        }
        let before = energy;
        let trials = if rough || !outlook.is_best() { TRIALS } else { 0 };
        for _ in 0..trials {
            let step = regularised(&normal, damping).cholesky().solve(&right);
            let moved = moved(&members, &free, &step);
            if let Some(trial) = search.simulate(&moved) {
                let trial_energy = search.energy(&trial);
                if trial_energy < energy {
                    let made = made(&members, &moved, &free);
                    let told = told(&normal, &right, &made);
                    if secant_may_do && BORNE_OUT.contains(&((energy - trial_energy) / told)) {
                        correct(&mut slopes, &now, &trial, &made);
                        serve_on = true;
                    }
                    (members, now, energy) = (moved, trial, trial_energy);
                    damping = (damping * 0.2).max(1e-6);
                    break;
                }
            }
            damping *= 8.0;
        }
        let gained = before - energy;
        if gained < LEAST_GAIN || gained < LEAST_SHARE * (base_energy - energy) {
            let steps = steps_of_search(rough, limited, ticks, searches);
            searches += 1;
            let mut found = false;
            for steps in steps {
                if search.is_the_whole_floor(&members) {
                    return None;
                }
                found |= pattern(&mut search, &mut members, &free, &mut now, &mut energy, steps);
                if base_energy - energy < problem.wanted_gain {
                    is_given_up = true;
                    found = false;
                    break;
                }
            }
            if !found {
                break;
            }
            serve_on = false;
            damping = 1e-2;
        }
    }
    Some(Fit {
        members,
        gain: base_energy - energy,
        residuals: now,
        covariance,
        free,
        jacobian: slopes,
        simulations: search.simulations,
        is_given_up,
    })
}

/// A limit below what the runs reached at least makes everything worse and has slopes that lead nowhere: raised until it does not.
fn raise_limits(search: &mut Search, members: &mut [Member], now: &mut Vec<Vec<f64>>, base_energy: f64) -> bool {
    let mut raised = false;
    for _ in 0..MOST_RAISES {
        if search.energy(now) <= base_energy {
            break;
        }
        let mut trial = members.to_vec();
        let mut limits = 0;
        for member in &mut trial {
            for (axis, value) in member.candidate.axes.iter().zip(&mut member.values) {
                if axis.neutral.is_infinite() && value.is_finite() {
                    *value = clamped(axis, RAISED * *value);
                    limits += 1;
                }
            }
        }
        let Some(residuals) = (limits > 0).then(|| search.simulate(&trial)).flatten() else {
            break;
        };
        members.clone_from_slice(&trial);
        *now = residuals;
        raised = true;
    }
    raised
}

fn has_limit(member: &Member) -> bool {
    let mut axes = member.candidate.axes.iter().zip(&member.values);
    axes.any(|(axis, value)| axis.neutral.is_infinite() && value.is_finite())
}

/// Levenberg's term on the diagonal.
fn regularised(normal: &Square, damping: f64) -> Square {
    let mut system = normal.clone();
    for k in 0..system.size {
        let more = (damping + 1e-9) * system.at(k, k) + 1e-9;
        system.add(k, k, more);
    }
    system
}

/// Change of the prediction per practical size of each free axis.
fn jacobian(search: &mut Search, members: &[Member], free: &[(usize, usize)], now: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
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
fn made(before: &[Member], after: &[Member], free: &[(usize, usize)]) -> Vec<f64> {
    let step = |(m, a): &(usize, usize)| {
        let (from, to) = (before[*m].values[*a], after[*m].values[*a]);
        (to - from) / scale(&before[*m].candidate.axes[*a], from)
    };
    free.iter().map(step).collect()
}

/// Decrease of the energy that the slopes tell for a step.
fn told(normal: &Square, right: &[f64], step: &[f64]) -> f64 {
    let mut told = 0.0;
    for (i, (a, right)) in step.iter().zip(right).enumerate() {
        let curved: f64 = step.iter().enumerate().map(|(j, b)| normal.at(i, j) * b).sum();
        told += a * (2.0 * right - curved);
    }
    told
}

/// Broyden's correction of slopes: the smallest change with which they tell what a step did (Broyden 1965, equation 4.5).
fn correct(slopes: &mut [Vec<Vec<f64>>], before: &[Vec<f64>], after: &[Vec<f64>], step: &[f64]) {
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
fn scale(axis: &Axis, value: f64) -> f64 {
    if axis.neutral.is_infinite() {
        0.1 * value.abs().max(1e-3)
    } else {
        axis.practical
    }
}

fn moved(members: &[Member], free: &[(usize, usize)], step: &[f64]) -> Vec<Member> {
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

/// Laws with corners, where slopes lie.
pub fn is_rough(candidate: &Candidate) -> bool {
    const ROUGH: [&str; 5] = [
        "command_dead_band",
        "gear_backlash",
        "low_friction_patch",
        "steering_backlash",
        "cable_drag",
    ];
    ROUGH.contains(&candidate.entry.name)
}

/// One round of steps along the axes; true when one of them gained.
fn pattern(
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
    before - *energy > LEAST_GAIN
}

impl Fit {
    /// The same values on other data, without slopes; `None` when they cannot be simulated.
    pub fn evaluated(&self, problem: &Problem) -> Option<Fit> {
        let mut search = Search::new(problem, &self.members);
        let residuals = search.simulate(&self.members)?;
        Some(Fit {
            members: self.members.clone(),
            gain: search.energy(problem.residuals) - search.energy(&residuals),
            residuals,
            covariance: Square::zero(0),
            free: Vec::new(),
            jacobian: Vec::new(),
            simulations: self.simulations + search.simulations,
            is_given_up: self.is_given_up,
        })
    }

    /// Scatter of an axis from run to run as a standard error of its mean, in its unit; 0 with fewer than three runs.
    pub fn scatter(&self, metric: &Metric, member: usize, axis: usize) -> f64 {
        let Some(position) = self.free.iter().position(|free| *free == (member, axis)) else {
            return 0.0;
        };
        let runs = self.residuals.len();
        if runs < 3 || self.jacobian.len() != self.free.len() {
            return 0.0;
        }
        let mut steps: Vec<(f64, f64)> = Vec::new();
        for run in 0..runs {
            let mut vectors: Vec<&[f64]> = vec![&self.residuals[run]];
            vectors.extend(self.jacobian.iter().map(|column| column[run].as_slice()));
            let gram = metric.gram_of_run(run, &vectors);
            let rows: Vec<usize> = (1..=self.free.len()).collect();
            let normal = regularised(&gram.part(&rows), 1e-3);
            let right: Vec<f64> = rows.iter().map(|row| gram.at(*row, 0)).collect();
            let factor = normal.cholesky();
            let variance = factor.inverse().at(position, position);
            steps.push((factor.solve(&right)[position], 1.0 / variance.max(1e-30)));
        }
        let total: f64 = steps.iter().map(|step| step.1).sum();
        let mean = steps.iter().map(|(step, weight)| step * weight).sum::<f64>() / total;
        let spread: f64 = steps
            .iter()
            .map(|(step, weight)| weight * (step - mean) * (step - mean))
            .sum::<f64>()
            / total;
        let described = &self.members[member].candidate.axes[axis];
        (spread / (runs - 1) as f64).sqrt() * scale(described, self.members[member].values[axis])
    }

    /// Standard deviation of an axis, in its unit; infinite when it was not fitted.
    pub fn sigma(&self, member: usize, axis: usize) -> f64 {
        let Some(position) = self.free.iter().position(|free| *free == (member, axis)) else {
            return f64::INFINITY;
        };
        let described = &self.members[member].candidate.axes[axis];
        let unit = scale(described, self.members[member].values[axis]);
        self.covariance.at(position, position).max(0.0).sqrt() * unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlook(iteration: usize, gain: f64, promised: f64) -> Outlook {
        Outlook {
            iteration,
            gain,
            promised,
        }
    }

    #[test]
    fn a_fit_ends_where_its_slopes_promise_nothing() {
        assert!(outlook(1, 100.0, 0.9 * LEAST_GAIN).is_best());
        assert!(outlook(1, 10_000.0, 0.9 * LEAST_SHARE * 10_000.0).is_best());
        assert!(!outlook(1, 100.0, 1.0).is_best());
    }

    #[test]
    fn a_fit_ends_when_what_it_may_still_gain_is_not_enough_and_not_before() {
        assert!(outlook(1, 10.0, 4.0).is_hopeless(30.0));
        assert!(!outlook(1, 10.0, 6.0).is_hopeless(30.0), "{HOPE} times 6 may be enough");
        assert!(!outlook(0, -50.0, 1.0).is_hopeless(30.0), "the start is no step");
        assert!(
            outlook(PATIENCE, -1.0, 1e6).is_hopeless(30.0),
            "worse than nothing for long"
        );
        assert!(
            !outlook(PATIENCE, -1.0, 1e6).is_hopeless(f64::NEG_INFINITY),
            "nothing is wanted"
        );
    }

    #[test]
    fn shifts_of_time_are_searched_in_ticks_once_before_anything_finer() {
        let tick = Steps::Seconds(TICK_S);
        assert_eq!(steps_of_search(false, false, &TICKS, 0)[0], tick);
        assert_eq!(steps_of_search(false, false, &TICKS, 0).len(), TICKS.len() + NEAR.len());
        assert_eq!(steps_of_search(false, false, &[], 0), [Steps::Sizes(NEAR[0])]);
        assert!(steps_of_search(false, false, &TICKS, 1).is_empty());
    }

    #[test]
    fn corrected_slopes_tell_what_the_step_did_and_nothing_else_new() {
        let mut slopes = vec![vec![vec![1.0, 2.0]], vec![vec![0.5, -1.0]]];
        let (before, after) = (vec![vec![3.0, 4.0]], vec![vec![1.5, 4.5]]);
        let step = [2.0, -1.0];
        let across = [1.0, 2.0];
        let told = |slopes: &[Vec<Vec<f64>>], step: &[f64], row: usize| {
            slopes[0][0][row] * step[0] + slopes[1][0][row] * step[1]
        };
        let old: Vec<f64> = (0..2).map(|row| told(&slopes, &across, row)).collect();
        correct(&mut slopes, &before, &after, &step);
        for row in 0..2 {
            assert!((told(&slopes, &step, row) - (before[0][row] - after[0][row])).abs() < 1e-12);
            assert!(
                (told(&slopes, &across, row) - old[row]).abs() < 1e-12,
                "nothing across the step"
            );
        }
    }

    #[test]
    fn slopes_tell_the_decrease_of_a_parabola() {
        // energy (3 - x)^2 + 2 (1 - y)^2, at 0
        let mut normal = Square::zero(2);
        normal.set(0, 0, 1.0);
        normal.set(1, 1, 2.0);
        let right = [3.0, 2.0];
        assert!((told(&normal, &right, &[3.0, 1.0]) - 11.0).abs() < 1e-12);
        assert!((told(&normal, &right, &[1.0, 0.0]) - 5.0).abs() < 1e-12);
    }
}
