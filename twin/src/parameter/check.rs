//! What is wrong with a robot description, field by field.

use super::table::{self, Parameter};
use super::{ParameterError, WHEEL_KINDS, chassis, check_value, control, field, plausible, problem};
use crate::MAX_WHEELS;
use crate::robot::{Motor, Noise, RobotDescription, Steering, Wheel};
use crate::tread::Tread;

/// All problems of a description, in the order of its fields.
pub(crate) fn check(robot: &RobotDescription) -> Vec<ParameterError> {
    let mut problems = Vec::new();
    if robot.name.trim().is_empty() || robot.name.len() > 64 {
        problems.push(problem(
            "name",
            format!("{:?} cannot name a robot", robot.name),
            "1..=64 bytes",
            "give the robot a short name",
        ));
    }
    check_value(&mut problems, None, robot.mass_kg, &table::MASS);
    check_value(&mut problems, None, robot.yaw_inertia_kg_m2, &table::YAW_INERTIA);
    check_value(&mut problems, None, robot.com_height_m, &table::COM_HEIGHT);
    check_wheels(&mut problems, &robot.wheels);
    if let Some(motor) = &robot.motor {
        check_motor(&mut problems, motor);
    }
    if let Some(steering) = &robot.steering {
        check_steering(&mut problems, steering);
    }
    check_value(&mut problems, None, robot.floor_friction, &table::FLOOR_FRICTION);
    if let Some(tread) = &robot.tread {
        check_tread(&mut problems, tread);
    }
    check_given(&mut problems, &[(robot.accelerometer_lag_s, &table::ACCELEROMETER_LAG)]);
    if let Some(noise) = &robot.noise {
        check_noise(&mut problems, noise);
    }
    if robot.wheels.len() <= MAX_WHEELS {
        plausible::check(&mut problems, robot);
        chassis::check(&mut problems, robot);
    }
    problems
}

fn check_wheels(problems: &mut Vec<ParameterError>, wheels: &[Wheel]) {
    if wheels.is_empty() || wheels.len() > MAX_WHEELS {
        let message = format!("{} wheels", wheels.len());
        problems.push(problem(
            "wheels",
            message,
            format!("1..={MAX_WHEELS} wheels"),
            "list the wheels that carry the robot",
        ));
    }
    // However many are listed, the answer is short.
    for (i, wheel) in wheels.iter().take(MAX_WHEELS).enumerate() {
        check_wheel(problems, i, wheel);
    }
}

fn check_wheel(problems: &mut Vec<ParameterError>, i: usize, wheel: &Wheel) {
    check_value(problems, Some(i), wheel.x_m, &table::WHEEL_X);
    check_value(problems, Some(i), wheel.y_m, &table::WHEEL_Y);
    check_value(
        problems,
        Some(i),
        wheel.rolling_direction_rad,
        &table::ROLLING_DIRECTION,
    );
    let caster = wheel.kind == "caster";
    for (value, parameter) in [
        (wheel.radius_m, &table::WHEEL_RADIUS),
        (wheel.spin_inertia_kg_m2, &table::SPIN_INERTIA),
    ] {
        match value {
            Some(value) => check_value(problems, Some(i), value, parameter),
            None if caster => {}
            None => problems.push(problem(
                field(parameter, Some(i)),
                "missing",
                "required unless the wheel is a caster",
                parameter.remedy,
            )),
        }
    }
    if !WHEEL_KINDS.contains(&wheel.kind.as_str()) {
        problems.push(problem(
            format!("wheels[{i}].kind"),
            format!("{:?} is unknown", wheel.kind),
            WHEEL_KINDS.join(", "),
            "use one of the kinds",
        ));
    }
    if caster && (wheel.driven || wheel.steered) {
        problems.push(problem(
            format!("wheels[{i}].driven"),
            "a caster is driven or steered",
            "casters roll freely",
            "make it a standard wheel",
        ));
    }
    if wheel.kind == "omni" && wheel.steered {
        problems.push(problem(
            format!("wheels[{i}].steered"),
            "an omni wheel is steered",
            "only standard wheels steer",
            "set steered to false",
        ));
    }
}

fn check_motor(problems: &mut Vec<ParameterError>, motor: &Motor) {
    let values = [
        (Some(motor.gear_ratio), &table::GEAR_RATIO),
        (Some(motor.torque_constant_n_m_per_a), &table::TORQUE_CONSTANT),
        (Some(motor.resistance_ohm), &table::RESISTANCE),
        (motor.current_limit_a, &table::CURRENT_LIMIT),
        (Some(motor.supply_v), &table::SUPPLY),
        (Some(motor.viscous_n_m_s), &table::VISCOUS),
        (Some(motor.coulomb_n_m), &table::COULOMB),
        (Some(motor.speed_loop_kp_v_s_per_rad), &table::SPEED_LOOP_KP),
        (Some(motor.speed_loop_ki_v_per_rad), &table::SPEED_LOOP_KI),
    ];
    check_given(problems, &values);
    if let Some(controller) = &motor.controller {
        control::check(problems, motor, controller);
    }
}

fn check_steering(problems: &mut Vec<ParameterError>, steering: &Steering) {
    let values = [
        (Some(steering.lag_s), &table::STEERING_LAG),
        (steering.filter_s, &table::STEERING_FILTER),
        (steering.rate_limit_rad_per_s, &table::STEERING_RATE),
        (steering.angle_limit_rad, &table::STEERING_ANGLE),
    ];
    check_given(problems, &values);
}

fn check_tread(problems: &mut Vec<ParameterError>, tread: &Tread) {
    let values = [
        (Some(tread.slip_scale_m_per_s), &table::TREAD_SLIP_SCALE),
        (Some(tread.creep), &table::TREAD_CREEP),
        (Some(tread.tail), &table::TREAD_TAIL),
        (Some(tread.sliding), &table::TREAD_SLIDING),
    ];
    check_given(problems, &values);
}

fn check_noise(problems: &mut Vec<ParameterError>, noise: &Noise) {
    let values = [
        (noise.pose_xy_m, &table::NOISE_POSE_XY),
        (noise.pose_yaw_rad, &table::NOISE_POSE_YAW),
        (noise.wheel_rad_per_s, &table::NOISE_WHEEL),
        (noise.current_a, &table::NOISE_CURRENT),
        (noise.gyro_rad_per_s, &table::NOISE_GYRO),
        (noise.accel_m_per_s2, &table::NOISE_ACCEL),
        (noise.bus_v, &table::NOISE_BUS),
        (noise.steering_rad, &table::NOISE_STEERING),
    ];
    check_given(problems, &values);
}

fn check_given(problems: &mut Vec<ParameterError>, values: &[(Option<f64>, &Parameter)]) {
    for (value, parameter) in values {
        if let Some(value) = value {
            check_value(problems, None, *value, parameter);
        }
    }
}
