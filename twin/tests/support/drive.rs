//! Ways to set robots going, written without the crate's own kinematics.
#![allow(dead_code)]

use twin::PHYSICS_PERIOD_S;
use twin::command::WheelCommand;
use twin::free::{FreeRobot, Start};
use twin::robot::RobotDescription;
use twin::twist::BodyTwist;

/// Steps with one command.
pub fn run(free: &mut FreeRobot, command: &WheelCommand, seconds: f64) {
    for _ in 0..(seconds / PHYSICS_PERIOD_S).round() as u32 {
        free.step(command);
    }
}

pub fn twist(forward_m_per_s: f64, left_m_per_s: f64, yaw_rate_rad_per_s: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}

/// A start in which every unsteered wheel rolls without longitudinal slip: `R W = p . (cos beta, sin beta)`.
pub fn rolling(description: &RobotDescription, twist: BodyTwist) -> Start {
    let mut start = Start {
        twist,
        ..Start::default()
    };
    for (index, wheel) in description.wheels.iter().enumerate() {
        let (sin, cos) = libm::sincos(wheel.rolling_direction_rad);
        let along = cos * (twist.forward_m_per_s - twist.yaw_rate_rad_per_s * wheel.y_m)
            + sin * (twist.left_m_per_s + twist.yaw_rate_rad_per_s * wheel.x_m);
        start.wheel_rad_per_s[index] = wheel.radius_m.map_or(0.0, |radius_m| along / radius_m);
    }
    start
}

/// Motors that can neither drive nor brake (n k_t = 1e-8 N m/A); the drive's friction stays.
pub fn torque_free(mut description: RobotDescription, viscous_n_m_s: f64, coulomb_n_m: f64) -> RobotDescription {
    if let Some(motor) = &mut description.motor {
        (motor.gear_ratio, motor.torque_constant_n_m_per_a) = (0.01, 1e-6);
        (motor.viscous_n_m_s, motor.coulomb_n_m) = (viscous_n_m_s, coulomb_n_m);
        (motor.speed_loop_kp_v_s_per_rad, motor.speed_loop_ki_v_per_rad) = (0.0, 0.0);
    }
    description
}

/// Fails unless `got` is within `relative` of `expected`; prints both.
#[track_caller]
pub fn assert_close(what: &str, got: f64, expected: f64, relative: f64) {
    println!("{what}: expected {expected:.6}, got {got:.6}");
    let error = (got / expected - 1.0).abs();
    assert!(
        error <= relative,
        "{what}: {got} against {expected}, off by {error:.2e}"
    );
}
