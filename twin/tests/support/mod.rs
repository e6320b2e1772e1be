//! Robots that the tests drive.
#![allow(dead_code)]

pub mod drive;
pub mod furnished;

use twin::command::WheelCommand;
use twin::robot::{Motor, Robot, RobotDescription, Steering, Wheel};

pub fn wheel(x_m: f64, y_m: f64, rolling_direction_rad: f64, kind: &str, driven: bool) -> Wheel {
    let caster = kind == "caster";
    Wheel {
        x_m,
        y_m,
        rolling_direction_rad,
        radius_m: (!caster).then_some(0.05),
        spin_inertia_kg_m2: (!caster).then_some(0.0008),
        kind: kind.to_owned(),
        driven,
        steered: false,
    }
}

pub fn motor() -> Motor {
    Motor {
        gear_ratio: 19.2,
        torque_constant_n_m_per_a: 0.031,
        resistance_ohm: 0.6,
        current_limit_a: Some(9.0),
        supply_v: 24.0,
        viscous_n_m_s: 0.0004,
        coulomb_n_m: 0.02,
        speed_loop_kp_v_s_per_rad: 0.8,
        speed_loop_ki_v_per_rad: 6.0,
        controller: None,
    }
}

fn description(chassis: &str, wheels: Vec<Wheel>) -> RobotDescription {
    RobotDescription {
        name: format!("{chassis}-test"),
        chassis: chassis.to_owned(),
        mass_kg: 12.0,
        yaw_inertia_kg_m2: 0.25,
        com_height_m: 0.11,
        wheels,
        motor: Some(motor()),
        steering: None,
        floor_friction: 0.8,
        tread: None,
        accelerometer_lag_s: None,
        noise: None,
    }
}

pub fn omni4() -> RobotDescription {
    let quarter = core::f64::consts::FRAC_PI_4;
    let at = |x: f64, y: f64, turns: f64| wheel(x, y, turns * quarter, "omni", true);
    description(
        "omni4",
        vec![
            at(0.12, 0.12, 3.0),
            at(-0.12, 0.12, 5.0),
            at(-0.12, -0.12, 7.0),
            at(0.12, -0.12, 9.0),
        ],
    )
}

/// Track 0.3 m, casters ahead and behind.
pub fn diff2() -> RobotDescription {
    let wheels = vec![
        wheel(0.0, 0.15, 0.0, "standard", true),
        wheel(0.0, -0.15, 0.0, "standard", true),
        wheel(0.12, 0.0, 0.0, "caster", false),
        wheel(-0.12, 0.0, 0.0, "caster", false),
    ];
    description("diff2", wheels)
}

/// `fwd`, `rwd` or `awd`.
pub fn car(chassis: &str) -> RobotDescription {
    let mut wheels = Vec::new();
    for (x_m, y_m) in [(0.14, 0.08), (0.14, -0.08), (-0.12, 0.08), (-0.12, -0.08)] {
        let front = x_m > 0.0;
        let driven = match chassis {
            "fwd" => front,
            "rwd" => !front,
            _ => true,
        };
        let mut wheel = wheel(x_m, y_m, 0.0, "standard", driven);
        wheel.steered = front;
        wheels.push(wheel);
    }
    let mut car = description(chassis, wheels);
    car.steering = Some(Steering {
        lag_s: 0.08,
        filter_s: None,
        rate_limit_rad_per_s: Some(6.0),
        angle_limit_rad: Some(0.5),
    });
    car
}

pub fn diff4() -> RobotDescription {
    let at = |x: f64, y: f64| wheel(x, y, 0.0, "standard", true);
    description(
        "diff4",
        vec![at(0.12, 0.12), at(0.12, -0.12), at(-0.12, 0.12), at(-0.12, -0.12)],
    )
}

pub fn all() -> Vec<RobotDescription> {
    vec![omni4(), diff2(), diff4(), car("fwd"), car("rwd"), car("awd")]
}

pub fn robot(description: RobotDescription) -> Robot {
    match Robot::new(description) {
        Ok(robot) => robot,
        Err(problem) => panic!("test robot refused: {problem}"),
    }
}

pub fn wheels(speeds: &[f64]) -> WheelCommand {
    let mut command = WheelCommand::default();
    command.wheel_rad_per_s[..speeds.len()].copy_from_slice(speeds);
    command
}
