//! The command that brings the model onto the virtual robot's way: Gauss-Newton on a few corrections over the horizon.
//!
//! ```text
//! c_j   = (u, v of r_(j + driving), g r of r_(j + turning)) + d_block(j)   lead by the model's own answer; g: what it turns less
//! e_m   = r_m^-1 x_m,   at M = 6 moments of the horizon, a radian counting L
//! (J'J + R + mu R) step = J'e + R d,     d <- d - step                    R = rho / (size of a component)^2
//! ```
//! Robots that cannot move sideways have no `v`; steered ones have the curvature in place of the yaw rate and never change
//! gear by a correction.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use twin::SUBSTEPS;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use super::model_robot::ModelRobot;
use super::virtual_robot::{VirtualRobot, motion};
use crate::TICK_S;
use crate::answer::{Answer, turn_share};
use crate::law::Drive;
use crate::prediction::{after, between, is_possible, moved};
use crate::team::accelerated;
use crate::vector::{heading, wrap};

/// Moments of the horizon that are compared.
const SAMPLES: usize = 6;
/// Corrections of one component hold for these shares of the horizon.
const BLOCKS: usize = 3;
const BLOCK_ENDS: [f64; BLOCKS] = [0.2, 0.5, 1.0];
const COMPONENTS: usize = 3;
const UNKNOWNS: usize = BLOCKS * COMPONENTS;
const RESIDUALS: usize = 3 * SAMPLES;
/// A radian counts this many metres.
const LEVER_HOLONOMIC_M: f64 = 0.2;
const LEVER_M: f64 = 0.1;
/// What a correction of size 1 costs, m2, and how many times as much a change costs. A standing correction must be cheap - it is
/// what the model knows to be wrong, and its cost is error that stays -, a change dear: the Jacobian is up to 18 turns old, and
/// steps that trust it grow into oscillations.
const COST_M2: f64 = 0.0003;
const CHANGE_SHARE: f64 = 20.0;
/// Sizes of the components: m/s, m/s, rad/s, or 1/m.
const SIZES: [f64; COMPONENTS] = [1.0, 1.0, 6.0];
const SIZE_PER_M: f64 = 8.0;
/// Steps of the finite differences.
const STEPS: [f64; COMPONENTS] = [0.05, 0.05, 0.2];
const STEP_PER_M: f64 = 0.2;
/// Bounds of a correction: so much, and this share of what the law asks for within the horizon.
const BOUNDS: [f64; COMPONENTS] = [0.12, 0.12, 0.4];
const BOUND_SHARES: [f64; COMPONENTS] = [0.3, 0.3, 0.5];
const BOUND_PER_M: f64 = 0.8;
/// A virtual robot that is slower over the whole horizon rests.
const REST_M_PER_S: f64 = 0.003;
const REST_RAD_PER_S: f64 = 0.01;
/// Slower steered robots keep their curvature.
const STILL_M_PER_S: f64 = 0.01;
/// Bounds of `g`.
const GAINS: [f64; 2] = [0.8, 2.5];

type Corrections = [[f64; COMPONENTS]; BLOCKS];

#[derive(Debug)]
pub(super) struct Plan {
    model: Robot,
    scratch: FreeRobot,
    drive: Drive,
    /// What is compared, ahead of the body origin: the fixed axle, or the point about which a robot skids. Where the body
    /// swings to in a turn says nothing of where it will go, and the other way round with the back first.
    point_x_m: f64,
    ahead: usize,
    lead_driving: usize,
    lead_turning: usize,
    turn_gain: f64,
    corrections: Corrections,
    jacobian: [[f64; RESIDUALS]; UNKNOWNS],
    /// Whose turn it is; a column of zeros, before its first turn, corrects nothing.
    column: usize,
    last_per_m: f64,
}

impl Plan {
    pub(super) fn new(model: &Robot, drive: Drive, point_x_m: f64, ahead: usize) -> Plan {
        let answer = Answer::of(model);
        let lead = |answer_s: f64| ((answer_s / TICK_S + 0.5) as usize).min(ahead);
        let share = turn_share(model);
        let [least, most] = GAINS;
        Plan {
            scratch: FreeRobot::at_rest(model, Pose::default()),
            model: model.clone(),
            drive,
            point_x_m,
            ahead,
            lead_driving: lead(answer.driving_s),
            lead_turning: lead(answer.turning_s),
            turn_gain: if share > 0.0 {
                (1.0 / share).clamp(least, most)
            } else {
                1.0
            },
            corrections: [[0.0; COMPONENTS]; BLOCKS],
            jacobian: [[0.0; RESIDUALS]; UNKNOWNS],
            column: 0,
            last_per_m: 0.0,
        }
    }

    pub(super) fn reset(&mut self) {
        self.corrections = [[0.0; COMPONENTS]; BLOCKS];
    }

