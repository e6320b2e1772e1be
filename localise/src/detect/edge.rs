//! Edges of a quadrilateral to a fraction of a pixel, and the corners where they meet.

use super::DetectorSettings;
use super::quad::Quad;
use crate::frame::Frame;
use crate::lens::Lens;

/// Corners after refinement, anticlockwise on the page.
#[derive(Debug, Clone)]
pub(super) struct Edges {
    pub(super) corners: [[f64; 2]; 4],
    pub(super) corners_px: [[f64; 2]; 4],
    pub(super) rms_px: f64,
}

/// Steps across an edge, px.
const STEP_PX: f64 = 0.5;
/// Half widths of the windows across an edge, px: first from the outline's pixels, then centred on the edge itself.
const REACH_PX: [f64; 2] = [2.5, 2.0];
/// Part of a side next to its ends that is left out: corners are rounded by the lens.
const END: f64 = 0.08;
/// Points on one edge.
const POINTS_MIN: usize = 6;
const POINTS_MAX: usize = 64;
/// Distance from the picture's border, px, that a tag needs.
const BORDER_PX: f64 = 1.5;

/// a x + b y = c with a^2 + b^2 = 1.
#[derive(Debug, Clone, Copy)]
struct Line {
    normal: [f64; 2],
    offset: f64,
}

/// Fits the four edges twice, first in pixels, then straightened through the lens.
pub(super) fn refine(frame: &Frame<'_>, lens: &Lens, quad: &Quad, settings: &DetectorSettings) -> Option<Edges> {
    let mut points: Vec<[f64; 2]> = Vec::with_capacity(POINTS_MAX);
    let mut lines = [Line {
        normal: [0.0; 2],
        offset: 0.0,
    }; 4];
    for (side, line) in lines.iter_mut().enumerate() {
        edge_points(
            frame,
            quad[side],
            quad[(side + 1) % 4],
            REACH_PX[0],
            settings,
            &mut points,
        );
        (*line, _) = fit(&mut points)?;
    }
    let coarse = corners(&lines)?;
    let width = frame.width_px() as f64 - 1.0 - BORDER_PX;
    let height = frame.height_px() as f64 - 1.0 - BORDER_PX;
    let inside = |p: &[f64; 2]| p[0] >= BORDER_PX && p[1] >= BORDER_PX && p[0] <= width && p[1] <= height;
    if !coarse.iter().all(inside) {
        return None;
    }
    let mut square_sum = 0.0;
    for (side, line) in lines.iter_mut().enumerate() {
        edge_points(
            frame,
            coarse[side],
            coarse[(side + 1) % 4],
            REACH_PX[1],
            settings,
            &mut points,
        );
        for point in &mut points {
            *point = lens.undistort(*point)?;
        }
        let rms;
        (*line, rms) = fit(&mut points)?;
        square_sum += rms * rms;
    }
    let corners = corners(&lines)?;
    let corners_px = corners.map(|corner| lens.distort(corner));
    let moved = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let rms_px = (square_sum / 4.0).sqrt() * lens.focal_px[0];
    let plausible = rms_px <= settings.edge_rms_max_px && (0..4).all(|i| moved(corners_px[i], coarse[i]) < 1.5);
    plausible.then_some(Edges {
        corners,
        corners_px,
        rms_px,
    })
}

/// Where the grey value rises across the side from one corner to the next, dark on the left of the walk.
///
/// The position is the centroid of the squared slope, which for a blurred straight edge is the edge itself.
fn edge_points(
    frame: &Frame<'_>,
    from: [f64; 2],
    to: [f64; 2],
    reach_px: f64,
    settings: &DetectorSettings,
    points: &mut Vec<[f64; 2]>,
) {
    points.clear();
    let (du, dv) = (to[0] - from[0], to[1] - from[1]);
    let length = du.hypot(dv);
    let outward = [-dv / length, du / length];
    let count = (length.round() as usize).clamp(POINTS_MIN + 2, POINTS_MAX);
    let steps = (2.0 * reach_px / STEP_PX).round() as usize;
    for index in 0..count {
        let along = END + (1.0 - 2.0 * END) * (index as f64 + 0.5) / count as f64;
        let base = [from[0] + along * du, from[1] + along * dv];
        let place = |across: f64| [base[0] + across * outward[0], base[1] + across * outward[1]];
        let mut last = frame.sample(place(-reach_px));
        let (mut weight, mut moment, mut rise) = (0.0, 0.0, 0.0);
        for step in 0..steps {
            let across = -reach_px + STEP_PX * (step + 1) as f64;
            let next = frame.sample(place(across));
            let slope = f64::from((next - last).max(0.0));
            weight += slope * slope;
            moment += slope * slope * (across - STEP_PX / 2.0);
            rise += slope;
            last = next;
        }
        if rise >= f64::from(settings.contrast_min) * 0.6 {
            points.push(place(moment / weight));
        }
    }
}

/// Total least squares line, once more without the points that stand out.
///
/// - Returns the line and the root mean square distance of the points that were kept; half of them must be.
fn fit(points: &mut Vec<[f64; 2]>) -> Option<(Line, f64)> {
    let wanted = POINTS_MIN.max(points.len() / 2);
    let (line, rms) = fit_all(points)?;
    let limit = 2.5 * rms;
    points.retain(|point| (line.normal[0] * point[0] + line.normal[1] * point[1] - line.offset).abs() <= limit);
    if points.len() < wanted {
        return None;
    }
    fit_all(points)
}

fn fit_all(points: &[[f64; 2]]) -> Option<(Line, f64)> {
    if points.len() < POINTS_MIN {
        return None;
    }
    let count = points.len() as f64;
    let mean = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count);
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for point in points {
        let (u, v) = (point[0] - mean[0], point[1] - mean[1]);
        uu += u * u;
        uv += u * v;
        vv += v * v;
    }
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    let normal = [-angle.sin(), angle.cos()];
    let offset = normal[0] * mean[0] + normal[1] * mean[1];
    let square_sum = normal[0] * normal[0] * uu + 2.0 * normal[0] * normal[1] * uv + normal[1] * normal[1] * vv;
    Some((Line { normal, offset }, (square_sum.max(0.0) / count).sqrt()))
}

/// Corner `i` is where side `i - 1` meets side `i`.
fn corners(lines: &[Line; 4]) -> Option<[[f64; 2]; 4]> {
    let mut out = [[0.0; 2]; 4];
    for (index, corner) in out.iter_mut().enumerate() {
        let (a, b) = (&lines[(index + 3) % 4], &lines[index]);
        let determinant = a.normal[0] * b.normal[1] - a.normal[1] * b.normal[0];
        if determinant.is_nan() || determinant.abs() < 0.3 {
            return None;
        }
        corner[0] = (a.offset * b.normal[1] - b.offset * a.normal[1]) / determinant;
        corner[1] = (a.normal[0] * b.offset - b.normal[0] * a.offset) / determinant;
    }
    Some(out)
}
