//! One robot in one exposure, ready to be painted pixel by pixel.
//!
//! A plane at height h is an affine map of a pixel's slope ([`super::optics::Optics::slope`]), so tag and body are each one affine
//! map an instant. A pixel's value is the mean over points spread in the pixel and over the instants; pixels whose points must
//! all agree take one look.

use super::blur::Region;
use super::cell_table::CellTable;
use super::optics::Optics;
use super::pattern::pattern;
use super::robot_view::RobotShape;
use super::tag::{CELL_M, CELLS, Tag};
use crate::plant::Pose;

/// A robot whose tag or body is nearer to the lens's height than this is not drawn.
const LEAST_DESCENT_M: f64 = 0.05;
/// Points around a body's rim that find its place in the picture.
const RIM_POINTS: u32 = 16;
/// Half a tag with its margin, to its corner.
const TAG_REACH_M: f64 = CELL_M * CELLS as f64 / 2.0 * std::f64::consts::SQRT_2;

/// `origin + along_x sx + along_y sy` for a slope `[sx, sy]`.
#[derive(Debug, Clone, Copy)]
struct Affine {
    origin: [f32; 2],
    along_x: [f32; 2],
    along_y: [f32; 2],
}

impl Affine {
    /// `scale * turn(-yaw) (world - centre) + shift`, mirrored if the second axis points down; world = position + descent slope.
    fn new(optics: &Optics, height_m: f64, pose: Pose, plane: Plane) -> Self {
        let descent_m = optics.position_m[2] - height_m;
        let (sin, cos) = if plane.turns {
            pose.yaw_rad.sin_cos()
        } else {
            (0.0, 1.0)
        };
        let down = if plane.turns { -1.0 } else { 1.0 };
        let (x_m, y_m) = (optics.position_m[0] - pose.x_m, optics.position_m[1] - pose.y_m);
        let (scale, shift) = (plane.per_metre, plane.shift);
        Self {
            origin: [
                (shift + scale * (cos * x_m + sin * y_m)) as f32,
                (shift + down * scale * (-sin * x_m + cos * y_m)) as f32,
            ],
            along_x: [
                (scale * cos * descent_m) as f32,
                (-down * scale * sin * descent_m) as f32,
            ],
            along_y: [
                (scale * sin * descent_m) as f32,
                (down * scale * cos * descent_m) as f32,
            ],
        }
    }

    #[inline(always)]
    fn at(&self, [sx, sy]: [f32; 2]) -> [f32; 2] {
        [
            self.origin[0] + self.along_x[0] * sx + self.along_y[0] * sy,
            self.origin[1] + self.along_x[1] * sx + self.along_y[1] * sy,
        ]
    }

    /// What a small change of slope adds.
    fn change(&self, [sx, sy]: [f64; 2]) -> [f32; 2] {
        [0, 1].map(|axis| (f64::from(self.along_x[axis]) * sx + f64::from(self.along_y[axis]) * sy) as f32)
    }

    /// The slope whose image is `point`; `None` if the map is flat.
    fn back(&self, point: [f32; 2]) -> Option<[f32; 2]> {
        let [a, c] = self.along_x;
        let [b, d] = self.along_y;
        let determinant = a * d - b * c;
        let (px, py) = (point[0] - self.origin[0], point[1] - self.origin[1]);
        (determinant != 0.0).then(|| [(d * px - b * py) / determinant, (a * py - c * px) / determinant])
    }
}

/// Coordinates on a plane of the robot.
#[derive(Debug, Clone, Copy)]
struct Plane {
    per_metre: f64,
    shift: f64,
    /// Turns with the robot, second axis to its right.
    turns: bool,
}

/// One instant: where tag (in cells, column and row) and body (in radii from its centre) are.
#[derive(Debug, Clone)]
struct Instant {
    tag: Affine,
    body: Affine,
    /// Of each point in the pixel, `[column, row, x, y]` from the pixel's centre.
    points: Vec<[f32; 4]>,
}

/// A robot ready to be painted.
#[derive(Debug, Clone)]
pub struct Stroke {
    pub region: Region,
    instants: Vec<Instant>,
    middle: usize,
    cells: Option<CellTable>,
    body: Option<f32>,
    /// How far, in cells, the points of a pixel can be from its centre at the middle instant.
    tag_spread: [f32; 2],
    /// Squares of the radii within which a pixel is all body, and beyond which it is none.
    body_rim: [f32; 2],
    points: f32,
}

