//! Slip-free kinematics of a wheel table: from body twists to wheel speeds and back.
//!
//! For wheel i at `(x_i, y_i)` with rolling direction `beta_i` (plus its steering angle), `docs/notation.md`:
//! ```text
//! along   R W_i = u cos beta + v sin beta + r (x sin beta - y cos beta)
//! across      0 = -u sin beta + v cos beta + r (x cos beta + y sin beta)      wheels of kind `Standard`
//! steering  tan delta_i = (x_i - x_f) tan delta / (L - y_i tan delta),  delta = atan(L r / u)
//! ```

use crate::watchdog::SetPoint;
use crate::{MAX_MOTORS, MAX_WHEELS};

/// Below this forward speed the steering angle of a twist is undefined.
const STILL_M_PER_S: f64 = 1e-9;

/// Velocity of the body origin in the body frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Twist {
    pub forward_m_per_s: f64,
    pub left_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
}

impl Twist {
    pub fn speed_m_per_s(&self) -> f64 {
        libm::sqrt(self.forward_m_per_s * self.forward_m_per_s + self.left_m_per_s * self.left_m_per_s)
    }

    /// The same motion along the same path at another speed.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            forward_m_per_s: factor * self.forward_m_per_s,
            left_m_per_s: factor * self.left_m_per_s,
            yaw_rate_rad_per_s: factor * self.yaw_rate_rad_per_s,
        }
    }

    pub fn is_finite(&self) -> bool {
        self.forward_m_per_s.is_finite() && self.left_m_per_s.is_finite() && self.yaw_rate_rad_per_s.is_finite()
    }
}

/// How a wheel touches the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelKind {
    /// Free across its rolling direction.
    Omni,
    Standard,
    /// Free in every direction.
    Caster,
}

/// One line of the wheel table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wheel {
    pub kind: WheelKind,
    pub x_m: f64,
    pub y_m: f64,
    pub rolling_direction_rad: f64,
    pub radius_m: f64,
    pub driven: bool,
    pub steered: bool,
}

/// Why a wheel table cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelTableError {
    /// More than [`MAX_WHEELS`], or more than [`MAX_MOTORS`] driven ones.
    TooMany,
    /// The radius of this driven wheel is not positive, or another number is not finite.
    Radius { wheel: usize },
    /// Steered wheels without an unsteered axle, or both in one place.
    Wheelbase,
}

/// Wheels of a robot in the order of its description.
#[derive(Debug, Clone, Copy)]
pub struct WheelTable {
    wheels: [Option<Wheel>; MAX_WHEELS],
    steering: Option<SteeringGeometry>,
}

#[derive(Debug, Clone, Copy)]
struct SteeringGeometry {
    /// Steered ahead of unsteered axle.
    wheelbase_m: f64,
    fixed_axle_x_m: f64,
    limit_rad: f64,
}

impl WheelTable {
    /// - `steering_limit_rad`: of the bicycle angle; read when a wheel is steered.
    pub fn new(wheels: &[Wheel], steering_limit_rad: f64) -> Result<Self, WheelTableError> {
        let driven = wheels.iter().filter(|wheel| wheel.driven).count();
        if wheels.len() > MAX_WHEELS || driven > MAX_MOTORS {
            return Err(WheelTableError::TooMany);
        }
        let is_bad = |wheel: &Wheel| {
            let numbers = [wheel.x_m, wheel.y_m, wheel.rolling_direction_rad, wheel.radius_m];
            !numbers.iter().all(|number| number.is_finite()) || (wheel.driven && wheel.radius_m <= 0.0)
        };
        if let Some(wheel) = wheels.iter().position(is_bad) {
            return Err(WheelTableError::Radius { wheel });
        }
        let mut table = [None; MAX_WHEELS];
        for (place, wheel) in table.iter_mut().zip(wheels) {
            *place = Some(*wheel);
        }
        let mut steering = None;
        if wheels.iter().any(|wheel| wheel.steered) {
            let (front, fixed) = (axle_x_m(wheels, true), axle_x_m(wheels, false));
            let (Some(front_m), Some(fixed_axle_x_m)) = (front, fixed) else {
                return Err(WheelTableError::Wheelbase);
            };
            let wheelbase_m = front_m - fixed_axle_x_m;
            if wheelbase_m == 0.0 {
                return Err(WheelTableError::Wheelbase);
            }
            let limit_rad = if steering_limit_rad.is_finite() {
                steering_limit_rad.clamp(0.0, 1.5)
            } else {
                1.5
            };
            steering = Some(SteeringGeometry {
                wheelbase_m,
                fixed_axle_x_m,
                limit_rad,
            });
        }
        Ok(Self {
            wheels: table,
            steering,
        })
    }

    fn wheels(&self) -> impl Iterator<Item = &Wheel> {
        self.wheels.iter().flatten()
    }

    /// Driven wheels.
    pub fn motors(&self) -> usize {
        self.wheels().filter(|wheel| wheel.driven).count()
    }

    pub fn is_steered(&self) -> bool {
        self.steering.is_some()
    }

