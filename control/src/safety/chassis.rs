//! What the filter decides about one robot: a few numbers `x`, all in m/s, and the limits of its wheels on them.
//!
//! ```text
//! holonomic        x = [u, v, rho r]    twist (u, v, r)
//! along an axis    x = [s, rho r, 0]    twist (s d, r), body origin moves with s d + r offset across d
//! steered          x = [u, 0, 0]        twist (u, k u), body origin moves with (u, k u offset); k is the desired curvature
//! ```

use twin::robot::{Robot, Wheel};
use twin::twist::BodyTwist;

use super::Limits;
use super::rows::{Row, Source};
use crate::law::Drive;
use crate::vector::{Vector, clip, direction, dot};

/// `rho`: weight of turning against driving, m. Small: where the wheels cannot do both, turning gives way.
pub const TURN_WEIGHT_M: f64 = 0.05;
/// Sides of the polygon inside the speed disc.
pub const SPEED_SIDES: usize = 16;
/// Most rows of one robot's own limits: speed, yaw rate, wheels.
pub const OWN_ROWS: usize = SPEED_SIDES + 2 + 2 * twin::MAX_WHEELS;
/// Below this forward speed a wanted curvature means nothing.
const STILL_M_PER_S: f64 = 1e-6;

/// The numbers that the filter chooses for one robot.
pub type Numbers = [f64; 3];

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    Holonomic,
    /// Along a direction in the body frame, forward and back.
    Axis {
        along: Vector,
    },
    Steered {
        least_radius_m: f64,
    },
}

/// Constants of one robot.
#[derive(Debug, Clone)]
pub struct Chassis {
    robot: Robot,
    pub motion: Motion,
    /// Sideways velocity of the body origin for each unit of yaw rate: how far it is ahead of the axle that cannot slide.
    pub offset_m: f64,
    /// Largest distance between the body origin and the centre of a turn on the spot: 0 but for robots that skid.
    pub walk_m: f64,
    /// Rim speed of each wheel for each number, divided by the wheel's radius; zero rows for wheels that are not driven.
    wheels: [Numbers; twin::MAX_WHEELS],
    wheel_limit_rad_per_s: f64,
    speed_m_per_s: f64,
    yaw_rate_rad_per_s: f64,
    /// Directions of the speed polygon's sides, one corner along x.
    sides: [Vector; SPEED_SIDES],
}

/// The centre of a turn of a robot that skids lies anywhere within this share of half the wheelbase.
const SKID_SHARE: f64 = 0.2;

/// Half of the distance between the first and the last axle of fixed wheels; 0 when one axle or rollers carry the turn.
fn half_wheelbase_m(robot: &Robot) -> f64 {
    let (first, last) = fixed_wheels(robot).fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), wheel| {
        (wheel.x_m.min(first), wheel.x_m.max(last))
    });
    0.5 * (last - first).max(0.0)
}

impl Chassis {
    pub fn new(robot: Robot, limits: &Limits) -> Chassis {
        let motion = match (robot.drive_axis_rad(), Drive::of(&robot)) {
            (Some(axis_rad), _) => Motion::Axis {
                along: crate::vector::heading(axis_rad),
            },
            (None, Drive::Holonomic) => Motion::Holonomic,
            (None, Drive::TurnInPlace { .. }) => Motion::Axis { along: [1.0, 0.0] },
            (None, Drive::Steered { turning_radius_m, .. }) => Motion::Steered {
                least_radius_m: turning_radius_m,
            },
        };
        let offset_m = match motion {
            Motion::Holonomic => 0.0,
            _ => -fixed_axle_x_m(&robot),
        };
        let mut chassis = Chassis {
            motion,
            offset_m,
            walk_m: match (motion, robot.drive_axis_rad()) {
                (Motion::Axis { .. }, None) => SKID_SHARE * half_wheelbase_m(&robot),
                _ => 0.0,
            },
            wheels: [[0.0; 3]; twin::MAX_WHEELS],
            wheel_limit_rad_per_s: robot.max_wheel_speed_rad_per_s() * limits.wheel_share,
            speed_m_per_s: limits.speed_m_per_s,
            yaw_rate_rad_per_s: limits.yaw_rate_rad_per_s,
            sides: std::array::from_fn(|k| {
                crate::vector::heading((2 * k + 1) as f64 * core::f64::consts::PI / SPEED_SIDES as f64)
            }),
            robot,
        };
        if !matches!(motion, Motion::Steered { .. }) {
            for number in 0..3 {
                let mut unit = [0.0; 3];
                unit[number] = 1.0;
                let command = chassis.robot.wheel_speeds(chassis.twist(unit, 0.0));
                for (row, speed) in chassis.wheels.iter_mut().zip(command.wheel_rad_per_s) {
                    row[number] = speed;
                }
            }
        }
        chassis
    }

    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    pub fn wheel_limit_rad_per_s(&self) -> f64 {
        self.wheel_limit_rad_per_s
    }

