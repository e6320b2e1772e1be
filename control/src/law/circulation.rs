//! Liveness rule: a robot with another one in its way swerves to the right.
//!
//! The swerve is perpendicular to the line between the two robots, so it never brings them closer, and since all
//! robots swerve to the same side a crowd turns like a roundabout instead of standing still. Only round a robot at rest
//! that leaves no room between itself and a wall on the right it goes to the left.

use super::Observation;
use crate::vector::{Vector, add, clip, direction, dot, length, right_of, scale, sub};

/// Gap between two bounding circles below which a robot starts to swerve.
const RANGE_M: f64 = 0.6;
/// A neighbour counts as in the way up to this cosine of the angle off the wanted direction.
const LEAST_COSINE: f64 = 0.05;
/// A slower robot is at rest: it swerves to no side itself.
const AT_REST_M_PER_S: f64 = 0.02;
/// Room that passing needs beyond the bounding circles, on each side of the passing robot.
const ROOM_M: f64 = 0.06;

/// `velocity` of robot `index` bent to the right of robots in its way; never faster than before.
///
/// - `goal_m`: where the robot wants to be; neighbours beyond it are not in the way.
pub fn keep_right(
    velocity: Vector,
    index: usize,
    goal_m: Vector,
    strength: f64,
    observation: &Observation<'_>,
) -> Vector {
    let speed = length(velocity);
    let Some(wanted) = direction(velocity) else {
        return velocity;
    };
    let own = &observation.robots[index];
    let here = [own.pose.x_m, own.pose.y_m];
    let goal_distance_m = length(sub(goal_m, here));
    let mut bent = velocity;
    for (j, other) in observation.robots.iter().enumerate() {
        if j == index || !other.pose.is_finite() {
            continue;
        }
        let line = sub([other.pose.x_m, other.pose.y_m], here);
        let Some(toward) = direction(line) else { continue };
        let gap_m =
            length(line) - observation.bodies[index].bounding_radius_m - observation.bodies[j].bounding_radius_m;
        let ahead = dot(toward, wanted);
        if gap_m >= RANGE_M || ahead <= LEAST_COSINE || goal_distance_m < gap_m {
            continue;
        }
        let near = (1.0 - gap_m / RANGE_M).min(1.0);
        let right = right_of(toward);
        let rests = length([other.twist.forward_m_per_s, other.twist.left_m_per_s]) < AT_REST_M_PER_S;
        let has_room = |side: Vector| passable(side, [index, j], observation);
        let side = if rests && !has_room(right) && has_room(scale(right, -1.0)) {
            scale(right, -1.0)
        } else {
            right
        };
        bent = add(bent, scale(side, strength * speed * ahead * near));
    }
    clip(bent, speed)
}

/// The first robot fits between the second one and the wall on this side of it.
fn passable(side: Vector, [own, other]: [usize; 2], observation: &Observation<'_>) -> bool {
    let [own_m, other_m] = [own, other].map(|robot| observation.bodies[robot].bounding_radius_m);
    let there = &observation.robots[other].pose;
    let way = add([there.x_m, there.y_m], scale(side, own_m + other_m + ROOM_M));
    let half = |axis: usize| 0.5 * observation.arena_m[axis] - own_m - ROOM_M;
    way[0].abs() <= half(0) && way[1].abs() <= half(1)
}
