//! A robot with four fixed wheels walks while it turns on the spot: inside a margin its yaw rate is limited.

mod common;

use common::chassis_robot;
use control::law::RobotObservation;
use control::safety::{FilterBody, Limits, SafetyFilter};
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

const RADIUS_M: f64 = 0.25;

/// Yaw rate that is left of 2 rad/s beside a parked robot, `seen_gap_m` from rim to rim.
fn yaw_rate_rad_per_s(chassis: &str, seen_gap_m: f64) -> f64 {
    let body = |chassis: &str| {
        let description = chassis_robot(chassis, "r")["description"].clone();
        FilterBody {
            robot: Robot::new(serde_json::from_value(description).expect("description")).expect("robot"),
            bounding_radius_m: RADIUS_M,
        }
    };
    let mut filter = SafetyFilter::new(Limits::default(), [4.0, 3.0], vec![body(chassis), body("omni4")]);
    let at = |x_m: f64| RobotObservation {
        pose: Pose {
            x_m,
            y_m: 0.0,
            yaw_rad: 0.3,
        },
        pose_age_s: 0.01,
        twist: BodyTwist::default(),
        online: true,
    };
    let robots = [at(0.0), at(2.0 * RADIUS_M + seen_gap_m)];
    let turn = BodyTwist {
        yaw_rate_rad_per_s: 2.0,
        ..BodyTwist::default()
    };
    let filtered = filter.apply(&robots, &[turn, BodyTwist::default()]);
    filtered[0].command.twist().yaw_rate_rad_per_s
}

#[test]
fn a_robot_that_skids_turns_slower_the_more_of_the_margin_is_used() {
    let limits = Limits::default();
    let margin_m = limits.robot_margin_m + 2.0 * limits.pose_error_m;
    let rates: Vec<f64> = [0.1, 0.0, -0.01, -0.02]
        .iter()
        .map(|free_m| yaw_rate_rad_per_s("diff4", margin_m + free_m))
        .collect();
    assert_eq!((rates[0], rates[3]), (2.0, 0.0), "{rates:?}");
    assert!(rates[1] < 2.0 && rates[2] < rates[1] && rates[2] > 0.0, "{rates:?}");
}

#[test]
fn robots_that_turn_about_one_axle_or_on_rollers_are_not_limited() {
    for chassis in ["diff2", "omni4"] {
        assert_eq!(yaw_rate_rad_per_s(chassis, 0.02), 2.0, "{chassis}");
    }
}
