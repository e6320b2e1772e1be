//! One physics step of one robot: wheels, contact and body together, integrated implicitly.
//!
//! ```text
//! contact velocity  a_i = A_i . z,  b_i = B_i . z,  z = (u, v, r)
//! slip              s_l = R W_i - a_i ;  s_t = -b_i            (omni: s_t = 0)
//! contact force     F = mu N_i tanh(|s| / s0) s / |s|
//! normal load       N = minimum-norm solution of its three sums at the acceleration of the contact forces
//! wheel             J_w dW_i/dt = torque_i - R F_l - b_w W_i - t_c tanh(W_i / 0.3)
//! body              m (du/dt - r v), m (dv/dt + r u), J dr/dt  =  sum F_l A_i + F_t B_i
//! ```
//!
//! The contact is stiff (thousands 1/s at small slip). A linearly implicit step ([`step`]) takes what changes smoothly;
//! where it sees itself err, as where a wheel passes from slip to grip, the step is divided, and the finest parts are
//! solved by Newton's method ([`newton`]). How finely depends on the state alone.

pub(crate) mod bristle;
mod constants;
mod matrix;
mod newton;
mod shape;
mod step;

use wide::f64x4;

use crate::lanes::{LANES, each, four, least};
use crate::model::Model;
use crate::state::BodyState;
use crate::{MAX_WHEELS, math};
use constants::{Constants, Loads};
pub(crate) use constants::{Fixed, Lines};
use matrix::Matrix;
use newton::Newton;
use shape::{Shape, Speeds};
use step::{Advance, Drive, Start};

/// Parts of a physics step at the finest.
const FINEST: u32 = 64;
/// A part of at most this many of the finest is solved by Newton's method when the linear step errs.
const NEWTON_SIZE: u32 = 4;
/// Steps that may use one matrix; all within a control tick.
const MATRIX_STEPS: u32 = 4;
/// A step whose estimated error is up to this many times the allowed one is corrected by it.
const CORRECTED: f64 = 16.0;
/// Weight of the defect of a step whose matrix is that of its start.
const NEW_MATRIX: f64 = 1.0 / 3.0;
/// The same for an older matrix.
const OLD_MATRIX: f64 = 0.5;

/// What a step leaves to the next ones of the same control tick.
///
/// It follows from the state at the start of the tick, so it is no part of the state itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Carry {
    /// Whether the four below are of the state as it is: where the last step ended.
    has_ended: bool,
    speeds: Speeds,
    wheels_rad: f64,
    friction: f64x4,
    shape: Shape,
    matrix: Matrix,
    /// Period the matrix is for, s, and the steps it may still serve.
    matrix_period_s: f64,
    matrix_steps: u32,
}

impl Carry {
    pub(crate) const EMPTY: Carry = Carry {
        has_ended: false,
        speeds: Speeds {
            twist: [0.0; 3],
            wheel: f64x4::ZERO,
        },
        wheels_rad: 0.0,
        friction: f64x4::ZERO,
        shape: Shape::ZERO,
        matrix: Matrix::ZERO,
        matrix_period_s: 0.0,
        matrix_steps: 0,
    };

    /// Forgets everything.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.has_ended = false;
        self.matrix_steps = 0;
    }
}

/// Advances `state` by one physics step with the voltages (or, without a motor, the wheel speeds) in it.
///
/// Geometry and voltages are those of the whole step. Returns the number of parts.
pub(crate) fn advance(model: &Model, state: &mut BodyState, period_s: f64) -> u32 {
    debug_assert!(model.fixed == Fixed::new(model), "vectors of a model that has changed");
    let steered;
    let wheels_rad = model.wheel_steering.wheels_rad(state.steering_rad);
    let lines = if model.steering.is_some() {
        steered = model.lines_at(wheels_rad);
        &steered
    } else {
        &model.fixed.straight
    };
    let mut kernel = Kernel {
        model,
        c: Constants::new(model, lines, state),
        wheels_rad,
    };
    if model.has_side {
        kernel.advance::<true>(state, period_s)
    } else {
        kernel.advance::<false>(state, period_s)
    }
}