    /// Desired numbers within the limits on speed and yaw rate, and the curvature that a steered robot keeps.
    pub fn desired(&self, wanted: &BodyTwist, last_curvature: f64) -> (Numbers, f64) {
        let yaw = wanted
            .yaw_rate_rad_per_s
            .clamp(-self.yaw_rate_rad_per_s, self.yaw_rate_rad_per_s);
        let asked = [wanted.forward_m_per_s, wanted.left_m_per_s];
        match self.motion {
            Motion::Holonomic => {
                let [u, v] = clip(asked, self.speed_m_per_s);
                ([u, v, TURN_WEIGHT_M * yaw], 0.0)
            }
            Motion::Axis { along } => {
                let s = dot(along, asked).clamp(-self.speed_m_per_s, self.speed_m_per_s);
                ([s, TURN_WEIGHT_M * yaw, 0.0], 0.0)
            }
            Motion::Steered { least_radius_m } => {
                let sharpest = 1.0 / least_radius_m.max(1e-3);
                let asked_curvature = wanted.yaw_rate_rad_per_s / wanted.forward_m_per_s;
                let curvature = if wanted.forward_m_per_s.abs() > STILL_M_PER_S && asked_curvature.is_finite() {
                    asked_curvature.clamp(-sharpest, sharpest)
                } else {
                    last_curvature
                };
                let fastest = self.steered_speed_m_per_s(curvature);
                ([wanted.forward_m_per_s.clamp(-fastest, fastest), 0.0, 0.0], curvature)
            }
        }
    }

    /// Fastest forward speed on an arc that keeps both the speed and the yaw rate.
    fn steered_speed_m_per_s(&self, curvature: f64) -> f64 {
        let sideways = curvature * self.offset_m;
        let body = self.speed_m_per_s / (1.0 + sideways * sideways).sqrt();
        body.min(self.yaw_rate_rad_per_s / curvature.abs().max(1e-9))
    }

