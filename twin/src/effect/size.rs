//! Practical and large sizes of parameters; some depend on the robot.

use crate::model::Model;
use crate::robot::RobotDescription;

/// A run that a size in percent refers to, s.
const RUN_S: f64 = 20.0;

/// A pair practical .. large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// In the parameter's unit.
    Absolute(f64, f64),
    /// Shares of the current-limited stall torque n k_t min(i_max, V / R).
    StallTorque(f64, f64),
    /// The same torque at no-load speed.
    StallViscous(f64, f64),
    /// Shares of the no-load wheel speed.
    FullSpeed(f64, f64),
    /// Shares of the supply voltage lost at full load of all motors.
    SagResistance(f64, f64),
    /// Shares of the supply voltage lost in 20 s.
    Droop(f64, f64),
    /// Shares of the robot's mass.
    Mass(f64, f64),
    /// Per kilogram of the robot.
    PerKilogram(f64, f64),
    /// Shares of the floor's friction coefficient.
    SideFriction(f64, f64),
}

impl Size {
    /// Practical and large value for a robot, in the parameter's unit.
    pub fn values(&self, robot: &RobotDescription) -> (f64, f64) {
        let scaled = |pair: (f64, f64), by: f64| (pair.0 * by, pair.1 * by);
        let stall = || {
            robot.motor.as_ref().map_or(1.0, |motor| {
                let free = motor.supply_v / motor.resistance_ohm;
                let current = motor.current_limit_a.map_or(free, |limit| limit.min(free));
                motor.gear_ratio * motor.torque_constant_n_m_per_a * current
            })
        };
        let full_speed = || {
            let speed = Model::new(robot).max_wheel_speed_rad_per_s();
            if speed.is_finite() { speed } else { 20.0 }
        };
        let supply = || robot.motor.as_ref().map_or(24.0, |motor| motor.supply_v);
        match *self {
            Size::Absolute(a, b) => (a, b),
            Size::StallTorque(a, b) => scaled((a, b), stall()),
            Size::StallViscous(a, b) => scaled((a, b), stall() / full_speed()),
            Size::FullSpeed(a, b) => scaled((a, b), full_speed()),
            Size::SagResistance(a, b) => {
                let motors = robot.wheels.iter().filter(|wheel| wheel.driven).count().max(1) as f64;
                let torque_per_ampere = robot
                    .motor
                    .as_ref()
                    .map_or(1.0, |motor| motor.gear_ratio * motor.torque_constant_n_m_per_a);
                scaled((a, b), supply() * torque_per_ampere / (motors * stall()))
            }
            Size::Droop(a, b) => scaled((a, b), supply() / RUN_S),
            Size::Mass(a, b) | Size::PerKilogram(a, b) => scaled((a, b), robot.mass_kg),
            Size::SideFriction(a, b) => scaled((a, b), robot.floor_friction),
        }
    }
}
