//! Steering of a robot that cannot lose its speed at once.

use super::SafetyFilter;
use crate::safety::chassis::Motion;
use crate::vector::{Vector, add, dot, heading, scale};

/// Shares of the curvature asked for that are tried, and points of the way that are looked at.
const SHARES: [f64; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
const POINTS: u32 = 4;

impl SafetyFilter {
    /// Curvature for a steered robot: as asked, or as much less as keeps the way it still needs to come to rest off walls,
    /// fence and obstacles.
    ///
    /// The rows lower the speed of a robot that steers towards something, but it steers at once and slows down later: at
    /// the speed it still has it would swing further than the rows know.
    pub(super) fn steadied(&self, i: usize, curvature: f64) -> f64 {
        let place = &self.places[i];
        let steered = matches!(self.chassis[i].motion, Motion::Steered { .. });
        let Some(at) = place.position.filter(|_| steered && curvature != 0.0) else {
            return curvature;
        };
        let (seen, sent) = (
            dot(place.heading, place.velocity),
            self.filtered[i].command.twist.forward_m_per_s,
        );
        let speed = if seen.abs() > sent.abs() { seen } else { sent };
        let way_m = 0.5 * speed * speed.abs() / self.limits.braking_m_per_s2;
        let from = add(at, scale(place.heading, speed * place.reaction_s));
        let room_m = |share: f64| {
            let bent = share * curvature;
            (1..=POINTS).fold(f64::INFINITY, |least, k| {
                let gone_m = way_m * f64::from(k) / f64::from(POINTS);
                least.min(self.room_m(i, arc(from, place.later, bent, gone_m)))
            })
        };
        let enough_m = self.limits.pose_error_m + 0.5 * self.limits.wall_margin_m;
        let (mut best, mut most_m) = (curvature, f64::NEG_INFINITY);
        for share in SHARES {
            let room_m = room_m(share);
            if room_m >= enough_m {
                return share * curvature;
            }
            if room_m > most_m + 1e-9 {
                (best, most_m) = (share * curvature, room_m);
            }
        }
        best
    }

    /// Distance of a robot's circle from what stands still, were it at `point`.
    fn room_m(&self, i: usize, point: Vector) -> f64 {
        let [half_x, half_y] = self.scene.half_arena_m;
        let walls_m = (half_x - point[0].abs()).min(half_y - point[1].abs());
        let fence_m = self.scene.fence.as_ref().map_or(f64::INFINITY, |fence| {
            let inside = fence.holds(point);
            let sides = (0..fence.sides()).map(|side| fence.clearance(side, point, inside).0);
            let nearest_m = sides.fold(f64::INFINITY, |least, side_m| least.min(side_m.abs()));
            if inside { nearest_m } else { -nearest_m }
        });
        let bodies_m = self.scene.bodies.iter().map(|body| body.clearance(point).0);
        let moving = self.scene.moving.iter();
        let moving_m = moving.map(|disc| disc.clearance_m(point, &self.places[i], &self.limits));
        let still_m = bodies_m.fold(walls_m.min(fence_m), f64::min);
        moving_m.fold(still_m, f64::min) - self.radii_m[i]
    }
}

/// Where a way of `gone_m` along an arc ends; backwards when it is negative.
fn arc(from: Vector, ahead: Vector, curvature: f64, gone_m: f64) -> Vector {
    let half = 0.5 * curvature * gone_m;
    let [cos, sin] = heading(half);
    // The chord: as long as sin(x) / x of the arc, turned by half of its angle.
    let chord_m = if half.abs() < 1e-6 { gone_m } else { gone_m * sin / half };
    let along = [ahead[0] * cos - ahead[1] * sin, ahead[1] * cos + ahead[0] * sin];
    add(from, scale(along, chord_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::length;

    #[test]
    fn an_arc_ends_where_its_circle_says() {
        // A quarter of a circle of 2 m to the left, and to the right backwards.
        let quarter_m = core::f64::consts::PI;
        let end = arc([1.0, 1.0], [1.0, 0.0], 0.5, quarter_m);
        assert!(length([end[0] - 3.0, end[1] - 3.0]) < 1e-12, "{end:?}");
        let end = arc([1.0, 1.0], [1.0, 0.0], -0.5, -quarter_m);
        assert!(length([end[0] + 1.0, end[1] + 1.0]) < 1e-12, "{end:?}");
        assert_eq!(arc([0.0, 0.0], [0.0, 1.0], 0.0, 0.7), [0.0, 0.7]);
    }
}
