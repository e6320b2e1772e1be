//! A pushable obstacle on the floor: dry friction under its whole area.
//!
//! ```text
//! m dV/dt = -mu m g V/n + m g tilt,   k^2 dr/dt = -mu g c^2 r/n,   n = sqrt(|V|^2 + (c r)^2)
//! ```
//!
//! `k` is the radius of gyration and `c` the mean distance of the area from the centre: the law is exact for sliding
//! and for turning in place under even pressure, and an ellipsoid between them. At rest it holds every push inside the
//! ellipsoid |F|^2 + (M/c)^2 <= (mu m g)^2.

use super::contents::PushableObstacle;
use super::shape::{Placed, Shape};
use crate::pose::{Pose, wrapped_rad};
use crate::twist::BodyTwist;
use crate::{GRAVITY_M_PER_S2, PHYSICS_PERIOD_S};

/// Most Newton steps for the speed at the end; a handful is enough, see [`Obstacle::slowed`].
const MAX_ITERATIONS: u32 = 40;
/// Numbers in [`ObstacleBody::words`].
pub(crate) const OBSTACLE_WORDS: usize = 6;

/// What can be seen of a pushable obstacle after a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObstacleState {
    /// Of its centre.
    pub pose: Pose,
    /// In its own axes.
    pub twist: BodyTwist,
}

/// Constants of one pushable obstacle.
#[derive(Debug, Clone)]
pub(crate) struct Obstacle {
    pub(crate) shape: Shape,
    pub(crate) mass_kg: f64,
    pub(crate) inertia_kg_m2: f64,
    pub(crate) radius_m: f64,
    /// mu g.
    friction_m_per_s2: f64,
    /// c.
    lever_m: f64,
    /// c^2/k^2.
    turning: f64,
    /// g times tilt along the world's x and y.
    pull_m_per_s2: [f64; 2],
}

/// State of one pushable obstacle; velocities in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ObstacleBody {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) yaw_rad: f64,
    /// `[x m/s, y m/s, yaw rad/s]`.
    pub(crate) velocity: [f64; 3],
}

impl Obstacle {
    pub(crate) fn new(described: &PushableObstacle, tilt_rad: [f64; 2]) -> Obstacle {
        let shape = described.shape;
        let lever_m = shape.mean_radius_m();
        Obstacle {
            shape,
            mass_kg: described.mass_kg,
            inertia_kg_m2: described.mass_kg * shape.gyration_m2(),
            radius_m: shape.bounding_radius_m(),
            friction_m_per_s2: described.floor_friction * GRAVITY_M_PER_S2,
            lever_m,
            turning: lever_m * lever_m / shape.gyration_m2(),
            pull_m_per_s2: tilt_rad.map(|tilt| GRAVITY_M_PER_S2 * tilt),
        }
    }

    /// Velocity after one physics step of tilt without friction.
    pub(crate) fn pulled(&self, velocity: [f64; 3]) -> [f64; 3] {
        [
            velocity[0] + PHYSICS_PERIOD_S * self.pull_m_per_s2[0],
            velocity[1] + PHYSICS_PERIOD_S * self.pull_m_per_s2[1],
            velocity[2],
        ]
    }

    /// Velocity after one physics step of friction; exactly zero when the friction can stop it in this step.
    ///
    /// Implicit: V1 = V0 - a V1/n, r1 = r0 - b r1/n with a = mu g h, b = a c^2/k^2, so that
    /// |V0|^2/(n + a)^2 + (c r0)^2/(n + b)^2 = 1, which falls and is convex in n: Newton from below is monotonic.
    pub(crate) fn slowed(&self, velocity: [f64; 3]) -> [f64; 3] {
        let a = PHYSICS_PERIOD_S * self.friction_m_per_s2;
        let b = a * self.turning;
        let sliding2 = velocity[0] * velocity[0] + velocity[1] * velocity[1];
        let rim = self.lever_m * velocity[2];
        let turning2 = rim * rim;
        if sliding2 / (a * a) + turning2 / (b * b) <= 1.0 {
            return [0.0; 3];
        }
        let mut n = ((sliding2 + turning2).sqrt() - a.max(b)).max(0.0);
        for _ in 0..MAX_ITERATIONS {
            let (from_a, from_b) = (n + a, n + b);
            let (slide, turn) = (sliding2 / (from_a * from_a), turning2 / (from_b * from_b));
            let step = (slide + turn - 1.0) / (2.0 * (slide / from_a + turn / from_b));
            n += step;
            if step.abs() <= 1e-15 * from_a {
                break;
            }
        }
        let n = n.max(0.0);
        [
            velocity[0] * n / (n + a),
            velocity[1] * n / (n + a),
            velocity[2] * n / (n + b),
        ]
    }

    /// One physics step that touches nothing.
    pub(crate) fn coast(&self, body: &ObstacleBody) -> ObstacleBody {
        let next = self.slowed(self.pulled(body.velocity));
        let mean = |axis: usize| 0.5 * PHYSICS_PERIOD_S * (body.velocity[axis] + next[axis]);
        ObstacleBody {
            x_m: body.x_m + mean(0),
            y_m: body.y_m + mean(1),
            yaw_rad: body.yaw_rad + mean(2),
            velocity: next,
        }
    }

