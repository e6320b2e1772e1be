//! Outlines of things on the floor.

use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// Outline seen from above, centred at its pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    Circle {
        radius_m: f64,
    },
    Rectangle {
        /// Whole side along its x.
        length_m: f64,
        /// Whole side along its y.
        width_m: f64,
    },
}

impl Shape {
    /// Radius of the circle around the centre that holds it, m.
    pub fn bounding_radius_m(&self) -> f64 {
        match *self {
            Shape::Circle { radius_m } => radius_m,
            Shape::Rectangle { length_m, width_m } => 0.5 * (length_m * length_m + width_m * width_m).sqrt(),
        }
    }

    /// Square of the radius of gyration of a plate of even density about its centre, m^2: R^2/2 or (l^2 + w^2)/12.
    pub fn gyration_m2(&self) -> f64 {
        match *self {
            Shape::Circle { radius_m } => 0.5 * radius_m * radius_m,
            Shape::Rectangle { length_m, width_m } => (length_m * length_m + width_m * width_m) / 12.0,
        }
    }

    /// Mean distance of its points from the centre, m.
    ///
    /// Circle: 2 R/3. Rectangle with half sides a, b and half diagonal d: d/3 + a^2/(6 b) asinh(b/a) + b^2/(6 a) asinh(a/b).
    pub fn mean_radius_m(&self) -> f64 {
        match *self {
            Shape::Circle { radius_m } => 2.0 * radius_m / 3.0,
            Shape::Rectangle { length_m, width_m } => {
                let (a, b) = (0.5 * length_m, 0.5 * width_m);
                let part = |a: f64, b: f64| a * a / (6.0 * b) * libm::asinh(b / a);
                (a * a + b * b).sqrt() / 3.0 + part(a, b) + part(b, a)
            }
        }
    }
}

/// A shape at its place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) shape: Shape,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) cos: f64,
    pub(crate) sin: f64,
}

impl Placed {
    pub(crate) fn new(shape: Shape, pose: Pose) -> Placed {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        Placed {
            shape,
            x_m: pose.x_m,
            y_m: pose.y_m,
            cos,
            sin,
        }
    }

    /// A point of the world in the axes of the shape.
    fn local(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        (dx * self.cos + dy * self.sin, dy * self.cos - dx * self.sin)
    }

    /// True for a point inside; its edge does not count.
    pub(crate) fn holds(&self, x_m: f64, y_m: f64) -> bool {
        let (x, y) = self.local(x_m, y_m);
        match self.shape {
            Shape::Circle { radius_m } => x * x + y * y < radius_m * radius_m,
            Shape::Rectangle { length_m, width_m } => 2.0 * x.abs() < length_m && 2.0 * y.abs() < width_m,
        }
    }

