//! Where a robot is and how it moves: an extended Kalman filter over `[x, y, yaw, b, u, v]`.
//!
//! `b` is the gyro's bias, `(u, v)` the velocity of the body origin in the body frame. [`orientation`] and [`position`] hold the
//! equations of the two halves; this file has the state, its covariance and what ties them. Every measurement enters as a scalar:
//! ```text
//! K = P h / (h' P h + R),  s += K (z - h(s)),  P -= K h' P
//! ```
//! A fix of the laboratory was exposed in the past: it is compared with the pose of that moment, kept for 0.4 s.

pub mod orientation;
pub mod position;

mod history;

use crate::kinematics::Twist;
use history::History;
use libm::sqrt;

const STATES: usize = 6;
const X: usize = 0;
const Y: usize = 1;
const YAW: usize = 2;
const BIAS: usize = 3;
const U: usize = 4;
const V: usize = 5;

/// Standard deviations up to which an estimate counts as bounded.
pub const BOUNDED_POSITION_M: f64 = 0.05;
pub const BOUNDED_YAW_RAD: f64 = 0.1;
/// A measurement further off than this many standard deviations is left out.
const GATE: f64 = 5.0;
/// So many fixes in a row left out mean that the estimate is wrong, not they.
const MAX_REJECTED_FIXES: u32 = 12;

/// What the filter takes sensors for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimatorSettings {
    /// Time between steps.
    pub step_s: f64,
    /// One standard deviation of a sample.
    pub gyro_rad_per_s: f64,
    /// How the bias wanders, rad/s in a square-root second.
    pub bias_walk_rad_per_s: f64,
    /// Error of the acceleration (noise, bias, slope) as a walk of the velocity, m/s in a square-root second.
    pub accel_walk_m_per_s: f64,
    /// Error of the velocity that the wheels show, and how long it stays the same.
    pub wheel_velocity_m_per_s: f64,
    pub wheel_correlation_s: f64,
    /// Position error gathered on the way, m in a square-root metre.
    pub odometry_walk_m: f64,
    /// World direction of magnetic north and error of the magnetometer's heading; `None` without a magnetometer.
    pub magnetometer: Option<Magnetometer>,
}

/// A compass and how far it can be trusted indoors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnetometer {
    /// Direction of the field's horizontal part in the world frame.
    pub north_rad: f64,
    /// Size of the field's horizontal part.
    pub field_t: f64,
    pub heading_rad: f64,
    /// How long its error stays the same.
    pub correlation_s: f64,
}

impl Default for EstimatorSettings {
    /// For the reference robots at 480 Hz.
    fn default() -> Self {
        Self {
            step_s: 1.0 / crate::firmware::RATE_HZ,
            gyro_rad_per_s: 0.006,
            bias_walk_rad_per_s: 1e-5,
            accel_walk_m_per_s: 0.1,
            wheel_velocity_m_per_s: 0.02,
            wheel_correlation_s: 0.1,
            odometry_walk_m: 0.02,
            magnetometer: None,
        }
    }
}

/// Sensor values of one step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measurement {
    pub gyro_z_rad_per_s: f64,
    /// Forward and left.
    pub accel_m_per_s2: [f64; 2],
    /// Twist that the wheels show.
    pub wheel_twist: Twist,
    /// The wheels see motion to the left ([`crate::kinematics::WheelTable::sees_sideways`]).
    pub sees_sideways: bool,
    /// The wheels have not turned for a while and are not told to.
    pub standing: bool,
    /// Horizontal field, forward and left.
    pub magnetic_field_t: Option<[f64; 2]>,
}

/// A pose of the laboratory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PoseFix {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub position_sd_m: f64,
    pub yaw_sd_rad: f64,
    /// Time since its exposure.
    pub age_ms: f64,
}

/// What became of a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FixOutcome {
    /// The pose starts from it.
    Anchored,
    Used,
    /// Too far from the estimate.
    Outlier,
    /// Older than the history, or not finite.
    Unusable,
}

/// Estimate of a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Estimate {
    pub x_m: f64,
    pub y_m: f64,
    /// Wrapped to +-pi.
    pub yaw_rad: f64,
    pub twist: Twist,
    pub gyro_bias_rad_per_s: f64,
    /// One standard deviation of the worse direction.
    pub position_sd_m: f64,
    pub yaw_sd_rad: f64,
    /// The pose is in the world frame.
    pub anchored: bool,
}

