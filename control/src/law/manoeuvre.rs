//! Driving a car-like robot along a Reeds-Shepp path to a pose, piece by piece, with a stop after each.
//!
//! On a piece with curvature k, with e the distance to its left, t the heading against it and sigma the direction of
//! driving, the commanded curvature is
//!
//! k_c = k - e / l^2 - 2 sigma t / l   =>   e'' + (2/l) e' + e / l^2 = 0 over the way driven   [Samson 1992, linearised]
//!
//! so errors decay over the length l without overshoot, forwards and backwards alike.

use twin::twist::BodyTwist;

use super::detour::Room;
use super::piece::{Place, errors};
use super::reeds_shepp::{self, Path};
use crate::TICK_S;
use crate::vector::{Vector, add, heading, length, scale, sub, wrap};

/// `l`: way over which errors decay.
const DECAY_M: f64 = 0.12;
/// Radius of the planned arcs over the smallest one of the robot: what is left is for corrections.
const RADIUS_SHARE: f64 = 1.15;
const ACCELERATION_M_PER_S2: f64 = 0.4;
/// While the wheels are turned to the next curvature the robot creeps this slowly: set-points are ratios of speeds.
const CREEP_M_PER_S: f64 = 0.001;
/// Slowest driving towards the end of a piece.
const SLOWEST_M_PER_S: f64 = 0.012;
/// A piece has been driven when this little is left.
const LEFT_M: f64 = 0.001;
/// Time for the steering to turn, and for the robot to come to rest, between two pieces.
const PAUSE_TICKS: u32 = 42;
/// Further off its path than this the robot plans anew.
const LOST_M: f64 = 0.08;
/// Points at which a path is compared with the walls, for each piece.
const SAMPLES: u32 = 12;

/// Turns that are tried where the yaw at the end is free.
const YAWS_RAD: [f64; 8] = [0.0, 0.25, -0.25, 0.5, -0.5, 0.9, -0.9, 1.4];

/// What a manoeuvre must know about the robot and the arena.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Car {
    pub turning_radius_m: f64,
    /// Position of the axle that is not steered, ahead of the body origin.
    pub axle_x_m: f64,
    pub speed_m_per_s: f64,
}

impl Car {
    /// The middle of the fixed axle: it moves like a unicycle.
    fn axle(&self, origin: &Place) -> Place {
        Place {
            place_m: add(origin.place_m, scale(heading(origin.yaw_rad), self.axle_x_m)),
            yaw_rad: origin.yaw_rad,
        }
    }

    /// The body origin when the axle is there.
    fn origin_m(&self, axle: &Place) -> Vector {
        sub(axle.place_m, scale(heading(axle.yaw_rad), self.axle_x_m))
    }

    /// Whether the body origin stays where it may be.
    fn stays(&self, path: &Path, holds: &dyn Fn(Vector) -> bool) -> bool {
        path.pieces().iter().all(|piece| {
            (1..=SAMPLES).all(|k| {
                let axle = piece.at(piece.length_m * f64::from(k) / f64::from(SAMPLES));
                holds(self.origin_m(&axle))
            })
        })
    }

    fn planned_radius_m(&self) -> f64 {
        RADIUS_SHARE * self.turning_radius_m
    }
}

/// A path and how much of it has been driven.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Manoeuvre {
    path: Path,
    planned: bool,
    index: u8,
    driven_m: f64,
    speed_m_per_s: f64,
    pause_ticks: u32,
}

