//! What the camera is told about a robot.

use super::problem::{CameraProblem, within};
use super::tag::Tag;
use crate::plant::Pose;
use serde::{Deserialize, Serialize};

/// Most instants of an exposure that are drawn; of more, this many are taken evenly.
pub const MAX_INSTANTS: usize = 16;

/// What a robot looks like from above: a disc with a tag lying flat over it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotShape {
    /// Height of the tag over the floor.
    pub tag_height_m: f64,
    /// Height of the body's upper side over the floor.
    pub body_height_m: f64,
    /// 0 for no body.
    pub body_radius_m: f64,
    /// 0 black to 1 white.
    pub body_reflectance: f64,
}

impl Default for RobotShape {
    fn default() -> Self {
        Self {
            tag_height_m: 0.15,
            body_height_m: 0.13,
            body_radius_m: 0.17,
            body_reflectance: 0.15,
        }
    }
}

impl RobotShape {
    /// Every rule on its own.
    pub fn check(&self) -> Result<(), CameraProblem> {
        let remedy = "give the robot's size in metres";
        within("tag_height_m", self.tag_height_m, 0.0, 2.0, remedy)?;
        within("body_height_m", self.body_height_m, 0.0, 2.0, remedy)?;
        within("body_radius_m", self.body_radius_m, 0.0, 1.0, remedy)?;
        within(
            "body_reflectance",
            self.body_reflectance,
            0.0,
            1.0,
            "give the share of light",
        )
    }
}

/// One robot during one exposure.
#[derive(Debug, Clone, Copy)]
pub struct RobotInView<'a> {
    /// The tag it carries; its id is the robot's number.
    pub tag: Option<Tag>,
    pub shape: RobotShape,
    /// Body origin at evenly spread instants of the exposure ([`super::exposure::instants_us`]), in order; the tag's centre is
    /// over it. A robot without poses, or with one that is not a number, is not drawn.
    pub poses: &'a [Pose],
}

impl RobotInView<'_> {
    /// At most [`MAX_INSTANTS`] poses, and only one if the robot stands still.
    pub(super) fn instants(&self) -> Vec<Pose> {
        let finite = |pose: &Pose| pose.x_m.is_finite() && pose.y_m.is_finite() && pose.yaw_rad.is_finite();
        let Some(first) = self.poses.first() else {
            return Vec::new();
        };
        if !self.poses.iter().all(finite) {
            return Vec::new();
        }
        if self.poses.iter().all(|pose| pose == first) {
            return vec![*first];
        }
        let count = self.poses.len().min(MAX_INSTANTS);
        (0..count)
            .filter_map(|part| self.poses.get((2 * part + 1) * self.poses.len() / (2 * count)).copied())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(count: usize) -> Vec<Pose> {
        (0..count)
            .map(|i| Pose {
                x_m: i as f64,
                ..Pose::default()
            })
            .collect()
    }

    #[test]
    fn instants_are_bounded_and_a_standing_robot_needs_one() {
        let view = |poses: &[Pose]| {
            RobotInView {
                tag: None,
                shape: RobotShape::default(),
                poses,
            }
            .instants()
            .iter()
            .map(|pose| pose.x_m)
            .collect::<Vec<_>>()
        };
        assert_eq!(view(&along(4)), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(view(&along(1000)).len(), MAX_INSTANTS);
        assert_eq!(view(&along(32))[..3], [1.0, 3.0, 5.0]);
        assert_eq!(view(&[Pose::default(); 9]), [0.0]);
        assert!(view(&[]).is_empty());
        assert!(
            view(&[Pose {
                yaw_rad: f64::NAN,
                ..Pose::default()
            }])
            .is_empty()
        );
    }
}
