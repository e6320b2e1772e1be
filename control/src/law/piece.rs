//! A piece of a path: straight or an arc of constant curvature, driven forwards or backwards.

use crate::vector::{Vector, add, heading, scale, sub, wrap};

/// Below this curvature a piece is straight.
const STRAIGHT_PER_M: f64 = 1e-9;

/// A place with a direction.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Place {
    pub place_m: Vector,
    pub yaw_rad: f64,
}

/// One piece: where it starts, how it bends, how long it is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Piece {
    pub from: Place,
    /// Positive: driven forwards it turns to the left.
    pub curvature_per_m: f64,
    /// Not negative.
    pub length_m: f64,
    /// Driven with the back first.
    pub backwards: bool,
}

impl Piece {
    /// 1 forwards, -1 backwards.
    pub fn sign(&self) -> f64 {
        if self.backwards { -1.0 } else { 1.0 }
    }

    /// Place after `driven_m` on the piece; straight chords and arcs in closed form.
    pub fn at(&self, driven_m: f64) -> Place {
        let along_m = self.sign() * driven_m;
        let Place { place_m, yaw_rad } = self.from;
        let turned_rad = self.curvature_per_m * along_m;
        if self.curvature_per_m.abs() < STRAIGHT_PER_M {
            return Place {
                place_m: add(place_m, scale(heading(yaw_rad), along_m)),
                yaw_rad,
            };
        }
        let radius_m = 1.0 / self.curvature_per_m;
        let [c0, s0] = heading(yaw_rad);
        let [c1, s1] = heading(yaw_rad + turned_rad);
        Place {
            place_m: add(place_m, [radius_m * (s1 - s0), radius_m * (c0 - c1)]),
            yaw_rad: wrap(yaw_rad + turned_rad),
        }
    }

    pub fn end(&self) -> Place {
        self.at(self.length_m)
    }

    /// Where a robot at `here_m` is on the piece, starting from where it was: one step of Newton's method, exact on a
    /// straight piece.
    pub fn progress_m(&self, last_m: f64, here_m: Vector) -> f64 {
        let reference = self.at(last_m);
        let [c, s] = heading(reference.yaw_rad);
        let off = sub(here_m, reference.place_m);
        (last_m + self.sign() * (off[0] * c + off[1] * s)).clamp(0.0, self.length_m)
    }
}

/// Distance to the left of `reference` (m) and heading against it (rad) of a robot.
pub fn errors(reference: &Place, here: &Place) -> [f64; 2] {
    let [c, s] = heading(reference.yaw_rad);
    let off = sub(here.place_m, reference.place_m);
    [c * off[1] - s * off[0], wrap(here.yaw_rad - reference.yaw_rad)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::length;
    use core::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_circle_ends_where_it_must() {
        let piece = Piece {
            curvature_per_m: 0.5,
            length_m: 2.0 * FRAC_PI_2,
            ..Piece::default()
        };
        let end = piece.end();
        assert!(length(sub(end.place_m, [2.0, 2.0])) < 1e-12 && (end.yaw_rad - FRAC_PI_2).abs() < 1e-12);
        let back = Piece {
            backwards: true,
            ..piece
        };
        assert!(length(sub(back.end().place_m, [-2.0, 2.0])) < 1e-12);
    }

    #[test]
    fn progress_is_found_on_an_arc() {
        let piece = Piece {
            curvature_per_m: -1.0,
            length_m: 3.0,
            ..Piece::default()
        };
        let mut progress_m = 0.0;
        for _ in 0..40 {
            progress_m = piece.progress_m(progress_m, piece.at(0.7).place_m);
        }
        assert!((progress_m - 0.7).abs() < 1e-9, "{progress_m}");
    }
}