    /// True when it will be somewhere else after the next step even if nobody touches it.
    pub(crate) fn is_restless(&self, body: &ObstacleBody) -> bool {
        body.velocity != [0.0; 3] || self.slowed(self.pulled([0.0; 3])) != [0.0; 3]
    }

    /// Largest acceleration that tilt gives it, m/s^2.
    pub(crate) fn largest_pull_m_per_s2(&self) -> f64 {
        let [x, y] = self.pull_m_per_s2;
        (x * x + y * y).sqrt()
    }

    pub(crate) fn placed(&self, body: &ObstacleBody) -> Placed {
        Placed::new(self.shape, body.pose())
    }
}

impl ObstacleBody {
    pub(crate) fn at_rest(pose: Pose) -> ObstacleBody {
        ObstacleBody {
            x_m: pose.x_m,
            y_m: pose.y_m,
            yaw_rad: wrapped_rad(pose.yaw_rad),
            velocity: [0.0; 3],
        }
    }

    pub(crate) fn pose(&self) -> Pose {
        Pose {
            x_m: self.x_m,
            y_m: self.y_m,
            yaw_rad: wrapped_rad(self.yaw_rad),
        }
    }

    pub(crate) fn view(&self) -> ObstacleState {
        let (sin, cos) = libm::sincos(self.yaw_rad);
        let [x, y, yaw_rate_rad_per_s] = self.velocity;
        ObstacleState {
            pose: self.pose(),
            twist: BodyTwist {
                forward_m_per_s: x * cos + y * sin,
                left_m_per_s: y * cos - x * sin,
                yaw_rate_rad_per_s,
            },
        }
    }

    /// Everything that the next step depends on, in a fixed order.
    pub(crate) fn words(&self) -> [f64; OBSTACLE_WORDS] {
        let [vx, vy, r] = self.velocity;
        [self.x_m, self.y_m, self.yaw_rad, vx, vy, r]
    }

    pub(crate) fn from_words(words: &[f64]) -> Option<ObstacleBody> {
        let &[x_m, y_m, yaw_rad, vx, vy, r] = words else {
            return None;
        };
        words.iter().all(|word| word.is_finite()).then_some(ObstacleBody {
            x_m,
            y_m,
            yaw_rad,
            velocity: [vx, vy, r],
        })
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.words().iter().all(|word| word.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(tilt_rad: [f64; 2]) -> Obstacle {
        let described = PushableObstacle {
            name: "disc".to_owned(),
            shape: Shape::Circle { radius_m: 0.2 },
            pose: Pose::default(),
            mass_kg: 3.0,
            floor_friction: 0.3,
        };
        Obstacle::new(&described, tilt_rad)
    }

    #[test]
    fn a_spin_alone_ends_after_its_known_angle() {
        // k^2 dr/dt = -mu g c  =>  r0^2 k^2/(2 mu g c) with k^2 = R^2/2, c = 2R/3.
        let disc = disc([0.0; 2]);
        let mut body = ObstacleBody::at_rest(Pose::default());
        body.velocity[2] = 4.0;
        for _ in 0..480 {
            body = disc.coast(&body);
        }
        let expected = 16.0 * 0.02 / (2.0 * 0.3 * 9.81 * 0.4 / 3.0);
        assert_eq!(body.velocity, [0.0; 3]);
        assert!((body.yaw_rad - expected).abs() < 1e-4, "{} {expected}", body.yaw_rad);
    }

    #[test]
    fn the_end_of_a_step_meets_the_implicit_law() {
        let disc = disc([0.0; 2]);
        let (a, b) = (
            0.3 * 9.81 / 480.0,
            0.3 * 9.81 / 480.0 * (0.4 / 3.0) * (0.4 / 3.0) / 0.02,
        );
        for start in [
            [1.0, 0.2, 3.0],
            [0.01, 0.0, 0.2],
            [0.0, 5.0, -0.1],
            [0.0, 0.0, 0.9],
            [0.005, 0.005, 0.0],
        ] {
            let end = disc.slowed(start);
            let rim = 0.4 / 3.0 * end[2];
            let n = (end[0] * end[0] + end[1] * end[1] + rim * rim).sqrt();
            for (axis, part) in [(0, a), (1, a), (2, b)] {
                let residual = end[axis] * (1.0 + part / n) - start[axis];
                assert!(residual.abs() < 1e-13, "{start:?} -> {end:?}: {residual}");
            }
        }
        assert_eq!(disc.slowed([0.5 * a, 0.0, 0.0]), [0.0; 3]);
    }

    #[test]
    fn a_tilt_below_the_friction_holds_and_above_it_slides() {
        assert!(!disc([0.2, 0.0]).is_restless(&ObstacleBody::at_rest(Pose::default())));
        let sliding = Obstacle {
            friction_m_per_s2: 0.1 * GRAVITY_M_PER_S2,
            ..disc([0.0, 0.2])
        };
        let mut body = ObstacleBody::at_rest(Pose::default());
        assert!(sliding.is_restless(&body));
        for _ in 0..480 {
            body = sliding.coast(&body);
        }
        // g (tilt - mu) for one second.
        assert!(
            (body.velocity[1] - 0.981).abs() < 1e-9 && (body.y_m - 0.4905).abs() < 1e-9,
            "{body:?}"
        );
    }
}