impl Stroke {
    /// `None` if nothing of the robot can be in the picture.
    ///
    /// - `slopes`: of every pixel, row by row.
    pub fn new(
        optics: &Optics,
        slopes: &[[f32; 2]],
        tag: Option<Tag>,
        shape: &RobotShape,
        poses: &[Pose],
    ) -> Option<Self> {
        let region = region(optics, tag.is_some(), shape, poses)?;
        let middle = poses.len() / 2;
        let turn = slope_per_pixel(optics, slopes, region);
        let tag_plane = Plane {
            per_metre: 1.0 / CELL_M,
            shift: CELLS as f64 / 2.0,
            turns: true,
        };
        let has_body = shape.body_radius_m > 0.0;
        let body_plane = Plane {
            per_metre: if has_body { 1.0 / shape.body_radius_m } else { 1.0 },
            shift: 0.0,
            turns: false,
        };
        let instants: Vec<Instant> = poses
            .iter()
            .enumerate()
            .map(|(index, pose)| {
                let tag = Affine::new(optics, shape.tag_height_m, *pose, tag_plane);
                let body = Affine::new(optics, shape.body_height_m, *pose, body_plane);
                let points = pattern(index, poses.len()).map(|[du, dv]| {
                    let slope = [0, 1].map(|axis| turn[0][axis] * du + turn[1][axis] * dv);
                    let ([column, row], [x, y]) = (tag.change(slope), body.change(slope));
                    [column, row, x, y]
                });
                Instant {
                    tag,
                    body,
                    points: points.collect(),
                }
            })
            .collect();
        let points = instants.iter().map(|instant| instant.points.len()).sum::<usize>() as f32;
        let tag_spread = tag_spread(&instants, middle);
        let rim = body_spread(&instants, middle);
        let inner = (1.0 - rim).max(0.0);
        Some(Self {
            region,
            middle,
            cells: tag.map(CellTable::new),
            body: has_body.then_some(shape.body_reflectance as f32),
            tag_spread,
            body_rim: [if rim < 1.0 { inner * inner } else { -1.0 }, (1.0 + rim) * (1.0 + rim)],
            instants,
            points,
        })
    }

    /// Paints the robot over `sharp`; all three are whole pictures of `width` pixels a row.
    pub fn paint(&self, slopes: &[[f32; 2]], light_dn: &[f32], sharp: &mut [f32], width: usize) {
        for row in self.region.top..self.region.bottom {
            let line = row * width + self.region.left..row * width + self.region.right;
            let pixels = slopes[line.clone()].iter().zip(&light_dn[line.clone()]);
            for ((slope, light), out) in pixels.zip(&mut sharp[line]) {
                *out = self.pixel(*slope, *light, *out);
            }
        }
    }

    #[inline(always)]
    fn pixel(&self, slope: [f32; 2], light_dn: f32, behind: f32) -> f32 {
        let Some(middle) = self.instants.get(self.middle) else {
            return behind;
        };
        let under = self.under_tag(middle, slope, light_dn, behind);
        let Some(cells) = &self.cells else {
            return under.unwrap_or_else(|| self.rim(slope, light_dn, behind));
        };
        let ([column, row], [dc, dr], end) = (middle.tag.at(slope), self.tag_spread, CELLS as f32);
        if !(column > -dc && column < end + dc && row > -dr && row < end + dr) {
            return under.unwrap_or_else(|| self.rim(slope, light_dn, behind));
        }
        match under {
            // a point is up to one spread from a pixel that is up to one spread off the tag
            Some(under) if 2.0 * dc.max(dr) <= CellTable::REACH => match cells.even([column, row], self.tag_spread) {
                Some([reflected, covered]) => reflected * light_dn + (1.0 - covered) * under,
                None => self.print(cells, slope, light_dn, under),
            },
            _ => self.mean(slope, light_dn, behind),
        }
    }

    /// The pixel without the tag, if the body covers all of it or none.
    #[inline(always)]
    fn under_tag(&self, middle: &Instant, slope: [f32; 2], light_dn: f32, behind: f32) -> Option<f32> {
        let Some(body) = self.body else { return Some(behind) };
        let [x, y] = middle.body.at(slope);
        let radius2 = x * x + y * y;
        if radius2 >= self.body_rim[1] {
            Some(behind)
        } else {
            (radius2 <= self.body_rim[0]).then_some(body * light_dn)
        }
    }

