//! Discs that others move: robots that stand on the floor, or are pushed over it, without being in the run.
//!
//! Nobody says what such a disc does next, only that its velocity changes by at most `a`. Seen `age` ago at `p` with
//! velocity `w`, after `t = age + T` (T: until a command of now takes effect) it is
//!
//! ```text
//! within  a (t + h)^2 / 2  of  p + w t,      with a velocity of  w +- a t       h: frames may be missing
//! row     n . v >= -c(s) + max(w . n, 0) + a t     as far as standing still;   n . v >= -c(s) + w . n   when it comes
//! s       = distance - radii - margin - 2 e - what may have shrunk - a (t + h)^2 / 2
//! ```
//! So a robot never drives at where a push could bring the disc, gives way to what comes, and does not flee from a push
//! that nobody makes.

use super::Limits;
use super::margin::{FLED_M_PER_S, Place};
use crate::vector::{Vector, add, length, scale, sub};

/// Most discs that can be looked at.
pub const MAX_MOVING: usize = 64;
/// A disc is not believed to be larger or older than this, nor faster, nor to change its velocity faster.
const LARGEST_M: f64 = 10.0;
const OLDEST_S: f64 = 10.0;
const FASTEST_M_PER_S: f64 = 10.0;
const LARGEST_ACCELERATION_M_PER_S2: f64 = 100.0;
const FARTHEST_M: f64 = 1e6;

/// Something round that others move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingDisc {
    /// Named in the record; what the caller likes.
    pub id: u32,
    /// Centre in the world frame, when it was seen.
    pub position_m: [f64; 2],
    pub velocity_m_per_s: [f64; 2],
    pub radius_m: f64,
    /// Time since it was seen.
    pub age_s: f64,
    /// Fastest change of its velocity from now on.
    pub acceleration_m_per_s2: f64,
}

impl MovingDisc {
    /// Whether these numbers can be those of a disc: finite, none negative, none absurd.
    pub(super) fn is_possible(&self) -> bool {
        let within = |value: f64, most: f64| (0.0..=most).contains(&value);
        within(self.radius_m, LARGEST_M)
            && within(self.age_s, OLDEST_S)
            && within(self.acceleration_m_per_s2, LARGEST_ACCELERATION_M_PER_S2)
            && self.velocity_m_per_s.iter().all(|part| part.abs() <= FASTEST_M_PER_S)
            && self.position_m.iter().all(|part| part.abs() <= FARTHEST_M)
    }

    /// From its observation until a command of now takes effect on a robot.
    fn until_s(&self, place: &Place) -> f64 {
        self.age_s + place.reaction_s
    }

    /// How far it may be from where it would be without a change of velocity.
    fn swerve_m(&self, until_s: f64, limits: &Limits) -> f64 {
        let time_s = until_s + limits.hold_s;
        0.5 * self.acceleration_m_per_s2 * time_s * time_s
    }

    /// It as the rows see it.
    pub(super) fn place(&self, place: &Place) -> Place {
        let until_s = self.until_s(place);
        Place {
            position: Some(self.position_m),
            radius_m: self.radius_m,
            velocity: self.velocity_m_per_s,
            commanded: self.velocity_m_per_s,
            pending_m: scale(self.velocity_m_per_s, until_s),
            reaction_s: until_s,
            ..Place::STILL
        }
    }

    /// What a push may add to what is lost, m, and to its speed, m/s.
    pub(super) fn pushed(&self, place: &Place, limits: &Limits) -> (f64, f64) {
        let until_s = self.until_s(place);
        (self.swerve_m(until_s, limits), self.acceleration_m_per_s2 * until_s)
    }

    /// Distance of a point from wherever it may be when a command of now takes effect.
    pub(super) fn clearance_m(&self, point: Vector, place: &Place, limits: &Limits) -> f64 {
        let until_s = self.until_s(place);
        let then = add(self.position_m, scale(self.velocity_m_per_s, until_s));
        length(sub(point, then)) - self.radius_m - self.swerve_m(until_s, limits)
    }
}

/// Right side of the row of a robot against a disc that comes at `coming_m_per_s` and may be pushed by `pushed_m_per_s`.
pub(super) fn bound_against_pushed(approach: f64, coming_m_per_s: f64, pushed_m_per_s: f64) -> f64 {
    let wary = (coming_m_per_s.max(0.0) + pushed_m_per_s - approach).min(0.0);
    if coming_m_per_s > FLED_M_PER_S {
        wary.max(coming_m_per_s - approach)
    } else {
        wary
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_is_not_fled_from_and_what_comes_is_given_way() {
        assert_eq!(bound_against_pushed(0.0, 0.0, 0.2), 0.0);
        assert!((bound_against_pushed(0.5, 0.0, 0.2) + 0.3).abs() < 1e-15);
        assert!((bound_against_pushed(0.1, 0.4, 0.2) - 0.3).abs() < 1e-15);
        assert!((bound_against_pushed(0.9, 0.4, 0.2) + 0.3).abs() < 1e-15);
        // One that leaves may turn round.
        assert!((bound_against_pushed(0.5, -0.4, 0.2) + 0.3).abs() < 1e-15);
    }

    #[test]
    fn a_push_reaches_as_far_as_its_parabola() {
        let disc = MovingDisc {
            id: 1,
            position_m: [1.0, 0.0],
            velocity_m_per_s: [0.3, 0.0],
            radius_m: 0.2,
            age_s: 0.05,
            acceleration_m_per_s2: 2.0,
        };
        let place = Place {
            reaction_s: 0.15,
            ..Place::STILL
        };
        let limits = Limits {
            hold_s: 0.1,
            ..Limits::default()
        };
        // 0.2 s at 0.3 m/s, and 2 m/s2 for 0.3 s.
        let (swerve_m, faster_m_per_s) = disc.pushed(&place, &limits);
        assert!((swerve_m - 0.09).abs() < 1e-15 && (faster_m_per_s - 0.4).abs() < 1e-15);
        assert!((disc.clearance_m([2.0, 0.0], &place, &limits) - (1.0 - 0.06 - 0.2 - 0.09)).abs() < 1e-12);
        assert!(disc.is_possible());
        for odd in [f64::NAN, f64::INFINITY, -1.0, 1e9] {
            assert!(!MovingDisc { radius_m: odd, ..disc }.is_possible());
            assert!(!MovingDisc { age_s: odd, ..disc }.is_possible());
        }
        assert!(
            !MovingDisc {
                position_m: [f64::NAN, 0.0],
                ..disc
            }
            .is_possible()
        );
        assert!(
            !MovingDisc {
                velocity_m_per_s: [0.0, f64::INFINITY],
                ..disc
            }
            .is_possible()
        );
    }
}
