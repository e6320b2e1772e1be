//! DC motor with inductance and cogging; torque and speed are referred to the wheel.

use super::Step;

/// Winding, rotor and friction of one motor, referred to the wheel through the gear.
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    /// Torque at the wheel per ampere; also volt seconds per radian of the wheel.
    pub constant_n_m_per_a: f64,
    pub resistance_ohm: f64,
    pub inductance_h: f64,
    pub current_limit_a: f64,
    pub rotor_inertia_kg_m2: f64,
    pub viscous_n_m_s: f64,
    pub coulomb_n_m: f64,
    /// Dry friction at rest over that in motion, and the speed at which half of the excess is gone.
    pub breakaway_ratio: f64,
    pub breakaway_rad_per_s: f64,
    /// Friction times (1 + this) forward, (1 - this) backward.
    pub friction_asymmetry: f64,
    /// Rise of the resistance at full current, and its time.
    pub heating: f64,
    pub heating_s: f64,
    /// Current of a blocked motor, at most the limit.
    pub full_current_a: f64,
    /// Amplitude at the wheel.
    pub cogging_n_m: f64,
    /// Cogging periods per turn of the wheel over 2 pi.
    pub cogging_per_rad: f64,
    pub cogging_phase_rad: f64,
}

/// Moving parts of one motor.
#[derive(Debug, Clone, Copy, Default)]
pub struct MotorState {
    pub current_a: f64,
    /// At the wheel's side of the gear.
    pub speed_rad_per_s: f64,
    pub angle_rad: f64,
    /// 0 cold, 1 after long full current.
    pub heat: f64,
}

/// Speed at which dry friction has half its size.
const COULOMB_HALF_RAD_PER_S: f64 = 0.05;

impl Motor {
    /// Moves winding and rotor by a step; `voltage_v` is `None` when the power stage is off.
    pub fn step(&self, state: &mut MotorState, voltage_v: Option<f64>, gear_torque_n_m: f64, step: Step) {
        let dt_s = step.dt_s;
        let load = state.current_a / self.full_current_a;
        state.heat += dt_s / self.heating_s * (load * load - state.heat);
        let resistance_ohm = self.resistance_ohm * (1.0 + self.heating * state.heat);
        state.current_a = voltage_v.map_or(0.0, |voltage_v| {
            let driving_v = voltage_v - self.constant_n_m_per_a * state.speed_rad_per_s;
            let current_a = (state.current_a + dt_s / self.inductance_h * driving_v)
                / (1.0 + dt_s * resistance_ohm / self.inductance_h);
            current_a.clamp(-self.current_limit_a, self.current_limit_a)
        });
        let cogging_n_m = if self.cogging_n_m == 0.0 {
            0.0
        } else {
            self.cogging_n_m * (self.cogging_per_rad * state.angle_rad + self.cogging_phase_rad).sin()
        };
        let driving_n_m = self.constant_n_m_per_a * state.current_a - cogging_n_m - gear_torque_n_m;
        // Friction enters implicitly: it can stop the rotor but not turn it round.
        let speed = state.speed_rad_per_s;
        let relative = speed / self.breakaway_rad_per_s;
        let breakaway = 1.0 + (self.breakaway_ratio - 1.0) / (1.0 + relative * relative);
        let side = 1.0 + self.friction_asymmetry * speed / (speed.abs() + COULOMB_HALF_RAD_PER_S);
        let dry_n_m_s = self.coulomb_n_m * breakaway / (speed.abs() + COULOMB_HALF_RAD_PER_S);
        let friction_n_m_s = side * (self.viscous_n_m_s + dry_n_m_s);
        let inertia = self.rotor_inertia_kg_m2;
        state.speed_rad_per_s =
            (state.speed_rad_per_s + dt_s * driving_n_m / inertia) / (1.0 + dt_s * friction_n_m_s / inertia);
        state.angle_rad += dt_s * state.speed_rad_per_s;
    }
}

/// Gear with play: springs and dampers that only push.
#[derive(Debug, Clone, Copy)]
pub struct Gear {
    pub half_backlash_rad: f64,
    pub stiffness_n_m_per_rad: f64,
    pub damping_n_m_s: f64,
}

impl Gear {
    /// Torque from rotor to wheel at a twist (rotor minus wheel) and its rate.
    pub fn torque_n_m(&self, twist_rad: f64, rate_rad_per_s: f64) -> f64 {
        let pushed_rad = (twist_rad.abs() - self.half_backlash_rad) * twist_rad.signum();
        if twist_rad.abs() <= self.half_backlash_rad {
            return 0.0;
        }
        let torque_n_m = self.stiffness_n_m_per_rad * pushed_rad + self.damping_n_m_s * rate_rad_per_s;
        if torque_n_m * pushed_rad > 0.0 { torque_n_m } else { 0.0 }
    }

