//! How close bodies came to each other, to walls, to what stands in the arena and to strangers, by the plant's true poses.

use api::arena::{Arena, FixedObstacle, Shape};

/// Circle of a stranger.
pub(crate) const STRANGER_RADIUS_M: f64 = 0.25;

/// Smallest distances of a drill, bounding circle to bounding circle, wall or outline; negative is a collision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    pub robots_m: f64,
    pub walls_m: f64,
    /// To what stands in the arena.
    pub obstacles_m: f64,
    /// To robots on the floor that are not in the run.
    pub strangers_m: f64,
}

impl Separation {
    pub const NONE: Self = Self {
        robots_m: f64::INFINITY,
        walls_m: f64::INFINITY,
        obstacles_m: f64::INFINITY,
        strangers_m: f64::INFINITY,
    };

    /// Takes one moment in.
    ///
    /// - `poses`, `radii_m`: of the robots of the run.
    pub(super) fn measure(
        &mut self,
        poses: &[[f64; 3]],
        radii_m: &[f64],
        arena: &Arena,
        strangers: &[(u16, [f64; 3])],
    ) {
        let fixed = arena
            .contents
            .as_ref()
            .map_or(&[] as &[FixedObstacle], |contents| &contents.fixed);
        for (i, ([x, y, _], radius_m)) in poses.iter().zip(radii_m).enumerate() {
            let wall_m = (arena.width_m / 2.0 - x.abs()).min(arena.height_m / 2.0 - y.abs()) - radius_m;
            self.walls_m = self.walls_m.min(wall_m);
            for ([ox, oy, _], other_radius_m) in poses.iter().zip(radii_m).skip(i + 1) {
                let gap_m = (x - ox).hypot(y - oy) - radius_m - other_radius_m;
                self.robots_m = self.robots_m.min(gap_m);
            }
            for obstacle in fixed {
                self.obstacles_m = self.obstacles_m.min(outside_m(obstacle, [*x, *y]) - radius_m);
            }
            for (_, [ox, oy, _]) in strangers {
                let gap_m = (x - ox).hypot(y - oy) - radius_m - STRANGER_RADIUS_M;
                self.strangers_m = self.strangers_m.min(gap_m);
            }
        }
    }
}

/// Distance of a point from an outline, m; negative inside.
pub(crate) fn outside_m(obstacle: &FixedObstacle, [x_m, y_m]: [f64; 2]) -> f64 {
    let (dx, dy) = (x_m - obstacle.pose.x_m, y_m - obstacle.pose.y_m);
    let (sin, cos) = obstacle.pose.yaw_rad.sin_cos();
    let (along, across) = ((cos * dx + sin * dy).abs(), (cos * dy - sin * dx).abs());
    match obstacle.shape {
        Shape::Circle { radius_m } => along.hypot(across) - radius_m,
        Shape::Rectangle { length_m, width_m } => {
            let (over_x, over_y) = (along - length_m / 2.0, across - width_m / 2.0);
            over_x.max(0.0).hypot(over_y.max(0.0)) + over_x.max(over_y).min(0.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::experiment::Pose;

    #[test]
    fn points_around_a_turned_rectangle() {
        let obstacle = FixedObstacle {
            name: "shelf".to_owned(),
            shape: Shape::Rectangle {
                length_m: 2.0,
                width_m: 1.0,
            },
            pose: Pose {
                x_m: 1.0,
                y_m: 0.0,
                yaw_rad: std::f64::consts::FRAC_PI_2,
            },
        };
        // It reaches from 0.5 to 1.5 along x and from -1 to 1 along y.
        let cases = [
            ([2.5, 0.0], 1.0),
            ([1.0, 1.25], 0.25),
            ([1.8, 1.4], 0.5),
            ([1.0, 0.0], -0.5),
            ([1.4, 0.9], -0.1),
        ];
        for (point, expected_m) in cases {
            assert!((outside_m(&obstacle, point) - expected_m).abs() < 1e-12, "{point:?}");
        }
    }
}