impl Estimate {
    /// Anchored and known within [`BOUNDED_POSITION_M`] and [`BOUNDED_YAW_RAD`].
    pub fn is_bounded(&self) -> bool {
        self.anchored && self.position_sd_m <= BOUNDED_POSITION_M && self.yaw_sd_rad <= BOUNDED_YAW_RAD
    }
}

/// The filter. No clock: steps are `step_s` apart.
#[derive(Debug, Clone)]
pub struct Estimator {
    settings: EstimatorSettings,
    state: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
    /// Yaw rate of the last step, bias taken off.
    yaw_rate_rad_per_s: f64,
    history: History,
    anchored: bool,
    rejected_fixes: u32,
}

/// A scalar measurement: how it depends on the state, its innovation and its variance.
#[derive(Debug, Clone, Copy)]
struct Scalar {
    row: [f64; STATES],
    innovation: f64,
    variance: f64,
}

impl Estimator {
    /// At rest somewhere.
    pub fn new(settings: EstimatorSettings) -> Self {
        let mut covariance = [[0.0; STATES]; STATES];
        let sd = [10.0, 10.0, 1.8, 0.02, 0.01, 0.01];
        for (i, (row, sd)) in covariance.iter_mut().zip(sd).enumerate() {
            row[i] = sd * sd;
        }
        Self {
            settings,
            state: [0.0; STATES],
            covariance,
            yaw_rate_rad_per_s: 0.0,
            history: History::default(),
            anchored: false,
            rejected_fixes: 0,
        }
    }

    /// The robot was lifted and put down somewhere at rest; only the gyro's bias is still known.
    pub fn lift(&mut self) {
        let (bias, variance) = (self.state[BIAS], self.covariance[BIAS][BIAS]);
        *self = Self::new(self.settings);
        self.state[BIAS] = bias;
        self.covariance[BIAS][BIAS] = variance;
    }

    /// One step of time with its sensor values. Values that are not finite are left out.
    pub fn step(&mut self, measurement: &Measurement) {
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        let gyro = if measurement.gyro_z_rad_per_s.is_finite() {
            measurement.gyro_z_rad_per_s
        } else {
            self.state[BIAS]
        };
        self.predict(gyro, measurement.accel_m_per_s2.map(finite));
        self.take_wheels(measurement);
        if measurement.standing {
            self.take_standstill(gyro);
        }
        if let Some(field_t) = measurement.magnetic_field_t {
            self.take_field(field_t);
        }
        self.history.push([self.state[X], self.state[Y], self.state[YAW]]);
    }

    /// Takes a fix whose exposure lies `age_ms` back.
    pub fn fix(&mut self, fix: &PoseFix) -> FixOutcome {
        let numbers = [
            fix.x_m,
            fix.y_m,
            fix.yaw_rad,
            fix.position_sd_m,
            fix.yaw_sd_rad,
            fix.age_ms,
        ];
        if !numbers.iter().all(|number| number.is_finite()) {
            return FixOutcome::Unusable;
        }
        let steps = fix.age_ms.max(0.0) / (1000.0 * self.settings.step_s);
        let Some(past) = self.history.at(steps) else {
            return FixOutcome::Unusable;
        };
        let position_sd_m = fix.position_sd_m.max(5e-4);
        let yaw_sd_rad = fix.yaw_sd_rad.max(1e-3);
        if !self.anchored || self.rejected_fixes >= MAX_REJECTED_FIXES {
            self.anchor(fix, past, position_sd_m, yaw_sd_rad);
            return FixOutcome::Anchored;
        }
        let innovations = [fix.x_m - past[0], fix.y_m - past[1], wrapped(fix.yaw_rad - past[2])];
        let variances = [
            position_sd_m * position_sd_m,
            position_sd_m * position_sd_m,
            yaw_sd_rad * yaw_sd_rad,
        ];
        let is_outlier = (0..3).any(|i| {
            let variance = self.covariance[i][i] + variances[i];
            innovations[i] * innovations[i] > GATE * GATE * variance
        });
        if is_outlier {
            self.rejected_fixes += 1;
            return FixOutcome::Outlier;
        }
        self.rejected_fixes = 0;
        let before = [self.state[X], self.state[Y], self.state[YAW]];
        for i in 0..3 {
            let mut row = [0.0; STATES];
            row[i] = 1.0;
            // What the scalars before have moved counts already.
            let moved = self.state[i] - before[i];
            self.take(&Scalar {
                row,
                innovation: innovations[i] - moved,
                variance: variances[i],
            });
        }
        self.history.shift(core::array::from_fn(|i| self.state[i] - before[i]));
        FixOutcome::Used
    }

