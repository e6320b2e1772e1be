//! From the unit square of a tag to a quadrilateral.

/// Projective map of [-1, 1] x [-1, 1] onto four corners given as (-1,-1), (1,-1), (1,1), (-1,1)  [Heckbert 1989, 2.2.3].
///
/// - Returns rows of the 3 x 3 matrix, or `None` if the last three corners stand on a line.
pub(super) fn square_to_quad(corners: &[[f64; 2]; 4]) -> Option<[[f64; 3]; 3]> {
    let [p0, p1, p2, p3] = *corners;
    let sum = [0, 1].map(|axis| p0[axis] - p1[axis] + p2[axis] - p3[axis]);
    let first = [0, 1].map(|axis| p1[axis] - p2[axis]);
    let second = [0, 1].map(|axis| p3[axis] - p2[axis]);
    let determinant = first[0] * second[1] - second[0] * first[1];
    let size = (first[0].hypot(first[1])) * second[0].hypot(second[1]);
    if determinant.is_nan() || determinant.abs() < 1e-3 * size {
        return None;
    }
    let g = (sum[0] * second[1] - second[0] * sum[1]) / determinant;
    let h = (first[0] * sum[1] - sum[0] * first[1]) / determinant;
    let a = [0, 1].map(|axis| p1[axis] - p0[axis] + g * p1[axis]);
    let b = [0, 1].map(|axis| p3[axis] - p0[axis] + h * p3[axis]);
    // From (s, t) in [0, 1] to (x, y) = 2 (s, t) - 1.
    let row = |a: f64, b: f64, c: f64| [a / 2.0, b / 2.0, c + (a + b) / 2.0];
    Some([row(a[0], b[0], p0[0]), row(a[1], b[1], p0[1]), row(g, h, 1.0)])
}

/// A point through the map.
pub(super) fn apply(map: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let [u, v, w] = map.map(|row| row[0] * x + row[1] * y + row[2]);
    [u / w, v / w]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_go_to_corners_and_the_centre_to_where_the_diagonals_cross() {
        let quad = [[1.0, 1.0], [5.0, 1.5], [4.0, 4.0], [0.5, 3.0]];
        let map = square_to_quad(&quad).expect("convex");
        for (from, to) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .into_iter()
            .zip(quad)
        {
            let got = apply(&map, from);
            assert!((got[0] - to[0]).abs() < 1e-12 && (got[1] - to[1]).abs() < 1e-12);
        }
        let [u, v] = apply(&map, [0.0, 0.0]);
        let on = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0]);
        assert!(on(quad[0], quad[2]).abs() < 1e-12 && on(quad[1], quad[3]).abs() < 1e-12);
        assert_eq!(square_to_quad(&[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), None);
    }
}
