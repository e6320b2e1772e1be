//! The linear constraints on velocities at one tick.

use super::Limits;
use super::intervention::WallSide;
use crate::vector::{Vector, dot, length, scale, sub};

/// Centres closer than this have no direction between them.
const COINCIDENT_M: f64 = 1e-6;

/// Where a robot is and how it may move, as the filter sees it at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Last known position; `None` before the first finite pose.
    pub position: Option<Vector>,
    pub radius_m: f64,
    /// The filter may give it a velocity; otherwise it is an obstacle.
    pub movable: bool,
    /// Estimated velocity in the world frame.
    pub velocity: Vector,
    /// Velocity of the last command in the world frame.
    pub commanded: Vector,
    pub pose_age_s: f64,
    /// Direction in which a robot that cannot move sideways moves; `None` for any direction.
    pub axis: Option<Vector>,
}

impl Place {
    /// The part of `n` that the robot can act on.
    fn reachable(&self, n: Vector) -> Vector {
        match (self.movable, self.axis) {
            (false, _) => [0.0, 0.0],
            (true, None) => n,
            (true, Some(axis)) => scale(axis, dot(axis, n)),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Against {
    Robot(u32),
    Wall(WallSide),
}

/// `n . (v_a - v_b) >= bound` with `bound <= 0`; `v_b` is zero for walls and obstacles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    pub robot: u32,
    pub against: Against,
    pub bound: f64,
    /// `n`: from the other robot or the wall to the robot.
    pub normal: Vector,
    /// Gradients with respect to both velocities, within what each robot can do.
    pub gradient: Vector,
    pub gradient_other: Vector,
    pub multiplier: f64,
}

impl Constraint {
    /// Squared length of the whole gradient.
    pub fn weight(&self) -> f64 {
        dot(self.gradient, self.gradient) + dot(self.gradient_other, self.gradient_other)
    }

    /// `n . (v_a - v_b)`.
    pub fn rate(&self, velocities: &[Vector]) -> f64 {
        let own = dot(self.gradient, velocities[self.robot as usize]);
        match self.against {
            Against::Robot(other) => own + dot(self.gradient_other, velocities[other as usize]),
            Against::Wall(_) => own,
        }
    }
}

/// Fastest approach that a gap allows.
fn approach_m_per_s(gap_m: f64, limits: &Limits) -> f64 {
    if gap_m <= 0.0 {
        return 0.0;
    }
    (limits.approach_gain_per_s * gap_m).min((2.0 * limits.braking_m_per_s2 * gap_m).sqrt())
}

/// Writes the constraints of all robots, pairs and walls that could matter; robots in rising order.
///
/// - Coincident robots have no direction between them: both become obstacles.
pub fn collect(places: &mut [Place], half_arena: Vector, limits: &Limits, constraints: &mut Vec<Constraint>) {
    constraints.clear();
    stop_coincident(places);
    for (j, second) in places.iter().enumerate() {
        for (i, first) in places[..j].iter().enumerate() {
            pair([i, j], [first, second], limits, constraints);
        }
    }
    for (i, place) in places.iter().enumerate() {
        walls(i, place, half_arena, limits, constraints);
    }
}

fn stop_coincident(places: &mut [Place]) {
    for j in 0..places.len() {
        for i in 0..j {
            let (Some(a), Some(b)) = (places[i].position, places[j].position) else {
                continue;
            };
            if length(sub(a, b)) < COINCIDENT_M {
                places[i].movable = false;
                places[j].movable = false;
            }
        }
    }
}

fn pair(index: [usize; 2], [a, b]: [&Place; 2], limits: &Limits, constraints: &mut Vec<Constraint>) {
    let (Some(at_a), Some(at_b)) = (a.position, b.position) else {
        return;
    };
    if !a.movable && !b.movable {
        return;
    }
    let line = sub(at_a, at_b);
    let distance_m = length(line);
    if distance_m < COINCIDENT_M {
        return;
    }
    let n = scale(line, 1.0 / distance_m);
    let closing = (-dot(n, sub(a.velocity, b.velocity)))
        .max(-dot(n, sub(a.commanded, b.commanded)))
        .max(0.0);
    let latency_s = limits.latency_s + a.pose_age_s.max(b.pose_age_s);
    let gap_m = distance_m - a.radius_m - b.radius_m - limits.robot_margin_m - closing * latency_s;
    let approach = approach_m_per_s(gap_m, limits);
    // An obstacle that is still rolling towards the robot uses up part of the allowed approach.
    let obstacle = if b.movable { 0.0 } else { dot(n, b.velocity) } - if a.movable { 0.0 } else { dot(n, a.velocity) };
    let bound = (obstacle.max(0.0) - approach).min(0.0);
    if bound < -2.0 * limits.speed_m_per_s {
        return;
    }
    let gradient = a.reachable(n);
    let gradient_other = scale(b.reachable(n), -1.0);
    constraints.push(Constraint {
        robot: index[0] as u32,
        against: Against::Robot(index[1] as u32),
        bound,
        normal: n,
        gradient,
        gradient_other,
        multiplier: 0.0,
    });
}

fn walls(i: usize, place: &Place, half_arena: Vector, limits: &Limits, constraints: &mut Vec<Constraint>) {
    let Some(position) = place.position.filter(|_| place.movable) else {
        return;
    };
    let sides = [
        (WallSide::Left, [1.0, 0.0], half_arena[0] + position[0]),
        (WallSide::Right, [-1.0, 0.0], half_arena[0] - position[0]),
        (WallSide::Bottom, [0.0, 1.0], half_arena[1] + position[1]),
        (WallSide::Top, [0.0, -1.0], half_arena[1] - position[1]),
    ];
    for (side, n, distance_m) in sides {
        let closing = (-dot(n, place.velocity)).max(-dot(n, place.commanded)).max(0.0);
        let latency_s = limits.latency_s + place.pose_age_s;
        let gap_m = distance_m - place.radius_m - limits.wall_margin_m - closing * latency_s;
        let approach = approach_m_per_s(gap_m, limits);
        if approach <= limits.speed_m_per_s {
            constraints.push(Constraint {
                robot: i as u32,
                against: Against::Wall(side),
                bound: -approach,
                normal: n,
                gradient: place.reachable(n),
                gradient_other: [0.0, 0.0],
                multiplier: 0.0,
            });
        }
    }
}