    /// Starts the pose from a fix, moved on by what has happened since its exposure.
    fn anchor(&mut self, fix: &PoseFix, past: [f64; 3], position_sd_m: f64, yaw_sd_rad: f64) {
        let turn_rad = wrapped(fix.yaw_rad - past[2]);
        let (sin, cos) = libm::sincos(turn_rad);
        let (dx, dy) = (self.state[X] - past[0], self.state[Y] - past[1]);
        let before = [self.state[X], self.state[Y], self.state[YAW]];
        self.state[X] = fix.x_m + cos * dx - sin * dy;
        self.state[Y] = fix.y_m + sin * dx + cos * dy;
        self.state[YAW] += turn_rad;
        for i in [X, Y, YAW] {
            for j in 0..STATES {
                self.covariance[i][j] = 0.0;
                self.covariance[j][i] = 0.0;
            }
        }
        self.covariance[X][X] = position_sd_m * position_sd_m;
        self.covariance[Y][Y] = position_sd_m * position_sd_m;
        self.covariance[YAW][YAW] = yaw_sd_rad * yaw_sd_rad;
        self.anchored = true;
        self.rejected_fixes = 0;
        self.history.shift(core::array::from_fn(|i| self.state[i] - before[i]));
    }

    /// The estimate now.
    pub fn estimate(&self) -> Estimate {
        let p = &self.covariance;
        let mean = 0.5 * (p[X][X] + p[Y][Y]);
        let half_gap = 0.5 * (p[X][X] - p[Y][Y]);
        let largest = mean + sqrt(half_gap * half_gap + p[X][Y] * p[X][Y]);
        Estimate {
            x_m: self.state[X],
            y_m: self.state[Y],
            yaw_rad: wrapped(self.state[YAW]),
            twist: Twist {
                forward_m_per_s: self.state[U],
                left_m_per_s: self.state[V],
                yaw_rate_rad_per_s: self.yaw_rate_rad_per_s,
            },
            gyro_bias_rad_per_s: self.state[BIAS],
            position_sd_m: sqrt(largest.max(0.0)),
            yaw_sd_rad: sqrt(p[YAW][YAW].max(0.0)),
            anchored: self.anchored,
        }
    }

    /// State `[x, y, yaw, b, u, v]` and its covariance.
    pub fn state(&self) -> (&[f64; 6], &[[f64; 6]; 6]) {
        (&self.state, &self.covariance)
    }

    fn take(&mut self, scalar: &Scalar) {
        let mut gain: [f64; STATES] =
            core::array::from_fn(|i| (0..STATES).map(|j| self.covariance[i][j] * scalar.row[j]).sum());
        let seen = gain;
        let innovation_variance = scalar.variance + (0..STATES).map(|i| scalar.row[i] * seen[i]).sum::<f64>();
        if innovation_variance <= 0.0 || !scalar.innovation.is_finite() {
            return;
        }
        for (i, gain) in gain.iter_mut().enumerate() {
            *gain /= innovation_variance;
            self.state[i] += *gain * scalar.innovation;
        }
        for i in 0..STATES {
            for j in i..STATES {
                let value = self.covariance[i][j] - 0.5 * (gain[i] * seen[j] + gain[j] * seen[i]);
                self.covariance[i][j] = value;
                self.covariance[j][i] = value;
            }
            self.covariance[i][i] = self.covariance[i][i].max(1e-15);
        }
    }

    /// A scalar that is left out when it is further off than the gate.
    fn take_gated(&mut self, scalar: &Scalar) {
        let mut seen = scalar.variance;
        for i in 0..STATES {
            for j in 0..STATES {
                seen += scalar.row[i] * self.covariance[i][j] * scalar.row[j];
            }
        }
        if scalar.innovation * scalar.innovation <= GATE * GATE * seen {
            self.take(scalar);
        }
    }
}

/// To +-pi.
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - core::f64::consts::TAU * libm::round(angle_rad / core::f64::consts::TAU)
}