    /// Can move to its left: all wheels that touch are free across.
    pub fn moves_sideways(&self) -> bool {
        self.wheels().all(|wheel| wheel.kind != WheelKind::Standard) && self.motors() > 2
    }

    /// Wheels say how fast it moves in every direction (an `omni4` on two driven wheels may slide unseen).
    pub fn sees_sideways(&self) -> bool {
        self.motors() > 2 || self.wheels().any(|wheel| wheel.kind == WheelKind::Standard)
    }

    /// Wheel set-points and steering angle of a twist.
    ///
    /// - `last_steering_rad` holds while the robot is to stand.
    pub fn set_point(&self, twist: &Twist, last_steering_rad: f64) -> SetPoint {
        let steering_rad = self.steering.map_or(0.0, |steering| {
            let wanted_rad = if twist.forward_m_per_s.abs() > STILL_M_PER_S {
                libm::atan(steering.wheelbase_m * twist.yaw_rate_rad_per_s / twist.forward_m_per_s)
            } else {
                last_steering_rad
            };
            wanted_rad.clamp(-steering.limit_rad, steering.limit_rad)
        });
        let mut set_point = SetPoint {
            steering_rad,
            ..SetPoint::default()
        };
        let driven = self.wheels().filter(|wheel| wheel.driven);
        for (speed, wheel) in set_point.wheel_rad_per_s.iter_mut().zip(driven) {
            let [forward, left, turning] = self.along(wheel, steering_rad);
            let rim_m_per_s =
                forward * twist.forward_m_per_s + left * twist.left_m_per_s + turning * twist.yaw_rate_rad_per_s;
            *speed = rim_m_per_s / wheel.radius_m;
        }
        set_point
    }

    /// Body twist of slip-free rolling, least squares over driven wheels and wheels that do not slide across.
    ///
    /// - `wheel_rad_per_s`: driven wheels in the order of the table.
    /// - Directions that no wheel sees come out as 0.
    pub fn twist(&self, wheel_rad_per_s: &[f64; MAX_MOTORS], steering_rad: f64) -> Twist {
        let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
        let mut add = |row: [f64; 3], value: f64| {
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate() {
                    normal[i][j] += a * b;
                }
                right[i] += a * value;
            }
        };
        let mut speeds = wheel_rad_per_s.iter();
        for wheel in self.wheels() {
            let row = self.along(wheel, steering_rad);
            if wheel.driven {
                add(row, wheel.radius_m * speeds.next().copied().unwrap_or(0.0));
            }
            if wheel.kind == WheelKind::Standard {
                let (cos, sin) = self.direction(wheel, steering_rad);
                add([-sin, cos, wheel.x_m * cos + wheel.y_m * sin], 0.0);
            }
        }
        let [forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s] = solve(normal, right);
        Twist {
            forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s,
        }
    }

    fn along(&self, wheel: &Wheel, steering_rad: f64) -> [f64; 3] {
        let (cos, sin) = self.direction(wheel, steering_rad);
        [cos, sin, wheel.x_m * sin - wheel.y_m * cos]
    }

    fn direction(&self, wheel: &Wheel, steering_rad: f64) -> (f64, f64) {
        let turned_rad = match self.steering {
            Some(steering) if wheel.steered => {
                let tangent = libm::tan(steering_rad.clamp(-steering.limit_rad, steering.limit_rad));
                libm::atan(
                    (wheel.x_m - steering.fixed_axle_x_m) * tangent / (steering.wheelbase_m - wheel.y_m * tangent),
                )
            }
            _ => 0.0,
        };
        let (sin, cos) = libm::sincos(wheel.rolling_direction_rad + turned_rad);
        (cos, sin)
    }
}

fn axle_x_m(wheels: &[Wheel], steered: bool) -> Option<f64> {
    let of = || {
        wheels
            .iter()
            .filter(|wheel| wheel.steered == steered && wheel.kind != WheelKind::Caster)
    };
    (of().count() > 0).then(|| of().map(|wheel| wheel.x_m).sum::<f64>() / of().count() as f64)
}

/// Solution of a symmetric positive semidefinite system by elimination with diagonal pivots; what is not determined is 0.
fn solve(mut a: [[f64; 3]; 3], mut b: [f64; 3]) -> [f64; 3] {
    const RELATIVE_PIVOT: f64 = 1e-9;
    let largest = a[0][0].max(a[1][1]).max(a[2][2]);
    let mut open = [true; 3];
    for _ in 0..3 {
        let mut pivot = 3;
        for i in 0..3 {
            if open[i] && (pivot == 3 || a[i][i] > a[pivot][pivot]) {
                pivot = i;
            }
        }
        if pivot == 3 || a[pivot][pivot] <= RELATIVE_PIVOT * largest {
            break;
        }
        open[pivot] = false;
        for i in (0..3).filter(|i| *i != pivot) {
            let factor = a[i][pivot] / a[pivot][pivot];
            let pivot_row = a[pivot];
            for (value, other) in a[i].iter_mut().zip(pivot_row) {
                *value -= factor * other;
            }
            b[i] -= factor * b[pivot];
        }
    }
    core::array::from_fn(|i| if open[i] { 0.0 } else { b[i] / a[i][i] })
}
