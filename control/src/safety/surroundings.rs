//! What stands still around the robots, or is moved by others: geofence and obstacles, as the filter sees them.

use twin::pose::Pose;
use twin::world::{Contents, Shape};

use crate::scenario::FieldProblem;
use crate::vector::{Vector, add, dot, length, right_of, scale, sub};

/// Most corners of a geofence.
pub const MAX_CORNERS: usize = 64;
/// Shortest side of a geofence.
const SHORTEST_SIDE_M: f64 = 1e-3;
/// A point closer to an edge than this has no direction from it.
const ON_EDGE_M: f64 = 1e-9;

/// A region that the bounding circles of all robots must stay in; its corners go round counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Geofence {
    corners: Vec<Vector>,
}

impl Geofence {
    /// A simple polygon, convex or not, from its corners `[x_m, y_m]` in either sense.
    ///
    /// - Errors: fewer than 3 or more than [`MAX_CORNERS`] corners, corners that are not finite or fall together, sides that cross.
    pub fn polygon(corners: &[[f64; 2]]) -> Result<Geofence, FieldProblem> {
        if !(3..=MAX_CORNERS).contains(&corners.len()) {
            let message = format!("a geofence of {} corners", corners.len());
            return Err(refused("geofence", message, format!("3 to {MAX_CORNERS} corners")));
        }
        for (i, corner) in corners.iter().enumerate() {
            let field = format!("geofence[{i}]");
            if !(corner[0].is_finite() && corner[1].is_finite()) {
                let message = format!("{corner:?} is not a place");
                return Err(refused(&field, message, "finite numbers of m".to_owned()));
            }
            let next = corners[(i + 1) % corners.len()];
            if length(sub(next, *corner)) < SHORTEST_SIDE_M {
                let message = "two corners fall together".to_owned();
                return Err(refused(
                    &field,
                    message,
                    format!("sides of at least {SHORTEST_SIDE_M} m"),
                ));
            }
            for j in i + 1..corners.len() {
                let apart = (j + 1) % corners.len() != i && j != i + 1;
                let other = [corners[j], corners[(j + 1) % corners.len()]];
                if apart && cross([*corner, next], other) {
                    let message = format!("the sides from corners {i} and {j} cross");
                    return Err(refused(
                        &field,
                        message,
                        "a polygon whose sides do not cross".to_owned(),
                    ));
                }
            }
        }
        let mut corners = corners.to_vec();
        if doubled_area_m2(&corners) < 0.0 {
            corners.reverse();
        }
        Ok(Geofence { corners })
    }

    /// The geofence of an arena, by its field; none where none is given.
    ///
    /// - Errors: as [`Self::polygon`].
    pub fn of(contents: &Contents) -> Result<Option<Geofence>, FieldProblem> {
        if contents.geofence.is_empty() {
            return Ok(None);
        }
        Geofence::polygon(&contents.geofence)
            .map(Some)
            .map_err(|problem| FieldProblem {
                field: format!("arena.contents.{}", problem.field),
                ..problem
            })
    }

    /// An upright rectangle with these opposite corners.
    pub fn rectangle(lower_m: [f64; 2], upper_m: [f64; 2]) -> Result<Geofence, FieldProblem> {
        Geofence::polygon(&[lower_m, [upper_m[0], lower_m[1]], upper_m, [lower_m[0], upper_m[1]]])
    }

    /// Number of sides.
    pub fn sides(&self) -> usize {
        self.corners.len()
    }

    /// Whether a point lies inside.
    pub fn holds(&self, point: [f64; 2]) -> bool {
        let n = self.corners.len();
        (0..n).fold(false, |inside, i| {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % n]);
            let spans = (a[1] > point[1]) != (b[1] > point[1]);
            inside != (spans && point[0] < a[0] + (b[0] - a[0]) * (point[1] - a[1]) / (b[1] - a[1]))
        })
    }

    /// Distance of a point from the nearest side, m; negative outside.
    pub fn depth_m(&self, point: [f64; 2]) -> f64 {
        let inside = self.holds(point);
        let sides = (0..self.sides()).map(|side| self.clearance(side, point, true).0);
        let nearest_m = sides.fold(f64::INFINITY, f64::min);
        if inside { nearest_m } else { -nearest_m }
    }

    /// Distance of a point from one side and the direction away from it, into the fence.
    ///
    /// Outside, the distance is negative and the direction leads back.
    pub(super) fn clearance(&self, side: usize, point: Vector, inside: bool) -> (f64, Vector) {
        let (from, to) = (self.corners[side], self.corners[(side + 1) % self.corners.len()]);
        let along = sub(to, from);
        let fraction = (dot(sub(point, from), along) / dot(along, along)).clamp(0.0, 1.0);
        let away = sub(point, add(from, scale(along, fraction)));
        let distance_m = length(away);
        if distance_m < ON_EDGE_M {
            return (0.0, scale(right_of(along), -1.0 / length(along)));
        }
        let sign = if inside { 1.0 } else { -1.0 };
        (sign * distance_m, scale(away, sign / distance_m))
    }
}