/// Forces of the slipping floor on the rims at the end of the last step, along the wheels, as they push the body, N; 0 before there was one. What
/// sticking contacts hold is not among them.
pub(crate) fn rim_forces_n(model: &Model, state: &BodyState) -> [f64; LANES] {
    let carry = &state.carry;
    if !carry.has_ended {
        return [0.0; LANES];
    }
    let load_n = four(&model.load.loads_n(state.accel_x, state.accel_y));
    (carry.friction * (carry.shape.along * load_n)).to_array()
}

/// One robot in one physics step.
struct Kernel<'a> {
    model: &'a Model,
    c: Constants<'a>,
    wheels_rad: f64,
}

impl Kernel<'_> {
    #[inline(always)]
    fn shape<const SIDE: bool>(&self, speeds: &Speeds) -> Shape {
        match &self.model.tyre {
            None => Shape::at::<SIDE>(&self.c, speeds),
            Some(tyre) => Shape::of_tyre(tyre, &self.c, speeds),
        }
    }

    #[inline(always)]
    fn first_shape<const SIDE: bool>(&self, state: &BodyState, speeds: &Speeds) -> Shape {
        let carry = &state.carry;
        if carry.has_ended
            && carry.wheels_rad == self.wheels_rad
            && !self.model.contact_varies
            && carry.speeds == *speeds
            && carry.friction == self.c.friction
        {
            carry.shape
        } else {
            self.shape::<SIDE>(speeds)
        }
    }

    /// A whole step at once where that is accurate, else in parts.
    #[inline(always)]
    fn advance<const SIDE: bool>(&mut self, state: &mut BodyState, period_s: f64) -> u32 {
        let speeds = Speeds {
            twist: [state.u, state.v, state.r],
            wheel: four(&state.wheel),
        };
        let shape = self.first_shape::<SIDE>(state, &speeds);
        if state.sticks {
            let lines = self.c.lines;
            bristle::load(&mut self.c, lines, state, &shape);
        }
        let start = Start::new(&self.c, speeds, shape, [state.accel_x, state.accel_y]);
        let parts = self.whole_or_parts::<SIDE>(state, start, period_s);
        if state.sticks || bristle::is_slow(&self.c, speeds.wheel) {
            let half = 0.5;
            let mean = Speeds {
                twist: each(|j| half * (speeds.twist[j] + [state.u, state.v, state.r][j])),
                wheel: f64x4::splat(half) * (speeds.wheel + four(&state.wheel)),
            };
            state.sticks = bristle::advance::<SIDE>(&self.c, state, &mean, period_s);
        }
        parts
    }

    #[inline(always)]
    fn whole_or_parts<const SIDE: bool>(&mut self, state: &mut BodyState, start: Start, period_s: f64) -> u32 {
        let carry = &mut state.carry;
        let mut weight = OLD_MATRIX;
        if carry.matrix_steps == 0 || carry.matrix_period_s != period_s {
            weight = NEW_MATRIX;
            carry.matrix = self.matrix::<SIDE>(&start, period_s);
            carry.matrix_period_s = period_s;
            carry.matrix_steps = MATRIX_STEPS;
        }
        state.carry.matrix_steps -= 1;
        if self.whole::<SIDE>(state, &start, (weight, period_s)) {
            return 1;
        }
        if weight == OLD_MATRIX {
            state.carry.matrix = self.matrix::<SIDE>(&start, period_s);
            state.carry.matrix_steps = MATRIX_STEPS - 1;
            if self.whole::<SIDE>(state, &start, (NEW_MATRIX, period_s)) {
                return 1;
            }
        }
        state.carry.matrix_steps = 0;
        self.in_parts::<SIDE>(state, start, period_s)
    }

    #[inline(always)]
    fn matrix<const SIDE: bool>(&self, start: &Start, period_s: f64) -> Matrix {
        let twist = start.speeds.twist;
        Matrix::new::<SIDE>(&self.c, twist, &start.shape, &start.drive, start.load_n, period_s)
    }

    /// Takes the step if it is accurate and leaves every wheel on the floor.
    #[inline(always)]
    fn whole<const SIDE: bool>(&self, state: &mut BodyState, start: &Start, (weight, period_s): (f64, f64)) -> bool {
        let matrix = &state.carry.matrix;
        let after = step::advance::<SIDE>(&self.c, start, matrix, period_s);
        let load_n = self.c.loads.at(after.accel);
        let shape = self.shape::<SIDE>(&after.end);
        let drive = Drive::at(&self.c, after.end.wheel, shape.spin_sign);
        let now = (&shape, &drive, load_n);
        let (error, missing) = step::error::<SIDE>(&self.c, start, matrix, &after, now, (weight, period_s));
        let standing = least(load_n) >= 0.0 && least(start.load_n) >= 0.0 && self.model.load.count() <= LANES;
        if error <= 1.0 && standing {
            take(state, &after, period_s);
            self.settle(state, &after.end, &shape, &drive);
            return true;
        }
        standing && error <= CORRECTED && self.corrected::<SIDE>(state, &after, &missing, period_s)
    }

    /// Takes the step less its estimated error.
    #[cold]
    #[inline(never)]
    fn corrected<const SIDE: bool>(
        &self,
        state: &mut BodyState,
        after: &Advance,
        missing: &Speeds,
        period_s: f64,
    ) -> bool {
        let after = step::corrected(after, missing, period_s);
        if least(self.c.loads.at(after.accel)) < 0.0 {
            return false;
        }
        take(state, &after, period_s);
        let shape = self.shape::<SIDE>(&after.end);
        let drive = Drive::at(&self.c, after.end.wheel, shape.spin_sign);
        self.settle(state, &after.end, &shape, &drive);
        true
    }

    /// In as many parts as accuracy needs.
    #[cold]
    #[inline(never)]
    fn in_parts<const SIDE: bool>(&mut self, state: &mut BodyState, start: Start, period_s: f64) -> u32 {
        let (mut start, mut at, mut size, mut parts) = (start, 0, FINEST, 0);
        while at < FINEST {
            parts += 1;
            let part_s = period_s * (f64::from(size) / f64::from(FINEST));
            let (after, shape, error) = match self.part::<SIDE>(&mut start, part_s) {
                Ok(part) => part,
                Err(error) if size > NEWTON_SIZE => {
                    // The error falls with the cube of the size.
                    size /= if error > 64.0 * CORRECTED && size > 2 * NEWTON_SIZE {
                        4
                    } else {
                        2
                    };
                    continue;
                }
                Err(error) => {
                    let newton = Newton::new(self.model, state, &self.c);
                    let after = newton.advance(&start.speeds, part_s);
                    (after, self.shape::<SIDE>(&after.end), error)
                }
            };
            take(state, &after, part_s);
            start = Start::new(&self.c, after.end, shape, after.accel);
            at += size;
            if at < FINEST && error < 0.1 * CORRECTED && at.is_multiple_of(2 * size) {
                size *= 2;
            }
        }
        self.settle(state, &start.speeds, &start.shape, &start.drive);
        parts
    }

    /// One part with every wheel either on the floor or without load; the error where it is too inaccurate.
    ///
    /// It begins with the wheels on the floor that were there in the part before: where loads react strongly to the
    /// forces (mu h near half the wheelbase) more than one set of wheels can carry the robot, and it stays with the one
    /// it has. Wheels whose load would be negative leave one by one.
    fn part<const SIDE: bool>(&mut self, start: &mut Start, part_s: f64) -> Result<(Advance, Shape, f64), f64> {
        let load = &self.model.load;
        let mut down = load.standing_at(start.accel);
        let mut fresh = down == [true; MAX_WHEELS];
        loop {
            let rows = load.standing_on(&down);
            self.c.loads = Loads::new(&rows);
            *start = Start::new(&self.c, start.speeds, start.shape, start.accel);
            let matrix = self.matrix::<SIDE>(start, part_s);
            let mut after = step::advance::<SIDE>(&self.c, start, &matrix, part_s);
            let mut shape = self.shape::<SIDE>(&after.end);
            let drive = Drive::at(&self.c, after.end.wheel, shape.spin_sign);
            let now = (&shape, &drive, self.c.loads.at(after.accel));
            let (error, missing) = step::error::<SIDE>(&self.c, start, &matrix, &after, now, (NEW_MATRIX, part_s));
            if error > CORRECTED || error.is_nan() {
                return Err(error);
            }
            let standing = down.iter().take(load.count()).filter(|down| **down).count();
            if standing > 1 && rows.most_negative(after.accel).is_some() {
                // Judged by what the loads of the part before would do: the solution may be on another branch.
                let worst = rows
                    .most_negative(start.explicit_accel(&self.c))
                    .or(rows.most_negative(after.accel));
                down[worst.unwrap_or(0)] = false;
                continue;
            }
            let lands = load.all_down.at(after.accel);
            if !fresh && (0..load.count()).any(|wheel| !down[wheel] && lands[wheel] > 0.0) {
                (down, fresh) = ([true; MAX_WHEELS], true);
                continue;
            }
            if error > 1.0 {
                after = step::corrected(&after, &missing, part_s);
                shape = self.shape::<SIDE>(&after.end);
            }
            return Ok((after, shape, error));
        }
    }

    /// Writes velocities and currents at the end of the step.
    #[inline(always)]
    fn settle(&self, state: &mut BodyState, end: &Speeds, shape: &Shape, drive: &Drive) {
        [state.u, state.v, state.r] = end.twist;
        state.wheel[..LANES].copy_from_slice(&end.wheel.to_array());
        state.current[..LANES].copy_from_slice(&(self.c.present * drive.current_a).to_array());
        // Field by field: a whole built elsewhere and copied makes the processor wait for its parts.
        let carry = &mut state.carry;
        carry.has_ended = true;
        carry.speeds = *end;
        carry.wheels_rad = self.wheels_rad;
        carry.friction = self.c.friction;
        carry.shape = *shape;
    }
}

