//! Command fusion: a target and the robot's own estimate in, a body twist within all limits out.
//!
//! ```text
//! pose      v = k e towards it, at most sqrt(2 a_b d) at a distance d; yaw alike
//! caps      |(u, v)| <= speed cap, |r| <= yaw-rate cap, every wheel <= its limit: the whole twist is scaled, so the path stays
//! region    velocity towards a side at distance d: at most sqrt(2 a_b d) - a_b T, d less 3 sigma and half the way of a step
//! change    |d(u, v)/dt| <= a, |dr/dt| <= alpha,  a_b = 0.8 a
//! ```
//! Without a target, or with one whose time is over, the twist goes to zero at these rates. Without an anchored estimate the region
//! cannot be kept, so the robot stands.

use crate::estimator::{Estimate, wrapped};
use crate::frame::{Aim, Target};
use crate::kinematics::{Twist, WheelTable};
use crate::watchdog::SetPoint;

/// Braking that limits reckon with, as a share of the largest acceleration.
const BRAKING_SHARE: f64 = 0.8;
const POSITION_GAIN_PER_S: f64 = 3.0;
const YAW_GAIN_PER_S: f64 = 4.0;
/// A pose is reached when it is this near.
const ARRIVED_M: f64 = 0.005;
const ARRIVED_RAD: f64 = 0.01;
/// A robot that cannot move sideways turns to its goal first when it is off by more.
const TURN_FIRST_RAD: f64 = 0.6;

/// Limits that no target widens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DynamicLimits {
    pub speed_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
    pub accel_m_per_s2: f64,
    pub yaw_accel_rad_per_s2: f64,
    /// Largest size of a wheel set-point.
    pub wheel_rad_per_s: f64,
}

impl Default for DynamicLimits {
    fn default() -> Self {
        Self {
            speed_m_per_s: 1.0,
            yaw_rate_rad_per_s: 3.0,
            accel_m_per_s2: 1.5,
            yaw_accel_rad_per_s2: 8.0,
            wheel_rad_per_s: 35.0,
        }
    }
}

/// Turns targets into wheel set-points; its steps are `step_s` apart.
#[derive(Debug, Clone)]
pub struct Fusion {
    limits: DynamicLimits,
    step_s: f64,
    target: Option<Held>,
    twist: Twist,
    steering_rad: f64,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    target: Target,
    /// What is left of its time.
    left_s: f64,
}

impl Fusion {
    pub fn new(limits: DynamicLimits, step_s: f64) -> Self {
        Self {
            limits,
            step_s,
            target: None,
            twist: Twist::default(),
            steering_rad: 0.0,
        }
    }

    /// Takes a target that may be `age_ms` old; what is left of its time counts from now.
    pub fn accept(&mut self, target: &Target, age_ms: f64) {
        let left_s = (f64::from(target.expiry_ms.min(crate::frame::target::MAX_EXPIRY_MS)) - age_ms) / 1000.0;
        self.target = (left_s > 0.0).then_some(Held {
            target: *target,
            left_s,
        });
    }

    /// Forgets target and motion: somebody else drives.
    pub fn reset(&mut self) {
        self.target = None;
        self.twist = Twist::default();
    }

    /// Takes over a robot in motion.
    pub fn take_over(&mut self, twist: &Twist, steering_rad: f64) {
        self.twist = *twist;
        self.steering_rad = steering_rad;
    }

    /// The twist of the last step.
    pub fn twist(&self) -> &Twist {
        &self.twist
    }

    /// Set-points until the next step.
    pub fn step(&mut self, estimate: &Estimate, wheels: &WheelTable) -> SetPoint {
        let step_s = self.step_s;
        if let Some(held) = &mut self.target {
            held.left_s -= step_s;
            if held.left_s < 0.0 {
                self.target = None;
            }
        }
        let wanted = match self.target {
            Some(Held { target, .. }) if target.enable && !target.stop && estimate.anchored => {
                let wanted = self.aimed(&target.aim, estimate, wheels);
                let capped = self.capped(&wanted, &target, wheels);
                let changed = self.changed(&capped);
                // The region has the last word, so that nothing after it can widen the motion again.
                self.kept_in(&changed, &target, estimate, wheels)
            }
            _ => self.changed(&Twist::default()),
        };
        self.twist = wanted;
        let set_point = wheels.set_point(&self.twist, self.steering_rad);
        self.steering_rad = set_point.steering_rad;
        set_point
    }

    fn braking_m_per_s2(&self) -> f64 {
        BRAKING_SHARE * self.limits.accel_m_per_s2
    }

    fn aimed(&self, aim: &Aim, estimate: &Estimate, wheels: &WheelTable) -> Twist {
        match *aim {
            Aim::Twist(twist) => Twist {
                left_m_per_s: if wheels.moves_sideways() {
                    twist.left_m_per_s
                } else {
                    0.0
                },
                ..twist
            },
            Aim::Pose { x_m, y_m, yaw_rad } => {
                let (dx, dy) = (x_m - estimate.x_m, y_m - estimate.y_m);
                let distance_m = libm::sqrt(dx * dx + dy * dy);
                let (sin, cos) = libm::sincos(estimate.yaw_rad);
                let (ahead, aside) = (cos * dx + sin * dy, cos * dy - sin * dx);
                let speed =
                    (POSITION_GAIN_PER_S * distance_m).min(libm::sqrt(2.0 * self.braking_m_per_s2() * distance_m));
                let final_turn = self.turn(wrapped(yaw_rad - estimate.yaw_rad));
                if wheels.moves_sideways() {
                    let factor = if distance_m > ARRIVED_M {
                        speed / distance_m
                    } else {
                        0.0
                    };
                    return Twist {
                        forward_m_per_s: factor * ahead,
                        left_m_per_s: factor * aside,
                        yaw_rate_rad_per_s: final_turn,
                    };
                }
                if distance_m <= ARRIVED_M * 4.0 {
                    let yaw_rate_rad_per_s = if wheels.is_steered() { 0.0 } else { final_turn };
                    return Twist {
                        yaw_rate_rad_per_s,
                        ..Twist::default()
                    };
                }
                self.driven_to(ahead, aside, speed, wheels)
            }
        }
    }