    /// Command for these numbers.
    pub fn twist(&self, x: Numbers, curvature: f64) -> BodyTwist {
        let (forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s) = match self.motion {
            Motion::Holonomic => (x[0], x[1], x[2] / TURN_WEIGHT_M),
            Motion::Axis { along } => (x[0] * along[0], x[0] * along[1], x[1] / TURN_WEIGHT_M),
            Motion::Steered { .. } => (x[0], 0.0, curvature * x[0]),
        };
        BodyTwist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s,
        }
    }

    /// Numbers of an earlier command.
    pub fn numbers(&self, twist: &BodyTwist) -> Numbers {
        let turn = TURN_WEIGHT_M * twist.yaw_rate_rad_per_s;
        match self.motion {
            Motion::Holonomic => [twist.forward_m_per_s, twist.left_m_per_s, turn],
            Motion::Axis { along } => [dot(along, [twist.forward_m_per_s, twist.left_m_per_s]), turn, 0.0],
            Motion::Steered { .. } => [twist.forward_m_per_s, 0.0, 0.0],
        }
    }

    /// Velocity of the body origin in the body frame.
    pub fn velocity(&self, x: Numbers, curvature: f64) -> Vector {
        match self.motion {
            Motion::Holonomic => [x[0], x[1]],
            Motion::Axis { along } => {
                let across = self.offset_m * x[1] / TURN_WEIGHT_M;
                [x[0] * along[0] - across * along[1], x[0] * along[1] + across * along[0]]
            }
            Motion::Steered { .. } => [x[0], self.offset_m * curvature * x[0]],
        }
    }

    /// Gradient of `n . velocity` with respect to the numbers, `n` in the body frame.
    pub fn gradient(&self, n: Vector, curvature: f64) -> Numbers {
        match self.motion {
            Motion::Holonomic => [n[0], n[1], 0.0],
            Motion::Axis { along } => {
                let across = [-along[1], along[0]];
                [dot(n, along), self.offset_m * dot(n, across) / TURN_WEIGHT_M, 0.0]
            }
            Motion::Steered { .. } => [n[0] + self.offset_m * curvature * n[1], 0.0, 0.0],
        }
    }

    /// Numbers with the yaw rate times `factor`.
    pub fn turning(&self, mut x: Numbers, factor: f64) -> Numbers {
        match self.motion {
            Motion::Holonomic => x[2] *= factor,
            Motion::Axis { .. } => x[1] *= factor,
            Motion::Steered { .. } => {}
        }
        x
    }

    /// Inside these sizes of driving and turning no own limit can be hurt.
    pub fn easy(&self) -> [f64; 2] {
        if matches!(self.motion, Motion::Steered { .. }) {
            return [0.0, 0.0];
        }
        let turn = TURN_WEIGHT_M * self.yaw_rate_rad_per_s;
        let turning = if self.motion == Motion::Holonomic { 2 } else { 1 };
        let inside = self.sides[0][0];
        let mut drive = self.speed_m_per_s * inside;
        for row in &self.wheels {
            let along = (row[0] * row[0] + if turning == 2 { row[1] * row[1] } else { 0.0 }).sqrt();
            if along > 0.0 {
                drive = drive.min((self.wheel_limit_rad_per_s - row[turning].abs() * turn) / along);
            }
        }
        [drive.max(0.0), turn]
    }

    /// Own limits as rows `gradient . x >= bound`: speed, yaw rate, wheels.
    ///
    /// The speed disc is replaced by a polygon inside it with a corner where the desired velocity points.
    pub fn own_rows(&self, robot: u32, desired: Numbers, curvature: f64, push: &mut impl FnMut(Row)) {
        let mut row = |source: Source, gradient: Numbers, limit: f64| {
            if limit.is_finite() {
                push(Row::own(robot, source, gradient.map(|g| -g), -limit));
            }
        };
        match self.motion {
            Motion::Holonomic => {
                let [c, s] = direction([desired[0], desired[1]]).unwrap_or([1.0, 0.0]);
                let limit = self.speed_m_per_s * self.sides[0][0];
                for [x, y] in self.sides {
                    row(Source::Speed, [c * x - s * y, s * x + c * y, 0.0], limit);
                }
                self.two_sided(
                    Source::YawRate,
                    [0.0, 0.0, 1.0],
                    TURN_WEIGHT_M * self.yaw_rate_rad_per_s,
                    &mut row,
                );
            }
            Motion::Axis { .. } => {
                self.two_sided(Source::Speed, [1.0, 0.0, 0.0], self.speed_m_per_s, &mut row);
                self.two_sided(
                    Source::YawRate,
                    [0.0, 1.0, 0.0],
                    TURN_WEIGHT_M * self.yaw_rate_rad_per_s,
                    &mut row,
                );
            }
            Motion::Steered { .. } => {
                self.two_sided(
                    Source::Speed,
                    [1.0, 0.0, 0.0],
                    self.steered_speed_m_per_s(curvature),
                    &mut row,
                );
                let unit = self.robot.wheel_speeds(self.twist([1.0, 0.0, 0.0], curvature));
                for (wheel, speed) in unit.wheel_rad_per_s.into_iter().enumerate() {
                    if speed != 0.0 {
                        self.two_sided(
                            Source::Wheel(wheel as u32),
                            [speed, 0.0, 0.0],
                            self.wheel_limit_rad_per_s,
                            &mut row,
                        );
                    }
                }
                return;
            }
        }
        for (wheel, speeds) in self.wheels.iter().enumerate() {
            if speeds.iter().any(|speed| *speed != 0.0) {
                self.two_sided(
                    Source::Wheel(wheel as u32),
                    *speeds,
                    self.wheel_limit_rad_per_s,
                    &mut row,
                );
            }
        }
    }

    fn two_sided(&self, source: Source, gradient: Numbers, limit: f64, row: &mut impl FnMut(Source, Numbers, f64)) {
        row(source, gradient, limit);
        row(source, gradient.map(|g| -g), limit);
    }
}

/// Wheels that neither steer nor roll sideways.
fn fixed_wheels(robot: &Robot) -> impl Iterator<Item = &Wheel> {
    let wheels = robot.description().wheels.iter();
    wheels.filter(|wheel| !wheel.steered && wheel.kind == "standard")
}

/// Where the wheels stand that neither steer nor slide sideways; the body turns about a point on that line.
fn fixed_axle_x_m(robot: &Robot) -> f64 {
    let (sum, count) = fixed_wheels(robot).fold((0.0, 0.0_f64), |(sum, count), w| (sum + w.x_m, count + 1.0));
    sum / count.max(1.0)
}
