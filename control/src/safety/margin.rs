//! Gaps and how fast they may shrink.
//!
//! ```text
//! s = distance - radii - margin - pose errors - tracking error * T - what may have shrunk since the measurement
//! T = age of the pose + latency of the link and the robot
//! n . (v_a - v_b) >= -approach(s),   approach(s) = alpha s up to s = a / alpha^2, sqrt(2 a s - (a / alpha)^2) beyond
//! ```

use super::Limits;
use crate::vector::{Vector, dot, scale, sub};

/// An obstacle slower than this is not fled from: that much is noise of the measurement.
pub const FLED_M_PER_S: f64 = 0.1;

/// Where a robot is and what it may still do, as the filter sees it at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Last known position; `None` before the first finite pose.
    pub position: Option<Vector>,
    pub radius_m: f64,
    /// The filter chooses its command; otherwise it is an obstacle.
    pub movable: bool,
    /// Measured velocity in the world frame.
    pub velocity: Vector,
    /// Velocity of the last command in the world frame.
    pub commanded: Vector,
    /// Displacement that commands of the last `reaction_s` ask for: what the measurement does not show yet.
    pub pending_m: Vector,
    /// `T`: age of the pose and latency.
    pub reaction_s: f64,
    /// Direction of the body's x, as measured, and after the turns that are on their way.
    pub heading: Vector,
    pub later: Vector,
    /// The two headings differ by more than rounding.
    pub turns: bool,
}

impl Place {
    /// Something that neither moves nor is uncertain.
    pub const STILL: Place = Place {
        position: None,
        radius_m: 0.0,
        movable: false,
        velocity: [0.0, 0.0],
        commanded: [0.0, 0.0],
        pending_m: [0.0, 0.0],
        reaction_s: 0.0,
        heading: [1.0, 0.0],
        later: [1.0, 0.0],
        turns: false,
    };

    /// Fastest motion along `-n`, measured or commanded.
    fn towards(&self, n: Vector) -> f64 {
        (-dot(n, self.velocity)).max(-dot(n, self.commanded)).max(0.0)
    }

    /// A direction of the world in the body frame, now or later.
    pub fn body_from_world(&self, n: Vector, later: bool) -> Vector {
        let [c, s] = if later { self.later } else { self.heading };
        [c * n[0] + s * n[1], c * n[1] - s * n[0]]
    }

    /// A vector of the body frame in the world, when a command of now takes effect.
    pub fn world_from_body(&self, a: Vector) -> Vector {
        let [c, s] = self.later;
        [c * a[0] - s * a[1], s * a[0] + c * a[1]]
    }
}

/// Fastest approach that a gap allows.
///
/// `alpha s` alone would brake by `alpha^2 s`: up to where that is `a`; from there on along the parabola of `a` that goes on
/// with the same slope.
pub fn approach_m_per_s(gap_m: f64, limits: &Limits) -> f64 {
    let (alpha, a) = (limits.approach_gain_per_s, limits.braking_m_per_s2);
    if gap_m > a / (alpha * alpha) {
        (2.0 * a * gap_m - (a / alpha) * (a / alpha)).sqrt()
    } else if gap_m > 0.0 {
        alpha * gap_m
    } else {
        0.0
    }
}

/// Depth in the margin at which a robot may move no closer to the tangent than 45 degrees.
const STEEP_M: f64 = 0.02;

/// Directions that a velocity must not go against at a gap `s` along `n`: `n`, or inside the margin `n -+ beta t`.
///
/// In continuous time `n` would do. With delays, sliding along something drifts towards it by a little every time, and a
/// row that only forbids approach never gives that back. Inside the margin `beta = -s / STEEP_M`, at most 1: sliding on
/// takes moving away. Standing still remains allowed, so that nothing is pushed out of a start pose.
pub fn forbidden(gap_m: f64, n: Vector) -> ([Vector; 2], usize) {
    if gap_m >= 0.0 {
        return ([n, n], 1);
    }
    let beta = (-gap_m / STEEP_M).min(1.0);
    let size = (1.0 + beta * beta).sqrt();
    let lean = |beta: f64| [(n[0] - beta * n[1]) / size, (n[1] + beta * n[0]) / size];
    ([lean(beta), lean(-beta)], 2)
}

