//! Collisions: bodies that can touch something in the next tick are solved together by rapier for that tick.
//!
//! The solver's world is built anew every tick from the bodies' own states, in robot order, so nothing of it has to be
//! stored. Wheels stay with the kernel and floor friction of obstacles with [`crate::world`]: each physics step first
//! integrates a body with those forces, then gives rapier the pose before and the velocity after; what rapier changes
//! is the impulse of the collision. A robot that was hit takes the step again with that impulse as a force spread over
//! it, so that its wheels turn as those of a body that was held, and the collision is solved again ([`tick`]).

mod furniture;
mod solver;
mod sweep;
mod tick;

pub(crate) use furniture::Furniture;
pub(crate) use sweep::{Sweep, Swept};
pub(crate) use tick::{Bodies, Touches, resolve_tick};

use std::sync::Arc;

use crate::CONTROL_PERIOD_S;
use crate::model::Model;
use crate::state::BodyState;
use crate::world::floor::Floor;
use crate::world::obstacle::ObstacleBody;

/// Added to the swept radius against rounding, m.
const SWEEP_MARGIN_M: f64 = 1e-3;

/// Distance that any body may cover in the next tick, m, collisions with faster ones included.
pub(crate) fn reach_m(
    models: &[Arc<Model>],
    states: &[BodyState],
    floor: &Floor,
    obstacles: (&Furniture, &[ObstacleBody]),
) -> f64 {
    let mut reach = 0.0_f64;
    let mut fastest_squared = 0.0_f64;
    for (model, state) in models.iter().zip(states) {
        fastest_squared = fastest_squared.max(state.u * state.u + state.v * state.v);
        reach = reach.max(model.max_acceleration_m_per_s2());
    }
    reach = reach * floor.largest_scale() + floor.pull_m_per_s2();
    for (obstacle, body) in obstacles.0.pushable.iter().zip(obstacles.1) {
        let [vx, vy, _] = body.velocity;
        fastest_squared = fastest_squared.max(vx * vx + vy * vy);
        reach = reach.max(obstacle.largest_pull_m_per_s2());
    }
    fastest_squared.sqrt() * CONTROL_PERIOD_S + 0.5 * reach * CONTROL_PERIOD_S * CONTROL_PERIOD_S + SWEEP_MARGIN_M
}
