//! Shortest paths of a car that drives forwards and backwards and turns no tighter than a radius.
//!
//! [Reeds and Shepp 1990, "Optimal paths for a car that goes both forwards and backwards", eqs. 8.1 to 8.11]; lengths
//! in units of the radius, angles of turn of at most pi. Every word is driven in closed form before it is offered, so a
//! path always ends at its goal.

use core::f64::consts::{FRAC_PI_2, PI};

use super::piece::{Piece, Place};
use crate::vector::{Vector, body_from_world, length, sub, wrap};

/// Most pieces of a path.
pub const MAX_PIECES: usize = 5;
/// A word must end this close to the goal, in radii.
const CLOSE: f64 = 1e-6;
/// A cusp costs as much as driving this many radii.
const CUSP_COST: f64 = 0.3;
/// Shorter pieces are left out, in radii.
const SHORTEST: f64 = 1e-9;

/// A path of up to five pieces.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Path {
    pieces: [Piece; MAX_PIECES],
    count: u8,
}

impl Path {
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces[..usize::from(self.count)]
    }

    #[cfg(test)]
    pub fn length_m(&self) -> f64 {
        self.pieces().iter().map(|piece| piece.length_m).sum()
    }

    /// Length with a price on every change of direction.
    pub fn cost_m(&self, radius_m: f64) -> f64 {
        let pieces = self.pieces();
        let cusps = pieces
            .windows(2)
            .filter(|two| two[0].backwards != two[1].backwards)
            .count();
        pieces.iter().map(|piece| piece.length_m).sum::<f64>() + CUSP_COST * radius_m * cusps as f64
    }
}

/// The cheapest path between two places among those that `allowed` accepts, else among all.
pub fn path(from: &Place, to: &Place, radius_m: f64, allowed: &dyn Fn(&Path) -> bool) -> Path {
    best(from, to, radius_m, allowed).map_or(Path::default(), |(_, found)| found)
}

/// The cheapest path between two places among those that `allowed` accepts.
pub fn allowed_path(from: &Place, to: &Place, radius_m: f64, allowed: &dyn Fn(&Path) -> bool) -> Option<Path> {
    best(from, to, radius_m, allowed).and_then(|(is_allowed, found)| is_allowed.then_some(found))
}

/// The cheapest path and whether `allowed` accepts it; one that it accepts comes before all others.
fn best(from: &Place, to: &Place, radius_m: f64, allowed: &dyn Fn(&Path) -> bool) -> Option<(bool, Path)> {
    let [x, y] = body_from_world(sub(to.place_m, from.place_m), from.yaw_rad);
    let goal = [x / radius_m, y / radius_m, wrap(to.yaw_rad - from.yaw_rad)];
    let mut best: Option<(bool, f64, Path)> = None;
    for word in &WORDS {
        for variant in 0..8_u8 {
            let Some(found) = candidate(word, variant, goal, from, radius_m) else {
                continue;
            };
            let cost_m = found.cost_m(radius_m);
            let cheaper = best.is_none_or(|(_, least_m, _)| cost_m < least_m - 1e-9);
            let was_inside = best.is_some_and(|(was_inside, ..)| was_inside);
            // Whether it is allowed takes most of the time, and no longer counts for one that is dearer than an allowed one.
            if was_inside && !cheaper {
                continue;
            }
            let inside = allowed(&found);
            if (inside && !was_inside) || (inside == was_inside && cheaper) {
                best = Some((inside, cost_m, found));
            }
        }
    }
    best.map(|(inside, _, found)| (inside, found))
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    Left,
    Right,
    Straight,
}

type Lengths = [f64; MAX_PIECES];
type Word = ([Turn; MAX_PIECES], fn(f64, f64, f64) -> Option<Lengths>);

const L: Turn = Turn::Left;
const R: Turn = Turn::Right;
const S: Turn = Turn::Straight;

/// One of each family; the symmetries give the others.
const WORDS: [Word; 8] = [
    ([L, S, L, S, S], left_straight_left),
    ([L, S, R, S, S], left_straight_right),
    ([L, R, L, S, S], left_right_left),
    ([L, R, L, R, S], inner_cusps),
    ([L, R, L, R, S], outer_cusps),
    ([L, R, S, L, S], turn_straight_left),
    ([L, R, S, R, S], turn_straight_right),
    ([L, R, S, L, R], turn_straight_turn),
];

