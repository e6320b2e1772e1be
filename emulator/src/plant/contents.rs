//! What stands in the arena and what its floor is like (`docs/world.md`), as the plant takes it.

use super::Pose;
use super::arena::Touch;
use super::body::{Body, Push};
use api::arena::{Contents, Shape};

/// Why an arena cannot be emulated.
#[derive(Debug, thiserror::Error)]
pub enum ContentsError {
    #[error(
        "arena.contents.pushable[0] {0:?}: the emulated plant has no obstacles that move; make it fixed or take it out"
    )]
    Pushable(String),
    #[error("arena.contents.{field} is not finite or not positive; give it a size and a pose")]
    Number { field: String },
}

/// Fixed obstacles, floor regions and tilt, ready for the plant.
#[derive(Debug, Clone, Default)]
pub struct PlantContents {
    fixed: Vec<Outline>,
    regions: Vec<(Outline, f64)>,
    /// Rise per metre along x and y; a floor that falls towards positive x has a negative one.
    pub slope: [f64; 2],
}

/// A shape at its place.
#[derive(Debug, Clone, Copy)]
struct Outline {
    x_m: f64,
    y_m: f64,
    cos: f64,
    sin: f64,
    shape: Shape,
}

impl Outline {
    fn new(shape: Shape, pose: &api::experiment::Pose, field: impl Fn() -> String) -> Result<Self, ContentsError> {
        let sizes = match shape {
            Shape::Circle { radius_m } => [radius_m, radius_m],
            Shape::Rectangle { length_m, width_m } => [length_m, width_m],
        };
        let place = [pose.x_m, pose.y_m, pose.yaw_rad];
        if !place.iter().chain(&sizes).all(|number| number.is_finite()) || sizes.iter().any(|size| *size <= 0.0) {
            return Err(ContentsError::Number { field: field() });
        }
        let (sin, cos) = pose.yaw_rad.sin_cos();
        Ok(Self {
            x_m: pose.x_m,
            y_m: pose.y_m,
            cos,
            sin,
            shape,
        })
    }

    /// A point in the shape's own frame.
    fn inside_frame(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x - self.x_m, y - self.y_m);
        [self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx]
    }

    fn holds(&self, point: [f64; 2]) -> bool {
        let [along, across] = self.inside_frame(point);
        match self.shape {
            Shape::Circle { radius_m } => along.hypot(across) <= radius_m,
            Shape::Rectangle { length_m, width_m } => along.abs() <= length_m / 2.0 && across.abs() <= width_m / 2.0,
        }
    }

    /// How far a point is outside the shape (negative inside), and the unit vector away from it in the world.
    fn distance(&self, point: [f64; 2]) -> (f64, [f64; 2]) {
        let [along, across] = self.inside_frame(point);
        let (distance_m, [nx, ny]) = match self.shape {
            Shape::Circle { radius_m } => {
                let far_m = along.hypot(across);
                (far_m - radius_m, unit([along, across]))
            }
            Shape::Rectangle { length_m, width_m } => {
                let (over_x, over_y) = (along.abs() - length_m / 2.0, across.abs() - width_m / 2.0);
                let (side_x, side_y) = (1f64.copysign(along), 1f64.copysign(across));
                if over_x > 0.0 && over_y > 0.0 {
                    (over_x.hypot(over_y), unit([over_x * side_x, over_y * side_y]))
                } else if over_x > over_y {
                    (over_x, [side_x, 0.0])
                } else {
                    (over_y, [0.0, side_y])
                }
            }
        };
        (
            distance_m,
            [self.cos * nx - self.sin * ny, self.sin * nx + self.cos * ny],
        )
    }
}

fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let size = x.hypot(y);
    if size > 1e-9 { [x / size, y / size] } else { [1.0, 0.0] }
}

