//! Limits of an arena's contents.

use super::contents::{Contents, MAX_FIXED, MAX_PUSHABLE, MAX_REGIONS};
use super::shape::{Placed, Shape};
use super::{Arena, START_OVERLAP_M};
use crate::parameter::{ParameterError, Range, check_range, problem, range};
use crate::pose::Pose;

const RADIUS: Range = range("radius_m", "m", 0.01, 50.0, "give the radius in metres");
const LENGTH: Range = range("length_m", "m", 0.01, 100.0, "give the whole side along the shape's x");
const WIDTH: Range = range("width_m", "m", 0.01, 100.0, "give the whole side along the shape's y");
const POSE_X: Range = range("x_m", "m", -500.0, 500.0, "give the centre in the world frame");
const POSE_Y: Range = range("y_m", "m", -500.0, 500.0, "give the centre in the world frame");
const POSE_YAW: Range = range("yaw_rad", "rad", -13.0, 13.0, "give radians, 0 = along the world's x");
const MASS: Range = range("mass_kg", "kg", 0.01, 2000.0, "give the mass of the whole obstacle");
const FRICTION: Range = range(
    "floor_friction",
    "",
    0.01,
    3.0,
    "give the friction coefficient of obstacle on floor, usually 0.2 to 0.6",
);
const SCALE: Range = range(
    "friction_scale",
    "",
    0.05,
    2.0,
    "give the friction inside over that of the floor; 1 is the floor's own",
);
const TILT_X: Range = range(
    "tilt_x_rad",
    "rad",
    -0.2,
    0.2,
    "give the slope along x in radians; the twin's law is linear in it",
);
const TILT_Y: Range = range(
    "tilt_y_rad",
    "rad",
    -0.2,
    0.2,
    "give the slope along y in radians; the twin's law is linear in it",
);

/// All problems, in the order of the fields; places are compared only where the numbers themselves are right.
pub(super) fn check(contents: &Contents, arena: &Arena) -> Vec<ParameterError> {
    let mut problems = Vec::new();
    check_count(&mut problems, "fixed", contents.fixed.len(), MAX_FIXED);
    check_count(&mut problems, "pushable", contents.pushable.len(), MAX_PUSHABLE);
    check_count(&mut problems, "regions", contents.regions.len(), MAX_REGIONS);
    if !problems.is_empty() {
        return problems;
    }
    for (index, one) in contents.fixed.iter().enumerate() {
        let at = format!("fixed[{index}]");
        check_name(&mut problems, &at, &one.name);
        check_place(&mut problems, &at, one.shape, one.pose, Inside::Whole(arena));
    }
    for (index, one) in contents.pushable.iter().enumerate() {
        let at = format!("pushable[{index}]");
        check_name(&mut problems, &at, &one.name);
        check_place(&mut problems, &at, one.shape, one.pose, Inside::Whole(arena));
        check_range(&mut problems, &format!("{at}."), one.mass_kg, &MASS);
        check_range(&mut problems, &format!("{at}."), one.floor_friction, &FRICTION);
    }
    for (index, one) in contents.regions.iter().enumerate() {
        let at = format!("regions[{index}]");
        check_place(&mut problems, &at, one.shape, one.pose, Inside::Centre(arena));
        check_range(&mut problems, &format!("{at}."), one.friction_scale, &SCALE);
    }
    check_range(&mut problems, "", contents.tilt_x_rad, &TILT_X);
    check_range(&mut problems, "", contents.tilt_y_rad, &TILT_Y);
    if problems.is_empty() {
        check_apart(&mut problems, contents);
    }
    problems
}

fn check_count(problems: &mut Vec<ParameterError>, field: &str, count: usize, most: usize) {
    if count > most {
        problems.push(problem(
            field,
            format!("{count} of them"),
            format!("at most {most}"),
            "leave some out or join them to larger shapes",
        ));
    }
}

fn check_name(problems: &mut Vec<ParameterError>, at: &str, name: &str) {
    if name.trim().is_empty() || name.len() > 64 {
        problems.push(problem(
            format!("{at}.name"),
            format!("{name:?} cannot name an obstacle"),
            "1..=64 bytes",
            "give the obstacle a short name",
        ));
    }
}

/// What of a thing must lie inside the walls.
enum Inside<'a> {
    Whole(&'a Arena),
    Centre(&'a Arena),
}

fn check_place(problems: &mut Vec<ParameterError>, at: &str, shape: Shape, pose: Pose, inside: Inside<'_>) {
    let before = problems.len();
    match shape {
        Shape::Circle { radius_m } => check_range(problems, &format!("{at}.shape.circle."), radius_m, &RADIUS),
        Shape::Rectangle { length_m, width_m } => {
            check_range(problems, &format!("{at}.shape.rectangle."), length_m, &LENGTH);
            check_range(problems, &format!("{at}.shape.rectangle."), width_m, &WIDTH);
        }
    }
    for (value, range) in [(pose.x_m, &POSE_X), (pose.y_m, &POSE_Y), (pose.yaw_rad, &POSE_YAW)] {
        check_range(problems, &format!("{at}.pose."), value, range);
    }
    if problems.len() > before {
        return;
    }
    let (arena, [half_x, half_y]) = match inside {
        Inside::Whole(arena) => (arena, Placed::new(shape, pose).half_extents_m()),
        Inside::Centre(arena) => (arena, [0.0, 0.0]),
    };
    let axes = [
        ("x_m", pose.x_m, 0.5 * arena.width_m - half_x),
        ("y_m", pose.y_m, 0.5 * arena.height_m - half_y),
    ];
    for (axis, value_m, most_m) in axes {
        if value_m.abs() > most_m + START_OVERLAP_M {
            let limit = if most_m < 0.0 {
                format!("smaller than the arena of {} m x {} m", arena.width_m, arena.height_m)
            } else {
                format!("{}..={most_m} m", -most_m)
            };
            problems.push(problem(
                format!("{at}.pose.{axis}"),
                format!("at {value_m} m it reaches beyond a wall"),
                limit,
                "move it into the arena",
            ));
        }
    }
}

/// Pushable obstacles start apart from each other and from fixed ones; fixed ones may overlap.
fn check_apart(problems: &mut Vec<ParameterError>, contents: &Contents) {
    let fixed: Vec<Placed> = contents
        .fixed
        .iter()
        .map(|one| Placed::new(one.shape, one.pose))
        .collect();
    let pushable: Vec<Placed> = contents
        .pushable
        .iter()
        .map(|one| Placed::new(one.shape, one.pose))
        .collect();
    for (index, one) in pushable.iter().enumerate() {
        let others = fixed
            .iter()
            .zip(&contents.fixed)
            .map(|(other, named)| (other, &named.name));
        let before = pushable[..index].iter().zip(&contents.pushable);
        for (other, name) in others.chain(before.map(|(other, named)| (other, &named.name))) {
            let reach_m = one.shape.bounding_radius_m() + other.shape.bounding_radius_m();
            let (dx, dy) = (other.x_m - one.x_m, other.y_m - one.y_m);
            if dx * dx + dy * dy >= reach_m * reach_m {
                continue;
            }
            let gap_m = one.gap_m(other);
            if gap_m < -START_OVERLAP_M {
                problems.push(problem(
                    format!("pushable[{index}].pose"),
                    format!("it overlaps {name:?} by {} m", -gap_m),
                    format!("at most {START_OVERLAP_M} m"),
                    "move one of the two",
                ));
            }
        }
    }
}