/// Gap from which the approach is `speed_m_per_s`: inverse of [`approach_m_per_s`].
pub fn reach_m(speed_m_per_s: f64, limits: &Limits) -> f64 {
    let (alpha, a) = (limits.approach_gain_per_s, limits.braking_m_per_s2);
    if alpha * speed_m_per_s > a {
        (speed_m_per_s * speed_m_per_s + (a / alpha) * (a / alpha)) / (2.0 * a)
    } else {
        speed_m_per_s / alpha
    }
}

/// How much of the distance along `n`, from `b` to `a`, may be gone or uncertain when a command of now takes effect.
pub fn lost_m(a: &Place, b: &Place, n: Vector, limits: &Limits) -> f64 {
    let measured = -dot(n, sub(scale(a.velocity, a.reaction_s), scale(b.velocity, b.reaction_s)));
    let commanded = -dot(n, sub(a.pending_m, b.pending_m));
    let held = a.towards(n) + b.towards(scale(n, -1.0));
    let tracking = limits.tracking_m_per_s * (a.reaction_s + b.reaction_s);
    measured.max(commanded).max(0.0) + limits.hold_s * held + tracking
}

/// Right side of the row of a robot against something that the filter does not steer and that comes at `coming_m_per_s`.
pub fn bound_against(approach: f64, coming_m_per_s: f64) -> f64 {
    let bound = coming_m_per_s.max(0.0) - approach;
    if coming_m_per_s > FLED_M_PER_S {
        bound
    } else {
        bound.min(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_the_inverse_of_approach() {
        let limits = Limits::default();
        for speed in [0.05, 0.3, 0.8, 1.6] {
            assert!((approach_m_per_s(reach_m(speed, &limits), &limits) - speed).abs() < 1e-12);
        }
        assert_eq!(approach_m_per_s(-0.1, &limits), 0.0);
        assert_eq!(approach_m_per_s(f64::NAN, &limits), 0.0);
    }

    #[test]
    fn no_approach_asks_for_more_braking_than_the_limit() {
        let limits = Limits::default();
        for k in 1..200 {
            let gap_m = 0.01 * f64::from(k);
            let rise = approach_m_per_s(gap_m + 1e-6, &limits) - approach_m_per_s(gap_m - 1e-6, &limits);
            let braking_m_per_s2 = approach_m_per_s(gap_m, &limits) * rise / 2e-6;
            assert!(
                braking_m_per_s2 < limits.braking_m_per_s2 * 1.0001,
                "{gap_m} m: {braking_m_per_s2}"
            );
        }
    }

    #[test]
    fn what_is_lost_in_a_head_on_approach() {
        let limits = Limits {
            hold_s: 0.05,
            tracking_m_per_s: 0.1,
            ..Limits::default()
        };
        let coming = |velocity: Vector, reaction_s: f64| Place {
            velocity,
            commanded: velocity,
            pending_m: scale(velocity, reaction_s),
            reaction_s,
            ..Place::STILL
        };
        // 0.5 m/s each way for 0.1 s, 0.05 s held, 0.1 m/s of tracking error for 0.2 s.
        let lost = lost_m(&coming([-0.5, 0.0], 0.1), &coming([0.5, 0.0], 0.1), [1.0, 0.0], &limits);
        assert!((lost - (0.1 + 0.05 + 0.02)).abs() < 1e-15);
        // One follows the other at the same speed: nothing closes, but the leader's flight may end while frames are lost.
        let lost = lost_m(
            &coming([-0.5, 0.0], 0.1),
            &coming([-0.5, 0.0], 0.1),
            [1.0, 0.0],
            &limits,
        );
        assert!((lost - (0.025 + 0.02)).abs() < 1e-15);
    }

    #[test]
    fn only_a_fast_obstacle_is_fled_from() {
        assert_eq!(bound_against(0.0, 0.09), 0.0);
        assert_eq!(bound_against(0.3, 0.09), 0.09 - 0.3);
        assert_eq!(bound_against(0.1, 0.4), 0.4 - 0.1);
        assert_eq!(bound_against(0.1, -0.4), -0.1);
    }
}
