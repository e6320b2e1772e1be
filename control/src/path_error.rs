//! How far a robot is from its path: distance to the active piece, with monotone progress.

use crate::law::Piece;
use crate::vector::{dot, length, scale, sub};

/// Within this of its end a piece is passed as soon as the next one is no further away.
const NEAR_END_M: f64 = 0.05;
/// Rounding, where both lie on one line.
const SAME_M: f64 = 1e-6;
/// Parts of an arc.
const PARTS: usize = 64;

/// Follows a robot along its path.
#[derive(Debug, Clone)]
pub struct PathError {
    /// Points of every piece; straight ones have two.
    pieces: Vec<Vec<[f64; 2]>>,
    active: usize,
    driven_m: f64,
}

impl PathError {
    /// - `pieces`: as [`crate::law::path`] gives them.
    pub fn new(pieces: &[Piece]) -> Self {
        let points = |piece: &Piece| {
            let parts = if piece.curvature_per_m == 0.0 { 1 } else { PARTS };
            let at = |part: usize| piece.at(piece.length_m * part as f64 / parts as f64).place_m;
            (0..=parts).map(at).collect()
        };
        Self {
            pieces: pieces.iter().map(points).collect(),
            active: 0,
            driven_m: 0.0,
        }
    }

    /// Distance to the active piece, m, of a robot that is here now; it never becomes active again once it is passed.
    pub fn at(&mut self, here_m: [f64; 2]) -> f64 {
        loop {
            let Some(points) = self.pieces.get(self.active) else {
                return 0.0;
            };
            let (distance_m, along_m, length_m) = nearest(points, here_m);
            self.driven_m = self.driven_m.max(along_m);
            let next = self.pieces.get(self.active + 1).map(|next| nearest(next, here_m).0);
            let passed =
                length_m - self.driven_m <= NEAR_END_M && next.is_some_and(|next_m| next_m <= distance_m + SAME_M);
            if !passed {
                return distance_m;
            }
            self.active += 1;
            self.driven_m = 0.0;
        }
    }

    /// The way as lines of points, one a piece, for drawing.
    pub fn lines(&self) -> &[Vec<[f64; 2]>] {
        &self.pieces
    }

    /// Number of the active piece.
    pub fn active(&self) -> usize {
        self.active
    }

    /// Whether the last piece is active.
    pub fn is_last(&self) -> bool {
        self.active + 1 >= self.pieces.len()
    }
}

/// Distance to a line of points, how far along it the nearest point is, and its length.
fn nearest(points: &[[f64; 2]], here_m: [f64; 2]) -> (f64, f64, f64) {
    let (mut best, mut begun_m) = ((f64::INFINITY, 0.0), 0.0);
    for (from, to) in points.iter().zip(points.iter().skip(1)) {
        let (along, here) = (sub(*to, *from), sub(here_m, *from));
        let length_m = length(along);
        let share = if length_m > 0.0 {
            (dot(here, along) / (length_m * length_m)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let distance_m = length(sub(here, scale(along, share)));
        if distance_m < best.0 {
            best = (distance_m, begun_m + share * length_m);
        }
        begun_m += length_m;
    }
    (best.0, best.1, begun_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Place;

    fn straight(from: [f64; 2], yaw_rad: f64, length_m: f64) -> Piece {
        Piece {
            from: Place { place_m: from, yaw_rad },
            length_m,
            ..Piece::default()
        }
    }

    #[test]
    fn a_way_out_and_back_counts_the_active_leg_only() {
        let there = straight([0.0, 0.0], 0.0, 1.0);
        let back = straight([1.0, 0.0], std::f64::consts::PI, 1.0);
        let mut error = PathError::new(&[there, back]);
        assert!((error.at([0.5, 0.1]) - 0.1).abs() < 1e-12);
        // Past the end: the next leg begins there.
        assert!((error.at([1.05, 0.0]) - 0.05).abs() < 1e-12);
        assert!(error.is_last());
        assert!((error.at([0.5, -0.2]) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn the_distance_to_an_arc_is_that_to_its_circle() {
        let arc = Piece {
            curvature_per_m: 2.0,
            length_m: 0.5 * std::f64::consts::FRAC_PI_2,
            ..straight([0.0, 0.0], 0.0, 0.0)
        };
        let angle = std::f64::consts::FRAC_PI_4;
        let at = |radius_m: f64| [radius_m * libm::sin(angle), 0.5 - radius_m * libm::cos(angle)];
        assert!((PathError::new(&[arc]).at(at(0.6)) - 0.1).abs() < 1e-4);
    }
}
