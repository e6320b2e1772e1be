//! A robot that is told to make room and does not: blocked wheels, a dead motor, a radio that it no longer hears.

mod common;

use common::{CHASSIS, chassis_robot};
use control::TICK_S;
use control::law::RobotObservation;
use control::safety::{FilterBody, Limits, SafetyFilter};
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

const RADIUS_M: f64 = 0.25;
const LATENCY_TICKS: usize = 12;

fn robot(chassis: &str) -> Robot {
    let description = chassis_robot(chassis, "r")["description"].clone();
    Robot::new(serde_json::from_value(description).expect("description")).expect("robot")
}

fn ahead(forward_m_per_s: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s,
        ..BodyTwist::default()
    }
}

/// One robot drives at another's back as fast as it may, the other is told to drive away and stands: the least distance of the circles, m.
/// The first does what it is told 0.1 s later.
fn least_gap_m(chassis: &str, wish_of_the_stuck_m_per_s: f64) -> f64 {
    let bodies = [chassis, chassis].map(|one| FilterBody {
        robot: robot(one),
        bounding_radius_m: RADIUS_M,
    });
    let mut filter = SafetyFilter::new(Limits::default(), [8.0, 8.0], bodies.to_vec());
    let wishes = [ahead(0.8), ahead(wish_of_the_stuck_m_per_s)];
    let (mut at_m, mut speed_m_per_s, mut least_m) = (-1.5, 0.0, f64::INFINITY);
    let mut told = [0.0; LATENCY_TICKS];
    for tick in 0..1800 {
        let seen = |x_m: f64, speed: f64| RobotObservation {
            pose: Pose {
                x_m,
                y_m: 0.0,
                yaw_rad: 0.0,
            },
            pose_age_s: 0.0,
            twist: ahead(speed),
            online: true,
        };
        let filtered = filter.apply(&[seen(at_m, speed_m_per_s), seen(0.0, 0.0)], &wishes);
        told[tick % LATENCY_TICKS] = filtered[0].command.twist().forward_m_per_s;
        speed_m_per_s = told[(tick + 1) % LATENCY_TICKS];
        at_m += speed_m_per_s * TICK_S;
        least_m = least_m.min(-at_m - 2.0 * RADIUS_M);
    }
    least_m
}

#[test]
fn nobody_counts_on_room_that_is_not_made() {
    for chassis in CHASSIS {
        for wish_m_per_s in [0.8, 0.2, 0.01] {
            let least_m = least_gap_m(chassis, wish_m_per_s);
            println!(
                "{chassis}, {wish_m_per_s} m/s wanted by the one that is stuck: {:.1} mm",
                1e3 * least_m
            );
            assert!(least_m > 0.015, "{chassis} {wish_m_per_s}: {least_m}");
        }
    }
}
