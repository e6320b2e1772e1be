//! Limits of robot descriptions: one table, used for validation and for messages.

use serde::Serialize;

use crate::MAX_WHEELS;
use crate::robot::{Motor, RobotDescription, Steering, Wheel};

/// A number or name in a description that cannot be simulated.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[error("{field}: {message} (limit: {limit}; {remedy})")]
pub struct ParameterError {
    /// Path of the field, for example `wheels[2].radius_m`.
    pub field: String,
    /// What is wrong, with the value.
    pub message: String,
    /// What is allowed, with the unit.
    pub limit: String,
    /// What to do about it.
    pub remedy: String,
}

/// Chassis that the wheel table describes.
pub const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];
/// Wheel kinds.
pub const WHEEL_KINDS: [&str; 3] = ["omni", "standard", "caster"];

/// Allowed range of one number.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Range {
    pub(crate) key: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) remedy: &'static str,
}

pub(crate) const fn range(key: &'static str, unit: &'static str, low: f64, high: f64, remedy: &'static str) -> Range {
    Range {
        key,
        unit,
        low,
        high,
        remedy,
    }
}

const MASS: Range = range(
    "mass_kg",
    "kg",
    0.01,
    2000.0,
    "give the mass of the whole robot with battery",
);
const INERTIA: Range = range(
    "yaw_inertia_kg_m2",
    "kg m2",
    1e-6,
    2000.0,
    "give the moment of inertia about the vertical axis; a box has m (l^2 + w^2) / 12",
);
const COM_HEIGHT: Range = range(
    "com_height_m",
    "m",
    0.0,
    3.0,
    "give the height of the centre of mass above the floor",
);
const FRICTION: Range = range(
    "floor_friction",
    "",
    0.01,
    3.0,
    "give the friction coefficient of tyre on floor, usually 0.3 to 1",
);
const WHEEL_X: Range = range(
    "x_m",
    "m",
    -5.0,
    5.0,
    "give the contact point in the body frame, x forward",
);
const WHEEL_Y: Range = range(
    "y_m",
    "m",
    -5.0,
    5.0,
    "give the contact point in the body frame, y left",
);
const DIRECTION: Range = range(
    "rolling_direction_rad",
    "rad",
    -13.0,
    13.0,
    "give radians, 0 = rolls forward",
);
const RADIUS: Range = range("radius_m", "m", 0.002, 1.0, "give the rolling radius in metres");
const SPIN: Range = range(
    "spin_inertia_kg_m2",
    "kg m2",
    1e-7,
    10.0,
    "give the wheel's inertia with the reflected rotor",
);
const GEAR: Range = range("motor.gear_ratio", "", 0.01, 2000.0, "give motor turns per wheel turn");
const TORQUE_CONSTANT: Range = range(
    "motor.torque_constant_n_m_per_a",
    "N m/A",
    1e-6,
    100.0,
    "give k_t of the motor shaft",
);
const RESISTANCE: Range = range("motor.resistance_ohm", "ohm", 1e-4, 1e4, "give the winding resistance");
const CURRENT: Range = range(
    "motor.current_limit_a",
    "A",
    1e-3,
    1e4,
    "give the driver's limit, or null for none",
);
const SUPPLY: Range = range("motor.supply_v", "V", 0.1, 1000.0, "give the nominal battery voltage");
const VISCOUS: Range = range(
    "motor.viscous_n_m_s",
    "N m s",
    0.0,
    10.0,
    "give viscous friction at the wheel",
);
const COULOMB: Range = range("motor.coulomb_n_m", "N m", 0.0, 100.0, "give dry friction at the wheel");
const KP: Range = range(
    "motor.speed_loop_kp_v_s_per_rad",
    "V s/rad",
    0.0,
    1e4,
    "give the gain of the wheel speed loop",
);
const KI: Range = range(
    "motor.speed_loop_ki_v_per_rad",
    "V/rad",
    0.0,
    1e5,
    "give the integral gain of the wheel speed loop",
);
const LAG: Range = range(
    "steering.lag_s",
    "s",
    0.0,
    10.0,
    "give the time constant of the steering gear, 0 = none",
);
const RATE: Range = range(
    "steering.rate_limit_rad_per_s",
    "rad/s",
    1e-3,
    1e3,
    "give the largest steering rate, or null for none",
);
const ANGLE: Range = range(
    "steering.angle_limit_rad",
    "rad",
    0.01,
    1.5,
    "give the largest bicycle angle in radians, or null for none",
);

fn problem(
    field: impl Into<String>,
    message: impl Into<String>,
    limit: impl Into<String>,
    remedy: &str,
) -> ParameterError {
    ParameterError {
        field: field.into(),
        message: message.into(),
        limit: limit.into(),
        remedy: remedy.to_owned(),
    }
}