    /// Command of this tick; nothing when the model says what cannot be.
    ///
    /// - `turn`: corrections are made anew; otherwise those of the tick before hold.
    pub(super) fn command(&mut self, model: &ModelRobot, ideal: &VirtualRobot, turn: bool) -> Option<BodyTwist> {
        if rests(ideal) {
            self.reset();
            return Some(ideal.at(1).twist);
        }
        if turn {
            let base = self.residuals(model, ideal, &self.corrections.clone())?;
            self.renew(model, ideal, &base)?;
            self.improve(&base, ideal);
        }
        let command = self.at_tick(ideal, &self.corrections, 0);
        self.last_per_m = self.per_m(ideal, 0);
        is_possible(&command).then_some(command)
    }

    /// One column of the Jacobian.
    fn renew(&mut self, model: &ModelRobot, ideal: &VirtualRobot, base: &[f64; RESIDUALS]) -> Option<()> {
        while !self.is_free(self.column % COMPONENTS) {
            self.column = (self.column + 1) % UNKNOWNS;
        }
        let (block, component) = (self.column / COMPONENTS, self.column % COMPONENTS);
        let column = self.column;
        self.column = (self.column + 1) % UNKNOWNS;
        let mut moved = self.corrections;
        let step = self.step(component);
        moved[block][component] += step;
        let changed = self.residuals(model, ideal, &moved)?;
        for (slot, (after, before)) in self.jacobian[column].iter_mut().zip(changed.iter().zip(base)) {
            *slot = (after - before) / step;
        }
        Some(())
    }