    /// Distance of a point from the outline, m; 0 inside.
    pub(crate) fn distance_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (x, y) = self.local(x_m, y_m);
        match self.shape {
            Shape::Circle { radius_m } => ((x * x + y * y).sqrt() - radius_m).max(0.0),
            Shape::Rectangle { length_m, width_m } => {
                let beyond_x = (x.abs() - 0.5 * length_m).max(0.0);
                let beyond_y = (y.abs() - 0.5 * width_m).max(0.0);
                (beyond_x * beyond_x + beyond_y * beyond_y).sqrt()
            }
        }
    }

    /// Half the extent along a direction of length 1, m.
    fn half_extent_m(&self, direction: [f64; 2]) -> f64 {
        match self.shape {
            Shape::Circle { radius_m } => radius_m,
            Shape::Rectangle { length_m, width_m } => {
                let along = (direction[0] * self.cos + direction[1] * self.sin).abs();
                let across = (direction[1] * self.cos - direction[0] * self.sin).abs();
                0.5 * (length_m * along + width_m * across)
            }
        }
    }

    /// Half the extents along the world's x and y, m.
    pub(crate) fn half_extents_m(&self) -> [f64; 2] {
        [self.half_extent_m([1.0, 0.0]), self.half_extent_m([0.0, 1.0])]
    }

    /// Gap to another shape, m; negative: how deep they overlap. Two rectangles corner to corner: a lower bound.
    pub(crate) fn gap_m(&self, other: &Placed) -> f64 {
        match (self.shape, other.shape) {
            (Shape::Circle { radius_m: a }, Shape::Circle { radius_m: b }) => {
                let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
                (dx * dx + dy * dy).sqrt() - a - b
            }
            (Shape::Circle { radius_m }, Shape::Rectangle { .. }) => other.distance_m(self.x_m, self.y_m) - radius_m,
            (Shape::Rectangle { .. }, Shape::Circle { radius_m }) => self.distance_m(other.x_m, other.y_m) - radius_m,
            (Shape::Rectangle { .. }, Shape::Rectangle { .. }) => {
                let axes = [
                    [self.cos, self.sin],
                    [-self.sin, self.cos],
                    [other.cos, other.sin],
                    [-other.sin, other.cos],
                ];
                axes.iter().fold(f64::NEG_INFINITY, |widest, axis| {
                    let between = (other.x_m - self.x_m) * axis[0] + (other.y_m - self.y_m) * axis[1];
                    widest.max(between.abs() - self.half_extent_m(*axis) - other.half_extent_m(*axis))
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x_m: f64, y_m: f64, yaw_rad: f64) -> Placed {
        let shape = Shape::Rectangle {
            length_m: 2.0,
            width_m: 1.0,
        };
        Placed::new(shape, Pose { x_m, y_m, yaw_rad })
    }

    #[test]
    fn the_mean_radius_is_that_of_a_fine_grid() {
        let shape = Shape::Rectangle {
            length_m: 0.6,
            width_m: 0.2,
        };
        let (mut sum, n) = (0.0, 400);
        for i in 0..n {
            for j in 0..n {
                let x = 0.6 * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
                let y = 0.2 * ((f64::from(j) + 0.5) / f64::from(n) - 0.5);
                sum += (x * x + y * y).sqrt();
            }
        }
        let grid = sum / f64::from(n * n);
        assert!((shape.mean_radius_m() / grid - 1.0).abs() < 1e-4, "{grid}");
    }

    #[test]
    fn distances_from_a_turned_rectangle() {
        let turned = rectangle(1.0, 2.0, core::f64::consts::FRAC_PI_2);
        assert!((turned.distance_m(2.0, 2.0) - 0.5).abs() < 1e-15);
        assert!((turned.distance_m(1.0, 4.0) - 1.0).abs() < 1e-15);
        assert_eq!(turned.distance_m(1.4, 2.9), 0.0);
        assert!(turned.holds(1.49, 2.99) && !turned.holds(1.51, 2.0));
        let [x, y] = turned.half_extents_m();
        assert!((x - 0.5).abs() < 1e-15 && (y - 1.0).abs() < 1e-15);
    }

    #[test]
    fn gaps_between_shapes() {
        let disc = Placed::new(
            Shape::Circle { radius_m: 0.25 },
            Pose {
                x_m: 2.0,
                ..Pose::default()
            },
        );
        assert!((rectangle(0.0, 0.0, 0.0).gap_m(&disc) - 0.75).abs() < 1e-15);
        assert!((disc.gap_m(&rectangle(0.0, 0.0, 0.0)) - 0.75).abs() < 1e-15);
        assert!((rectangle(0.0, 0.0, 0.0).gap_m(&rectangle(2.5, 0.2, 0.0)) - 0.5).abs() < 1e-15);
        assert!((rectangle(0.0, 0.0, 0.0).gap_m(&rectangle(1.9, 0.2, 0.0)) + 0.1).abs() < 1e-12);
        // The corner of the turned one points at the other's side.
        let turned = rectangle(2.5, 0.0, core::f64::consts::FRAC_PI_4);
        let corner_m = 0.5 * (2.0 + 1.0) * core::f64::consts::FRAC_1_SQRT_2;
        assert!((rectangle(0.0, 0.0, 0.0).gap_m(&turned) - (1.5 - corner_m)).abs() < 1e-12);
    }
}
