//! `path_following`: PID on the distance to a path of waypoints.
//!
//! The path runs from the start through the waypoints. With e the distance to its left, the robot is to return with
//!
//! u = k_p e + k_i int e dt + k_d de/dt        [PID; the cascade for robots that cannot move sideways: Siciliano and Khatib 2016]
//!
//! across the path while it drives along it. A robot that moves sideways does just that; the others point along the sum
//! of both. A robot that turns in place stops and turns at corners, that much earlier as its model says that it turns ahead of its origin.
//! A car-like robot drives arcs there, as tight as it may, and
//! never bends more than its steering allows; where the path turns back it changes gear.

use twin::twist::BodyTwist;

use super::motion::{YAW_RATE_LIMIT_RAD_PER_S, pointing_share};
use super::parameters::{REACH_RADIUS, SPEED, YAW_GAIN};
use super::piece::{Piece, Place, errors};
use super::targets::{Owner, TargetRule, YawUse};
use super::{
    Body, Demand, Drive, Law, LawSpec, Observation, PATH_FOLLOWING, ParameterSpec, Parameters, RobotObservation, corner,
};
use crate::TICK_S;
use crate::scenario::Scenario;
use crate::vector::{Vector, body_from_world, dot, heading, length, right_of, scale, sub, wrap};

pub(super) const SPEC: LawSpec = LawSpec {
    name: PATH_FOLLOWING,
    title: "Path following: PID on the distance to the path through the waypoints, corners as the chassis allows",
    source: "PID on the cross-track distance; cascade and curvature limit after Siciliano and Khatib (eds.) 2016, Springer Handbook of Robotics",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 1,
        most_each: u32::MAX,
        yaw: YawUse::Unused,
        apart: false,
        meaning: "Corners of each robot's path, which begins at its start; a robot without any stands still.",
    },
    parameters: &[
        SPEED,
        ParameterSpec::quantity(
            "distance_gain_per_s",
            "1/s",
            [0.1, 1.5, 5.0],
            "k_p: speed back to the path for each metre of distance.",
        ),
        ParameterSpec::quantity(
            "integral_gain_per_s2",
            "1/s2",
            [0.0, 0.2, 2.0],
            "k_i: the same for each metre-second of distance gathered.",
        ),
        ParameterSpec::quantity(
            "derivative_gain",
            "",
            [0.0, 0.1, 0.9],
            "k_d: the same for each metre per second by which the distance changes.",
        ),
        YAW_GAIN,
        REACH_RADIUS,
    ],
};

/// Braking that the speed before corners relies on.
const BRAKING_M_PER_S2: f64 = 0.3;
const ACCELERATION_M_PER_S2: f64 = 0.5;
/// Speed at which a corner is passed.
const CORNER_M_PER_S: f64 = 0.04;
/// A corner counts as passed this close.
const PASSED_M: f64 = 0.002;
/// Bends below this angle are no corners.
const CORNER_RAD: f64 = 0.05;
/// A robot that turns on the spot at a corner drives on when it points this well.
const TURNED_RAD: f64 = 0.03;
/// A body origin that lies l behind the point about which the robot turns - with the back first, or between the axles of a
/// robot that skids - swings out before it comes back. With the heading b = k_p e / base that is wanted,
/// `de/dt = -s b + l db/dt` and `db/dt = k_b (k_p e / base - b)` grow as soon as base < l k_p, whatever the speed s; twice
/// that halves the damping at most.
const SWING_ROOM: f64 = 2.0;
/// The return to the path is at most this share of the speed.
const RETURN_SHARE: f64 = 0.8;
/// Largest magnitude of the integral, and distance beyond which it rests.
const INTEGRAL_M_S: f64 = 0.15;
const INTEGRAL_RANGE_M: f64 = 0.15;

#[derive(Debug)]
pub struct PathFollowing {
    robots: Vec<Progress>,
}

#[derive(Debug, Clone, Default)]
struct Progress {
    pieces: Vec<Piece>,
    /// Of a steered robot: how far the body points outside of each piece where that begins, seen along the body.
    outward_rad: Vec<f64>,
    index: usize,
    driven_m: f64,
    speed_m_per_s: f64,
    integral_m_s: f64,
    first_yaw_rad: Option<f64>,
    /// A robot that turns on the spot has turned at the corner that it passed last.
    turned: bool,
    finished: bool,
}

