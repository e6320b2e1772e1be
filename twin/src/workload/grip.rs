//! How much of their friction the driven wheels of a robot use.

use crate::SLIP_SCALE_M_PER_S;
use crate::free::RobotState;
use crate::math::tanh;
use crate::model::Model;

/// sum |F_i| / sum mu N_i over the driven wheels, 0 to 1.
///
/// |F_i| / (mu N_i) = tanh(|s_i| / s0), with the slips of the state and the loads at its acceleration. For the nominal
/// contact law and a centre of mass at the body origin; a friction that differs from wheel to wheel counts as equal.
pub(super) fn in_use(model: &Model, state: &RobotState) -> f64 {
    let geometry = model.geometry_at(model.wheel_steering.wheels_rad(state.steering_rad));
    let twist = &state.twist;
    let (u, v, r) = (twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s);
    let loads_n = model.load.loads_n(state.accel_x_m_per_s2, state.accel_y_m_per_s2);
    let (mut used_n, mut all_n) = (0.0, 0.0);
    for lane in (0..model.lanes).filter(|lane| model.driven[*lane]) {
        let (cos, sin) = (geometry.cos[lane], geometry.sin[lane]);
        let rolling = model.radius_m[lane] * state.wheel_rad_per_s[model.wheel_of_lane[lane]];
        let along = rolling - (cos * u + sin * v + geometry.arm_along_m[lane] * r);
        let across = model.lateral[lane] * (cos * v - sin * u + geometry.arm_across_m[lane] * r);
        let slip_m_per_s = (along * along + across * across).sqrt();
        used_n += loads_n[lane] * tanh(slip_m_per_s / SLIP_SCALE_M_PER_S);
        all_n += loads_n[lane];
    }
    used_n / all_n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::reference_robot;
    use crate::pose::Pose;
    use crate::robot::Robot;
    use crate::state::BodyState;
    use crate::twist::BodyTwist;

    fn at(chassis: &str, twist: BodyTwist, wheel_rad_per_s: f64) -> f64 {
        let robot = Robot::new(reference_robot(chassis)).expect("reference");
        let mut state = BodyState::at_rest(robot.model(), Pose::default()).view(robot.model());
        state.twist = twist;
        state.wheel_rad_per_s = [wheel_rad_per_s; crate::MAX_WHEELS];
        in_use(robot.model(), &state)
    }

    /// tanh(1) = e^2 - 1 / e^2 + 1 at a slip of s0; 1 for a sliding robot; 0 for a rolling one.
    #[test]
    fn grip_is_the_hyperbolic_tangent_of_slip() {
        let forward = |forward_m_per_s| BodyTwist {
            forward_m_per_s,
            ..BodyTwist::default()
        };
        assert_eq!(at("diff4", forward(0.0), 0.0), 0.0);
        assert!(at("diff4", forward(0.5), 10.0) < 1e-12);
        let e2 = libm::exp(2.0);
        assert!((at("diff4", forward(0.5), 10.4) - (e2 - 1.0) / (e2 + 1.0)).abs() < 1e-12);
        assert!(at("diff4", forward(0.5), 0.0) > 1.0 - 1e-12);
    }

    #[test]
    fn sideways_motion_is_slip_for_a_standard_wheel_only() {
        let left = BodyTwist {
            left_m_per_s: 0.02,
            ..BodyTwist::default()
        };
        let tanh_1 = libm::tanh(1.0);
        assert!((at("awd", left, 0.0) - tanh_1).abs() < 1e-12);
        // An omni wheel at 45 degrees slips along its rolling direction by 0.02 / sqrt 2 alone.
        let share = libm::tanh(core::f64::consts::FRAC_1_SQRT_2);
        assert!((at("omni4", left, 0.0) - share).abs() < 1e-12);
    }
}