/// Bits of a variant: time flipped, reflected, driven from the goal to the start.
fn candidate(word: &Word, variant: u8, goal: [f64; 3], from: &Place, radius_m: f64) -> Option<Path> {
    let (flipped, reflected, reversed) = (variant & 1 != 0, variant & 2 != 0, variant & 4 != 0);
    let [mut x, mut y, mut phi] = goal;
    if reversed {
        let [c, s] = [libm::cos(phi), libm::sin(phi)];
        (x, y) = (x * c + y * s, x * s - y * c);
    }
    if flipped {
        (x, phi) = (-x, -phi);
    }
    if reflected {
        (y, phi) = (-y, -phi);
    }
    let (turns, lengths) = word;
    let lengths = lengths(x, y, phi)?;
    let mut path = Path::default();
    let mut at = *from;
    for k in 0..MAX_PIECES {
        let k = if reversed { MAX_PIECES - 1 - k } else { k };
        let driven = if flipped { -lengths[k] } else { lengths[k] };
        if driven.abs() < SHORTEST {
            continue;
        }
        let side = match turns[k] {
            Turn::Left => 1.0,
            Turn::Right => -1.0,
            Turn::Straight => 0.0,
        };
        let piece = Piece {
            from: at,
            curvature_per_m: if reflected { -side } else { side } / radius_m,
            length_m: driven.abs() * radius_m,
            backwards: driven < 0.0,
        };
        at = piece.end();
        path.pieces[usize::from(path.count)] = piece;
        path.count += 1;
    }
    let [gx, gy, turn] = goal;
    let end = body_from_world(sub(at.place_m, from.place_m), from.yaw_rad);
    let miss: Vector = [end[0] / radius_m - gx, end[1] / radius_m - gy];
    let arrives = length(miss) < CLOSE && wrap(at.yaw_rad - from.yaw_rad - turn).abs() < CLOSE;
    arrives.then_some(path)
}

fn polar(x: f64, y: f64) -> (f64, f64) {
    (length([x, y]), libm::atan2(y, x))
}

/// Eq. 8.1.
fn left_straight_left(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (u, t) = polar(x - libm::sin(phi), y - 1.0 + libm::cos(phi));
    let v = wrap(phi - t);
    (t >= 0.0 && v >= 0.0).then_some([t, u, v, 0.0, 0.0])
}

/// Eq. 8.2.
fn left_straight_right(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (u1, t1) = polar(x + libm::sin(phi), y - 1.0 - libm::cos(phi));
    let squared = u1 * u1 - 4.0;
    if squared < 0.0 {
        return None;
    }
    let u = squared.sqrt();
    let t = wrap(t1 + libm::atan2(2.0, u));
    let v = wrap(t - phi);
    (t >= 0.0 && v >= 0.0).then_some([t, u, v, 0.0, 0.0])
}

/// Eqs. 8.3 and 8.4.
fn left_right_left(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (u1, theta) = polar(x - libm::sin(phi), y - 1.0 + libm::cos(phi));
    if u1 > 4.0 {
        return None;
    }
    let u = -2.0 * libm::asin(0.25 * u1);
    let t = wrap(theta + 0.5 * u + PI);
    let v = wrap(phi - t + u);
    (t >= 0.0 && u <= 0.0).then_some([t, u, v, 0.0, 0.0])
}

fn tau_omega(u: f64, v: f64, xi: f64, eta: f64, phi: f64) -> (f64, f64) {
    let delta = wrap(u - v);
    let a = libm::sin(u) - libm::sin(delta);
    let b = libm::cos(u) - libm::cos(delta) - 1.0;
    let t1 = libm::atan2(eta * a - xi * b, xi * a + eta * b);
    let t2 = 2.0 * (libm::cos(delta) - libm::cos(v) - libm::cos(u)) + 3.0;
    let tau = if t2 < 0.0 { wrap(t1 + PI) } else { wrap(t1) };
    (tau, wrap(tau - u + v - phi))
}

/// Eq. 8.7.
fn inner_cusps(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (xi, eta) = (x + libm::sin(phi), y - 1.0 - libm::cos(phi));
    let rho = 0.25 * (2.0 + length([xi, eta]));
    if rho > 1.0 {
        return None;
    }
    let u = libm::acos(rho);
    let (t, v) = tau_omega(u, -u, xi, eta, phi);
    (t >= 0.0 && v <= 0.0).then_some([t, u, -u, v, 0.0])
}

