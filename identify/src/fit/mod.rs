//! Bounded Levenberg-Marquardt on simulations, with a pattern search where a law is not smooth.

mod bounds;
mod edge;
mod search;
mod slopes;

pub use self::bounds::{Bounded, Bounds};
pub use self::edge::larger_patches;
pub(crate) use self::search::EDGE_SHARE;
use self::search::{Search, TICKS, come_nearer, is_shift, pattern, steps_of_search};
use self::slopes::{correct, jacobian, made, moved, regularised, scale, told};
use crate::floor::Metric;
use crate::hypothesis::{Axis, Candidate, Hypothesis, LOST};
use crate::linear::Square;
use crate::record::Record;

/// Runs, product and the model that effects are added to.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    pub records: &'a [Record],
    pub metric: &'a Metric,
    pub bounds: &'a Bounds,
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
/// A slope beside which others are seen is of a step of this many practical sizes.
const SLOPE_STEP: f64 = 0.3;
/// Dampings that are tried for a step.
const TRIALS: usize = 4;
/// A limit that is far too low is raised by this factor, so many times.
const RAISED: f64 = 1.3;
const MOST_RAISES: usize = 6;
/// The last raise is looked at in so many parts.
const PARTS_OF_A_RAISE: u32 = 6;
/// A law is not linear: a fit may gain this many times what its slopes promise.
const HOPE: f64 = 4.0;
/// Slopes serve for a further step when the last one gained this part of what they told.
const BORNE_OUT: core::ops::Range<f64> = 0.8..1.25;
/// Lengths of steps in a row that may lead nowhere before a pattern search ends.
const MOST_IN_VAIN: usize = 2;
/// Half width of a 95 % interval in standard deviations.
pub const NORMAL_95: f64 = 1.96;
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

/// The members with one free axis of them moved, for every such axis.
pub fn moved_one_by_one(members: &[Member]) -> Vec<Vec<Member>> {
    let free = free_axes(members);
    let alone = free.iter().map(|axis| moved(members, &[*axis], &[SLOPE_STEP]));
    alone.collect()
}

/// Axes that a fit may move: those with finite values.
fn free_axes(members: &[Member]) -> Vec<(usize, usize)> {
    let mut free = Vec::new();
    for (m, member) in members.iter().enumerate() {
        for (a, axis) in member.candidate.axes.iter().enumerate() {
            let fixed_shape = member.candidate.entry.name == "caster_swivel" && !axis.carries_size;
            let foot = member.candidate.entry.name == "lens_distortion" && !axis.carries_size;
            let is_lost = member.candidate.entry.name == LOST;
            if member.values[a].is_finite() && !fixed_shape && !foot && !is_lost {
                free.push((m, a));
            }
        }
    }
    free
}