impl Manoeuvre {
    /// One tick of the way to `goal`; a twist of the body origin and the point on the path.
    ///
    /// - `holds`: whether the body origin may be there; a path that it accepts is preferred.
    pub fn step(
        &mut self,
        car: &Car,
        here: &Place,
        goal: &Place,
        holds: &dyn Fn(Vector) -> bool,
    ) -> (BodyTwist, Vector) {
        let axle = car.axle(here);
        if !self.planned {
            let radius_m = car.planned_radius_m();
            *self = Manoeuvre {
                path: reeds_shepp::path(&axle, &car.axle(goal), radius_m, &|path| car.stays(path, holds)),
                planned: true,
                pause_ticks: PAUSE_TICKS,
                ..Manoeuvre::default()
            };
        }
        let Some(piece) = self.path.pieces().get(usize::from(self.index)).copied() else {
            // All pieces are driven; when the robot has come to rest, plan what is left.
            self.planned = self.pause_ticks > 0;
            self.pause_ticks = self.pause_ticks.saturating_sub(1);
            return (BodyTwist::default(), goal.place_m);
        };
        self.driven_m = piece.progress_m(self.driven_m, axle.place_m);
        let reference = piece.at(self.driven_m);
        let [left_m, off_rad] = errors(&reference, &axle);
        if length(sub(axle.place_m, reference.place_m)) > LOST_M && self.pause_ticks == 0 {
            self.planned = false;
            return (BodyTwist::default(), reference.place_m);
        }
        let left_to_drive_m = piece.length_m - self.driven_m;
        if left_to_drive_m <= LEFT_M {
            self.index += 1;
            self.driven_m = 0.0;
            self.speed_m_per_s = 0.0;
            self.pause_ticks = PAUSE_TICKS;
            return (BodyTwist::default(), reference.place_m);
        }
        let limit_per_m = 1.0 / car.turning_radius_m;
        let curvature_per_m =
            piece.curvature_per_m - left_m / (DECAY_M * DECAY_M) - 2.0 * piece.sign() * off_rad / DECAY_M;
        let curvature_per_m = curvature_per_m.clamp(-limit_per_m, limit_per_m);
        let speed_m_per_s = self.speed(car, left_to_drive_m);
        let forward_m_per_s = piece.sign() * speed_m_per_s;
        let twist = BodyTwist {
            forward_m_per_s,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: forward_m_per_s * curvature_per_m,
        };
        let ahead = sub(reference.place_m, scale(heading(reference.yaw_rad), car.axle_x_m));
        (twist, ahead)
    }

    /// Cost of the way between two places where every point of it is free.
    pub fn cost_m(car: &Car, from: &Place, to: &Place, room: &Room<'_>) -> Option<f64> {
        let radius_m = car.planned_radius_m();
        let stays = |path: &Path| car.stays(path, &|origin| room.holds(origin));
        let found = reeds_shepp::allowed_path(&car.axle(from), &car.axle(to), radius_m, &stays);
        found.map(|path| path.cost_m(radius_m))
    }

    /// Whether what is left of the path leads where the robot may not be.
    pub fn is_blocked(&self, car: &Car, room: &Room<'_>) -> bool {
        let pieces = self.path.pieces();
        let left = pieces.iter().enumerate().skip(usize::from(self.index));
        let mut points = left.flat_map(|(at, piece)| {
            let from_m = if at == usize::from(self.index) {
                self.driven_m
            } else {
                0.0
            };
            (1..=SAMPLES).map(move |k| piece.at(from_m + (piece.length_m - from_m) * f64::from(k) / f64::from(SAMPLES)))
        });
        self.planned && points.any(|axle| !room.holds(car.origin_m(&axle)))
    }

    /// The yaw, of eight around that of the robot, with which `goal_m` is reached most cheaply.
    pub fn best_yaw_rad(car: &Car, here: &Place, goal_m: Vector) -> f64 {
        let radius_m = car.planned_radius_m();
        let mut best = (f64::INFINITY, here.yaw_rad);
        for turn in YAWS_RAD {
            let goal = Place {
                place_m: goal_m,
                yaw_rad: wrap(here.yaw_rad + turn),
            };
            let path = reeds_shepp::path(&car.axle(here), &car.axle(&goal), radius_m, &|_| true);
            let cost_m = path.cost_m(radius_m);
            if cost_m < best.0 {
                best = (cost_m, goal.yaw_rad);
            }
        }
        best.1
    }

    /// The last piece of the path is being driven.
    pub fn is_ending(&self) -> bool {
        self.planned && usize::from(self.index) + 1 == self.path.pieces().len()
    }

    /// The next place to plan from is where the robot is.
    pub fn forget(&mut self) {
        *self = Manoeuvre::default();
    }

    fn speed(&mut self, car: &Car, left_m: f64) -> f64 {
        if self.pause_ticks > 0 {
            self.pause_ticks -= 1;
            return CREEP_M_PER_S;
        }
        let braking = (2.0 * ACCELERATION_M_PER_S2 * 0.5 * left_m).sqrt();
        self.speed_m_per_s = (self.speed_m_per_s + ACCELERATION_M_PER_S2 * TICK_S)
            .min(braking)
            .clamp(SLOWEST_M_PER_S, car.speed_m_per_s.max(SLOWEST_M_PER_S));
        self.speed_m_per_s
    }
}

/// How far `here` is from `goal`: metres and radians, not negative.
pub fn distance(here: &Place, goal: &Place) -> [f64; 2] {
    [
        length(sub(goal.place_m, here.place_m)),
        wrap(goal.yaw_rad - here.yaw_rad).abs(),
    ]
}
