//! What a world starts from: checks and fingerprint.

use super::{Arena, Contents, MAX_ROBOTS, START_OVERLAP_M, WorldError};
use crate::digest::Digest;
use crate::parameter::problem;
use crate::pose::Pose;
use crate::robot::Robot;

pub(super) fn wall_distance_m(arena: &Arena, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
    (0.5 * arena.width_m - x_m.abs()).min(0.5 * arena.height_m - y_m.abs()) - radius_m
}

pub(super) fn check_start(arena: &Arena, contents: &Contents, robots: &[(Robot, Pose, f64)]) -> Result<(), WorldError> {
    let side = 0.1..=1000.0;
    if !side.contains(&arena.width_m) || !side.contains(&arena.height_m) {
        return Err(WorldError::Arena {
            width_m: arena.width_m,
            height_m: arena.height_m,
        });
    }
    if robots.is_empty() || robots.len() > MAX_ROBOTS {
        return Err(WorldError::RobotCount { count: robots.len() });
    }
    for (index, (robot, pose, radius_m)) in robots.iter().enumerate() {
        let name = || robot.name().to_owned();
        if !(0.001..=10.0).contains(radius_m) {
            return Err(WorldError::BoundingRadius {
                robot: index,
                name: name(),
                radius_m: *radius_m,
            });
        }
        if !pose.is_finite() {
            return Err(WorldError::StartNotFinite {
                robot: index,
                name: name(),
            });
        }
        let distance_m = wall_distance_m(arena, pose.x_m, pose.y_m, *radius_m);
        if distance_m < -START_OVERLAP_M {
            return Err(WorldError::StartOutside {
                robot: index,
                name: name(),
                beyond_m: -distance_m,
            });
        }
        for (before, (_, other, other_radius_m)) in robots[..index].iter().enumerate() {
            let overlap_m = radius_m + other_radius_m - pose.distance_m(other);
            if overlap_m > START_OVERLAP_M {
                return Err(WorldError::StartOverlap {
                    a: before,
                    b: index,
                    overlap_m,
                });
            }
        }
    }
    check_contents(arena, contents, robots)
}

/// The contents themselves, and that no robot starts in an obstacle.
fn check_contents(arena: &Arena, contents: &Contents, robots: &[(Robot, Pose, f64)]) -> Result<(), WorldError> {
    if let Some(problem) = contents.check(arena).into_iter().next() {
        return Err(WorldError::Contents(problem));
    }
    for (index, (robot, pose, radius_m)) in robots.iter().enumerate() {
        let fixed = contents
            .fixed_overlap_m(pose.x_m, pose.y_m, *radius_m)
            .map(|(at, overlap_m)| (format!("fixed[{at}].pose"), overlap_m));
        let pushable = || {
            contents
                .pushable_overlap_m(pose.x_m, pose.y_m, *radius_m)
                .map(|(at, overlap_m)| (format!("pushable[{at}].pose"), overlap_m))
        };
        if let Some((field, overlap_m)) = fixed.or_else(pushable) {
            return Err(WorldError::Contents(problem(
                field,
                format!(
                    "robot {index} ({}) starts {overlap_m} m inside the obstacle",
                    robot.name()
                ),
                format!("at most {START_OVERLAP_M} m"),
                "move the obstacle or the robot's start pose",
            )));
        }
    }
    Ok(())
}

/// Hash of everything a trace starts from.
pub(super) fn fingerprint(arena: &Arena, contents: &Contents, robots: &[(Robot, Pose, f64)]) -> Digest {
    let mut bytes = crate::VERSION.as_bytes().to_vec();
    let mut number = |value: f64| bytes.extend_from_slice(&value.to_bits().to_le_bytes());
    number(arena.width_m);
    number(arena.height_m);
    for (_, pose, radius_m) in robots {
        for value in [pose.x_m, pose.y_m, pose.yaw_rad, *radius_m] {
            number(value);
        }
    }
    for (robot, _, _) in robots {
        let text = serde_json::to_string(robot.description()).unwrap_or_default();
        bytes.extend_from_slice(text.as_bytes());
        if !robot.effects().is_empty() {
            let text = serde_json::to_string(robot.effects()).unwrap_or_default();
            bytes.extend_from_slice(text.as_bytes());
        }
        if let Some(residual) = robot.residual() {
            let text = serde_json::to_string(residual.document()).unwrap_or_default();
            bytes.extend_from_slice(text.as_bytes());
        }
    }
    if !contents.is_empty() {
        let text = serde_json::to_string(contents).unwrap_or_default();
        bytes.extend_from_slice(text.as_bytes());
    }
    Digest::of_bytes(&bytes)
}
