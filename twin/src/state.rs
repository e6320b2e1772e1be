//! State of one robot.

use crate::MAX_WHEELS;
use crate::kernel::Carry;
use crate::model::Model;
use crate::pose::{Pose, wrapped_rad};
use crate::twist::BodyTwist;

/// What can be seen of a robot after a tick. Arrays are indexed by position in `wheels`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotState {
    pub pose: Pose,
    pub twist: BodyTwist,
    pub wheel_rad_per_s: [f64; MAX_WHEELS],
    /// Absolute, not wrapped, zero at the start; both as the encoders give them.
    pub wheel_rad: [f64; MAX_WHEELS],
    /// Positive drives the wheel along its rolling direction.
    pub current_a: [f64; MAX_WHEELS],
    pub voltage_v: [f64; MAX_WHEELS],
    /// Battery voltage; 0 without a motor description.
    pub bus_v: f64,
    /// Bicycle angle, at the servo.
    pub steering_rad: f64,
    /// As the gyro gives it.
    pub gyro_z_rad_per_s: f64,
    /// Acceleration that all forces but gravity gave the centre of mass in the last physics step, body frame.
    pub accel_x_m_per_s2: f64,
    pub accel_y_m_per_s2: f64,
}

impl RobotState {
    pub(crate) const ZERO: RobotState = RobotState {
        pose: Pose {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
        },
        twist: BodyTwist {
            forward_m_per_s: 0.0,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: 0.0,
        },
        wheel_rad_per_s: [0.0; MAX_WHEELS],
        wheel_rad: [0.0; MAX_WHEELS],
        current_a: [0.0; MAX_WHEELS],
        voltage_v: [0.0; MAX_WHEELS],
        bus_v: 0.0,
        steering_rad: 0.0,
        gyro_z_rad_per_s: 0.0,
        accel_x_m_per_s2: 0.0,
        accel_y_m_per_s2: 0.0,
    };
}

/// Numbers outside the wheels in [`BodyState::words`].
const BODY_WORDS: usize = 11;
const WHEEL_WORDS: usize = 7;
/// Most numbers of one robot.
pub(crate) const MAX_WORDS: usize = BODY_WORDS + WHEEL_WORDS * MAX_WHEELS;

/// Everything that the next step depends on. Wheel arrays are indexed by lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyState {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) yaw_rad: f64,
    /// Heading as a unit vector; set from the yaw at the start of every tick.
    pub(crate) cos_yaw: f64,
    pub(crate) sin_yaw: f64,
    pub(crate) u: f64,
    pub(crate) v: f64,
    pub(crate) r: f64,
    pub(crate) accel_x: f64,
    pub(crate) accel_y: f64,
    pub(crate) steering_rad: f64,
    pub(crate) wheel: [f64; MAX_WHEELS],
    pub(crate) angle: [f64; MAX_WHEELS],
    pub(crate) integral: [f64; MAX_WHEELS],
    pub(crate) current: [f64; MAX_WHEELS],
    pub(crate) voltage: [f64; MAX_WHEELS],
    /// Deflections of sticking contacts; see the kernel's `bristle`.
    pub(crate) bristle_along_m: [f64; MAX_WHEELS],
    pub(crate) bristle_across_m: [f64; MAX_WHEELS],
    /// Whether any is not zero.
    pub(crate) sticks: bool,
    /// Empty at the start of every tick.
    pub(crate) carry: Carry,
}

