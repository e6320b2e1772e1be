//! What a range sensor can see, and rays through it.

use crate::pose::Pose;
use crate::world::Arena;

/// Everything around one robot, itself left out.
#[derive(Debug, Clone, Copy, Default)]
pub struct Surroundings<'a> {
    /// Absent: a floor without walls.
    pub arena: Option<Arena>,
    /// Other robots' bounding circles and round obstacles.
    pub circles: &'a [Circle],
    pub boxes: &'a [OrientedBox],
}

/// Round body in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    pub x_m: f64,
    pub y_m: f64,
    pub radius_m: f64,
}

/// Rectangle in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// Of its centre.
    pub pose: Pose,
    /// Whole side along its x.
    pub length_m: f64,
    /// Whole side along its y.
    pub width_m: f64,
}

/// Half line in the world frame; the direction has length 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub x_m: f64,
    pub y_m: f64,
    pub direction_x: f64,
    pub direction_y: f64,
}

impl Surroundings<'_> {
    /// Distance along each ray to the first thing it meets, m; infinite when there is none, 0 from inside a thing or
    /// beyond a wall.
    pub fn distances_m<const N: usize>(&self, rays: &[Ray; N]) -> [f64; N] {
        let mut nearest = [f64::INFINITY; N];
        let mut meet = |distance_m: &dyn Fn(&Ray) -> Option<f64>| {
            for (nearest, ray) in nearest.iter_mut().zip(rays) {
                if let Some(found_m) = distance_m(ray) {
                    *nearest = nearest.min(found_m);
                }
            }
        };
        if let Some(arena) = &self.arena {
            meet(&|ray| Some(wall_distance_m(arena, ray)));
        }
        for circle in self.circles {
            meet(&|ray| circle.distance_m(ray));
        }
        for oriented in self.boxes {
            let (sin, cos) = libm::sincos(oriented.pose.yaw_rad);
            meet(&|ray| oriented.distance_m(ray, [cos, sin]));
        }
        nearest
    }
}

/// Distance to the wall that the ray leaves the arena through.
fn wall_distance_m(arena: &Arena, ray: &Ray) -> f64 {
    let axis = |at_m: f64, direction: f64, half_m: f64| {
        if at_m.abs() > half_m {
            0.0
        } else if direction == 0.0 {
            f64::INFINITY
        } else {
            (half_m.copysign(direction) - at_m) / direction
        }
    };
    axis(ray.x_m, ray.direction_x, 0.5 * arena.width_m).min(axis(ray.y_m, ray.direction_y, 0.5 * arena.height_m))
}

impl Circle {
    /// With the centre at `a` along and `b` across the ray: a - sqrt(R^2 - b^2). A tangent touches at `a`.
    fn distance_m(&self, ray: &Ray) -> Option<f64> {
        let (dx, dy) = (self.x_m - ray.x_m, self.y_m - ray.y_m);
        let radius2 = self.radius_m * self.radius_m;
        if dx * dx + dy * dy <= radius2 {
            return Some(0.0);
        }
        let along = dx * ray.direction_x + dy * ray.direction_y;
        let across = dx * ray.direction_y - dy * ray.direction_x;
        let half_chord2 = radius2 - across * across;
        (along > 0.0 && half_chord2 >= 0.0).then(|| along - half_chord2.sqrt())
    }
}

impl OrientedBox {
    /// Where the ray is inside both slabs of the box at once.
    fn distance_m(&self, ray: &Ray, [cos, sin]: [f64; 2]) -> Option<f64> {
        let (dx, dy) = (ray.x_m - self.pose.x_m, ray.y_m - self.pose.y_m);
        let x_axis = [
            dx * cos + dy * sin,
            ray.direction_x * cos + ray.direction_y * sin,
            0.5 * self.length_m,
        ];
        let y_axis = [
            dy * cos - dx * sin,
            ray.direction_y * cos - ray.direction_x * sin,
            0.5 * self.width_m,
        ];
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for [at_m, direction, half_m] in [x_axis, y_axis] {
            if direction == 0.0 {
                if at_m.abs() > half_m {
                    return None;
                }
                continue;
            }
            let near_side_m = -half_m.copysign(direction);
            enter = enter.max((near_side_m - at_m) / direction);
            leave = leave.min((-near_side_m - at_m) / direction);
        }
        (enter <= leave).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_4;

    fn ray(x_m: f64, y_m: f64, angle_rad: f64) -> Ray {
        let (direction_y, direction_x) = libm::sincos(angle_rad);
        Ray {
            x_m,
            y_m,
            direction_x,
            direction_y,
        }
    }

    fn square(yaw_rad: f64) -> OrientedBox {
        let pose = Pose {
            x_m: 2.0,
            y_m: 0.0,
            yaw_rad,
        };
        OrientedBox {
            pose,
            length_m: 1.0,
            width_m: 1.0,
        }
    }

    fn to_box(oriented: OrientedBox, ray: Ray) -> f64 {
        let seen = Surroundings {
            boxes: &[oriented],
            ..Surroundings::default()
        };
        seen.distances_m(&[ray])[0]
    }

    #[test]
    fn a_box_is_met_at_its_face_or_its_corner() {
        let face = to_box(square(0.0), ray(0.0, 0.0, 0.0));
        assert_eq!(face, 1.5);
        let corner = to_box(square(FRAC_PI_4), ray(0.0, 0.0, 0.0));
        assert!(
            (corner - (2.0 - core::f64::consts::FRAC_1_SQRT_2)).abs() < 1e-15,
            "{corner}"
        );
    }

    #[test]
    fn a_ray_past_a_corner_meets_nothing() {
        let corner_m = core::f64::consts::FRAC_1_SQRT_2;
        let turned = square(FRAC_PI_4);
        assert!(to_box(turned, ray(0.0, corner_m - 1e-9, 0.0)).is_finite());
        assert_eq!(to_box(turned, ray(0.0, corner_m + 1e-9, 0.0)), f64::INFINITY);
        assert_eq!(to_box(turned, ray(0.0, -corner_m - 1e-9, 0.0)), f64::INFINITY);
    }

    #[test]
    fn a_box_beside_or_behind_is_not_met() {
        assert_eq!(to_box(square(0.0), ray(0.0, 0.501, 0.0)), f64::INFINITY);
        assert_eq!(to_box(square(0.0), ray(0.0, 0.0, core::f64::consts::PI)), f64::INFINITY);
        assert_eq!(to_box(square(0.0), ray(0.0, 0.499, 0.0)), 1.5);
        assert_eq!(to_box(square(0.0), ray(2.1, 0.2, 1.0)), 0.0, "from inside");
    }

    #[test]
    fn a_sensor_beyond_a_wall_sees_it_at_once() {
        let arena = Some(Arena {
            width_m: 4.0,
            height_m: 3.0,
        });
        let seen = Surroundings {
            arena,
            ..Surroundings::default()
        };
        assert_eq!(seen.distances_m(&[ray(2.1, 0.0, 0.0), ray(2.1, 0.0, 3.0)]), [0.0, 0.0]);
        assert_eq!(seen.distances_m(&[ray(2.0, 0.0, 0.0)]), [0.0]);
    }
}