/// Eq. 8.8.
fn outer_cusps(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (xi, eta) = (x + libm::sin(phi), y - 1.0 - libm::cos(phi));
    let rho = (20.0 - xi * xi - eta * eta) / 16.0;
    if !(0.0..=1.0).contains(&rho) {
        return None;
    }
    let u = -libm::acos(rho);
    let (t, v) = tau_omega(u, u, xi, eta, phi);
    (u >= -FRAC_PI_2 && t >= 0.0 && v >= 0.0).then_some([t, u, u, v, 0.0])
}

/// Eq. 8.9.
fn turn_straight_left(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (rho, theta) = polar(x - libm::sin(phi), y - 1.0 + libm::cos(phi));
    if rho < 2.0 {
        return None;
    }
    let r = (rho * rho - 4.0).sqrt();
    let u = 2.0 - r;
    let t = wrap(theta + libm::atan2(r, -2.0));
    let v = wrap(phi - FRAC_PI_2 - t);
    (t >= 0.0 && u <= 0.0 && v <= 0.0).then_some([t, -FRAC_PI_2, u, v, 0.0])
}

/// Eq. 8.10.
fn turn_straight_right(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (xi, eta) = (x + libm::sin(phi), y - 1.0 - libm::cos(phi));
    let (rho, theta) = polar(-eta, xi);
    if rho < 2.0 {
        return None;
    }
    let (t, u) = (theta, 2.0 - rho);
    let v = wrap(t + FRAC_PI_2 - phi);
    (t >= 0.0 && u <= 0.0 && v <= 0.0).then_some([t, -FRAC_PI_2, u, v, 0.0])
}

/// Eq. 8.11.
fn turn_straight_turn(x: f64, y: f64, phi: f64) -> Option<Lengths> {
    let (xi, eta) = (x + libm::sin(phi), y - 1.0 - libm::cos(phi));
    let rho = length([xi, eta]);
    if rho < 2.0 {
        return None;
    }
    let u = 4.0 - (rho * rho - 4.0).sqrt();
    let t = wrap(libm::atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta));
    let v = wrap(t - phi);
    (u <= 0.0 && t >= 0.0 && v >= 0.0).then_some([t, -FRAC_PI_2, u, -FRAC_PI_2, v])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(x: f64, y: f64, yaw_rad: f64) -> Path {
        let to = Place {
            place_m: [x, y],
            yaw_rad,
        };
        path(&Place::default(), &to, 0.5, &|_| true)
    }

    #[test]
    fn every_place_is_reached_and_no_path_is_shorter_than_the_straight_line() {
        for i in 0..13 {
            for j in 0..13 {
                for k in 0..12 {
                    let place_m = [-1.5 + 0.25 * f64::from(i), -1.5 + 0.25 * f64::from(j)];
                    let yaw_rad = -3.0 + 0.5 * f64::from(k);
                    let found = between(place_m[0], place_m[1], yaw_rad);
                    let Some(end) = found.pieces().last().map(Piece::end) else {
                        assert!(length(place_m) < 1e-9 && yaw_rad == 0.0, "{place_m:?} {yaw_rad}");
                        continue;
                    };
                    assert!(length(sub(end.place_m, place_m)) < 1e-5, "{place_m:?} {yaw_rad}");
                    assert!(wrap(end.yaw_rad - yaw_rad).abs() < 1e-5, "{place_m:?} {yaw_rad}");
                    assert!(found.length_m() > length(place_m) - 1e-9);
                }
            }
        }
    }

    /// Straight ahead, straight back, a half circle, and the shift to the side of two arcs whose length is known:
    /// cos a = 1 - d / (4 R) with four arcs is never longer than going round.
    #[test]
    fn known_paths_are_found() {
        assert!((between(2.0, 0.0, 0.0).length_m() - 2.0).abs() < 1e-12);
        assert!((between(-2.0, 0.0, 0.0).length_m() - 2.0).abs() < 1e-12);
        assert!((between(0.0, 1.0, PI).length_m() - 0.5 * PI).abs() < 1e-9);
        assert!((between(0.5, 0.5, FRAC_PI_2).length_m() - 0.5 * FRAC_PI_2).abs() < 1e-9);
        assert!(between(0.0, 0.02, 0.0).length_m() < 0.5);
    }
}
