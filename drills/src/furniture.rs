//! Discs and rectangles that stand in an arena, at random, clear of where robots start.

use crate::attack::RADIUS_M;
use api::arena::{FixedObstacle, Shape};
use api::experiment::Pose;
use emulator::noise::Noise;
use std::f64::consts::TAU;

/// Gap between the circles around an obstacle and a robot at its start.
const START_GAP_M: f64 = 0.03;
/// Half sides of the arena.
const HALF_ARENA_M: [f64; 2] = [2.0, 1.5];
/// Attempts for each obstacle; a full floor has fewer of them.
const ATTEMPTS: u32 = 200;

/// At most `count` obstacles between robots that start at `starts`: legs of tables, pillars, boxes, and partitions long and thin. They
/// may stand so close to each other, to walls and to robots that no robot fits between.
pub fn furniture(random: &mut Noise, starts: &[[f64; 3]], count: usize) -> Vec<FixedObstacle> {
    let mut standing: Vec<FixedObstacle> = Vec::with_capacity(count);
    let mut circles: Vec<([f64; 2], f64)> = starts.iter().map(|start| ([start[0], start[1]], RADIUS_M)).collect();
    for _ in 0..count {
        for _ in 0..ATTEMPTS {
            let shape = if random.uniform() < 0.5 {
                Shape::Circle {
                    radius_m: 0.02 + 0.25 * random.uniform(),
                }
            } else {
                Shape::Rectangle {
                    length_m: 0.1 + 0.9 * random.uniform(),
                    width_m: 0.04 + 0.3 * random.uniform(),
                }
            };
            let radius_m = around_m(shape);
            let place = HALF_ARENA_M.map(|half_m| (half_m - radius_m) * (2.0 * random.uniform() - 1.0));
            let yaw_rad = TAU * (random.uniform() - 0.5);
            let is_clear = |(centre, other_m): &([f64; 2], f64)| {
                (place[0] - centre[0]).hypot(place[1] - centre[1]) >= radius_m + other_m + START_GAP_M
            };
            if circles.iter().all(is_clear) {
                circles.push((place, radius_m));
                standing.push(FixedObstacle {
                    name: format!("obstacle-{}", standing.len() + 1),
                    shape,
                    pose: Pose {
                        x_m: place[0],
                        y_m: place[1],
                        yaw_rad,
                    },
                });
                break;
            }
        }
    }
    standing
}

/// Circle around a shape, m.
fn around_m(shape: Shape) -> f64 {
    match shape {
        Shape::Circle { radius_m } => radius_m,
        Shape::Rectangle { length_m, width_m } => 0.5 * length_m.hypot(width_m),
    }
}