impl BodyState {
    pub(crate) fn at_rest(model: &Model, pose: Pose) -> BodyState {
        let zero = [0.0; MAX_WHEELS];
        let yaw_rad = wrapped_rad(pose.yaw_rad);
        let (sin_yaw, cos_yaw) = libm::sincos(yaw_rad);
        let [com_x_m, com_y_m] = model.com_m;
        BodyState {
            x_m: pose.x_m + (com_x_m * cos_yaw - com_y_m * sin_yaw),
            y_m: pose.y_m + (com_x_m * sin_yaw + com_y_m * cos_yaw),
            yaw_rad,
            cos_yaw,
            sin_yaw,
            u: 0.0,
            v: 0.0,
            r: 0.0,
            accel_x: 0.0,
            accel_y: 0.0,
            steering_rad: 0.0,
            wheel: zero,
            angle: zero,
            integral: zero,
            current: zero,
            voltage: zero,
            bristle_along_m: zero,
            bristle_across_m: zero,
            sticks: false,
            carry: Carry::EMPTY,
        }
    }

    /// Takes a twist of the body origin.
    pub(crate) fn set_twist(&mut self, model: &Model, twist: BodyTwist) {
        let [com_x_m, com_y_m] = model.com_m;
        self.r = twist.yaw_rate_rad_per_s;
        self.u = twist.forward_m_per_s - self.r * com_y_m;
        self.v = twist.left_m_per_s + self.r * com_x_m;
    }

    /// Position of the body origin.
    #[inline(always)]
    pub(crate) fn origin_m(&self, model: &Model) -> (f64, f64) {
        let [com_x_m, com_y_m] = model.com_m;
        (
            self.x_m - (com_x_m * self.cos_yaw - com_y_m * self.sin_yaw),
            self.y_m - (com_x_m * self.sin_yaw + com_y_m * self.cos_yaw),
        )
    }

    /// Wraps the yaw and recomputes the heading vector from it: once per tick, so that rounding cannot grow.
    #[inline(always)]
    pub(crate) fn refresh_heading(&mut self) {
        self.carry.clear();
        self.yaw_rad = wrapped_rad(self.yaw_rad);
        let (sin, cos) = libm::sincos(self.yaw_rad);
        self.cos_yaw = cos;
        self.sin_yaw = sin;
    }

    /// The state as numbers in a fixed order; how many of them depends on the number of lanes.
    #[inline(always)]
    pub(crate) fn words(&self, lanes: usize, out: &mut [f64; MAX_WORDS]) -> usize {
        out[..BODY_WORDS].copy_from_slice(&[
            self.x_m,
            self.y_m,
            self.yaw_rad,
            self.cos_yaw,
            self.sin_yaw,
            self.u,
            self.v,
            self.r,
            self.accel_x,
            self.accel_y,
            self.steering_rad,
        ]);
        let mut at = BODY_WORDS;
        for array in [
            &self.wheel,
            &self.angle,
            &self.integral,
            &self.current,
            &self.voltage,
            &self.bristle_along_m,
            &self.bristle_across_m,
        ] {
            out[at..at + lanes].copy_from_slice(&array[..lanes]);
            at += lanes;
        }
        at
    }

    /// Numbers in [`BodyState::words`].
    pub(crate) fn word_count(lanes: usize) -> usize {
        BODY_WORDS + WHEEL_WORDS * lanes
    }

    /// Inverse of [`BodyState::words`]; `None` when the count does not fit.
    pub(crate) fn from_words(words: &[f64], model: &Model) -> Option<BodyState> {
        let lanes = model.lanes;
        if words.len() != BodyState::word_count(lanes) {
            return None;
        }
        let mut state = BodyState::at_rest(model, Pose::default());
        let (body, wheels) = words.split_at(BODY_WORDS);
        let fields = [
            &mut state.x_m,
            &mut state.y_m,
            &mut state.yaw_rad,
            &mut state.cos_yaw,
            &mut state.sin_yaw,
            &mut state.u,
            &mut state.v,
            &mut state.r,
            &mut state.accel_x,
            &mut state.accel_y,
            &mut state.steering_rad,
        ];
        for (field, word) in fields.into_iter().zip(body) {
            *field = *word;
        }
        let arrays = [
            &mut state.wheel,
            &mut state.angle,
            &mut state.integral,
            &mut state.current,
            &mut state.voltage,
            &mut state.bristle_along_m,
            &mut state.bristle_across_m,
        ];
        for (index, array) in arrays.into_iter().enumerate() {
            array[..lanes].copy_from_slice(&wheels[index * lanes..(index + 1) * lanes]);
        }
        let deflected = |array: &[f64]| array.iter().any(|deflection| *deflection != 0.0);
        state.sticks = deflected(&state.bristle_along_m) || deflected(&state.bristle_across_m);
        Some(state)
    }

