//! Outline of a component and the quadrilateral that fills it.

use super::DetectorSettings;

/// Four corners, px, anticlockwise as one sees them on the page.
pub(super) type Quad = [[f64; 2]; 4];

/// Least share of the hull that its quadrilateral must fill.
const FILL_MIN: f64 = 0.8;
/// Largest ratio of two sides.
const SIDES_RATIO_MAX: f64 = 2.0;

/// Convex hull of pixel squares given as `[from, to)` per row, in pixel coordinates (centres on whole numbers).
pub(super) fn outline(rows: &[[u32; 2]], top: u32, hull: &mut Vec<[f64; 2]>) {
    hull.clear();
    // Down the right side, then up the left side: each a monotone chain.
    let edges = |row: usize| [f64::from(top) + row as f64 - 0.5, f64::from(top) + row as f64 + 0.5];
    for (row, &[from, to]) in rows.iter().enumerate() {
        if from < to {
            let right = f64::from(to) - 0.5;
            edges(row).iter().for_each(|&v| push(hull, 0, [right, v]));
        }
    }
    let start = hull.len();
    for (row, &[from, to]) in rows.iter().enumerate().rev() {
        if from < to {
            let left = f64::from(from) - 0.5;
            edges(row).iter().rev().for_each(|&v| push(hull, start, [left, v]));
        }
    }
}

fn push(hull: &mut Vec<[f64; 2]>, start: usize, point: [f64; 2]) {
    while hull.len() >= start + 2 && cross(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0.0 {
        hull.pop();
    }
    hull.push(point);
}

/// Twice the signed area of a triangle; positive clockwise on the page (v points down).
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Quadrilateral of hull points: the farthest pair is a diagonal, the points farthest from it the other corners.
pub(super) fn quad_of_hull(hull: &[[f64; 2]], settings: &DetectorSettings) -> Option<Quad> {
    if hull.len() < 4 {
        return None;
    }
    let mut corner = [0usize; 4];
    let mut longest = 0.0;
    for (i, a) in hull.iter().enumerate() {
        for (j, b) in hull.iter().enumerate().skip(i + 1) {
            let distance = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
            if distance > longest {
                longest = distance;
                (corner[0], corner[2]) = (i, j);
            }
        }
    }
    // The hull runs clockwise: going from corner 2 on it comes back to corner 0 through corner 1's side.
    (corner[1], corner[3]) = (
        farthest(hull, corner[0], corner[2]),
        farthest(hull, corner[2], corner[0]),
    );
    (corner[0], corner[2]) = (
        farthest(hull, corner[3], corner[1]),
        farthest(hull, corner[1], corner[3]),
    );
    let quad = corner.map(|index| hull[index]);
    let area: f64 = (0..hull.len())
        .map(|i| cross(hull[0], hull[i], hull[(i + 1) % hull.len()]))
        .sum();
    let filled = cross(quad[0], quad[1], quad[2]) + cross(quad[0], quad[2], quad[3]);
    let sides = [0, 1, 2, 3].map(|i| {
        let (a, b) = (quad[i], quad[(i + 1) % 4]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    });
    let shortest = sides.iter().copied().fold(f64::INFINITY, f64::min);
    let longest = sides.iter().copied().fold(0.0, f64::max);
    let fits = filled >= FILL_MIN * area
        && shortest >= settings.edge_min_px
        && longest <= settings.edge_max_px
        && longest <= SIDES_RATIO_MAX * shortest;
    // Clockwise to anticlockwise.
    fits.then_some([quad[3], quad[2], quad[1], quad[0]])
}

/// Hull point strictly between two others (walking on from the first) that is farthest from their line.
fn farthest(hull: &[[f64; 2]], from: usize, to: usize) -> usize {
    let mut best = (0.0, from);
    let mut index = (from + 1) % hull.len();
    while index != to {
        let distance = cross(hull[from], hull[to], hull[index]).abs();
        if distance > best.0 {
            best = (distance, index);
        }
        index = (index + 1) % hull.len();
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 30 turned by 20 degrees around (50, 50), cut into pixel rows.
    fn rows() -> Vec<[u32; 2]> {
        let (sine, cosine) = 20f64.to_radians().sin_cos();
        let inside = |u: u32, v: u32| {
            let (x, y) = (f64::from(u) - 50.0, f64::from(v) - 50.0);
            (cosine * x + sine * y).abs() <= 15.0 && (cosine * y - sine * x).abs() <= 15.0
        };
        (20..80)
            .filter_map(|v| {
                let columns: Vec<u32> = (0..100).filter(|&u| inside(u, v)).collect();
                Some([*columns.first()?, columns.last()? + 1])
            })
            .collect()
    }

    #[test]
    fn a_turned_square_gives_its_corners_anticlockwise() {
        let rows = rows();
        let top = 50 - rows.len() as u32 / 2;
        let mut hull = Vec::new();
        outline(&rows, top, &mut hull);
        let quad = quad_of_hull(&hull, &DetectorSettings::default()).expect("a square");
        let area = cross(quad[0], quad[1], quad[2]) + cross(quad[0], quad[2], quad[3]);
        assert!(area < -2.0 * 800.0, "anticlockwise on the page, {area}");
        for corner in quad {
            assert!(
                ((corner[0] - 50.0).hypot(corner[1] - 50.0) - 15.0 * 2f64.sqrt()).abs() < 1.2,
                "{corner:?}"
            );
        }
    }

    #[test]
    fn a_triangle_is_no_quadrilateral() {
        let rows: Vec<[u32; 2]> = (0..40).map(|row| [20, 21 + row]).collect();
        let mut hull = Vec::new();
        outline(&rows, 5, &mut hull);
        assert_eq!(quad_of_hull(&hull, &DetectorSettings::default()), None);
    }
}