impl PathFollowing {
    pub fn new(scenario: &Scenario) -> PathFollowing {
        let drives = super::drives(scenario);
        let progress = |(i, drive): (usize, &Drive)| {
            let pieces = corner::pieces(&corner::corners(scenario, i), *drive).unwrap_or_default();
            Progress {
                outward_rad: outward_rad(&pieces, *drive),
                pieces,
                ..Progress::default()
            }
        };
        PathFollowing {
            robots: drives.iter().enumerate().map(progress).collect(),
        }
    }
}

impl Law for PathFollowing {
    fn name(&self) -> &'static str {
        PATH_FOLLOWING
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        for (i, (progress, demand)) in self.robots.iter_mut().zip(demands).enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            if !robot.pose.is_finite() {
                demand.finished = progress.finished;
                continue;
            }
            *demand = progress.follow(robot, body, observation.parameters);
        }
    }
}

impl Progress {
    fn follow(&mut self, robot: &RobotObservation, body: &Body, parameters: &Parameters) -> Demand {
        let drive = body.drive;
        let here = Place {
            place_m: [robot.pose.x_m, robot.pose.y_m],
            yaw_rad: robot.pose.yaw_rad,
        };
        let first_yaw_rad = *self.first_yaw_rad.get_or_insert(here.yaw_rad);
        let Some(piece) = self.pass(here.place_m, body) else {
            return Demand {
                target: here.place_m,
                finished: true,
                ..Demand::default()
            };
        };
        let reference = piece.at(self.driven_m);
        let [left_m, _] = errors(&reference, &here);
        let last = self.index + 1 == self.pieces.len();
        let to_end_m = piece.length_m - self.driven_m;
        let reach_m = parameters.get("reach_radius_m");
        self.finished |= last && to_end_m <= reach_m && length(sub(piece.end().place_m, here.place_m)) <= reach_m;
        self.finished |= last && drive != Drive::Holonomic && to_end_m <= 1e-9;
        let straight = piece.curvature_per_m == 0.0;
        let mut demand = Demand {
            target: reference.place_m,
            segment: straight.then(|| [piece.from.place_m, piece.end().place_m]),
            finished: self.finished,
            ..Demand::default()
        };
        if self.finished && drive != Drive::Holonomic {
            return demand;
        }
        let along_m_per_s = self.speed((to_end_m - self.early_m(body)).max(0.0), parameters);
        let back_m_per_s = self.back(left_m, &reference, robot, parameters);
        demand.twist = match drive {
            Drive::Holonomic => {
                let world = [
                    sub(scale(heading(reference.yaw_rad), along_m_per_s), [0.0, 0.0]),
                    scale(right_of(heading(reference.yaw_rad)), back_m_per_s),
                ];
                let velocity = [world[0][0] + world[1][0], world[0][1] + world[1][1]];
                let [forward_m_per_s, left_m_per_s] = body_from_world(velocity, here.yaw_rad);
                let turn = parameters.get("yaw_gain_per_s") * wrap(first_yaw_rad - here.yaw_rad);
                BodyTwist {
                    forward_m_per_s,
                    left_m_per_s,
                    yaw_rate_rad_per_s: turn.clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S),
                }
            }
            _ => {
                let outward_rad = self.outward_rad.get(self.index).copied().unwrap_or_default();
                let way = Way {
                    piece,
                    yaw_rad: reference.yaw_rad,
                    outward_rad: outward_at(&piece, outward_rad, self.driven_m, drive),
                };
                let (twist, error_rad) = pointed(drive, &here, &way, [along_m_per_s, back_m_per_s], parameters);
                self.turned |= !matches!(drive, Drive::TurnInPlace { .. }) || error_rad.abs() < TURNED_RAD;
                if self.turned {
                    twist
                } else {
                    self.speed_m_per_s = 0.0;
                    BodyTwist {
                        forward_m_per_s: 0.0,
                        ..twist
                    }
                }
            }
        };
        demand
    }

    /// The piece that the robot is on; `None` without a path.
    fn pass(&mut self, here_m: Vector, body: &Body) -> Option<Piece> {
        let mut piece = *self.pieces.get(self.index)?;
        self.driven_m = piece.progress_m(self.driven_m, here_m);
        while self.index + 1 < self.pieces.len() && piece.length_m - self.driven_m <= self.slack_m(body) {
            self.index += 1;
            self.driven_m = 0.0;
            self.integral_m_s = 0.0;
            self.turned = false;
            piece = self.pieces[self.index];
            self.driven_m = piece.progress_m(0.0, here_m);
        }
        Some(piece)
    }

    /// A corner is passed this far before it; where the path is smooth, at its end.
    fn slack_m(&self, body: &Body) -> f64 {
        if self.corner_ahead() {
            PASSED_M + self.early_m(body)
        } else {
            1e-6
        }
    }

    /// How far before a corner a robot turns on the spot that does so about a point c ahead of its origin: from d before it, a turn
    /// by a leaves the origin `|c - d| sin a` beside the next leg and `(c - d) cos a - c` along it. `d = c (1 - cos a)` keeps it
    /// within c of both legs, and at the corner itself where the path turns back.
    fn early_m(&self, body: &Body) -> f64 {
        let (Some(piece), Some(next)) = (self.pieces.get(self.index), self.pieces.get(self.index + 1)) else {
            return 0.0;
        };
        if is_smooth(piece, next) {
            return 0.0;
        }
        let turn_rad = wrap(next.from.yaw_rad - piece.end().yaw_rad);
        let early_m = body.turn_point_x_m * (1.0 - libm::cos(turn_rad));
        early_m.clamp(0.0, 0.5 * piece.length_m)
    }

    /// The path ends or bends at the end of the piece.
    fn corner_ahead(&self) -> bool {
        let (Some(piece), next) = (self.pieces.get(self.index), self.pieces.get(self.index + 1)) else {
            return true;
        };
        next.is_none_or(|next| !is_smooth(piece, next))
    }

    /// Speed along the path: brakes for the next corner and the end.
    fn speed(&mut self, to_end_m: f64, parameters: &Parameters) -> f64 {
        let last = self.index + 1 == self.pieces.len();
        let mut room_m = to_end_m;
        let mut k = self.index;
        let smooth = |k: usize| {
            let next = self.pieces.get(k + 1);
            next.is_some_and(|next| is_smooth(&self.pieces[k], next))
        };
        while smooth(k) && room_m < 1.0 {
            k += 1;
            room_m += self.pieces[k].length_m;
        }
        let braking = (2.0 * BRAKING_M_PER_S2 * room_m).sqrt();
        // Close to the end the speed goes with what is left, so that the robot comes to rest there.
        let approach = if last { (2.0 * room_m).max(0.01) } else { CORNER_M_PER_S };
        let limit = braking.min(parameters.get("speed_m_per_s"));
        let limit = if last { limit.min(approach) } else { limit.max(approach) };
        self.speed_m_per_s = (self.speed_m_per_s + ACCELERATION_M_PER_S2 * TICK_S).min(limit);
        if last && to_end_m <= 1e-9 {
            0.0
        } else {
            self.speed_m_per_s
        }
    }

    /// Speed to the right, back to the path.
    fn back(&mut self, left_m: f64, reference: &Place, robot: &RobotObservation, parameters: &Parameters) -> f64 {
        if left_m.abs() < INTEGRAL_RANGE_M {
            self.integral_m_s = (self.integral_m_s + left_m * TICK_S).clamp(-INTEGRAL_M_S, INTEGRAL_M_S);
        }
        let known = robot.twist.forward_m_per_s.is_finite() && robot.twist.left_m_per_s.is_finite();
        let twist = [robot.twist.forward_m_per_s, robot.twist.left_m_per_s];
        let velocity = crate::vector::world_from_body(twist, robot.pose.yaw_rad);
        let rate = if known {
            -dot(velocity, right_of(heading(reference.yaw_rad)))
        } else {
            0.0
        };
        let wanted = parameters.get("distance_gain_per_s") * left_m
            + parameters.get("integral_gain_per_s2") * self.integral_m_s
            + parameters.get("derivative_gain") * rate;
        let limit = RETURN_SHARE * parameters.get("speed_m_per_s");
        wanted.clamp(-limit, limit)
    }
}

