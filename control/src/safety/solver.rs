//! Projection of desired velocities onto the constraints: Hildreth's method, then one shortening that cannot fail.

use super::constraints::{Against, Constraint};
use crate::vector::{Vector, add, scale};

/// Most sweeps over all constraints.
pub const MAX_SWEEPS: u32 = 80;
/// The projection aims this far inside, so that what remains of the error does not matter.
const INSIDE_M_PER_S: f64 = 1e-3;
/// A sweep that moves less than this ends the iteration.
const SETTLED_M_PER_S: f64 = 1e-6;
/// A constraint counts as kept up to this rounding error.
pub const KEPT_M_PER_S: f64 = 1e-9;

/// Nearest velocities that keep the constraints, in place: `min sum |v - v_desired|^2`.
///
/// Coordinate ascent on the dual in fixed order [Hildreth 1957]; at most [`MAX_SWEEPS`] sweeps.
pub fn project(constraints: &mut [Constraint], velocities: &mut [Vector]) {
    for _ in 0..MAX_SWEEPS {
        let mut largest = 0.0_f64;
        for constraint in constraints.iter_mut() {
            let weight = constraint.weight();
            if weight < 1e-18 {
                continue;
            }
            let goal = constraint.bound + INSIDE_M_PER_S * weight.sqrt();
            let wanted = constraint.multiplier + (goal - constraint.rate(velocities)) / weight;
            let change = wanted.max(0.0) - constraint.multiplier;
            if change == 0.0 {
                continue;
            }
            constraint.multiplier += change;
            let own = constraint.robot as usize;
            velocities[own] = add(velocities[own], scale(constraint.gradient, change));
            if let Against::Robot(other) = constraint.against {
                let other = other as usize;
                velocities[other] = add(velocities[other], scale(constraint.gradient_other, change));
            }
            largest = largest.max(change.abs() * weight.sqrt());
        }
        if largest < SETTLED_M_PER_S {
            break;
        }
    }
}

/// Factor in [0, 1] by which both robots of a constraint must shorten their velocities to keep it.
pub fn shortening(constraint: &Constraint, velocities: &[Vector]) -> f64 {
    let rate = constraint.rate(velocities);
    if rate >= constraint.bound - KEPT_M_PER_S {
        1.0
    } else if constraint.bound < -KEPT_M_PER_S {
        (constraint.bound / rate).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Groups of robots that share constraints, as a forest over their indices.
#[derive(Debug, Clone)]
pub struct Groups {
    parent: Vec<u32>,
}

impl Groups {
    pub fn new(robots: usize) -> Groups {
        Groups {
            parent: (0..robots as u32).collect(),
        }
    }

    pub fn reset(&mut self) {
        for (i, parent) in self.parent.iter_mut().enumerate() {
            *parent = i as u32;
        }
    }

    /// Smallest index of the group.
    pub fn of(&self, robot: usize) -> usize {
        let mut at = robot;
        while self.parent[at] as usize != at {
            at = self.parent[at] as usize;
        }
        at
    }

    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        self.parent[high] = low as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(robot: u32, n: Vector, bound: f64) -> Constraint {
        let against = Against::Wall(super::super::WallSide::Left);
        Constraint {
            robot,
            against,
            bound,
            normal: n,
            gradient: n,
            gradient_other: [0.0, 0.0],
            multiplier: 0.0,
        }
    }

    #[test]
    fn projection_onto_a_corner_is_the_corner() {
        let mut constraints = [wall(0, [1.0, 0.0], -0.1), wall(0, [0.0, 1.0], -0.2)];
        let mut velocities = [[-1.0, -1.0]];
        project(&mut constraints, &mut velocities);
        assert!(
            (velocities[0][0] + 0.099).abs() < 1e-6 && (velocities[0][1] + 0.199).abs() < 1e-6,
            "{velocities:?}"
        );
    }

    #[test]
    fn two_robots_share_the_change_equally() {
        let pair = Constraint {
            robot: 0,
            against: Against::Robot(1),
            bound: 0.0,
            normal: [-1.0, 0.0],
            gradient: [-1.0, 0.0],
            gradient_other: [1.0, 0.0],
            multiplier: 0.0,
        };
        let mut velocities = [[0.5, 0.1], [-0.3, 0.0]];
        project(&mut [pair], &mut velocities);
        assert!((velocities[0][0] - velocities[1][0]).abs() < 2e-3);
        assert!((velocities[0][0] - 0.1).abs() < 1e-3 && velocities[0][1] == 0.1);
    }

    #[test]
    fn shortening_keeps_the_bound() {
        let constraint = wall(0, [1.0, 0.0], -0.1);
        let factor = shortening(&constraint, &[[-0.4, 0.0]]);
        assert!((factor - 0.25).abs() < 1e-12);
        assert_eq!(shortening(&wall(0, [1.0, 0.0], 0.0), &[[-0.4, 0.0]]), 0.0);
        assert_eq!(shortening(&constraint, &[[0.4, 0.0]]), 1.0);
    }
}
