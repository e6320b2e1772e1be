//! Path following of robots that drag their wheels over the floor: they turn about a point that need not be the body origin.

mod common;

use common::team;
use control::TICK_S;
use control::law::{self, Demand, Drive, Observation, Parameters, RobotObservation};
use control::path_error::PathError;
use serde_json::json;
use twin::pose::Pose;
use twin::twist::BodyTwist;

/// The body origin lies so far behind the point about which the robot turns.
const POINT_M: f64 = 0.04;
/// First-order lag of the yaw rate.
const LAG_S: f64 = 0.15;
/// The robot is at the end of its path within this, as the law is told.
const REACHED_M: f64 = 0.03;

struct Driven {
    largest_m: f64,
    seconds: f64,
    end_m: [f64; 2],
}

/// The paper's L, out and back, from 45 degrees beside it.
///
/// - `known_m`: the turning point as the law is told.
fn drive(distance_gain_per_s: f64, known_m: f64) -> Driven {
    let parameters = json!({"speed_m_per_s": 0.7, "distance_gain_per_s": distance_gain_per_s, "integral_gain_per_s2": 0.0,
        "derivative_gain": 0.0, "yaw_gain_per_s": 5.0, "reach_radius_m": REACHED_M});
    let targets =
        json!([{"x_m": 1.0, "y_m": 0.0}, {"x_m": 1.0, "y_m": 2.0}, {"x_m": 1.0, "y_m": 0.0}, {"x_m": 0.0, "y_m": 0.0}]);
    let document = team(
        "path_following",
        parameters,
        &[("diff4", [0.0, 0.0, -core::f64::consts::FRAC_PI_4])],
        targets,
        90.0,
        [12.0, 12.0],
    );
    let scenario = common::parsed(&document);
    let robots = control::team::robots(&scenario).expect("robots");
    let mut bodies = law::bodies(&scenario, &robots);
    bodies[0].turn_point_x_m = known_m;
    assert_eq!(bodies[0].drive, Drive::TurnInPlace { swing_m: 0.12 });
    let mut law = law::build(&scenario).expect("a law");
    let (goals, parameters) = (law::goals(&scenario), Parameters::of(&scenario.experiment.control));
    let mut error = PathError::new(&law::path(&scenario, 0));
    let (mut pose, mut twist) = (
        Pose {
            yaw_rad: -core::f64::consts::FRAC_PI_4,
            ..Pose::default()
        },
        BodyTwist::default(),
    );
    let mut largest_m = 0.0_f64;
    for tick in 0..90 * 120_u64 {
        let slid = BodyTwist {
            left_m_per_s: -POINT_M * twist.yaw_rate_rad_per_s,
            ..twist
        };
        let seen = RobotObservation {
            pose,
            pose_age_s: 0.0,
            twist: slid,
            online: true,
        };
        let mut demands = [Demand::default()];
        law.step(
            &Observation {
                tick,
                robots: &[seen],
                bodies: &bodies,
                arena_m: [12.0, 12.0],
                targets: &goals,
                parameters: &parameters,
            },
            &mut demands,
        );
        largest_m = largest_m.max(error.at([pose.x_m, pose.y_m]));
        if demands[0].finished {
            return Driven {
                largest_m,
                seconds: tick as f64 * TICK_S,
                end_m: [pose.x_m, pose.y_m],
            };
        }
        twist.forward_m_per_s = demands[0].twist.forward_m_per_s;
        twist.yaw_rate_rad_per_s += (demands[0].twist.yaw_rate_rad_per_s - twist.yaw_rate_rad_per_s) * TICK_S / LAG_S;
        let (sin, cos) = (libm::sin(pose.yaw_rad), libm::cos(pose.yaw_rad));
        pose.x_m += TICK_S * (cos * slid.forward_m_per_s - sin * slid.left_m_per_s);
        pose.y_m += TICK_S * (sin * slid.forward_m_per_s + cos * slid.left_m_per_s);
        pose.yaw_rad += TICK_S * twist.yaw_rate_rad_per_s;
    }
    panic!("k_p {distance_gain_per_s}: never arrives, {largest_m} m beside its path");
}

/// Turning moves the origin off the next leg; a law that aims back at once, at a speed of nothing, turns ever further.
#[test]
fn a_robot_whose_origin_swings_out_in_turns_stays_near_its_path_and_arrives() {
    for gain in [1.5, 3.0, 5.0] {
        let driven = drive(gain, 0.0);
        println!(
            "k_p {gain}: {:.0} mm, {:.1} s, ends {:?}",
            1e3 * driven.largest_m,
            driven.seconds,
            driven.end_m
        );
        // Where the path turns back the origin comes to lie twice as far beyond the corner.
        assert!(
            driven.largest_m < 2.0 * POINT_M + 0.006,
            "k_p {gain}: {} m",
            driven.largest_m
        );
        assert!(driven.seconds < 24.0, "k_p {gain}: {} s", driven.seconds);
        assert!(
            libm::hypot(driven.end_m[0], driven.end_m[1]) < REACHED_M,
            "k_p {gain}: {:?}",
            driven.end_m
        );
    }
}

#[test]
fn a_robot_that_knows_where_it_turns_keeps_its_origin_within_that_of_both_legs() {
    for gain in [1.5, 3.0, 5.0] {
        let driven = drive(gain, POINT_M);
        println!("k_p {gain}: {:.0} mm, {:.1} s", 1e3 * driven.largest_m, driven.seconds);
        assert!(driven.largest_m < POINT_M + 0.006, "k_p {gain}: {} m", driven.largest_m);
        assert!(
            libm::hypot(driven.end_m[0], driven.end_m[1]) < REACHED_M,
            "k_p {gain}: {:?}",
            driven.end_m
        );
    }
}