fn check_value(problems: &mut Vec<ParameterError>, prefix: &str, value: f64, range: &Range) {
    if value.is_finite() && (range.low..=range.high).contains(&value) {
        return;
    }
    let message = if value.is_finite() {
        format!("{value} is out of range")
    } else {
        format!("{value} is not a finite number")
    };
    let unit = if range.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", range.unit)
    };
    let limit = format!("{}..={}{unit}", range.low, range.high);
    problems.push(problem(format!("{prefix}{}", range.key), message, limit, range.remedy));
}

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
    check_value(&mut problems, "", robot.mass_kg, &MASS);
    check_value(&mut problems, "", robot.yaw_inertia_kg_m2, &INERTIA);
    check_value(&mut problems, "", robot.com_height_m, &COM_HEIGHT);
    check_wheels(&mut problems, &robot.wheels);
    if let Some(motor) = &robot.motor {
        check_motor(&mut problems, motor);
    }
    if let Some(steering) = &robot.steering {
        check_steering(&mut problems, steering);
    }
    check_value(&mut problems, "", robot.floor_friction, &FRICTION);
    check_noise(&mut problems, robot);
    check_chassis(&mut problems, robot);
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
    for (i, wheel) in wheels.iter().enumerate() {
        let prefix = format!("wheels[{i}].");
        check_value(problems, &prefix, wheel.x_m, &WHEEL_X);
        check_value(problems, &prefix, wheel.y_m, &WHEEL_Y);
        check_value(problems, &prefix, wheel.rolling_direction_rad, &DIRECTION);
        let caster = wheel.kind == "caster";
        for (value, range) in [(wheel.radius_m, &RADIUS), (wheel.spin_inertia_kg_m2, &SPIN)] {
            match value {
                Some(value) => check_value(problems, &prefix, value, range),
                None if caster => {}
                None => problems.push(problem(
                    format!("{prefix}{}", range.key),
                    "missing",
                    "required unless the wheel is a caster",
                    range.remedy,
                )),
            }
        }
        if !WHEEL_KINDS.contains(&wheel.kind.as_str()) {
            problems.push(problem(
                format!("{prefix}kind"),
                format!("{:?} is unknown", wheel.kind),
                WHEEL_KINDS.join(", "),
                "use one of the kinds",
            ));
        }
        if caster && (wheel.driven || wheel.steered) {
            problems.push(problem(
                format!("{prefix}driven"),
                "a caster is driven or steered",
                "casters roll freely",
                "make it a standard wheel",
            ));
        }
        if wheel.kind == "omni" && wheel.steered {
            problems.push(problem(
                format!("{prefix}steered"),
                "an omni wheel is steered",
                "only standard wheels steer",
                "set steered to false",
            ));
        }
    }
}

fn check_motor(problems: &mut Vec<ParameterError>, motor: &Motor) {
    let values = [
        (motor.gear_ratio, &GEAR),
        (motor.torque_constant_n_m_per_a, &TORQUE_CONSTANT),
        (motor.resistance_ohm, &RESISTANCE),
        (motor.current_limit_a.unwrap_or(CURRENT.high), &CURRENT),
        (motor.supply_v, &SUPPLY),
        (motor.viscous_n_m_s, &VISCOUS),
        (motor.coulomb_n_m, &COULOMB),
        (motor.speed_loop_kp_v_s_per_rad, &KP),
        (motor.speed_loop_ki_v_per_rad, &KI),
    ];
    for (value, range) in values {
        check_value(problems, "", value, range);
    }
}

fn check_steering(problems: &mut Vec<ParameterError>, steering: &Steering) {
    check_value(problems, "", steering.lag_s, &LAG);
    check_value(problems, "", steering.rate_limit_rad_per_s.unwrap_or(RATE.high), &RATE);
    check_value(problems, "", steering.angle_limit_rad.unwrap_or(ANGLE.high), &ANGLE);
}

fn check_noise(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
    let Some(noise) = &robot.noise else { return };
    let entries = [
        ("pose_xy_m", noise.pose_xy_m),
        ("pose_yaw_rad", noise.pose_yaw_rad),
        ("wheel_rad_per_s", noise.wheel_rad_per_s),
        ("current_a", noise.current_a),
        ("gyro_rad_per_s", noise.gyro_rad_per_s),
        ("accel_m_per_s2", noise.accel_m_per_s2),
        ("bus_v", noise.bus_v),
        ("steering_rad", noise.steering_rad),
    ];
    for (key, value) in entries {
        let range = Range {
            key,
            unit: "",
            low: 0.0,
            high: 1e3,
            remedy: "give one standard deviation, or leave it out",
        };
        if let Some(value) = value {
            check_value(problems, "noise.", value, &range);
        }
    }
}

/// What makes a wheel table a chassis of its name.
fn check_chassis(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
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
        "diff2" if driven != 2 || standard < 2 || omni != 0 => Some("2 driven standard wheels, casters besides"),
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