fn refused(field: &str, message: String, limit: String) -> FieldProblem {
    FieldProblem {
        field: field.to_owned(),
        message,
        limit,
        remedy: "give the corners of a simple polygon in order".to_owned(),
    }
}

fn doubled_area_m2(corners: &[Vector]) -> f64 {
    let n = corners.len();
    (0..n).fold(0.0, |area, i| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        area + a[0] * b[1] - a[1] * b[0]
    })
}

fn cross(a: [Vector; 2], b: [Vector; 2]) -> bool {
    let side = |line: [Vector; 2], point: Vector| dot(right_of(sub(line[1], line[0])), sub(point, line[0]));
    side(a, b[0]) * side(a, b[1]) <= 0.0 && side(b, a[0]) * side(b, a[1]) <= 0.0
}

/// An obstacle at its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    shape: Shape,
    at: Vector,
    cos_sin: Vector,
    /// Velocity of its centre in the world frame, and its yaw rate.
    velocity: Vector,
    yaw_rate_rad_per_s: f64,
    pub(super) pushable: bool,
    /// Position in `fixed` or `pushable` of the arena's contents.
    pub(super) index: u32,
    pub(super) bounding_radius_m: f64,
}

impl Body {
    pub(super) fn centre(&self) -> Vector {
        self.at
    }

    /// More than any point of its outline moves at.
    pub(super) fn fastest_m_per_s(&self) -> f64 {
        length(self.velocity) + self.yaw_rate_rad_per_s.abs() * self.bounding_radius_m
    }

    /// Distance of a point from the outline, negative inside, the direction away from it, and how fast the outline
    /// comes that way.
    pub(super) fn clearance(&self, point: Vector) -> (f64, Vector, f64) {
        let [c, s] = self.cos_sin;
        let from = sub(point, self.at);
        let (distance_m, normal) = match self.shape {
            Shape::Circle { radius_m } => {
                let centre_m = length(from);
                let normal = if centre_m < ON_EDGE_M {
                    [1.0, 0.0]
                } else {
                    scale(from, 1.0 / centre_m)
                };
                (centre_m - radius_m, normal)
            }
            Shape::Rectangle { length_m, width_m } => {
                let local = [c * from[0] + s * from[1], c * from[1] - s * from[0]];
                let (distance_m, n) = rectangle_clearance(local, [0.5 * length_m, 0.5 * width_m]);
                (distance_m, [c * n[0] - s * n[1], s * n[0] + c * n[1]])
            }
        };
        let arm = sub(from, scale(normal, distance_m));
        let turning = scale(right_of(arm), -self.yaw_rate_rad_per_s);
        (distance_m, normal, dot(normal, add(self.velocity, turning)))
    }
}

fn rectangle_clearance(local: Vector, half: Vector) -> (f64, Vector) {
    let beyond = [local[0].abs() - half[0], local[1].abs() - half[1]];
    let sign = [1.0_f64.copysign(local[0]), 1.0_f64.copysign(local[1])];
    if beyond[0] > 0.0 || beyond[1] > 0.0 {
        let away = [beyond[0].max(0.0), beyond[1].max(0.0)];
        let distance_m = length(away);
        return (
            distance_m,
            [sign[0] * away[0] / distance_m, sign[1] * away[1] / distance_m],
        );
    }
    if beyond[0] > beyond[1] {
        (beyond[0], [sign[0], 0.0])
    } else {
        (beyond[1], [0.0, sign[1]])
    }
}