    /// Forward or backward towards a point in the body frame, turning on the way.
    fn driven_to(&self, ahead: f64, aside: f64, speed: f64, wheels: &WheelTable) -> Twist {
        let backward = ahead < 0.0;
        let bearing_rad = if backward {
            libm::atan2(-aside, -ahead)
        } else {
            libm::atan2(aside, ahead)
        };
        let forward_m_per_s = speed * libm::cos(bearing_rad) * if backward { -1.0 } else { 1.0 };
        if wheels.is_steered() {
            // Pure pursuit: the arc through the point.
            let square = ahead * ahead + aside * aside;
            return Twist {
                forward_m_per_s,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: forward_m_per_s * 2.0 * aside / square.max(1e-6),
            };
        }
        Twist {
            forward_m_per_s: if bearing_rad.abs() > TURN_FIRST_RAD {
                0.0
            } else {
                forward_m_per_s
            },
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: self.turn(bearing_rad),
        }
    }

    fn turn(&self, error_rad: f64) -> f64 {
        if error_rad.abs() <= ARRIVED_RAD {
            return 0.0;
        }
        let brakable = libm::sqrt(2.0 * BRAKING_SHARE * self.limits.yaw_accel_rad_per_s2 * error_rad.abs());
        (YAW_GAIN_PER_S * error_rad.abs()).min(brakable) * if error_rad < 0.0 { -1.0 } else { 1.0 }
    }

    fn capped(&self, wanted: &Twist, target: &Target, wheels: &WheelTable) -> Twist {
        if !wanted.is_finite() {
            return Twist::default();
        }
        let speed_cap = target.speed_cap_m_per_s.min(self.limits.speed_m_per_s).max(0.0);
        let yaw_cap = target
            .yaw_rate_cap_rad_per_s
            .min(self.limits.yaw_rate_rad_per_s)
            .max(0.0);
        let fastest_wheel = wheels
            .set_point(wanted, self.steering_rad)
            .wheel_rad_per_s
            .iter()
            .fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()));
        let factor = ratio(speed_cap, wanted.speed_m_per_s())
            .min(ratio(yaw_cap, wanted.yaw_rate_rad_per_s.abs()))
            .min(ratio(self.limits.wheel_rad_per_s, fastest_wheel));
        wanted.scaled(factor)
    }

    /// Scales a twist down until it cannot leave the region.
    fn kept_in(&self, wanted: &Twist, target: &Target, estimate: &Estimate, wheels: &WheelTable) -> Twist {
        // What the wheels make of it: the body origin of a car-like robot swings sideways ahead of its fixed axle.
        let set_point = wheels.set_point(wanted, self.steering_rad);
        let made = wheels.twist(&set_point.wheel_rad_per_s, set_point.steering_rad);
        let (sin, cos) = libm::sincos(estimate.yaw_rad);
        let east = cos * made.forward_m_per_s - sin * made.left_m_per_s;
        let north = sin * made.forward_m_per_s + cos * made.left_m_per_s;
        let region = &target.region;
        let sides = [
            (region.right_m - estimate.x_m, east),
            (estimate.x_m - region.left_m, -east),
            (region.top_m - estimate.y_m, north),
            (estimate.y_m - region.bottom_m, -north),
        ];
        let braking = self.braking_m_per_s2();
        let margin_m = 3.0 * estimate.position_sd_m + 0.5 * made.speed_m_per_s() * self.step_s;
        let factor =
            sides
                .iter()
                .filter(|(_, outward)| *outward > 0.0)
                .fold(1.0, |factor: f64, (distance_m, outward)| {
                    let brakable = libm::sqrt(2.0 * braking * (distance_m - margin_m).max(0.0)) - braking * self.step_s;
                    factor.min(ratio(brakable.max(0.0), *outward))
                });
        wanted.scaled(factor)
    }

    /// As near to the wanted twist as the accelerations allow.
    fn changed(&self, wanted: &Twist) -> Twist {
        let before = &self.twist;
        let change = Twist {
            forward_m_per_s: wanted.forward_m_per_s - before.forward_m_per_s,
            left_m_per_s: wanted.left_m_per_s - before.left_m_per_s,
            yaw_rate_rad_per_s: wanted.yaw_rate_rad_per_s - before.yaw_rate_rad_per_s,
        };
        let linear = ratio(self.limits.accel_m_per_s2 * self.step_s, change.speed_m_per_s());
        let turning = ratio(
            self.limits.yaw_accel_rad_per_s2 * self.step_s,
            change.yaw_rate_rad_per_s.abs(),
        );
        Twist {
            forward_m_per_s: before.forward_m_per_s + linear * change.forward_m_per_s,
            left_m_per_s: before.left_m_per_s + linear * change.left_m_per_s,
            yaw_rate_rad_per_s: before.yaw_rate_rad_per_s + turning * change.yaw_rate_rad_per_s,
        }
    }
}

/// Factor that brings a size down to its limit.
fn ratio(limit: f64, size: f64) -> f64 {
    if size > limit { limit / size } else { 1.0 }
}
