//! Liveness rule: a robot with another one in its way swerves to the right.
//!
//! The swerve is perpendicular to the line between the two robots, so it never brings them closer, and since all
//! robots swerve to the same side a crowd turns like a roundabout instead of standing still.

use super::Observation;
use crate::vector::{Vector, add, clip, direction, dot, length, right_of, scale, sub};

/// Gap between two bounding circles below which a robot starts to swerve.
const RANGE_M: f64 = 0.6;
/// A neighbour counts as in the way up to this cosine of the angle off the wanted direction.
const LEAST_COSINE: f64 = 0.05;

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
        bent = add(bent, scale(right_of(toward), strength * speed * ahead * near));
    }
    clip(bent, speed)
}
