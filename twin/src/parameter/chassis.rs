//! Which wheel tables make a chassis.

use super::{CHASSIS, ParameterError, problem};
use crate::robot::{RobotDescription, Wheel};

/// What makes a wheel table a chassis of its name.
pub(super) fn check(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
    let chassis = robot.chassis.as_str();
    if !CHASSIS.contains(&chassis) {
        problems.push(problem(
            "chassis",
            format!("{chassis:?} is not supported"),
            CHASSIS.join(", "),
            "use one of the supported chassis",
        ));
        return;
    }
    let count = |pick: &dyn Fn(&Wheel) -> bool| robot.wheels.iter().filter(|wheel| pick(wheel)).count();
    let driven = count(&|wheel| wheel.driven);
    let omni = count(&|wheel| wheel.kind == "omni");
    let standard = count(&|wheel| wheel.kind == "standard");
    let steered = count(&|wheel| wheel.steered);
    let car = matches!(chassis, "fwd" | "rwd" | "awd");
    let wrong = match chassis {
        "omni4" if omni != 4 || standard != 0 || !(2..=4).contains(&driven) => {
            Some("4 omni wheels, 2 to 4 of them driven")
        }
        "diff2" if driven != 2 || !(2..=4).contains(&standard) || omni != 0 => {
            Some("2 driven standard wheels, at most 2 free ones, casters besides")
        }
        "diff4" if driven != 4 || standard != 4 || omni != 0 => Some("4 driven standard wheels"),
        "fwd" | "rwd" if driven != 2 || standard != 4 || omni != 0 => Some("4 standard wheels, 2 of them driven"),
        "awd" if driven != 4 || standard != 4 || omni != 0 => Some("4 driven standard wheels"),
        _ => None,
    };
    if let Some(limit) = wrong {
        let message = format!("{driven} driven, {standard} standard and {omni} omni wheels do not make a {chassis}");
        problems.push(problem(
            "wheels",
            message,
            limit,
            "correct the wheel table or the chassis name",
        ));
    }
    if !car && steered > 0 {
        problems.push(problem(
            "wheels",
            format!("{steered} steered wheels on a {chassis}"),
            "no steered wheels",
            "set steered to false",
        ));
    }
    if car && steered != 2 {
        problems.push(problem(
            "wheels",
            format!("{steered} steered wheels"),
            "2 steered wheels on one axle",
            "mark the two wheels of the steered axle",
        ));
    }
    if car && robot.steering.is_none() {
        problems.push(problem(
            "steering",
            "missing",
            "required with steered wheels",
            "give lag_s, rate_limit_rad_per_s and angle_limit_rad",
        ));
    }
    if car && steered == 2 && problems.is_empty() {
        check_steered_axle(problems, &robot.wheels);
    }
    if chassis == "omni4" && driven == 2 && problems.is_empty() {
        check_two_wheel_mode(problems, &robot.wheels);
    }
}

/// Two driven omni wheels move the body along one line and turn it only when they roll in parallel and side by side.
fn check_two_wheel_mode(problems: &mut Vec<ParameterError>, wheels: &[Wheel]) {
    let mut driven = wheels.iter().enumerate().filter(|(_, wheel)| wheel.driven);
    let (Some((i, a)), Some((k, b))) = (driven.next(), driven.next()) else {
        return;
    };
    let angle = libm::sin(a.rolling_direction_rad - b.rolling_direction_rad);
    let (sin, cos) = libm::sincos(a.rolling_direction_rad);
    let apart_m = ((b.x_m - a.x_m) * sin - (b.y_m - a.y_m) * cos).abs();
    let limit = "opposite wheels: rolling directions parallel within 0.05, lines at least 0.01 m apart";
    let message = if angle.abs() > 0.05 {
        format!("driven wheels {i} and {k} do not roll in parallel (sine of the angle between them {angle})")
    } else if apart_m < 0.01 {
        format!("driven wheels {i} and {k} roll along lines {apart_m} m apart and cannot turn the robot")
    } else {
        return;
    };
    problems.push(problem("wheels", message, limit, "drive two opposite wheels"));
}

fn check_steered_axle(problems: &mut Vec<ParameterError>, wheels: &[Wheel]) {
    let mean_x = |steered: bool| {
        let picked = wheels
            .iter()
            .filter(|wheel| wheel.kind == "standard" && wheel.steered == steered);
        picked.clone().map(|wheel| wheel.x_m).sum::<f64>() / picked.count() as f64
    };
    let wheelbase = mean_x(true) - mean_x(false);
    if wheelbase.abs() < 0.01 {
        let message = format!("steered and fixed axle are {wheelbase} m apart");
        problems.push(problem(
            "wheels",
            message,
            "at least 0.01 m",
            "correct the wheel positions",
        ));
    }
}