impl PlantContents {
    /// - Refuses obstacles that move, and sizes and poses that are no numbers.
    pub fn new(contents: Option<&Contents>) -> Result<Self, ContentsError> {
        let Some(contents) = contents else {
            return Ok(Self::default());
        };
        if let Some(pushable) = contents.pushable.first() {
            return Err(ContentsError::Pushable(pushable.name.clone()));
        }
        let fixed = contents.fixed.iter().enumerate();
        let regions = contents.regions.iter().enumerate();
        Ok(Self {
            fixed: fixed
                .map(|(i, obstacle)| Outline::new(obstacle.shape, &obstacle.pose, || format!("fixed[{i}]")))
                .collect::<Result<_, _>>()?,
            regions: regions
                .map(|(i, region)| {
                    let field = || format!("regions[{i}]");
                    if !region.friction_scale.is_finite() || region.friction_scale <= 0.0 {
                        return Err(ContentsError::Number { field: field() });
                    }
                    Ok((Outline::new(region.shape, &region.pose, field)?, region.friction_scale))
                })
                .collect::<Result<_, _>>()?,
            slope: [-contents.tilt_x_rad, -contents.tilt_y_rad],
        })
    }

    /// Times the floor friction at a point; where regions overlap, the last holds.
    pub fn friction_scale(&self, point: [f64; 2]) -> f64 {
        let region = self.regions.iter().rev().find(|(outline, _)| outline.holds(point));
        region.map_or(1.0, |(_, scale)| *scale)
    }

    /// A circle that stands in a fixed obstacle.
    pub fn is_blocked(&self, pose: &Pose, radius_m: f64) -> bool {
        let point = [pose.x_m, pose.y_m];
        self.fixed.iter().any(|outline| outline.distance(point).0 < radius_m)
    }

    /// Adds what the obstacles that a robot presses against do to it.
    pub(super) fn press(&self, body: &Body, push: &mut Push) {
        let pose = body.pose();
        for outline in &self.fixed {
            let (distance_m, normal) = outline.distance([pose.x_m, pose.y_m]);
            let depth_m = body.radius_m - distance_m;
            if depth_m > 0.0 {
                Touch::fixed(body, depth_m, normal).press(body, push);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(shape: Shape, x_m: f64, y_m: f64, yaw_rad: f64) -> Outline {
        let pose = api::experiment::Pose { x_m, y_m, yaw_rad };
        Outline::new(shape, &pose, String::new).unwrap()
    }

    #[test]
    fn the_furnished_example_can_be_emulated() {
        let read = |text: &str| -> api::lab::LabDescription { serde_json::from_str(text).expect("a laboratory") };
        let lab = read(include_str!("../../../examples/lab/furnished.json"));
        let reference = read(include_str!("../../../examples/lab/reference.json"));
        assert_eq!(lab.robots, reference.robots, "the same robots in another room");
        let contents = PlantContents::new(lab.arena.contents.as_ref()).expect("all of it is known");
        // On the slippery patch, beside it, and in the pillar.
        assert!(contents.friction_scale([-0.9, 0.15]) == 0.5 && contents.friction_scale([1.0, 0.15]) == 1.0);
        let pillar = Pose {
            x_m: 0.1,
            y_m: 0.3,
            yaw_rad: 0.0,
        };
        assert!(contents.is_blocked(&pillar, 0.2) && !contents.is_blocked(&pillar, 0.1));
    }

    #[test]
    fn distances_by_hand() {
        let box_shape = Shape::Rectangle {
            length_m: 2.0,
            width_m: 1.0,
        };
        let turned = outline(box_shape, 1.0, 0.0, std::f64::consts::FRAC_PI_2);
        // Turned by 90 degrees it is 1 wide along x and 2 along y.
        for (point, distance, normal) in [
            ([2.0, 0.0], 0.5, [1.0, 0.0]),
            ([1.0, -1.5], 0.5, [0.0, -1.0]),
            ([1.1, 0.0], -0.4, [1.0, 0.0]),
            ([1.5 + 0.3, 1.0 + 0.4], 0.5, [0.6, 0.8]),
        ] {
            let (found, [nx, ny]) = turned.distance(point);
            assert!((found - distance).abs() < 1e-12, "{point:?}: {found}");
            assert!(
                (nx - normal[0]).abs() < 1e-12 && (ny - normal[1]).abs() < 1e-12,
                "{point:?}: {nx} {ny}"
            );
            assert_eq!(turned.holds(point), distance <= 0.0);
        }
        let disc = outline(Shape::Circle { radius_m: 0.5 }, 0.0, 0.0, 0.0);
        assert!((disc.distance([0.6, 0.8]).0 - 0.5).abs() < 1e-12);
    }
}
