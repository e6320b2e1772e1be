//! Slip-free kinematics over the wheel table.

use nalgebra::{SMatrix, SVector};

use crate::command::WheelCommand;
use crate::linear::solve_semidefinite;
use crate::model::{Geometry, Model};
use crate::twist::BodyTwist;

/// Below this forward speed the steering angle of a twist is undefined, m/s.
const STILL_M_PER_S: f64 = 1e-9;

fn along(geometry: &Geometry, lane: usize) -> SVector<f64, 3> {
    SVector::<f64, 3>::new(geometry.cos[lane], geometry.sin[lane], geometry.arm_along_m[lane])
}

fn across(geometry: &Geometry, lane: usize) -> SVector<f64, 3> {
    SVector::<f64, 3>::new(-geometry.sin[lane], geometry.cos[lane], geometry.arm_across_m[lane])
}

/// Two driven wheels of an `omni4`: nothing keeps it from sliding across their rolling direction.
fn is_two_wheel_mode(model: &Model) -> bool {
    let lanes = || (0..model.lanes).filter(|lane| model.driven[*lane]);
    lanes().count() == 2 && lanes().all(|lane| model.omni[lane])
}

/// Direction in which the driven wheels of the two-wheel mode move the body, in (-pi/2, pi/2]; none for other robots.
pub(crate) fn drive_axis_rad(model: &Model) -> Option<f64> {
    let lane = (0..model.lanes).find(|lane| model.driven[*lane])?;
    is_two_wheel_mode(model).then(|| {
        let (cos, sin) = (model.geometry.cos[lane], model.geometry.sin[lane]);
        let forward = cos > 0.0 || (cos == 0.0 && sin > 0.0);
        if forward {
            libm::atan2(sin, cos)
        } else {
            libm::atan2(-sin, -cos)
        }
    })
}

pub(crate) fn wheel_speeds(model: &Model, twist: BodyTwist, last_steering_rad: f64) -> WheelCommand {
    let mut command = WheelCommand::default();
    if let Some(steering) = &model.steering {
        let wanted = if twist.forward_m_per_s.abs() > STILL_M_PER_S {
            libm::atan(steering.wheelbase_m * twist.yaw_rate_rad_per_s / twist.forward_m_per_s)
        } else {
            last_steering_rad
        };
        command.steering_rad = steering.limited_rad(wanted);
    }
    let geometry = model.geometry_at(command.steering_rad);
    let z = SVector::<f64, 3>::new(twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s);
    for lane in (0..model.lanes).filter(|lane| model.driven[*lane]) {
        command.wheel_rad_per_s[model.wheel_of_lane[lane]] = along(&geometry, lane).dot(&z) / model.radius_m[lane];
    }
    command
}

/// Set-points with a twist of slip-free rolling besides, at the steering angle as it is told.
pub(crate) fn shifted(model: &Model, mut command: WheelCommand, [u, v, r]: [f64; 3]) -> WheelCommand {
    let steering = model.steering.as_ref();
    let geometry = model.geometry_at(steering.map_or(0.0, |steering| steering.limited_rad(command.steering_rad)));
    for lane in (0..model.lanes).filter(|lane| model.driven[*lane]) {
        let speed = geometry.cos[lane] * u + geometry.sin[lane] * v + geometry.arm_along_m[lane] * r;
        command.wheel_rad_per_s[model.wheel_of_lane[lane]] += speed / model.radius_m[lane];
    }
    command
}

pub(crate) fn twist_of_wheels(model: &Model, command: &WheelCommand) -> BodyTwist {
    let steering_rad = model
        .steering
        .as_ref()
        .map_or(0.0, |steering| steering.limited_rad(command.steering_rad));
    let geometry = model.geometry_at(steering_rad);
    let mut normal = SMatrix::<f64, 3, 3>::zeros();
    let mut right = SVector::<f64, 3>::zeros();
    let sliding = is_two_wheel_mode(model);
    for lane in 0..model.lanes {
        if model.driven[lane] {
            let row = along(&geometry, lane);
            normal += row * row.transpose();
            right += row * (model.radius_m[lane] * command.wheel_rad_per_s[model.wheel_of_lane[lane]]);
        }
        if model.lateral[lane] > 0.0 || (sliding && model.driven[lane]) {
            let row = across(&geometry, lane);
            normal += row * row.transpose();
        }
    }
    let z = solve_semidefinite(&normal, &right);
    BodyTwist {
        forward_m_per_s: z[0],
        left_m_per_s: z[1],
        yaw_rate_rad_per_s: z[2],
    }
}