    /// Mean of a pixel at the body's rim, off the tag.
    fn rim(&self, slope: [f32; 2], light_dn: f32, behind: f32) -> f32 {
        let mut covered = 0.0;
        for instant in &self.instants {
            let [x, y] = instant.body.at(slope);
            for [_, _, dx, dy] in &instant.points {
                let (x, y) = (x + dx, y + dy);
                covered += if x * x + y * y <= 1.0 { 1.0 } else { 0.0 };
            }
        }
        let share = covered / self.points;
        share * self.body.unwrap_or(0.0) * light_dn + (1.0 - share) * behind
    }

    /// Mean of a pixel on the tag or at its edge, with one and the same under it.
    fn print(&self, cells: &CellTable, slope: [f32; 2], light_dn: f32, under: f32) -> f32 {
        let (mut reflected, mut covered) = (0.0, 0.0);
        for instant in &self.instants {
            let [column, row] = instant.tag.at(slope);
            for [dc, dr, _, _] in &instant.points {
                let [reflectance, cover] = cells.near(column + dc, row + dr);
                reflected += reflectance;
                covered += cover;
            }
        }
        (reflected * light_dn + (self.points - covered) * under) / self.points
    }

    /// Mean over all points of the pixel at all instants, wherever it is.
    fn mean(&self, slope: [f32; 2], light_dn: f32, behind: f32) -> f32 {
        let (mut reflected, mut covered) = (0.0, 0.0);
        for instant in &self.instants {
            let ([column, row], [x, y]) = (instant.tag.at(slope), instant.body.at(slope));
            for [dc, dr, dx, dy] in &instant.points {
                let cell = self.cells.as_ref().and_then(|cells| cells.at(column + dc, row + dr));
                let point = cell.or_else(|| {
                    let (x, y) = (x + dx, y + dy);
                    self.body.filter(|_| x * x + y * y <= 1.0)
                });
                if let Some(reflectance) = point {
                    reflected += reflectance;
                    covered += 1.0;
                }
            }
        }
        (reflected * light_dn + (self.points - covered) * behind) / self.points
    }
}

/// The rectangle of pixels that the robot can touch.
fn region(optics: &Optics, has_tag: bool, shape: &RobotShape, poses: &[Pose]) -> Option<Region> {
    let mut discs = Vec::new();
    if has_tag {
        discs.push((TAG_REACH_M, shape.tag_height_m));
    }
    if shape.body_radius_m > 0.0 {
        discs.push((shape.body_radius_m, shape.body_height_m));
    }
    let fits = |height_m: f64| optics.position_m[2] - height_m >= LEAST_DESCENT_M;
    if !(fits(shape.tag_height_m) && fits(shape.body_height_m)) {
        return None;
    }
    let mut ends = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for (radius_m, height_m) in discs {
        // a polygon around the disc, not in it
        let radius_m = radius_m / (std::f64::consts::PI / f64::from(RIM_POINTS)).cos();
        for (pose, point) in poses
            .iter()
            .flat_map(|pose| (0..RIM_POINTS).map(move |point| (pose, point)))
        {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(point) / f64::from(RIM_POINTS)).sin_cos();
            let world_m = [pose.x_m + radius_m * cos, pose.y_m + radius_m * sin, height_m];
            if let Some([u, v]) = optics.project(world_m) {
                ends = [ends[0].min(u), ends[1].min(v), ends[2].max(u), ends[3].max(v)];
            }
        }
    }
    let [left, top] = [ends[0], ends[1]].map(|end| (end - 1.5).floor().max(0.0));
    let right = (ends[2] + 2.5).ceil().min(f64::from(optics.width_px));
    let bottom = (ends[3] + 2.5).ceil().min(f64::from(optics.height_px));
    (left < right && top < bottom).then_some(Region {
        left: left as usize,
        top: top as usize,
        right: right as usize,
        bottom: bottom as usize,
    })
}

/// Change of slope per pixel along u and along v in the middle of a region.
fn slope_per_pixel(optics: &Optics, slopes: &[[f32; 2]], region: Region) -> [[f64; 2]; 2] {
    let (width, height) = (usize::from(optics.width_px), usize::from(optics.height_px));
    let u = ((region.left + region.right) / 2).clamp(1, width - 2);
    let v = ((region.top + region.bottom) / 2).clamp(1, height - 2);
    let half = |after: usize, before: usize| {
        [0, 1].map(|axis| (f64::from(slopes[after][axis]) - f64::from(slopes[before][axis])) / 2.0)
    };
    let at = v * width + u;
    [half(at + 1, at - 1), half(at + width, at - width)]
}

