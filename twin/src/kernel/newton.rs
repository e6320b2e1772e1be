//! One part of a step by Newton's method, for where the linearly implicit one errs: a wheel between slip and grip.
//!
//! The two-stage, second-order, L-stable and algebraically stable SDIRK method with gamma = 1 - 1/sqrt 2: a dissipative
//! system can never gain energy from its step size. Each stage is a Newton iteration; wheel speeds are eliminated wheel
//! by wheel, which leaves 3 x 3. Where a slip jumps, the secant slope F / s replaces the tangent: that iteration
//! minimises a convex potential by quadratics that lie above it and cannot cycle.

use wide::f64x4;

use super::constants::Constants;
use super::shape::Speeds;
use super::step::Advance;
use crate::lanes::LANES as N;
use crate::math;
use crate::model::{Geometry, Model};
use crate::state::BodyState;
use crate::tyre::Tyre;
use crate::{COULOMB_SCALE_RAD_PER_S, MAX_WHEELS, SLIP_SCALE_M_PER_S};

/// 1 - 1/sqrt 2.
const GAMMA: f64 = 0.292_893_218_813_452_5;
/// Largest change of a slip in the last iteration, m/s; the error left is quadratic in it (below 1e-6 m/s).
const TOLERANCE_M_PER_S: f64 = 1e-4;
/// A slip that moved less than this many slip scales is followed by a Newton iteration, else by a secant one.
const NEWTON_RANGE: f64 = 0.5;
/// Bound on the iterations of one stage.
const MAX_ITERATIONS: u32 = 40;
/// Square of the smallest scaled slip, so that tanh(q)/q needs no case.
const TINY: f64 = 1e-30;

/// Body twist and wheel speeds of one stage.
#[derive(Clone, Copy)]
struct Stage {
    z: [f64; 3],
    wheel: [f64; N],
}

/// Inputs that stay the same during a step.
pub(super) struct Newton<'a> {
    model: &'a Model,
    geometry: Geometry,
    /// mu N_i / s0, N s/m.
    grip: [f64; N],
    /// V_i, held during the step.
    voltage: [f64; N],
    /// Forces on the body and torques on the wheels that do not change.
    body_force: [f64; 3],
    torque: [f64; N],
}

/// Forces of all contacts, N, and their slopes over the slip, N s/m.
struct Contacts {
    force_l: [f64; N],
    force_t: [f64; N],
    d_ll: [f64; N],
    d_lt: [f64; N],
    d_tt: [f64; N],
}

/// Sums over the wheels in one iteration: the 3 x 3 matrix and its right-hand side, without the body's own terms.
#[derive(Default)]
struct Sums {
    s00: f64,
    s01: f64,
    s02: f64,
    s11: f64,
    s12: f64,
    s22: f64,
    force: [f64; 3],
    reduced: [f64; 3],
}