/// All obstacles: the fixed ones, then the pushable ones at their start.
pub(super) fn bodies(contents: &Contents) -> Vec<Body> {
    let fixed = contents.fixed.iter().map(|one| (one.shape, one.pose, false));
    let pushable = contents.pushable.iter().map(|one| (one.shape, one.pose, true));
    let mut bodies = Vec::with_capacity(contents.fixed.len() + contents.pushable.len());
    for (kind, list) in [fixed.collect::<Vec<_>>(), pushable.collect()].into_iter().enumerate() {
        for (index, (shape, pose, pushable)) in list.into_iter().enumerate() {
            debug_assert_eq!(kind == 1, pushable);
            let mut body = Body {
                shape,
                at: [0.0, 0.0],
                cos_sin: [1.0, 0.0],
                velocity: [0.0, 0.0],
                yaw_rate_rad_per_s: 0.0,
                pushable,
                index: index as u32,
                bounding_radius_m: shape.bounding_radius_m(),
            };
            body.place(pose, [0.0, 0.0], 0.0);
            bodies.push(body);
        }
    }
    bodies
}

impl Body {
    /// Puts it where it was seen; what is not finite is not believed.
    pub(super) fn place(&mut self, pose: Pose, velocity: Vector, yaw_rate_rad_per_s: f64) {
        if pose.is_finite() {
            self.at = [pose.x_m, pose.y_m];
            self.cos_sin = crate::vector::heading(pose.yaw_rad);
        }
        let known = velocity[0].is_finite() && velocity[1].is_finite() && yaw_rate_rad_per_s.is_finite();
        (self.velocity, self.yaw_rate_rad_per_s) = if known {
            (velocity, yaw_rate_rad_per_s)
        } else {
            ([0.0; 2], 0.0)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fence_of_any_sense_holds_what_is_inside() {
        // An L: the notch at the upper right is outside.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let mut reversed = l;
        reversed.reverse();
        for corners in [l, reversed] {
            let fence = Geofence::polygon(&corners).expect("fence");
            assert!(fence.holds([0.5, 1.5]) && fence.holds([1.5, 0.5]) && !fence.holds([1.5, 1.5]));
            let nearest = |point: Vector| {
                (0..fence.sides())
                    .map(|side| fence.clearance(side, point, fence.holds(point)).0)
                    .min_by(|a, b| a.abs().total_cmp(&b.abs()))
                    .expect("sides")
            };
            assert!((nearest([0.5, 1.5]) - 0.5).abs() < 1e-15);
            // Seen from the reflex corner (1, 1).
            assert!((nearest([0.7, 0.6]) - 0.5).abs() < 1e-15);
            assert!((nearest([1.2, 1.5]) + 0.2).abs() < 1e-15);
        }
    }

    #[test]
    fn bad_fences_are_refused() {
        assert_eq!(
            Geofence::polygon(&[[0.0, 0.0], [1.0, 0.0]])
                .expect_err("two corners")
                .field,
            "geofence"
        );
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(
            Geofence::polygon(&bow_tie)
                .expect_err("crossing")
                .message
                .contains("cross")
        );
        let odd = [[0.0, 0.0], [f64::NAN, 1.0], [1.0, 0.0]];
        assert_eq!(Geofence::polygon(&odd).expect_err("NaN").field, "geofence[1]");
        assert!(Geofence::rectangle([0.0, 0.0], [0.0, 1.0]).is_err());
    }

    #[test]
    fn clearances_of_a_turned_rectangle() {
        let shape = Shape::Rectangle {
            length_m: 2.0,
            width_m: 1.0,
        };
        let contents = Contents {
            fixed: vec![twin::world::FixedObstacle {
                name: "one".into(),
                shape,
                pose: Pose {
                    x_m: 1.0,
                    y_m: 2.0,
                    yaw_rad: core::f64::consts::FRAC_PI_2,
                },
            }],
            ..Contents::default()
        };
        let mut body = bodies(&contents)[0];
        let (distance_m, n, _) = body.clearance([2.0, 2.0]);
        assert!((distance_m - 0.5).abs() < 1e-15 && (n[0] - 1.0).abs() < 1e-15);
        let (distance_m, n, _) = body.clearance([1.4, 2.0]);
        assert!((distance_m + 0.1).abs() < 1e-15 && (n[0] - 1.0).abs() < 1e-15);
        let (distance_m, n, _) = body.clearance([1.8, 3.4]);
        assert!((distance_m - 0.5).abs() < 1e-12 && (n[0] - 0.6).abs() < 1e-12, "{n:?}");
        // Turning at 1 rad/s, its right edge 0.7 m above the centre moves left at 0.7 m/s.
        body.place(
            Pose {
                x_m: 1.0,
                y_m: 2.0,
                yaw_rad: core::f64::consts::FRAC_PI_2,
            },
            [0.1, 0.0],
            1.0,
        );
        let (_, _, coming) = body.clearance([2.0, 2.7]);
        assert!((coming - (0.1 - 0.7)).abs() < 1e-12, "{coming}");
    }
}
