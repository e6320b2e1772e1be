//! What is wrong with a motor's controller.

use super::table::{self, Parameter};
use super::{ParameterError, check_value, problem};
use crate::PHYSICS_RATE_HZ;
use crate::motor_control::{KINDS, MotorController};
use crate::robot::Motor;

pub(super) fn check(problems: &mut Vec<ParameterError>, motor: &Motor, controller: &MotorController) {
    if !KINDS.contains(&controller.kind.as_str()) {
        problems.push(problem(
            "motor.controller.kind",
            format!("{:?} is unknown", controller.kind),
            KINDS.join(", "),
            "use one of the kinds",
        ));
    }
    check_rate(problems, controller.sample_rate_hz);
    let delay = f64::from(controller.computation_delay_samples);
    check_value(problems, None, delay, &table::CONTROLLER_DELAY);
    if let Some(ticks) = controller.encoder_ticks_per_rev {
        check_value(problems, None, f64::from(ticks), &table::CONTROLLER_TICKS);
    }
    check_window(problems, controller);
    if KINDS.contains(&controller.kind.as_str()) {
        check_gains(problems, controller);
    }
    check_current(problems, motor, controller);
}

fn check_rate(problems: &mut Vec<ParameterError>, rate_hz: u32) {
    let before = problems.len();
    check_value(problems, None, f64::from(rate_hz), &table::CONTROLLER_RATE);
    if problems.len() == before && !rate_hz.is_multiple_of(PHYSICS_RATE_HZ) && !PHYSICS_RATE_HZ.is_multiple_of(rate_hz)
    {
        problems.push(problem(
            table::CONTROLLER_RATE.path,
            format!("{rate_hz} Hz does not fit the physics steps"),
            format!("a divisor or a multiple of {PHYSICS_RATE_HZ} Hz"),
            "take the nearest of 120, 160, 240, 480, 960, 1440, 1920 ... Hz",
        ));
    }
}

fn check_window(problems: &mut Vec<ParameterError>, controller: &MotorController) {
    let window = &table::CONTROLLER_WINDOW;
    match (controller.encoder_ticks_per_rev, controller.speed_window_samples) {
        (Some(_), None) => problems.push(problem(
            window.path,
            "missing",
            "required with encoder_ticks_per_rev",
            window.remedy,
        )),
        (None, Some(_)) => problems.push(problem(
            window.path,
            "a window without an encoder",
            "only with encoder_ticks_per_rev",
            "give the ticks of the encoder, or leave the window out",
        )),
        (_, Some(samples)) => check_value(problems, None, f64::from(samples), window),
        (None, None) => {}
    }
}

fn check_gains(problems: &mut Vec<ParameterError>, controller: &MotorController) {
    let gains: [(Option<f64>, &Parameter); 4] = [
        (controller.speed_kp_a_s_per_rad, &table::CASCADE_SPEED_KP),
        (controller.speed_ki_a_per_rad, &table::CASCADE_SPEED_KI),
        (controller.current_kp_v_per_a, &table::CASCADE_CURRENT_KP),
        (controller.current_ki_v_per_a_s, &table::CASCADE_CURRENT_KI),
    ];
    let cascade = controller.kind == "cascade";
    for (value, parameter) in gains {
        match value {
            Some(value) if cascade => check_value(problems, None, value, parameter),
            None if cascade => problems.push(problem(
                parameter.path,
                "missing",
                "required by a cascade",
                parameter.remedy,
            )),
            Some(_) => problems.push(problem(
                parameter.path,
                "a gain of the cascade in a speed_pi",
                "only in a cascade",
                "leave it out: a speed_pi has its gains in motor",
            )),
            None => {}
        }
    }
}

fn check_current(problems: &mut Vec<ParameterError>, motor: &Motor, controller: &MotorController) {
    let limit = &table::CASCADE_CURRENT_LIMIT;
    let Some(limit_a) = controller.current_limit_a else {
        return;
    };
    if controller.kind != "cascade" {
        problems.push(problem(
            limit.path,
            "a speed_pi does not see the current",
            "only in a cascade",
            "leave it out",
        ));
        return;
    }
    let before = problems.len();
    check_value(problems, None, limit_a, limit);
    let most_a = motor.current_limit_a.unwrap_or(f64::INFINITY);
    if problems.len() == before && limit_a > most_a {
        problems.push(problem(
            limit.path,
            format!("{limit_a} is more than the driver gives"),
            format!("at most motor.current_limit_a = {most_a} A"),
            "lower it, or leave it out",
        ));
    }
}