/// How far points can be from their pixel's centre at the middle instant, in cells, columns and rows.
fn tag_spread(instants: &[Instant], middle: usize) -> [f32; 2] {
    let end = CELLS as f32;
    let (mut moved, mut around) = ([0.0f32; 2], [0.0f32; 2]);
    let Some(reference) = instants.get(middle) else {
        return moved;
    };
    for instant in instants {
        for corner in [[0.0, 0.0], [end, 0.0], [0.0, end], [end, end]] {
            // on the tag as it is at either instant
            for slope in [reference.tag.back(corner), instant.tag.back(corner)]
                .into_iter()
                .flatten()
            {
                let (one, other) = (instant.tag.at(slope), reference.tag.at(slope));
                moved = [0, 1].map(|axis| moved[axis].max((one[axis] - other[axis]).abs()));
            }
        }
        for point in &instant.points {
            around = [0, 1].map(|axis| around[axis].max(point[axis].abs()));
        }
    }
    [0, 1].map(|axis| 1.001 * (moved[axis] + around[axis]) + 1e-3)
}

/// The same for the body, in radii.
fn body_spread(instants: &[Instant], middle: usize) -> f32 {
    let Some(reference) = instants.get(middle) else {
        return 0.0;
    };
    let length = |x: f32, y: f32| (x * x + y * y).sqrt();
    let (mut moved, mut around) = (0.0f32, 0.0f32);
    for instant in instants {
        let [x, y] = [0, 1].map(|axis| instant.body.origin[axis] - reference.body.origin[axis]);
        moved = moved.max(length(x, y));
        for point in &instant.points {
            around = around.max(length(point[2], point[3]));
        }
    }
    1.001 * (moved + around) + 1e-4
}

#[cfg(test)]
mod tests {
    use super::super::tag::{BLACK_REFLECTANCE, WHITE_REFLECTANCE};
    use super::*;

    /// One look is enough where all points agree: the shortcut gives what all points would give, and nothing lies outside of
    /// the region.
    #[test]
    fn the_shortcut_changes_nothing() {
        let text = include_str!("../../../examples/lab/cameras/cam-0.json");
        let optics = Optics::from(&super::super::Calibration::parse(text).expect("the example"));
        let (slopes, width) = (optics.slopes().expect("slopes"), usize::from(optics.width_px));
        let still = [Pose {
            x_m: -0.3,
            y_m: 1.1,
            yaw_rad: 0.5,
        }];
        let moving: Vec<Pose> = (0..8)
            .map(|i| f64::from(i) * 0.004)
            .map(|at| Pose {
                x_m: -1.2 + at,
                y_m: -0.4 + 0.5 * at,
                yaw_rad: 2.0 + 3.0 * at,
            })
            .collect();
        let wide = RobotShape {
            body_radius_m: 0.12,
            ..RobotShape::default()
        };
        for (poses, shape) in [
            (&still[..], RobotShape::default()),
            (&moving, RobotShape::default()),
            (&moving, wide),
        ] {
            let stroke = Stroke::new(&optics, &slopes, Tag::new(7), &shape, poses).expect("in view");
            let (mut looks, mut touched, mut on_edge) = (0, 0, 0);
            for (index, slope) in slopes.iter().enumerate() {
                let (u, v) = (index % width, index / width);
                let (short, full) = (stroke.pixel(*slope, 200.0, 77.0), stroke.mean(*slope, 200.0, 77.0));
                if (short - full).abs() > 1e-3 {
                    // a point within rounding of a cell's edge may fall to either side
                    let point = 200.0 * (WHITE_REFLECTANCE - BLACK_REFLECTANCE) as f32 / stroke.points;
                    assert!((short - full).abs() < 1.001 * point, "({u}, {v}): {short} {full}");
                    on_edge += 1;
                }
                let region = stroke.region;
                let inside = u >= region.left && u < region.right && v >= region.top && v < region.bottom;
                assert!(inside || full == 77.0, "({u}, {v}) is touched outside of the region");
                touched += usize::from(full != 77.0);
                looks += usize::from((full / 200.0 - wide.body_reflectance as f32).abs() < 1e-6);
            }
            assert!(
                touched > 2000 && looks > 100 && on_edge <= 3,
                "{touched} {looks} {on_edge}"
            );
        }
    }
}
