//! Motor and speed loop of a driven wheel.

use wide::f64x4;

use crate::PHYSICS_PERIOD_S;
use crate::lanes::Real;
use crate::robot::Motor;

/// Constants of the motor equations.
///
/// i = clamp((V - n k_e W) / R_a, +-i_max), k_e = k_t ;  torque = n k_t i
///
/// Speed loop, sampled at 480 Hz and held: I += e T, |k_i I| <= V_bus ; V = clamp(k_p e + k_i I, +-V_bus), e = W_cmd - W.
#[derive(Debug, Clone)]
pub(crate) struct MotorModel {
    /// Infinite when unlimited.
    pub(crate) current_limit_a: f64,
    pub(crate) supply_v: f64,
    kp: f64,
    ki: f64,
    integral_limit_rad: f64,
}

impl MotorModel {
    pub(crate) fn new(motor: &Motor) -> MotorModel {
        let ki = motor.speed_loop_ki_v_per_rad;
        MotorModel {
            current_limit_a: motor.current_limit_a.unwrap_or(f64::INFINITY),
            supply_v: motor.supply_v,
            kp: motor.speed_loop_kp_v_s_per_rad,
            ki,
            integral_limit_rad: if ki > 0.0 { motor.supply_v / ki } else { 0.0 },
        }
    }

    /// One sample of the speed loops: new error integrals, rad, and voltages, V.
    #[inline(always)]
    pub(crate) fn sample(&self, error_rad_per_s: f64x4, integral_rad: f64x4) -> (f64x4, f64x4) {
        let all = f64x4::splat;
        let integral = integral_rad + error_rad_per_s * all(PHYSICS_PERIOD_S);
        let limit_rad = all(self.integral_limit_rad);
        let integral = integral.lesser(limit_rad).greater(-limit_rad);
        let wanted = all(self.kp) * error_rad_per_s + all(self.ki) * integral;
        let limit_v = all(self.supply_v);
        (integral, wanted.lesser(limit_v).greater(-limit_v))
    }

    /// The battery's voltage now.
    pub(crate) fn set_supply(&mut self, supply_v: f64) {
        self.supply_v = supply_v;
        self.integral_limit_rad = if self.ki > 0.0 { supply_v / self.ki } else { 0.0 };
    }

    /// Error integral at which the loop gives a voltage at an error, rad.
    pub(crate) fn settled_integral_rad(&self, voltage_v: f64, error_rad_per_s: f64) -> f64 {
        if self.ki <= 0.0 {
            return 0.0;
        }
        ((voltage_v - self.kp * error_rad_per_s) / self.ki)
            .min(self.integral_limit_rad)
            .max(-self.integral_limit_rad)
    }
}
