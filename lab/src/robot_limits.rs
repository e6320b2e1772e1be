//! How fast a robot can be, from its wheels: what the estimator believes.

use crate::estimator::MotionLimits;

/// What a robot's wheels allow.
#[derive(Debug, Clone, Copy)]
pub struct RobotLimits {
    pub motion: MotionLimits,
    /// Of the largest driven wheel.
    pub wheel_radius_m: f64,
}

/// Fastest that any robot here is thought to be when its description sets no limit.
const UNLIMITED_M_PER_S: f64 = 3.0;

impl RobotLimits {
    /// From the validated description.
    pub fn of(robot: &twin::robot::Robot) -> Self {
        let wheels = &robot.description().wheels;
        let wheel_radius_m = wheels
            .iter()
            .filter(|wheel| wheel.driven)
            .filter_map(|wheel| wheel.radius_m)
            .fold(0.0, f64::max);
        // Two omni wheels at right angles move the body by sqrt 2 of their rim speed.
        let rim_m_per_s = robot.max_wheel_speed_rad_per_s() * wheel_radius_m * std::f64::consts::SQRT_2;
        let speed_m_per_s = rim_m_per_s.min(UNLIMITED_M_PER_S);
        let lever_m = wheels
            .iter()
            .map(|wheel| f64::hypot(wheel.x_m, wheel.y_m))
            .fold(f64::INFINITY, f64::min)
            .max(0.05);
        let yaw_rate_rad_per_s = speed_m_per_s / lever_m;
        Self {
            motion: MotionLimits {
                speed_m_per_s,
                yaw_rate_rad_per_s,
            },
            wheel_radius_m,
        }
    }
}
