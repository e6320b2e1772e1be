//! What stands around one robot, as its range sensors see it.

use super::Arena;
use super::shape::Shape;
use crate::pose::Pose;
use crate::sensor::surroundings::{Circle, OrientedBox, Surroundings};

/// Walls, obstacles and other robots at one tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub arena: Arena,
    pub circles: Vec<Circle>,
    pub boxes: Vec<OrientedBox>,
}

impl Scene {
    /// The same for [`crate::sensor`].
    pub fn surroundings(&self) -> Surroundings<'_> {
        Surroundings {
            arena: Some(self.arena),
            circles: &self.circles,
            boxes: &self.boxes,
        }
    }

    pub(super) fn add(&mut self, shape: Shape, pose: Pose) {
        match shape {
            Shape::Circle { radius_m } => self.circles.push(Circle {
                x_m: pose.x_m,
                y_m: pose.y_m,
                radius_m,
            }),
            Shape::Rectangle { length_m, width_m } => self.boxes.push(OrientedBox {
                pose,
                length_m,
                width_m,
            }),
        }
    }
}
