//! The quadratic programme of one group of robots, solved exactly: `min |x - d|^2` subject to rows `g . x >= b`.
//!
//! Dual active-set method [Goldfarb, Idnani 1983] with the identity as Hessian. The rows that are active at the
//! minimum are gathered one at a time, most violated first (lowest position among equals); `x = d + sum u_k g_k` with
//! multipliers `u >= 0` solves the problem of the gathered rows at every moment. Their Gram matrix is kept as a
//! Cholesky factor. Starts from the rows that were active on the tick before.

use super::chassis::Numbers;
use super::rows::{NOBODY, Row};

/// A row counts as kept up to this, m/s.
pub const KEPT_M_PER_S: f64 = 1e-9;
/// What may be left after the last rounding, m/s; more is not a solution.
pub const RESIDUAL_M_PER_S: f64 = 1e-7;
/// Squared distance of a row of length 1 from the span of the others below which it adds nothing to them.
const DEPENDENT: f64 = 1e-10;
/// Rows dropped at once while the rows of the tick before are tried; then all are forgotten.
const WARM_TRIALS: u32 = 6;

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Solved,
    /// The robots of the rows in [`Solver::clash`] cannot keep them all.
    Infeasible,
    /// Too many steps, or rounding got the better of it.
    NotConverged,
}

/// A group to solve.
#[derive(Debug, Clone, Copy)]
pub struct Group<'a> {
    /// Positions of the rows of robots against robots, walls, fence and obstacles, rising.
    pub shared: &'a [u32],
    /// Robots of the group, rising.
    pub robots: &'a [u32],
    /// Own limits of every robot: first position and number.
    pub own: &'a [[u32; 2]],
    /// No own limit is hurt inside these sizes of driving and turning, for every robot.
    pub easy: &'a [[f64; 2]],
    /// Holonomic robots drive with two numbers.
    pub planar: &'a [bool],
}

/// Memory of the method; allocates only in `new`.
#[derive(Debug, Clone)]
pub struct Solver {
    size: usize,
    active: Vec<u32>,
    multipliers: Vec<f64>,
    /// Lower Cholesky factor of the Gram matrix, `size` numbers a row.
    factor: Vec<f64>,
    forward: Vec<f64>,
    step: Vec<f64>,
    clash: Vec<u32>,
    pub steps: u32,
}

impl Solver {
    /// For at most `robots` robots in a group.
    pub fn new(robots: usize) -> Solver {
        let size = 3 * robots + 1;
        Solver {
            size,
            active: Vec::with_capacity(size),
            multipliers: Vec::with_capacity(size),
            factor: vec![0.0; size * size],
            forward: vec![0.0; size],
            step: vec![0.0; size],
            clash: Vec::with_capacity(size),
            steps: 0,
        }
    }

    /// Rows that contradict each other, after [`Outcome::Infeasible`].
    pub fn clash(&self) -> &[u32] {
        &self.clash
    }

    /// Solves in place: `x` becomes the nearest to `desired`; `multiplier` and `active` of the rows are set.
    ///
    /// Rows whose `active` is set on entry are tried first.
    pub fn solve(&mut self, group: &Group, rows: &mut [Row], desired: &[Numbers], x: &mut [Numbers]) -> Outcome {
        self.warm(group, rows, desired);
        self.place(group, rows, desired, x);
        let most_steps = 100 + 20 * group.robots.len() as u32;
        let outcome = loop {
            let Some(row) = most_violated(group, rows, x) else {
                break Outcome::Solved;
            };
            if self.steps >= most_steps {
                break Outcome::NotConverged;
            }
            let taken = rows[row as usize];
            match self.take(row, &taken, rows, x, most_steps) {
                Outcome::Solved => {}
                other => break other,
            }
        };
        if outcome != Outcome::Solved {
            return outcome;
        }
        // Once more from the multipliers, so that no rounding error of the way here is left.
        self.place(group, rows, desired, x);
        for (row, u) in self.active.iter().zip(&self.multipliers) {
            rows[*row as usize].multiplier = *u;
        }
        match worst(group, rows, x, false) {
            Some((_, left)) if left < -RESIDUAL_M_PER_S => Outcome::NotConverged,
            _ => Outcome::Solved,
        }
    }

