//! Range sensors of every robot: eight beams from the body origin, 45 degrees apart, the first one straight ahead.
//!
//! They are computed from the poses that the robots are seen at and from the arena's map: walls, fixed obstacles and other
//! robots as circles. So a program reads the same in the twin and on the floor, and what is on no map is not measured.

use control::law::Body;
use twin::world::{Contents, Shape};

use crate::view::Seen;

/// Beams of a robot.
pub const BEAMS: usize = 8;
/// Furthest that a beam measures; it reads this when nothing is nearer.
pub const FURTHEST_M: f64 = 2.0;

/// Map of what does not move.
#[derive(Debug, Clone, Default)]
pub struct Surroundings {
    half_m: [f64; 2],
    circles: Vec<([f64; 2], f64)>,
    /// Sides as `[from, to]`.
    sides: Vec<[[f64; 2]; 2]>,
}

impl Surroundings {
    /// Of an arena `[width, height]` around the origin.
    pub fn new(arena_m: [f64; 2], contents: &Contents) -> Surroundings {
        let mut map = Surroundings {
            half_m: [arena_m[0] / 2.0, arena_m[1] / 2.0],
            ..Surroundings::default()
        };
        for obstacle in &contents.fixed {
            let centre = [obstacle.pose.x_m, obstacle.pose.y_m];
            match obstacle.shape {
                Shape::Circle { radius_m } => map.circles.push((centre, radius_m)),
                Shape::Rectangle { length_m, width_m } => {
                    let (sin, cos) = libm::sincos(obstacle.pose.yaw_rad);
                    let corner = |x: f64, y: f64| [centre[0] + x * cos - y * sin, centre[1] + x * sin + y * cos];
                    let (a, b) = (length_m / 2.0, width_m / 2.0);
                    let corners = [corner(a, b), corner(-a, b), corner(-a, -b), corner(a, -b)];
                    for k in 0..4 {
                        map.sides.push([corners[k], corners[(k + 1) % 4]]);
                    }
                }
            }
        }
        map
    }

    /// Fills in the ranges of all robots, m from their origins; [`FURTHEST_M`] where the pose is not known.
    pub fn measure(&self, bodies: &[Body], robots: &mut [Seen]) {
        for i in 0..robots.len() {
            let own = robots[i];
            let mut ranges_m = [FURTHEST_M; BEAMS];
            if own.x_m.is_finite() && own.y_m.is_finite() && own.yaw_rad.is_finite() {
                let from = [own.x_m, own.y_m];
                let (sin, cos) = libm::sincos(own.yaw_rad);
                for (beam, range_m) in ranges_m.iter_mut().enumerate() {
                    *range_m = self.still(from, turned([cos, sin], beam));
                }
                for (j, other) in robots.iter().enumerate().filter(|(j, _)| *j != i) {
                    let radius_m = bodies.get(j).map_or(0.0, |body| body.bounding_radius_m);
                    let to = [other.x_m - from[0], other.y_m - from[1]];
                    let reach_m = FURTHEST_M + radius_m;
                    // False also of what is not a number.
                    if to[0] * to[0] + to[1] * to[1] < reach_m * reach_m {
                        for (beam, range_m) in ranges_m.iter_mut().enumerate() {
                            *range_m = range_m.min(to_circle(to, radius_m, turned([cos, sin], beam)));
                        }
                    }
                }
            }
            robots[i].ranges_m = ranges_m;
        }
    }

    fn still(&self, from: [f64; 2], direction: [f64; 2]) -> f64 {
        let mut range_m = FURTHEST_M;
        for axis in 0..2 {
            let side_m = self.half_m[axis].copysign(direction[axis]);
            if direction[axis] != 0.0 {
                range_m = range_m.min(((side_m - from[axis]) / direction[axis]).max(0.0));
            }
        }
        for (centre, radius_m) in &self.circles {
            let to = [centre[0] - from[0], centre[1] - from[1]];
            range_m = range_m.min(to_circle(to, *radius_m, direction));
        }
        for side in &self.sides {
            range_m = range_m.min(to_side(from, direction, side));
        }
        range_m
    }
}

/// The beam's direction: the forward axis turned by eighths of a turn.
fn turned([c, s]: [f64; 2], beam: usize) -> [f64; 2] {
    let h = core::f64::consts::FRAC_1_SQRT_2;
    match beam % BEAMS {
        0 => [c, s],
        1 => [h * (c - s), h * (c + s)],
        2 => [-s, c],
        3 => [-h * (c + s), h * (c - s)],
        4 => [-c, -s],
        5 => [h * (s - c), -h * (c + s)],
        6 => [s, -c],
        _ => [h * (c + s), h * (s - c)],
    }
}

