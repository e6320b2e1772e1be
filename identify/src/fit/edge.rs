//! Moves of a patch of which runs meet one side alone.
//!
//! Where wheels cross an edge and never the middle, they tell where that edge is, and neither how large the patch is nor where its middle: centre and radius change
//! together or not at all. Steps along one axis at a time move the edge and end at once; these moves leave it where it is.

/// Positions whose mean is farther from the middle than this share of the distance within which they count met one side.
const OFF_THE_MIDDLE: f64 = 0.3;
/// A patch shrinks to this part of its radius at once, and turns about its edge by so much, rad.
const LEAST_PART: f64 = 0.5;
const MOST_TURN_RAD: f64 = 0.5;
/// Radii of larger patches with the same edge, as multiples.
const MULTIPLES: [f64; 3] = [1.5, 2.0, 3.0];

/// How a patch moves about its edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Move {
    Larger,
    Smaller,
    Left,
    Right,
}

impl Move {
    pub(super) const ALL: [Move; 4] = [Move::Larger, Move::Smaller, Move::Left, Move::Right];
}

/// The edge of a patch that is met from one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    at_m: [f64; 2],
    /// From the middle of the patch to it, of length 1.
    toward: [f64; 2],
}

impl Edge {
    /// `None` where the whole patch is met, or none of it.
    ///
    /// - `values`: centre and radius, m, and what else the patch has.
    /// - `positions_m`: of the robot's middle; `reach_m`: from there to the farthest wheel. Each counts by how far wheels may be beyond the edge.
    pub(super) fn of(values: &[f64], positions_m: impl Iterator<Item = [f64; 2]>, reach_m: f64) -> Option<Edge> {
        let &[x_m, y_m, radius_m, ..] = values else { return None };
        let within_m = radius_m + reach_m;
        let (mut depth, mut sum) = (0.0, [0.0; 2]);
        for [x, y] in positions_m {
            let off = [x - x_m, y - y_m];
            let own = within_m - length(off);
            if own > 0.0 {
                depth += own;
                sum = [sum[0] + own * off[0], sum[1] + own * off[1]];
            }
        }
        let mean = sum.map(|sum| sum / depth);
        let distance_m = length(mean);
        // Nothing that counts makes it NaN.
        if distance_m.is_nan() || distance_m < OFF_THE_MIDDLE * within_m {
            return None;
        }
        let toward = mean.map(|part| part / distance_m);
        let at_m = [x_m + radius_m * toward[0], y_m + radius_m * toward[1]];
        Some(Edge { at_m, toward })
    }

    /// A patch with this edge, `step_m` more or less of the radius, or its middle so much farther on one side.
    pub(super) fn moved(&self, values: &[f64], way: Move, step_m: f64) -> Vec<f64> {
        let radius_m = values[2];
        let angle = (step_m / radius_m).min(MOST_TURN_RAD);
        match way {
            Move::Larger => self.patch(values, radius_m + step_m, 0.0),
            Move::Smaller => self.patch(values, (radius_m - step_m).max(LEAST_PART * radius_m), 0.0),
            Move::Left => self.patch(values, radius_m, angle),
            Move::Right => self.patch(values, radius_m, -angle),
        }
    }

    /// A patch with this edge, this radius, and its middle turned about the edge.
    fn patch(&self, values: &[f64], radius_m: f64, angle: f64) -> Vec<f64> {
        let (sin, cos) = libm::sincos(angle);
        let [x, y] = [
            cos * self.toward[0] - sin * self.toward[1],
            sin * self.toward[0] + cos * self.toward[1],
        ];
        let mut patch = values.to_vec();
        patch[0] = self.at_m[0] - radius_m * x;
        patch[1] = self.at_m[1] - radius_m * y;
        patch[2] = radius_m;
        patch
    }

    /// The edge as it is after the patch was turned about it.
    pub(super) fn after(&self, values: &[f64]) -> Edge {
        let off = [self.at_m[0] - values[0], self.at_m[1] - values[1]];
        let distance_m = length(off);
        Edge {
            at_m: self.at_m,
            toward: off.map(|part| part / distance_m),
        }
    }
}

/// Larger patches with the same edge, which runs that met it from one side do not tell from it; arguments as of [`Edge::of`].
pub fn larger_patches(values: &[f64], positions_m: impl Iterator<Item = [f64; 2]>, reach_m: f64) -> Vec<Vec<f64>> {
    let Some(edge) = Edge::of(values, positions_m, reach_m) else {
        return Vec::new();
    };
    let larger = MULTIPLES.map(|multiple| edge.patch(values, multiple * values[2], 0.0));
    larger.into()
}