    /// Begins with the rows of the tick before whose multipliers are still positive.
    fn warm(&mut self, group: &Group, rows: &mut [Row], desired: &[Numbers]) {
        self.active.clear();
        self.multipliers.clear();
        self.steps = 0;
        let own = group.robots.iter().flat_map(|robot| {
            let [first, count] = group.own[*robot as usize];
            first..first + count
        });
        for at in group.shared.iter().copied().chain(own) {
            if !std::mem::take(&mut rows[at as usize].active) {
                continue;
            }
            let rest = self.reduce(&rows[at as usize], rows);
            if rest > 1e3 * DEPENDENT && self.active.len() + 1 < self.size {
                rows[at as usize].active = true;
                self.append(at, rest, 0.0);
            }
        }
        for _ in 0..WARM_TRIALS {
            self.equalise(rows, desired);
            if self.multipliers.iter().all(|u| *u >= 0.0) {
                return;
            }
            for k in (0..self.active.len()).rev() {
                if self.multipliers[k] < 0.0 {
                    rows[self.active[k] as usize].active = false;
                    self.drop(k);
                }
            }
        }
        for row in self.active.drain(..) {
            rows[row as usize].active = false;
        }
        self.multipliers.clear();
    }

    /// Multipliers that make all gathered rows equalities.
    fn equalise(&mut self, rows: &[Row], desired: &[Numbers]) {
        let q = self.active.len();
        for k in 0..q {
            let row = &rows[self.active[k] as usize];
            let mut sum = row.bound - row.value(desired);
            let line = &self.factor[k * self.size..k * self.size + k + 1];
            for (l, w) in line[..k].iter().zip(&self.forward) {
                sum -= l * w;
            }
            self.forward[k] = sum / line[k];
        }
        self.backward(q);
        self.multipliers.copy_from_slice(&self.step[..q]);
    }

    /// `step = L^-T forward`.
    fn backward(&mut self, q: usize) {
        for k in (0..q).rev() {
            let mut sum = self.forward[k];
            for m in k + 1..q {
                sum -= self.factor[m * self.size + k] * self.step[m];
            }
            self.step[k] = sum / self.factor[k * self.size + k];
        }
    }

    /// `forward = L^-1 (gathered rows . row)`; the square of what of the row lies outside their span.
    fn reduce(&mut self, row: &Row, rows: &[Row]) -> f64 {
        let mut rest = row.inner(row);
        for k in 0..self.active.len() {
            let mut sum = rows[self.active[k] as usize].inner(row);
            let line = &self.factor[k * self.size..k * self.size + k + 1];
            for (l, w) in line[..k].iter().zip(&self.forward) {
                sum -= l * w;
            }
            let w = sum / line[k];
            self.forward[k] = w;
            rest -= w * w;
        }
        rest
    }

    fn append(&mut self, row: u32, rest: f64, multiplier: f64) {
        let q = self.active.len();
        let at = q * self.size;
        self.factor[at..at + q].copy_from_slice(&self.forward[..q]);
        self.factor[at + q] = rest.sqrt();
        self.active.push(row);
        self.multipliers.push(multiplier);
    }

    /// Forgets a gathered row; Givens rotations make the factor triangular again.
    fn drop(&mut self, k: usize) {
        self.active.remove(k);
        self.multipliers.remove(k);
        let (q, n) = (self.active.len(), self.size);
        for i in k..q {
            self.factor.copy_within((i + 1) * n..(i + 1) * n + i + 2, i * n);
        }
        for j in k..q {
            let (a, b) = (self.factor[j * n + j], self.factor[j * n + j + 1]);
            let size = (a * a + b * b).sqrt();
            let (c, s) = (a / size, b / size);
            for i in j..q {
                let (a, b) = (self.factor[i * n + j], self.factor[i * n + j + 1]);
                self.factor[i * n + j] = c * a + s * b;
                self.factor[i * n + j + 1] = c * b - s * a;
            }
        }
    }