/// No corner between two pieces, and no change of gear.
fn is_smooth(piece: &Piece, next: &Piece) -> bool {
    piece.backwards == next.backwards && wrap(next.from.yaw_rad - piece.end().yaw_rad).abs() <= CORNER_RAD
}

/// Where a robot is on its path.
struct Way {
    piece: Piece,
    /// Of the path.
    yaw_rad: f64,
    outward_rad: f64,
}

/// How far a steered body points outside of a piece.
///
/// The body origin runs along the path and drags the fixed axle, which lies L behind it: with x along the body
/// `db/dx = k - sin(b) / L`, so `b = L k + (b_0 - L k) exp(-x / L)` for small b. The same holds with the back first, from the end.
fn outward_at(piece: &Piece, begins_rad: f64, driven_m: f64, drive: Drive) -> f64 {
    let Drive::Steered { axle_x_m, .. } = drive else {
        return 0.0;
    };
    let lever_m = -axle_x_m;
    let settled_rad = lever_m * piece.curvature_per_m;
    let x_m = if piece.backwards {
        piece.length_m - driven_m
    } else {
        driven_m
    };
    if lever_m > 0.0 {
        settled_rad + (begins_rad - settled_rad) * libm::exp(-x_m / lever_m)
    } else {
        settled_rad
    }
}