fn length([x, y]: [f64; 2]) -> f64 {
    libm::sqrt(x * x + y * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATCH: [f64; 4] = [0.2, 0.1, 0.3, 0.5];
    const WEST: [[f64; 2]; 4] = [[-0.2, 0.1], [-0.1, 0.2], [-0.1, 0.0], [-3.0, 0.0]];

    fn from_the_west() -> Edge {
        Edge::of(&PATCH, WEST.into_iter(), 0.2).expect("one side is met")
    }

    fn edge_x(values: &[f64]) -> f64 {
        values[0] - values[2]
    }

    #[test]
    fn the_edge_that_is_met_stays_where_it_is() {
        let edge = from_the_west();
        let [larger, smaller, left, right] = Move::ALL.map(|way| edge.moved(&PATCH, way, 0.05));
        for moved in [&larger, &smaller] {
            assert!((edge_x(moved) - edge_x(&PATCH)).abs() < 1e-12, "{moved:?}");
            assert!((moved[1] - 0.1).abs() < 1e-12 && moved[3] == 0.5, "{moved:?}");
        }
        assert!((larger[2] - 0.35).abs() < 1e-12 && (smaller[2] - 0.25).abs() < 1e-12);
        for moved in [&left, &right] {
            let from_edge = libm::hypot(moved[0] + 0.1, moved[1] - 0.1);
            assert!((from_edge - 0.3).abs() < 1e-12 && moved[2] == 0.3, "{moved:?}");
            assert!(
                (libm::hypot(moved[0] - 0.2, moved[1] - 0.1) - 0.05).abs() < 1e-3,
                "{moved:?}"
            );
        }
        assert!((left[1] - 0.1) * (right[1] - 0.1) < 0.0, "one on either side");
    }

    #[test]
    fn a_patch_that_was_turned_goes_on_about_the_same_edge() {
        let edge = from_the_west();
        let left = edge.moved(&PATCH, Move::Left, 0.05);
        let larger = edge.after(&left).moved(&left, Move::Larger, 0.1);
        let from_edge = libm::hypot(larger[0] + 0.1, larger[1] - 0.1);
        assert!(
            (from_edge - 0.4).abs() < 1e-12 && (larger[2] - 0.4).abs() < 1e-12,
            "{larger:?}"
        );
    }

    #[test]
    fn a_small_patch_neither_vanishes_nor_turns_over() {
        let small = [0.2, 0.1, 0.05, 0.5];
        let edge = Edge::of(&small, WEST.into_iter(), 0.5).expect("one side is met");
        assert_eq!(edge.moved(&small, Move::Smaller, 0.15)[2], 0.025);
        for way in [Move::Left, Move::Right] {
            let moved = edge.moved(&small, way, 0.15);
            assert!(libm::hypot(moved[0] - 0.2, moved[1] - 0.1) < 0.03, "{moved:?}");
        }
    }

    #[test]
    fn a_patch_that_is_driven_through_or_not_at_all_has_no_such_edge() {
        let through = [[-0.1, 0.12], [0.2, 0.14], [0.5, 0.16]];
        assert_eq!(Edge::of(&PATCH, through.into_iter(), 0.2), None);
        assert_eq!(Edge::of(&PATCH, [[2.0, 2.0]].into_iter(), 0.2), None);
        assert_eq!(Edge::of(&PATCH, core::iter::empty(), 0.2), None);
    }

    #[test]
    fn who_waits_beside_a_patch_did_not_meet_it_there() {
        let waiting = (0..200).map(|_| [0.2, -0.39]);
        let crossing = (0..20).map(|_| [0.0, 0.1]);
        let edge = Edge::of(&PATCH, waiting.chain(crossing), 0.2).expect("one side is met");
        assert!(edge.toward[0] < -0.6, "{edge:?}");
    }

    #[test]
    fn larger_patches_have_the_same_edge() {
        let larger = larger_patches(&PATCH, WEST.into_iter(), 0.2);
        assert_eq!(larger.len(), MULTIPLES.len());
        for patch in &larger {
            assert!(
                (edge_x(patch) + 0.1).abs() < 1e-12 && patch[2] > 0.3 && patch[3] == 0.5,
                "{patch:?}"
            );
        }
        assert!(larger_patches(&PATCH, core::iter::empty(), 0.2).is_empty());
    }
}
