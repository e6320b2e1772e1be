//! Moves of a patch of which runs meet one side alone.
//!
//! Where wheels cross an edge and never the middle, they tell where that edge is, and neither how large the patch is nor where its middle: centre and radius change
//! together or not at all. Steps along one axis at a time move the edge and end at once; these moves leave the middle of what was met on the edge.

/// Of what is met farther from the middle than this share of the radius one side is met.
const OFF_THE_MIDDLE: f64 = 0.3;
/// Moves that [`moves`] gives: larger, smaller, turned about the edge to the left and to the right.
pub(super) const COUNT: usize = 4;
pub(super) const LARGER: usize = 0;

/// Radii of larger patches with the same edge, as multiples.
const MULTIPLES: [f64; 3] = [1.5, 2.0, 3.0];

/// The edge of a patch that is met from one side.
struct Edge {
    at_m: [f64; 2],
    /// From the middle of the patch to it, of length 1.
    toward: [f64; 2],
    radius_m: f64,
}

impl Edge {
    /// `None` where the whole patch is met, or none of it.
    fn of(values: &[f64], positions_m: impl Iterator<Item = [f64; 2]>, reach_m: f64) -> Option<Edge> {
        let &[x_m, y_m, radius_m, ..] = values else { return None };
        let (mut met, mut sum) = (0.0, [0.0; 2]);
        for [x, y] in positions_m {
            let off = [x - x_m, y - y_m];
            if libm::sqrt(off[0] * off[0] + off[1] * off[1]) < radius_m + reach_m {
                met += 1.0;
                sum = [sum[0] + off[0], sum[1] + off[1]];
            }
        }
        if met == 0.0 {
            return None;
        }
        let mean = sum.map(|sum| sum / met);
        let distance_m = libm::sqrt(mean[0] * mean[0] + mean[1] * mean[1]);
        if distance_m < OFF_THE_MIDDLE * radius_m {
            return None;
        }
        let toward = mean.map(|part| part / distance_m);
        let at_m = [x_m + radius_m * toward[0], y_m + radius_m * toward[1]];
        Some(Edge { at_m, toward, radius_m })
    }

    /// A patch with this edge, this radius, and its middle turned about the edge.
    fn patch(&self, values: &[f64], radius_m: f64, angle: f64) -> Vec<f64> {
        let (sin, cos) = libm::sincos(angle);
        let [x, y] = self.toward;
        let mut patch = values.to_vec();
        patch[0] = self.at_m[0] - radius_m * (cos * x - sin * y);
        patch[1] = self.at_m[1] - radius_m * (sin * x + cos * y);
        patch[2] = radius_m;
        patch
    }
}

/// Patches with `step_m` more and less of the radius, and with the middle `step_m` farther on either side; `None` where the whole patch is met, or none of it.
///
/// - `values`: centre and radius, m, and what else the patch has.
/// - `positions_m`: of the robot's middle; `reach_m`: from there to the farthest wheel.
pub(super) fn moves(
    values: &[f64],
    positions_m: impl Iterator<Item = [f64; 2]>,
    reach_m: f64,
    step_m: f64,
) -> Option<[Vec<f64>; COUNT]> {
    let edge = Edge::of(values, positions_m, reach_m)?;
    let angle = step_m / edge.radius_m;
    Some([
        edge.patch(values, edge.radius_m + step_m, 0.0),
        edge.patch(values, (edge.radius_m - step_m).max(0.0), 0.0),
        edge.patch(values, edge.radius_m, angle),
        edge.patch(values, edge.radius_m, -angle),
    ])
}

/// Larger patches with the same edge, which the runs that met it from one side do not tell from it; arguments as of [`moves`].
pub fn larger_patches(values: &[f64], positions_m: impl Iterator<Item = [f64; 2]>, reach_m: f64) -> Vec<Vec<f64>> {
    let Some(edge) = Edge::of(values, positions_m, reach_m) else {
        return Vec::new();
    };
    let larger = MULTIPLES.map(|multiple| edge.patch(values, multiple * edge.radius_m, 0.0));
    larger.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge_x(values: &[f64]) -> f64 {
        values[0] - values[2]
    }

    #[test]
    fn the_edge_that_is_met_stays_where_it_is() {
        let patch = [0.2, 0.1, 0.3, 0.5];
        let west = [[-0.2, 0.1], [-0.1, 0.2], [-0.1, 0.0], [-3.0, 0.0]];
        let [larger, smaller, left, right] = moves(&patch, west.into_iter(), 0.2, 0.05).expect("one side is met");
        for moved in [&larger, &smaller] {
            assert!((edge_x(moved) - edge_x(&patch)).abs() < 1e-12, "{moved:?}");
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
    fn a_patch_that_is_driven_through_or_not_at_all_has_no_such_moves() {
        let patch = [0.2, 0.1, 0.3, 0.5];
        let through = [[-0.1, 0.1], [0.2, 0.1], [0.5, 0.12]];
        assert_eq!(moves(&patch, through.into_iter(), 0.2, 0.05), None);
        assert_eq!(moves(&patch, [[2.0, 2.0]].into_iter(), 0.2, 0.05), None);
        assert_eq!(moves(&patch, core::iter::empty(), 0.2, 0.05), None);
    }

    #[test]
    fn larger_patches_have_the_same_edge() {
        let west = [[-0.2, 0.1], [-0.1, 0.2], [-0.1, 0.0]];
        let larger = larger_patches(&[0.2, 0.1, 0.3, 0.5], west.into_iter(), 0.2);
        assert_eq!(larger.len(), MULTIPLES.len());
        for patch in &larger {
            assert!(
                (edge_x(patch) + 0.1).abs() < 1e-12 && patch[2] > 0.3 && patch[3] == 0.5,
                "{patch:?}"
            );
        }
        assert!(larger_patches(&[0.2, 0.1, 0.3, 0.5], core::iter::empty(), 0.2).is_empty());
    }

    #[test]
    fn a_radius_does_not_become_negative() {
        let [_, smaller, ..] = moves(&[0.0, 0.0, 0.03, 0.5], [[0.1, 0.0]].into_iter(), 0.2, 0.1).expect("one side");
        assert_eq!(smaller[2], 0.0);
    }
}
