//! Effects that only change constants of the equations.

use super::Effect;
use crate::model::Model;
use crate::robot::{RobotDescription, Wheel};

/// The description whose geometry the robot itself works with: nominal, but for the effective track.
pub(crate) fn tracked(robot: &RobotDescription, effects: &[Effect]) -> RobotDescription {
    let mut changed = robot.clone();
    for effect in effects.iter().filter(|effect| effect.name == "track_width") {
        let scale = 1.0 + effect.value("relative");
        for wheel in &mut changed.wheels {
            wheel.y_m *= scale;
            if wheel.kind == "omni" {
                wheel.x_m *= scale;
            }
        }
    }
    changed
}

/// The description as the floor meets it. Its numbers may leave the range of a user's description.
pub(crate) fn physical(robot: &RobotDescription, effects: &[Effect]) -> RobotDescription {
    let mut changed = tracked(robot, effects);
    for effect in effects {
        match effect.name.as_str() {
            "wheel_radius" => {
                let scale = 1.0 + effect.value("relative");
                changed.wheels.iter_mut().for_each(|wheel| scale_radius(wheel, scale));
            }
            "wheel_radius_one" => {
                let scale = 1.0 + effect.value("relative");
                one(&mut changed, effect)
                    .into_iter()
                    .for_each(|wheel| scale_radius(wheel, scale));
            }
            "wheel_misalignment" => {
                if let Some(wheel) = one(&mut changed, effect) {
                    wheel.rolling_direction_rad += effect.value("toe");
                }
            }
            "floor_friction" => changed.floor_friction *= effect.value("scale"),
            "payload" => {
                changed.mass_kg += effect.value("mass");
                changed.yaw_inertia_kg_m2 += effect.value("inertia");
            }
            "coulomb_friction" => {
                if let Some(motor) = &mut changed.motor {
                    motor.coulomb_n_m += effect.value("torque");
                }
            }
            "viscous_friction" => {
                if let Some(motor) = &mut changed.motor {
                    motor.viscous_n_m_s += effect.value("coefficient");
                }
            }
            "steering_lag" => {
                if let Some(steering) = &mut changed.steering {
                    steering.lag_s += effect.value("time_constant");
                }
            }
            _ => {}
        }
    }
    changed
}

/// Changes the constants that a description cannot say.
pub(crate) fn shape(model: &mut Model, effects: &[Effect]) {
    for effect in effects {
        let lane = effect.index.and_then(|index| model.lane_of_wheel(index));
        match (effect.name.as_str(), lane) {
            ("weak_motor", Some(lane)) => model.torque_per_current[lane] *= effect.value("gain"),
            ("encoder_scale", Some(lane)) => model.encoder[lane] *= 1.0 + effect.value("relative"),
            ("steering_offset", _) => model.wheel_steering.offset_rad += effect.value("offset"),
            ("steering_scale", _) => model.wheel_steering.scale *= effect.value("scale"),
            ("center_of_mass_offset", _) => model.move_center_of_mass(effect.value("x"), effect.value("y")),
            ("longitudinal_slip", _) => model.tyre_mut().slip_ratio += effect.value("slip_ratio_at_full_force"),
            ("lateral_slip", _) => {
                let side_friction = effect.value("side_friction");
                if side_friction.is_finite() {
                    let nominal = model.nominal_friction;
                    model.tyre_mut().side_scale = side_friction / nominal;
                }
            }
            _ => {}
        }
    }
}

fn scale_radius(wheel: &mut Wheel, scale: f64) {
    if let Some(radius_m) = &mut wheel.radius_m {
        *radius_m *= scale;
    }
}

fn one<'a>(robot: &'a mut RobotDescription, effect: &Effect) -> Option<&'a mut Wheel> {
    effect.index.and_then(|index| robot.wheels.get_mut(index))
}