impl<'a> Newton<'a> {
    /// With the loads at the acceleration of the part before.
    pub(super) fn new(model: &'a Model, state: &BodyState, c: &Constants) -> Newton<'a> {
        let loads = model.load.loads_n(state.accel_x, state.accel_y);
        let mut newton = Newton {
            model,
            geometry: Geometry {
                cos: by_wheel(c.lines.along[0]),
                sin: by_wheel(c.lines.along[1]),
                arm_along_m: by_wheel(c.lines.along[2]),
                arm_across_m: by_wheel(c.lines.across[2]),
            },
            grip: [0.0; N],
            voltage: [0.0; N],
            body_force: c.body_force,
            torque: c.torque_n_m.to_array(),
        };
        for (i, load) in loads.iter().take(N).enumerate() {
            newton.grip[i] = model.friction[i] / SLIP_SCALE_M_PER_S * load;
            newton.voltage[i] = state.voltage[i];
        }
        newton
    }

    /// Advances the speeds by `part_s`.
    #[cold]
    #[inline(never)]
    pub(super) fn advance(&self, start: &Speeds, part_s: f64) -> Advance {
        let k = GAMMA * part_s;
        let now = Stage {
            z: start.twist,
            wheel: start.wheel.to_array(),
        };
        let first = self.solve(&now, now, k);
        // Stage 2 starts from y0 + (1 - gamma) h f(y1) with f(y1) = (y1 - y0) / (gamma h).
        let base = extrapolated(&now, &first, (1.0 - GAMMA) / GAMMA);
        let guess = extrapolated(&now, &first, 1.0 / GAMMA);
        let second = self.solve(&base, guess, k);
        let mean = |a: f64, b: f64| (1.0 - GAMMA) * a + GAMMA * b;
        let rate = |j: usize| (second.z[j] - now.z[j]) / part_s;
        let twist = [0, 1, 2].map(|j| mean(first.z[j], second.z[j]));
        let g = self.model.gravity_m_per_s2;
        let wheel = [0, 1, 2, 3].map(|i| mean(first.wheel[i], second.wheel[i]));
        Advance {
            end: Speeds {
                twist: second.z,
                wheel: f64x4::new(second.wheel),
            },
            mean: Speeds {
                twist,
                wheel: f64x4::new(wheel),
            },
            accel: [
                rate(0) - twist[2] * twist[1] - g[0],
                rate(1) + twist[2] * twist[0] - g[1],
            ],
        }
    }

    /// Solves y = base + k f(y) from a first guess.
    fn solve(&self, base: &Stage, guess: Stage, k: f64) -> Stage {
        let mut y = guess;
        for i in 0..N {
            // Wheels without a motor model keep the commanded speed exactly.
            if self.model.free[i] == 0.0 {
                y.wheel[i] = base.wheel[i];
            }
        }
        let scale_m_per_s = self
            .model
            .tyre
            .map_or(SLIP_SCALE_M_PER_S, |tyre| tyre.tread.slip_scale_m_per_s);
        let near_m_per_s = NEWTON_RANGE * scale_m_per_s;
        let mut moved = [0.0_f64; N];
        for _ in 0..MAX_ITERATIONS {
            let tangent = moved.map(|slip| if slip < near_m_per_s { 1.0 } else { 0.0 });
            if self.iterate(base, &mut y, k, &tangent, &mut moved) < TOLERANCE_M_PER_S {
                break;
            }
        }
        y
    }

    /// One Newton (tangent 1) or secant (tangent 0) iteration; returns the largest change of a slip, m/s.
    ///
    /// Short passes over all wheels, so that the compiler takes several wheels at once.
    fn iterate(&self, base: &Stage, y: &mut Stage, k: f64, tangent: &[f64; N], moved: &mut [f64; N]) -> f64 {
        let (m, g) = (self.model, &self.geometry);
        let contact = match &m.tyre {
            None => self.contact(y, tangent),
            Some(tyre) => self.tyre_contact(tyre, y, tangent),
        };
        let (torque, torque_slope) = self.drive(&y.wheel);
        let (mut gain, mut residual, mut alpha, mut beta, mut delta, mut shift) =
            ([0.0; N], [0.0; N], [0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            let (radius, inertia) = (m.radius_m[i], m.spin_inertia_kg_m2[i]);
            residual[i] = inertia * (y.wheel[i] - base.wheel[i]) - k * (torque[i] - radius * contact.force_l[i]);
            let reach = k * radius * radius;
            gain[i] = m.free[i] / (inertia + k * torque_slope[i] + reach * contact.d_ll[i]);
            let kept = 1.0 - reach * gain[i] * contact.d_ll[i];
            alpha[i] = contact.d_ll[i] * kept;
            beta[i] = contact.d_lt[i] * kept;
            delta[i] = contact.d_tt[i] - reach * gain[i] * contact.d_lt[i] * contact.d_lt[i];
            shift[i] = radius * gain[i] * residual[i];
        }
        let mut sums = Sums {
            force: self.body_force,
            ..Sums::default()
        };
        for i in 0..N {
            let a = [g.cos[i], g.sin[i], g.arm_along_m[i]];
            let b = [-g.sin[i], g.cos[i], g.arm_across_m[i]];
            // S += alpha A A' + beta (A B' + B A') + delta B B'
            let (mut along, mut across) = ([0.0; 3], [0.0; 3]);
            for j in 0..3 {
                along[j] = alpha[i] * a[j] + beta[i] * b[j];
                across[j] = beta[i] * a[j] + delta[i] * b[j];
                sums.force[j] += contact.force_l[i] * a[j] + contact.force_t[i] * b[j];
                sums.reduced[j] += shift[i] * (contact.d_ll[i] * a[j] + contact.d_lt[i] * b[j]);
            }
            sums.s00 += along[0] * a[0] + across[0] * b[0];
            sums.s01 += along[0] * a[1] + across[0] * b[1];
            sums.s02 += along[0] * a[2] + across[0] * b[2];
            sums.s11 += along[1] * a[1] + across[1] * b[1];
            sums.s12 += along[1] * a[2] + across[1] * b[2];
            sums.s22 += along[2] * a[2] + across[2] * b[2];
        }
        let [du, dv, dr] = self.body_change(base, y, k, &sums);
        for i in 0..N {
            let along = g.cos[i] * du + g.sin[i] * dv + g.arm_along_m[i] * dr;
            let across = g.cos[i] * dv - g.sin[i] * du + g.arm_across_m[i] * dr;
            let pull = k * m.radius_m[i] * (contact.d_ll[i] * along + contact.d_lt[i] * across);
            let change = gain[i] * (pull - residual[i]);
            y.wheel[i] += change;
            moved[i] = (m.radius_m[i] * change - along).abs() + m.lateral[i] * across.abs();
        }
        y.z = [y.z[0] + du, y.z[1] + dv, y.z[2] + dr];
        moved
            .iter()
            .fold(0.0_f64, |largest, slip| if *slip > largest { *slip } else { largest })
    }

    /// Contact forces and their slopes over the slip.
    fn contact(&self, y: &Stage, tangent: &[f64; N]) -> Contacts {
        let (m, g) = (self.model, &self.geometry);
        let [u, v, r] = y.z;
        let (mut ql, mut qt, mut q2, mut t) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        const PER_SCALE: f64 = 1.0 / SLIP_SCALE_M_PER_S;
        for i in 0..N {
            ql[i] = PER_SCALE * (m.radius_m[i] * y.wheel[i] - (g.cos[i] * u + g.sin[i] * v + g.arm_along_m[i] * r));
            qt[i] = -PER_SCALE * m.lateral[i] * (g.cos[i] * v - g.sin[i] * u + g.arm_across_m[i] * r);
            q2[i] = ql[i] * ql[i] + qt[i] * qt[i] + TINY;
        }
        let q = q2.map(f64::sqrt);
        for i in 0..N {
            t[i] = math::tanh(q[i]);
        }
        let mut out = Contacts {
            force_l: [0.0; N],
            force_t: [0.0; N],
            d_ll: [0.0; N],
            d_lt: [0.0; N],
            d_tt: [0.0; N],
        };
        for i in 0..N {
            let secant = t[i] / q[i];
            let bend = tangent[i] * ((1.0 - t[i] * t[i]) - secant) / q2[i];
            let grip = self.grip[i];
            out.force_l[i] = SLIP_SCALE_M_PER_S * grip * secant * ql[i];
            out.force_t[i] = SLIP_SCALE_M_PER_S * grip * secant * qt[i];
            out.d_ll[i] = grip * (secant + bend * ql[i] * ql[i]);
            out.d_lt[i] = grip * bend * ql[i] * qt[i];
            out.d_tt[i] = m.lateral[i] * grip * (secant + bend * qt[i] * qt[i]);
        }
        out
    }

    /// The same with a tyre of its own in each direction.
    #[inline(never)]
    fn tyre_contact(&self, tyre: &Tyre, y: &Stage, tangent: &[f64; N]) -> Contacts {
        let (m, g) = (self.model, &self.geometry);
        let [u, v, r] = y.z;
        let (mut along, mut across, mut rolling) = ([0.0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            let rim = m.radius_m[i] * y.wheel[i];
            along[i] = rim - (g.cos[i] * u + g.sin[i] * v + g.arm_along_m[i] * r);
            across[i] = -m.lateral[i] * (g.cos[i] * v - g.sin[i] * u + g.arm_across_m[i] * r);
            rolling[i] = rim.abs();
        }
        let friction = m.fixed.friction * m.fixed.per_nominal_friction;
        let grip = tyre.grip(f64x4::new(along), f64x4::new(across), f64x4::new(rolling), friction);
        let limit_n = f64x4::splat(SLIP_SCALE_M_PER_S) * f64x4::new(self.grip);
        let mut out = Contacts {
            force_l: (limit_n * grip.along).to_array(),
            force_t: (limit_n * grip.across).to_array(),
            d_ll: (limit_n * grip.d_ll).to_array(),
            d_lt: (limit_n * grip.d_lt).to_array(),
            d_tt: (limit_n * grip.d_tt).to_array(),
        };
        for i in 0..N {
            if tangent[i] == 0.0 {
                let secant = |force: f64, slip: f64, slope: f64| if slip == 0.0 { slope } else { force / slip };
                out.d_ll[i] = secant(out.force_l[i], along[i], out.d_ll[i]);
                out.d_tt[i] = secant(out.force_t[i], across[i], out.d_tt[i]);
                out.d_lt[i] = 0.0;
            }
            out.d_lt[i] *= m.lateral[i];
            out.d_tt[i] *= m.lateral[i];
        }
        out
    }

    /// Torques on the wheels but for the contact, N m, and minus their slopes over the wheel speed, N m s.
    fn drive(&self, wheel: &[f64; N]) -> ([f64; N], [f64; N]) {
        let m = self.model;
        let (mut torque, mut slope, mut t) = ([0.0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            t[i] = math::tanh(wheel[i] * (1.0 / COULOMB_SCALE_RAD_PER_S));
        }
        for i in 0..N {
            torque[i] = self.torque[i] - m.viscous_n_m_s[i] * wheel[i] - m.coulomb_n_m[i] * t[i];
            slope[i] = m.viscous_n_m_s[i] + m.coulomb_n_m[i] * (1.0 - t[i] * t[i]) * (1.0 / COULOMB_SCALE_RAD_PER_S);
        }
        if let Some(motor) = &m.motor {
            for i in 0..N {
                let per_current = m.torque_per_current[i];
                let current = m.current_a(motor, i, self.voltage[i], wheel[i]);
                let inside = if current.abs() < motor.current_limit_a {
                    m.powered[i]
                } else {
                    0.0
                };
                torque[i] += m.powered[i] * per_current * current;
                slope[i] += inside * (per_current * per_current * m.per_ohm[i]);
            }
        }
        (torque, slope)
    }

    /// Solves the 3 x 3 system for the change of the body twist.
    fn body_change(&self, base: &Stage, y: &Stage, k: f64, sums: &Sums) -> [f64; 3] {
        let (mass, inertia) = (self.model.mass_kg, self.model.yaw_inertia_kg_m2);
        let [u, v, r] = y.z;
        let km = k * mass;
        let right = [
            -(mass * (u - base.z[0]) - k * sums.force[0] - km * r * v) - k * sums.reduced[0],
            -(mass * (v - base.z[1]) - k * sums.force[1] + km * r * u) - k * sums.reduced[1],
            -(inertia * (r - base.z[2]) - k * sums.force[2]) - k * sums.reduced[2],
        ];
        let a00 = mass + k * sums.s00;
        let a01 = k * sums.s01 - km * r;
        let a02 = k * sums.s02 - km * v;
        let a10 = k * sums.s01 + km * r;
        let a11 = mass + k * sums.s11;
        let a12 = k * sums.s12 + km * u;
        let (a20, a21, a22) = (k * sums.s02, k * sums.s12, inertia + k * sums.s22);
        let c00 = a11 * a22 - a12 * a21;
        let c01 = a12 * a20 - a10 * a22;
        let c02 = a10 * a21 - a11 * a20;
        let per_determinant = 1.0 / (a00 * c00 + a01 * c01 + a02 * c02);
        [
            per_determinant
                * (right[0] * c00 + right[1] * (a02 * a21 - a01 * a22) + right[2] * (a01 * a12 - a02 * a11)),
            per_determinant
                * (right[0] * c01 + right[1] * (a00 * a22 - a02 * a20) + right[2] * (a02 * a10 - a00 * a12)),
            per_determinant
                * (right[0] * c02 + right[1] * (a01 * a20 - a00 * a21) + right[2] * (a00 * a11 - a01 * a10)),
        ]
    }
}

fn extrapolated(start: &Stage, first: &Stage, factor: f64) -> Stage {
    let mut out = *start;
    for j in 0..3 {
        out.z[j] += factor * (first.z[j] - start.z[j]);
    }
    for i in 0..N {
        out.wheel[i] += factor * (first.wheel[i] - start.wheel[i]);
    }
    out
}

fn by_wheel(lanes: f64x4) -> [f64; MAX_WHEELS] {
    let mut wheels = [0.0; MAX_WHEELS];
    wheels[..N].copy_from_slice(&lanes.to_array());
    wheels
}