    /// Elastic energy at a twist.
    pub fn energy_j(&self, twist_rad: f64) -> f64 {
        let pushed_rad = (twist_rad.abs() - self.half_backlash_rad).max(0.0);
        0.5 * self.stiffness_n_m_per_rad * pushed_rad * pushed_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor() -> Motor {
        Motor {
            constant_n_m_per_a: 0.5952,
            resistance_ohm: 0.6,
            inductance_h: 0.35e-3,
            current_limit_a: 9.0,
            rotor_inertia_kg_m2: 0.00056,
            viscous_n_m_s: 0.0004,
            coulomb_n_m: 0.02,
            breakaway_ratio: 1.0,
            breakaway_rad_per_s: 2.0,
            friction_asymmetry: 0.0,
            heating: 0.0,
            heating_s: 30.0,
            full_current_a: 9.0,
            cogging_n_m: 0.0,
            cogging_per_rad: 230.0,
            cogging_phase_rad: 0.0,
        }
    }

    #[test]
    fn runs_up_to_the_speed_where_back_voltage_and_friction_balance() {
        let (motor, mut state) = (motor(), MotorState::default());
        for _ in 0..7680 {
            motor.step(&mut state, Some(12.0), 0.0, Step { dt_s: 1.0 / 7680.0 });
            assert!(state.current_a.abs() <= 9.0);
        }
        let friction_n_m = 0.0004 * state.speed_rad_per_s + 0.02;
        let expected = (12.0 - 0.6 * friction_n_m / 0.5952) / 0.5952;
        assert!(
            (state.speed_rad_per_s - expected).abs() < 0.02,
            "{} {expected}",
            state.speed_rad_per_s
        );
    }

    #[test]
    fn worn_friction_and_heat_by_hand() {
        let free = |motor: &Motor, volts: f64| {
            let mut state = MotorState::default();
            for _ in 0..7680 {
                motor.step(&mut state, Some(volts), 0.0, Step { dt_s: 1.0 / 7680.0 });
            }
            state
        };
        let mut one_way = motor();
        one_way.coulomb_n_m = 0.2;
        one_way.viscous_n_m_s = 0.0;
        one_way.friction_asymmetry = 0.5;
        // The current carries 0.3 N m forward and 0.1 N m backward, a little less by the smooth corner.
        let (forward, backward) = (free(&one_way, 12.0).current_a, free(&one_way, -12.0).current_a);
        assert!((forward - 0.3 / 0.5952).abs() < 0.01 && (backward + 0.1 / 0.5952).abs() < 0.01);
        let mut sticky = motor();
        sticky.coulomb_n_m = 0.2;
        sticky.viscous_n_m_s = 0.0;
        sticky.breakaway_ratio = 2.0;
        // 1 rad/s is a half of the 2 rad/s: 0.2 (1 + 1 / (1 + 0.25)) over 1.05 of the corner.
        let mut state = MotorState {
            speed_rad_per_s: 1.0,
            ..MotorState::default()
        };
        sticky.step(&mut state, None, 0.0, Step { dt_s: 1e-7 });
        let torque = (1.0 - state.speed_rad_per_s) / 1e-7 * 0.00056;
        assert!((torque - 0.36 / 1.05).abs() < 1e-3, "{torque}");
        let mut hot = motor();
        hot.heating = 0.4;
        hot.heating_s = 0.1;
        hot.rotor_inertia_kg_m2 = 1e9;
        // Blocked at 3 V: i = V / (R (1 + 0.4 (i / 9)^2)).
        let current = free(&hot, 3.0).current_a;
        let balance = 3.0 / (0.6 * (1.0 + 0.4 * (current / 9.0).powi(2)));
        assert!((current - balance).abs() < 1e-3 && current < 4.8, "{current} {balance}");
    }

    #[test]
    fn the_gear_only_pushes_and_only_beyond_its_play() {
        let gear = Gear {
            half_backlash_rad: 0.01,
            stiffness_n_m_per_rad: 60.0,
            damping_n_m_s: 0.06,
        };
        assert_eq!(gear.torque_n_m(0.009, 5.0), 0.0);
        assert!((gear.torque_n_m(0.02, 0.0) - 0.6).abs() < 1e-12 && (gear.torque_n_m(-0.02, 0.0) + 0.6).abs() < 1e-12);
        assert_eq!(gear.torque_n_m(0.011, -50.0), 0.0);
    }
}