    /// One Gauss-Newton step, within the bounds.
    fn improve(&mut self, base: &[f64; RESIDUALS], ideal: &VirtualRobot) {
        let mut matrix = [[0.0; UNKNOWNS]; UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        for a in 0..UNKNOWNS {
            let component = a % COMPONENTS;
            let size = self.size(component);
            let cost = COST_M2 / (size * size);
            let now = self.corrections[a / COMPONENTS][component];
            if !self.is_free(component) {
                matrix[a][a] = 1.0;
                continue;
            }
            right[a] = dot(&self.jacobian[a], base) + cost * now;
            for (slot, other) in matrix[a].iter_mut().zip(&self.jacobian).take(a + 1) {
                *slot = dot(&self.jacobian[a], other);
            }
            matrix[a][a] += cost * (1.0 + CHANGE_SHARE);
        }
        let Some(step) = solved(matrix, right) else {
            self.reset();
            return;
        };
        let bounds = self.bounds(ideal);
        for (a, step) in step.into_iter().enumerate() {
            let component = a % COMPONENTS;
            let slot = &mut self.corrections[a / COMPONENTS][component];
            let next = *slot - step;
            *slot = if next.is_finite() {
                next.clamp(-bounds[component], bounds[component])
            } else {
                0.0
            };
        }
    }

    /// Differences of predicted and wanted poses over the horizon, in the frames of the wanted ones.
    fn residuals(
        &mut self,
        model: &ModelRobot,
        ideal: &VirtualRobot,
        corrections: &Corrections,
    ) -> Option<[f64; RESIDUALS]> {
        let lever_m = if self.drive == Drive::Holonomic {
            LEVER_HOLONOMIC_M
        } else {
            LEVER_M
        };
        self.scratch.copy_from(model.free());
        let mut told = model.told();
        let mut steering_rad = model.steering_rad();
        let mut own = self.model.seen_pose(self.scratch.pose());
        let mut expected = own;
        let mut residuals = [0.0; RESIDUALS];
        let mut tick = 0;
        for sample in 0..SAMPLES {
            let end = (self.ahead * (sample + 1)) / SAMPLES;
            let seconds = (end - tick) as f64 * TICK_S;
            while tick < end {
                told = accelerated(&told, &self.at_tick(ideal, corrections, tick));
                let wheels = self.model.wheel_speeds_holding(told, steering_rad);
                steering_rad = wheels.steering_rad;
                (0..SUBSTEPS).for_each(|_| self.scratch.step(&wheels));
                tick += 1;
            }
            let next = self.model.seen_pose(self.scratch.pose());
            let mut way = between(&motion(&own), &motion(&next));
            way.yaw_rad = wrap(way.yaw_rad);
            own = next;
            expected = moved(&expected, &after(&way, model.bias(), seconds));
            let off = between(&motion(&ideal.at(end).pose), &motion(&expected));
            // Of the point that is compared.
            let [c, s] = heading(off.yaw_rad);
            residuals[3 * sample] = off.at[0] + (c - 1.0) * self.point_x_m;
            residuals[3 * sample + 1] = off.at[1] + s * self.point_x_m;
            residuals[3 * sample + 2] = lever_m * wrap(off.yaw_rad);
        }
        // False also of what is not a number.
        residuals.iter().all(|part| part.abs() < 10.0).then_some(residuals)
    }

    /// Command so many ticks from now.
    fn at_tick(&self, ideal: &VirtualRobot, corrections: &Corrections, tick: usize) -> BodyTwist {
        let share = tick as f64 / self.ahead as f64;
        let block = BLOCK_ENDS.iter().position(|end| share < *end).unwrap_or(BLOCKS - 1);
        let [forward, left, turn] = corrections[block];
        let driving = &ideal.at(tick + 1 + self.lead_driving).twist;
        let u = driving.forward_m_per_s;
        match self.drive {
            Drive::Steered { turning_radius_m, .. } => {
                let corrected = u + forward;
                let kept = if u > 0.0 {
                    corrected.max(0.0)
                } else if u < 0.0 {
                    corrected.min(0.0)
                } else {
                    0.0
                };
                let sharpest_per_m = 1.0 / turning_radius_m.max(1e-3);
                let per_m = (self.per_m(ideal, tick) * self.turn_gain + turn).clamp(-sharpest_per_m, sharpest_per_m);
                BodyTwist {
                    forward_m_per_s: kept,
                    left_m_per_s: 0.0,
                    yaw_rate_rad_per_s: kept * per_m,
                }
            }
            drive => BodyTwist {
                forward_m_per_s: u + forward,
                left_m_per_s: if drive == Drive::Holonomic {
                    driving.left_m_per_s + left
                } else {
                    0.0
                },
                yaw_rate_rad_per_s: self.turn_gain * ideal.at(tick + 1 + self.lead_turning).twist.yaw_rate_rad_per_s
                    + turn,
            },
        }
    }

    /// Curvature of the way where steering has to be begun now.
    fn per_m(&self, ideal: &VirtualRobot, tick: usize) -> f64 {
        let twist = &ideal.at(tick + 1 + self.lead_turning).twist;
        if twist.forward_m_per_s.abs() > STILL_M_PER_S {
            twist.yaw_rate_rad_per_s / twist.forward_m_per_s
        } else {
            self.last_per_m
        }
    }

    fn bounds(&self, ideal: &VirtualRobot) -> [f64; COMPONENTS] {
        let mut most = [0.0_f64; COMPONENTS];
        for tick in 0..=self.ahead {
            let twist = &ideal.at(tick).twist;
            let speed = twist.speed_m_per_s();
            let parts = [speed, speed, self.turn_gain * twist.yaw_rate_rad_per_s.abs()];
            for (slot, part) in most.iter_mut().zip(parts) {
                *slot = slot.max(part);
            }
        }
        let mut bounds = std::array::from_fn(|k| BOUNDS[k] + BOUND_SHARES[k] * most[k]);
        if self.is_steered() {
            bounds[2] = BOUND_PER_M;
        }
        bounds
    }

    fn is_free(&self, component: usize) -> bool {
        component != 1 || self.drive == Drive::Holonomic
    }

    fn is_steered(&self) -> bool {
        matches!(self.drive, Drive::Steered { .. })
    }

    fn size(&self, component: usize) -> f64 {
        if component == 2 && self.is_steered() {
            SIZE_PER_M
        } else {
            SIZES[component]
        }
    }

    fn step(&self, component: usize) -> f64 {
        if component == 2 && self.is_steered() {
            STEP_PER_M
        } else {
            STEPS[component]
        }
    }
}

/// The virtual robot stands, and will over the horizon.
fn rests(ideal: &VirtualRobot) -> bool {
    (0..=ideal.ahead()).all(|tick| {
        let twist = &ideal.at(tick).twist;
        twist.speed_m_per_s() < REST_M_PER_S && twist.yaw_rate_rad_per_s.abs() < REST_RAD_PER_S
    })
}

fn dot(a: &[f64; RESIDUALS], b: &[f64; RESIDUALS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solution of a symmetric positive definite system by Cholesky's method, from its lower half; `None` when it is not one.
fn solved(mut matrix: [[f64; UNKNOWNS]; UNKNOWNS], mut right: [f64; UNKNOWNS]) -> Option<[f64; UNKNOWNS]> {
    for row in 0..UNKNOWNS {
        for column in 0..=row {
            let products = matrix[row].iter().zip(&matrix[column]).take(column);
            let sum = matrix[row][column] - products.map(|(a, b)| a * b).sum::<f64>();
            if row == column {
                if sum.is_nan() || sum < 1e-30 {
                    return None;
                }
                matrix[row][row] = sum.sqrt();
            } else {
                matrix[row][column] = sum / matrix[column][column];
            }
        }
    }
    for row in 0..UNKNOWNS {
        for k in 0..row {
            right[row] -= matrix[row][k] * right[k];
        }
        right[row] /= matrix[row][row];
    }
    for row in (0..UNKNOWNS).rev() {
        for k in row + 1..UNKNOWNS {
            right[row] -= matrix[k][row] * right[k];
        }
        right[row] /= matrix[row][row];
    }
    Some(right)
}