/// [`outward_at`] where each piece begins, seen along the body: 0 after a change of gear.
fn outward_rad(pieces: &[Piece], drive: Drive) -> Vec<f64> {
    let mut begins = vec![0.0; pieces.len()];
    for k in 1..pieces.len() {
        let before = &pieces[k - 1];
        if !before.backwards && is_smooth(before, &pieces[k]) {
            begins[k] = outward_at(before, begins[k - 1], before.length_m, drive);
        }
    }
    for k in (1..pieces.len()).rev() {
        let after = &pieces[k];
        if after.backwards && is_smooth(&pieces[k - 1], after) {
            begins[k - 1] = outward_at(after, begins[k], 0.0, drive);
        }
    }
    begins
}

/// How far the body origin swings out to the wrong side, for a radian, when the robot turns back to a piece: it lies behind
/// the point about which it turns, as the robot drives.
fn swing_m(drive: Drive, piece: &Piece) -> f64 {
    match drive {
        Drive::Steered { axle_x_m, .. } => (piece.sign() * axle_x_m).max(0.0),
        Drive::TurnInPlace { swing_m } => swing_m,
        Drive::Holonomic => 0.0,
    }
}

/// A robot that cannot move sideways points along the sum of both speeds, `[along, back]`; with its error of heading, rad.
fn pointed(
    drive: Drive,
    here: &Place,
    way: &Way,
    [along_m_per_s, back_m_per_s]: [f64; 2],
    parameters: &Parameters,
) -> (BodyTwist, f64) {
    let piece = &way.piece;
    let gain_per_s = parameters.get("distance_gain_per_s");
    let base = along_m_per_s
        .max(0.1)
        .max(SWING_ROOM * gain_per_s * swing_m(drive, piece));
    let wanted_rad = way.yaw_rad - way.outward_rad - piece.sign() * libm::atan2(back_m_per_s, base);
    let error_rad = wrap(wanted_rad - here.yaw_rad);
    let turn = parameters.get("yaw_gain_per_s") * error_rad;
    let twist = match drive {
        Drive::Steered {
            turning_radius_m,
            axle_x_m,
        } => {
            let forward_m_per_s = piece.sign() * along_m_per_s * libm::cos(error_rad).max(0.3);
            let limit = forward_m_per_s.abs() / turning_radius_m.max(1e-3);
            let curvature_per_m = if axle_x_m < 0.0 {
                libm::tan(way.outward_rad) / -axle_x_m
            } else {
                piece.curvature_per_m
            };
            let ahead = forward_m_per_s * curvature_per_m;
            BodyTwist {
                forward_m_per_s,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: (ahead + turn).clamp(-limit, limit),
            }
        }
        _ => BodyTwist {
            forward_m_per_s: along_m_per_s * pointing_share(error_rad),
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: turn.clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S),
        },
    };
    (twist, error_rad)
}
