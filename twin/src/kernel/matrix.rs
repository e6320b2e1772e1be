//! The matrix of a linearly implicit step.

use wide::f64x4;

use super::constants::Constants;
use super::shape::Shape;
use super::step::{Drive, GAMMA};
use crate::lanes::{Real, each, sum};

/// M - gamma h J at some state, with the wheels eliminated, and what else the step keeps of that state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matrix {
    /// Row i, column j: what the right-hand side i weighs in the derivative j, once divided by the determinant.
    inverse: [[f64; 3]; 3],
    gain: f64x4,
    /// Torque on the wheel over the body's derivative, N m s^2.
    pull: [f64x4; 3],
    /// Force on the body over the torque on the wheel.
    pub(super) push: [f64x4; 3],
    /// Force on the body per load.
    pub(super) per_load: [f64x4; 3],
    /// The same at each contact, along and across.
    pub(super) grip: [f64x4; 2],
    /// Slopes of the forces over the slips, N s/m.
    pub(super) slope: [f64x4; 3],
    pub(super) torque_slope: f64x4,
}

impl Matrix {
    pub(super) const ZERO: Matrix = Matrix {
        inverse: [[0.0; 3]; 3],
        gain: f64x4::ZERO,
        pull: [f64x4::ZERO; 3],
        push: [f64x4::ZERO; 3],
        per_load: [f64x4::ZERO; 3],
        grip: [f64x4::ZERO; 2],
        slope: [f64x4::ZERO; 3],
        torque_slope: f64x4::ZERO,
    };

    /// At a twist, with these loads, N.
    #[inline(always)]
    pub(super) fn new<const SIDE: bool>(
        c: &Constants,
        twist: [f64; 3],
        shape: &Shape,
        drive: &Drive,
        load_n: f64x4,
        period_s: f64,
    ) -> Matrix {
        let kappa = GAMMA * period_s;
        let [u, v, r] = twist;
        let k = f64x4::splat(kappa);
        let stiffness = c.friction * load_n.greater(f64x4::ZERO);
        let slope = [stiffness * shape.d_ll, stiffness * shape.d_lt, stiffness * shape.d_tt];
        let s = each(|j| k * slope[j]);
        let torque_slope = drive.slope(c);
        let gain = c.free / ((c.spin_inertia_kg_m2 + k * torque_slope) + c.radius2_m2 * s[0]);
        let grip = [c.friction * shape.along, c.friction * shape.across];
        let both = |l: f64x4, t: f64x4, j: usize| {
            if SIDE {
                l * c.lines.along[j] + t * c.lines.across[j]
            } else {
                l * c.lines.along[j]
            }
        };
        let a = each(|j| both(s[0], s[1], j));
        let pull = each(|j| c.radius_m * a[j]);
        let push = each(|j| gain * pull[j]);
        let per_load = each(|j| both(grip[0], grip[1], j));
        let retarding = c.radius_m * grip[0];
        let b = each(|j| both(s[1], s[2], j));
        let symmetric = |i: usize, j: usize| {
            let along = c.lines.along[i] * a[j] - push[i] * pull[j];
            sum(if SIDE { along + c.lines.across[i] * b[j] } else { along })
        };
        let coupling = each(|j| push[j] * retarding - per_load[j]);
        // Load per body derivative: n . (k + gamma h d(-r v, r u)/dy k).
        let (x, y) = (c.loads.per_x, c.loads.per_y);
        let (kr, ku, kv) = (
            f64x4::splat(kappa * r),
            f64x4::splat(kappa * u),
            f64x4::splat(kappa * v),
        );
        let load = [x + kr * y, y - kr * x, ku * y - kv * x];
        let coupled = |i: usize, j: usize| sum(coupling[i] * load[j]);
        let (s01, s02, s12) = (symmetric(0, 1), symmetric(0, 2), symmetric(1, 2));
        let (m, km) = (c.mass_kg, kappa * c.mass_kg);
        let full = [
            [
                m + (symmetric(0, 0) + coupled(0, 0)),
                s01 + (coupled(0, 1) - km * r),
                s02 + (coupled(0, 2) - km * v),
            ],
            [
                s01 + (coupled(1, 0) + km * r),
                m + (symmetric(1, 1) + coupled(1, 1)),
                s12 + (coupled(1, 2) + km * u),
            ],
            [
                s02 + coupled(2, 0),
                s12 + coupled(2, 1),
                c.yaw_inertia_kg_m2 + (symmetric(2, 2) + coupled(2, 2)),
            ],
        ];
        Matrix {
            inverse: inverse(&full),
            gain,
            pull: each(|j| pull[j] - retarding * load[j]),
            push,
            per_load,
            grip,
            slope,
            torque_slope,
        }
    }

    /// The body's derivative from its right-hand side, the wheels' share included.
    #[inline(always)]
    pub(super) fn body(&self, right: [f64; 3]) -> [f64; 3] {
        let m = &self.inverse;
        each(|j| (right[0] * m[0][j] + right[1] * m[1][j]) + right[2] * m[2][j])
    }

    /// The wheels' derivatives from their torques and the body's derivative.
    #[inline(always)]
    pub(super) fn wheels(&self, torque: f64x4, body: [f64; 3]) -> f64x4 {
        let [x, y, z] = each(|j| f64x4::splat(body[j]));
        self.gain * ((torque + self.pull[0] * x) + (self.pull[1] * y + self.pull[2] * z))
    }
}

#[inline(always)]
fn inverse(a: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, s: usize, j: usize, k: usize| a[r][j] * a[s][k] - a[r][k] * a[s][j];
    let cofactor = [
        [minor(1, 2, 1, 2), minor(1, 2, 2, 0), minor(1, 2, 0, 1)],
        [minor(2, 0, 1, 2), minor(2, 0, 2, 0), minor(2, 0, 0, 1)],
        [minor(0, 1, 1, 2), minor(0, 1, 2, 0), minor(0, 1, 0, 1)],
    ];
    let determinant = (a[0][0] * cofactor[0][0] + a[0][1] * cofactor[0][1]) + a[0][2] * cofactor[0][2];
    let per_determinant = 1.0 / determinant;
    each(|i| each(|j| per_determinant * cofactor[i][j]))
}