/// Moves pose and wheel angles through one part of a step.
#[inline(always)]
fn take(state: &mut BodyState, after: &Advance, part_s: f64) {
    [state.accel_x, state.accel_y] = after.accel;
    move_pose(state, after.mean.twist, part_s);
    let turned = after.mean.wheel.to_array();
    for (angle, turned) in state.angle.iter_mut().zip(turned) {
        *angle += part_s * turned;
    }
}

/// Moves the pose along the arc of a constant twist: chord = twist x sinc(angle / 2), halfway heading.
#[inline(always)]
pub(crate) fn move_pose(state: &mut BodyState, [u, v, r]: [f64; 3], period_s: f64) {
    let half = 0.5 * r * period_s;
    let (sin, cos) = if half.abs() <= 0.25 {
        math::sin_cos_small(half)
    } else {
        libm::sincos(half)
    };
    let chord = if half.abs() > 1e-6 { sin / half } else { 1.0 };
    let middle_cos = state.cos_yaw * cos - state.sin_yaw * sin;
    let middle_sin = state.sin_yaw * cos + state.cos_yaw * sin;
    state.x_m += period_s * chord * (u * middle_cos - v * middle_sin);
    state.y_m += period_s * chord * (u * middle_sin + v * middle_cos);
    state.yaw_rad += 2.0 * half;
    state.cos_yaw = middle_cos * cos - middle_sin * sin;
    state.sin_yaw = middle_sin * cos + middle_cos * sin;
}