    /// True when every number is finite.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> bool {
        // 0 * x is 0 for finite x and NaN otherwise.
        let mut sum = 0.0 * self.x_m + 0.0 * self.y_m + 0.0 * self.yaw_rad + 0.0 * self.u + 0.0 * self.v + 0.0 * self.r;
        sum += 0.0 * self.accel_x + 0.0 * self.accel_y + 0.0 * self.steering_rad;
        for lane in 0..MAX_WHEELS {
            sum +=
                0.0 * self.wheel[lane] + 0.0 * self.angle[lane] + 0.0 * self.integral[lane] + 0.0 * self.current[lane];
        }
        sum == 0.0
    }

    /// Name of the first number that is not finite.
    #[cold]
    pub(crate) fn non_finite_field(&self, model: &Model) -> String {
        let body = [
            ("pose.x_m", self.x_m),
            ("pose.y_m", self.y_m),
            ("pose.yaw_rad", self.yaw_rad),
            ("twist.forward_m_per_s", self.u),
            ("twist.left_m_per_s", self.v),
            ("twist.yaw_rate_rad_per_s", self.r),
            ("steering_rad", self.steering_rad),
        ];
        if let Some((name, _)) = body.iter().find(|(_, value)| !value.is_finite()) {
            return (*name).to_owned();
        }
        for lane in 0..model.lanes {
            let wheel = [
                ("wheel_rad_per_s", self.wheel[lane]),
                ("wheel_rad", self.angle[lane]),
                ("current_a", self.current[lane]),
            ];
            if let Some((name, _)) = wheel.iter().find(|(_, value)| !value.is_finite()) {
                return format!("{name}[{}]", model.wheel_of_lane[lane]);
            }
        }
        "acceleration".to_owned()
    }

    pub(crate) fn view(&self, model: &Model) -> RobotState {
        let mut out = RobotState::ZERO;
        self.write_view(model, &mut out);
        out
    }

    /// The same, written into `out` number by number: copies of what was just written make the processor wait.
    pub(crate) fn write_view(&self, model: &Model, out: &mut RobotState) {
        let (x_m, y_m) = self.origin_m(model);
        let [com_x_m, com_y_m] = model.com_m;
        out.pose.x_m = x_m;
        out.pose.y_m = y_m;
        out.pose.yaw_rad = wrapped_rad(self.yaw_rad);
        out.twist.forward_m_per_s = self.u + self.r * com_y_m;
        out.twist.left_m_per_s = self.v - self.r * com_x_m;
        out.twist.yaw_rate_rad_per_s = self.r;
        for by_wheel in [
            &mut out.wheel_rad_per_s,
            &mut out.wheel_rad,
            &mut out.current_a,
            &mut out.voltage_v,
        ] {
            *by_wheel = [0.0; MAX_WHEELS];
        }
        for lane in 0..model.lanes {
            let wheel = model.wheel_of_lane[lane];
            out.wheel_rad_per_s[wheel] = model.encoder_speed(self, lane);
            out.wheel_rad[wheel] = model.encoder[lane] * (self.angle[lane] + model.gear_place_rad[lane]);
            out.current_a[wheel] = self.current[lane];
            out.voltage_v[wheel] = self.voltage[lane];
        }
        out.bus_v = model.motor.as_ref().map_or(0.0, |motor| motor.supply_v);
        out.steering_rad = self.steering_rad;
        out.gyro_z_rad_per_s = self.r;
        out.accel_x_m_per_s2 = self.accel_x;
        out.accel_y_m_per_s2 = self.accel_y;
    }
}