/// Distance along a beam to a circle whose centre is `to` away; 0 inside, [`FURTHEST_M`] when it is missed.
fn to_circle(to: [f64; 2], radius_m: f64, direction: [f64; 2]) -> f64 {
    let along = to[0] * direction[0] + to[1] * direction[1];
    let beyond = to[0] * to[0] + to[1] * to[1] - radius_m * radius_m;
    if beyond <= 0.0 {
        return 0.0;
    }
    let under = along * along - beyond;
    if along <= 0.0 || under < 0.0 {
        return FURTHEST_M;
    }
    (along - under.sqrt()).min(FURTHEST_M)
}

fn to_side(from: [f64; 2], direction: [f64; 2], [a, b]: &[[f64; 2]; 2]) -> f64 {
    let side = [b[0] - a[0], b[1] - a[1]];
    let to = [a[0] - from[0], a[1] - from[1]];
    let cross = direction[0] * side[1] - direction[1] * side[0];
    if cross == 0.0 {
        return FURTHEST_M;
    }
    let along = (to[0] * side[1] - to[1] * side[0]) / cross;
    let share = (to[0] * direction[1] - to[1] * direction[0]) / cross;
    if along >= 0.0 && (0.0..=1.0).contains(&share) {
        along.min(FURTHEST_M)
    } else {
        FURTHEST_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twin::pose::Pose;
    use twin::world::FixedObstacle;

    fn seen(x_m: f64, y_m: f64, yaw_rad: f64) -> Seen {
        Seen {
            x_m,
            y_m,
            yaw_rad,
            age_s: 0.0,
            forward_m_per_s: 0.0,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: 0.0,
            online: true,
            ranges_m: [0.0; BEAMS],
        }
    }

    fn body() -> Body {
        Body {
            name: "r".into(),
            drive: control::law::Drive::Holonomic,
            bounding_radius_m: 0.2,
            turn_point_x_m: 0.0,
        }
    }

    #[test]
    fn walls_robots_and_boxes_are_measured_where_they_are() {
        let shape = Shape::Rectangle {
            length_m: 0.4,
            width_m: 0.2,
        };
        let contents = Contents {
            fixed: vec![FixedObstacle {
                name: "box".into(),
                shape,
                pose: Pose {
                    x_m: 0.0,
                    y_m: -0.6,
                    yaw_rad: 0.0,
                },
            }],
            ..Contents::default()
        };
        let map = Surroundings::new([4.0, 3.0], &contents);
        let mut robots = [seen(0.5, 0.0, 0.0), seen(-0.5, 0.0, 0.0), seen(0.0, f64::NAN, 0.0)];
        map.measure(&[body(), body(), body()], &mut robots);
        // Ahead the wall at x = 2, left that at y = 1.5, behind the other robot's circle, right the wall at y = -1.5.
        let expected = [(0, 1.5), (2, 1.5), (4, 0.8), (6, 1.5)];
        for (beam, range_m) in expected {
            assert!(
                (robots[0].ranges_m[beam] - range_m).abs() < 1e-12,
                "{beam}: {:?}",
                robots[0]
            );
        }
        // Diagonally back and right past the box's corner region: its upper side is at y = -0.5, 0.5 sqrt 2 away.
        assert!((robots[0].ranges_m[5] - 0.5 * 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(robots[2].ranges_m, [FURTHEST_M; BEAMS]);
    }

    #[test]
    fn a_turn_by_an_eighth_moves_the_readings_by_one_beam() {
        let map = Surroundings::new([4.0, 3.0], &Contents::default());
        for k in 0..BEAMS {
            let mut robots = [
                seen(0.7, 0.4, 0.0),
                seen(0.7, 0.4, core::f64::consts::FRAC_PI_4 * k as f64),
            ];
            map.measure(&[body()], &mut robots[..1]);
            map.measure(&[body()], &mut robots[1..]);
            for beam in 0..BEAMS {
                let apart = robots[1].ranges_m[beam] - robots[0].ranges_m[(beam + k) % BEAMS];
                assert!(apart.abs() < 1e-9, "{k} {beam}");
            }
        }
    }
}