    /// `x = d + sum u_k g_k`.
    fn place(&self, group: &Group, rows: &[Row], desired: &[Numbers], x: &mut [Numbers]) {
        for robot in group.robots {
            x[*robot as usize] = desired[*robot as usize];
        }
        for (row, u) in self.active.iter().zip(&self.multipliers) {
            advance(&rows[*row as usize], *u, x);
        }
    }

    /// Makes one violated row an equality, giving up rows whose multiplier would turn negative.
    fn take(&mut self, at: u32, row: &Row, rows: &mut [Row], x: &mut [Numbers], most_steps: u32) -> Outcome {
        let mut multiplier = 0.0;
        loop {
            self.steps += 1;
            if self.steps > most_steps {
                return Outcome::NotConverged;
            }
            let rest = self.reduce(row, rows);
            let q = self.active.len();
            self.backward(q);
            let mut blocking = None;
            let mut length = f64::INFINITY;
            for k in 0..q {
                if self.step[k] > 1e-14 && self.multipliers[k] < length * self.step[k] {
                    length = self.multipliers[k] / self.step[k];
                    blocking = Some(k);
                }
            }
            let outside = rest > DEPENDENT && q + 1 < self.size;
            let full = if outside {
                (row.bound - row.value(x)) / rest
            } else {
                f64::INFINITY
            };
            if full == f64::INFINITY && blocking.is_none() {
                self.clash.clear();
                self.clash.push(at);
                for k in 0..q {
                    if self.step[k] < -1e-9 {
                        self.clash.push(self.active[k]);
                    }
                }
                return Outcome::Infeasible;
            }
            let length = length.min(full).max(0.0);
            for (u, r) in self.multipliers.iter_mut().zip(&self.step) {
                *u = (*u - length * r).max(0.0);
            }
            multiplier += length;
            if outside {
                advance(row, length, x);
                for k in 0..q {
                    advance(&rows[self.active[k] as usize], -length * self.step[k], x);
                }
            }
            match blocking {
                Some(k) if length < full => {
                    rows[self.active[k] as usize].active = false;
                    self.drop(k);
                }
                _ => {
                    rows[at as usize].active = true;
                    self.append(at, rest, multiplier);
                    return Outcome::Solved;
                }
            }
        }
    }
}

fn most_violated(group: &Group, rows: &[Row], x: &[Numbers]) -> Option<u32> {
    let (at, left) = worst(group, rows, x, true)?;
    (left < -KEPT_M_PER_S).then_some(at)
}

/// The row that is violated most, and by how much (negative); while gathering, those already gathered are left out.
fn worst(group: &Group, rows: &[Row], x: &[Numbers], gathering: bool) -> Option<(u32, f64)> {
    let mut worst = None;
    let mut least = 0.0;
    let mut look = |at: u32| {
        let row = &rows[at as usize];
        let left = row.value(x) - row.bound;
        if left < least && !(gathering && row.active) {
            least = left;
            worst = Some((at, left));
        }
    };
    group.shared.iter().copied().for_each(&mut look);
    for robot in group.robots {
        let i = *robot as usize;
        let (drive, turn) = if group.planar[i] {
            (x[i][0] * x[i][0] + x[i][1] * x[i][1], x[i][2])
        } else {
            (x[i][0] * x[i][0], x[i][1])
        };
        let [easy_drive, easy_turn] = group.easy[i];
        if drive > easy_drive * easy_drive || turn.abs() > easy_turn {
            let [first, count] = group.own[i];
            (first..first + count).for_each(&mut look);
        }
    }
    worst
}

fn advance(row: &Row, factor: f64, x: &mut [Numbers]) {
    for (robot, gradient) in row.robots.iter().zip(&row.gradient) {
        if *robot != NOBODY {
            for (x, g) in x[*robot as usize].iter_mut().zip(gradient) {
                *x += factor * g;
            }
        }
    }
}

/// Half the squared distance from the desired numbers: what is minimised.
#[cfg(test)]
pub fn cost(x: &[Numbers], desired: &[Numbers]) -> f64 {
    x.iter().zip(desired).fold(0.0, |sum, (x, d)| {
        let change = [x[0] - d[0], x[1] - d[1], x[2] - d[2]];
        sum + 0.5 * super::rows::inner(&change, &change)
    })
}
