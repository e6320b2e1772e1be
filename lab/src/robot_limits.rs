//! How fast a robot can be, from its wheels: what the estimator believes.

use crate::estimator::MotionLimits;
use control::answer::{Answer, chassis_answer_s};

/// What a robot's wheels allow.
#[derive(Debug, Clone, Copy)]
pub struct RobotLimits {
    pub motion: MotionLimits,
    /// Of the largest driven wheel.
    pub wheel_radius_m: f64,
    /// From set-points to motion: as assumed for safety, and as its description has it.
    pub answer_s: f64,
    pub nominal: Answer,
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
            answer_s: chassis_answer_s(robot),
            nominal: Answer::of(robot),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::answer::{ROLLING_ANSWER_S, SKIDDING_ANSWER_S};

    #[test]
    fn only_a_robot_with_two_rigid_axles_skids() {
        for chassis in ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"] {
            let path = format!("{}/../examples/robots/{chassis}-sam3x.json", env!("CARGO_MANIFEST_DIR"));
            let text = std::fs::read_to_string(path).expect("an example");
            let document: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let description = serde_json::from_value(document["robot"].clone()).expect("a robot");
            let robot = twin::robot::Robot::new(description).expect("a valid robot");
            let answer_s = RobotLimits::of(&robot).answer_s;
            let asked_s = if chassis == "diff4" {
                SKIDDING_ANSWER_S
            } else {
                ROLLING_ANSWER_S
            };
            assert_eq!(answer_s, asked_s, "{chassis}");
        }
    }
}