fn clamped(axis: &Axis, value: f64) -> f64 {
    value.clamp(axis.low, axis.high.min(1e6))
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
    if raise_limits(&mut search, &mut members, &mut now, base_energy)
        || come_nearer(&mut search, &mut members, &mut now, base_energy)
    {
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
            let mut in_vain = 0;
            for steps in steps {
                if in_vain >= MOST_IN_VAIN {
                    break;
                }
                if search.is_the_whole_floor(&members) {
                    return None;
                }
                let before = energy;
                found |= pattern(&mut search, &mut members, &free, &mut now, &mut energy, steps);
                let gain = base_energy - energy;
                if gain < problem.wanted_gain || (problem.wanted_gain.is_finite() && gain <= 0.0) {
                    is_given_up = true;
                    found = false;
                    break;
                }
                let is_vain = before - energy < LEAST_SHARE * gain;
                let is_of_size = matches!(steps, search::Steps::Sizes(_));
                in_vain = if is_vain { in_vain + usize::from(is_of_size) } else { 0 };
            }
            if !found {
                break;
            }
            serve_on = false;
            damping = 1e-2;
        }
    }
    if search.is_the_whole_floor(&members) {
        return None;
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

/// A limit below what the runs reached at least makes everything worse and has slopes that lead nowhere: raised until it does not. One that only the hardest
/// moment reaches may lie between the last step and the one before.
fn raise_limits(search: &mut Search, members: &mut [Member], now: &mut Vec<Vec<f64>>, base_energy: f64) -> bool {
    let mut raised = false;
    let mut energy = search.energy(now);
    for _ in 0..MOST_RAISES {
        if energy <= base_energy {
            break;
        }
        let trial = with_limits(members, RAISED).and_then(|trial| Some((search.simulate(&trial)?, trial)));
        let Some((residuals, trial)) = trial else { break };
        members.clone_from_slice(&trial);
        *now = residuals;
        energy = search.energy(now);
        raised = true;
    }
    if !raised || energy > base_energy {
        return raised;
    }
    let above = members.to_vec();
    for part in 1..PARTS_OF_A_RAISE {
        let factor = libm::pow(RAISED, -f64::from(part) / f64::from(PARTS_OF_A_RAISE));
        let trial = with_limits(&above, factor).and_then(|trial| Some((search.simulate(&trial)?, trial)));
        let Some((residuals, trial)) = trial else { continue };
        let trial_energy = search.energy(&residuals);
        if trial_energy < energy {
            members.clone_from_slice(&trial);
            (*now, energy) = (residuals, trial_energy);
        }
    }
    raised
}

/// All limits of the members times a factor; `None` when there are none.
fn with_limits(members: &[Member], factor: f64) -> Option<Vec<Member>> {
    let mut scaled = members.to_vec();
    let mut limits = 0;
    for member in &mut scaled {
        for (axis, value) in member.candidate.axes.iter().zip(&mut member.values) {
            if axis.neutral.is_infinite() && value.is_finite() {
                *value = clamped(axis, factor * *value);
                limits += 1;
            }
        }
    }
    (limits > 0).then_some(scaled)
}

fn has_limit(member: &Member) -> bool {
    let mut axes = member.candidate.axes.iter().zip(&member.values);
    axes.any(|(axis, value)| axis.neutral.is_infinite() && value.is_finite())
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

impl Fit {
    /// What it says of one member, the others being fitted beside it.
    pub fn only(mut self, member: usize) -> Fit {
        let rows: Vec<usize> = (0..self.free.len()).filter(|row| self.free[*row].0 == member).collect();
        if self.covariance.size == self.free.len() {
            self.covariance = self.covariance.part(&rows);
        }
        if self.jacobian.len() == self.free.len() {
            let mut jacobian = rows
                .iter()
                .map(|row| core::mem::take(&mut self.jacobian[*row]))
                .collect();
            core::mem::swap(&mut self.jacobian, &mut jacobian);
        }
        self.free = rows.iter().map(|row| (0, self.free[*row].1)).collect();
        self.members = vec![self.members.swap_remove(member)];
        self
    }

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

    /// The members as the other runs would have them, by the slopes of the fit; `None` when these do not tell.
    pub fn without(&self, metric: &Metric, run: usize) -> Option<Vec<Member>> {
        if self.free.is_empty() || self.jacobian.len() != self.free.len() {
            return None;
        }
        let rows: Vec<usize> = (1..=self.free.len()).collect();
        let mut normal = Square::zero(rows.len());
        let mut right = vec![0.0; rows.len()];
        for other in (0..self.residuals.len()).filter(|other| *other != run) {
            let mut vectors: Vec<&[f64]> = vec![&self.residuals[other]];
            vectors.extend(self.jacobian.iter().map(|column| column[other].as_slice()));
            let gram = metric.gram_of_run(other, &vectors);
            let own = gram.part(&rows);
            normal
                .values
                .iter_mut()
                .zip(&own.values)
                .for_each(|(sum, own)| *sum += own);
            right
                .iter_mut()
                .zip(&rows)
                .for_each(|(sum, row)| *sum += gram.at(*row, 0));
        }
        let step = regularised(&normal, 1e-3).cholesky().solve(&right);
        let is_told = step.iter().all(|step| step.is_finite());
        is_told.then(|| moved(&self.members, &self.free, &step))
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

    /// The largest size of a member in practical sizes that its axes surely have: of what they hardly say, as a load's inertia beside its mass, the
    /// near end of the 95 % interval counts.
    pub fn sure_size(&self, member: usize) -> f64 {
        let Member { candidate, values } = &self.members[member];
        let pairs = candidate.axes.iter().zip(values).enumerate();
        let sure = pairs.map(|(a, (axis, value))| {
            let sigma = Some(self.sigma(member, a)).filter(|sigma| sigma.is_finite());
            let away = value - axis.neutral;
            let nearer = (away.abs() - NORMAL_95 * sigma.unwrap_or(0.0)).max(0.0);
            if away.is_finite() {
                axis.neutral + nearer.copysign(away)
            } else {
                *value
            }
        });
        candidate.size(&sure.collect::<Vec<f64>>())
    }
}

#[cfg(test)]
mod tests;
