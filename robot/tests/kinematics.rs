//! Wheel tables against closed forms.
#![allow(clippy::disallowed_methods, reason = "an oracle may use the platform's functions")]

mod kit;

use kit::{RADIUS_M, Random};
use robot::MAX_MOTORS;
use robot::kinematics::{Twist, Wheel, WheelKind, WheelTable, WheelTableError};

fn twist(forward: f64, left: f64, yaw_rate: f64) -> Twist {
    Twist {
        forward_m_per_s: forward,
        left_m_per_s: left,
        yaw_rate_rad_per_s: yaw_rate,
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12 * (1.0 + b.abs())
}

#[test]
fn an_omni_robot_by_hand() {
    // Wheels at (+-0.12, +-0.12), tangential: rim = (-u sin p + v cos p) + r d with p = 45, 135, 225, 315 degrees.
    let (table, distance_m) = (kit::omni(), 0.12 * 2f64.sqrt());
    for (u, v, r) in [(0.5, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.0, 1.2), (0.4, -0.2, -0.7)] {
        let set_point = table.set_point(&twist(u, v, r), 0.0);
        for (i, speed) in set_point.wheel_rad_per_s.iter().enumerate() {
            let place = std::f64::consts::FRAC_PI_4 * (2 * i + 1) as f64;
            let by_hand = (-u * place.sin() + v * place.cos() + r * distance_m) / RADIUS_M;
            assert!(near(*speed, by_hand), "wheel {i}: {speed} {by_hand}");
        }
    }
    assert!(table.moves_sideways() && table.sees_sideways() && !table.is_steered());
}

#[test]
fn a_differential_robot_by_hand() {
    let table = kit::diff();
    let set_point = table.set_point(&twist(0.5, 0.0, 0.8), 0.0);
    assert!(near(set_point.wheel_rad_per_s[0], (0.5 - 0.15 * 0.8) / RADIUS_M));
    assert!(near(set_point.wheel_rad_per_s[1], (0.5 + 0.15 * 0.8) / RADIUS_M));
    assert_eq!(set_point.wheel_rad_per_s[2..], [0.0, 0.0]);
    let back = table.twist(&[8.0, 12.0, 0.0, 0.0], 0.0);
    assert!(
        near(back.forward_m_per_s, 0.5) && near(back.yaw_rate_rad_per_s, 0.2 / 0.3) && back.left_m_per_s.abs() < 1e-12
    );
    assert!(!table.moves_sideways() && table.sees_sideways());
}

#[test]
fn a_car_steers_by_its_bicycle_angle_and_its_axles_meet() {
    let table = kit::car();
    let (u, r, wheelbase_m) = (0.6, 0.7, 0.26);
    let set_point = table.set_point(&twist(u, 0.0, r), 0.0);
    assert!(near(set_point.steering_rad, (wheelbase_m * r / u).atan()));
    // The rear wheels run on arcs around (-0.13, u / r).
    assert!(near(set_point.wheel_rad_per_s[0], (u - 0.12 * r) / RADIUS_M));
    assert!(near(set_point.wheel_rad_per_s[1], (u + 0.12 * r) / RADIUS_M));
    assert_eq!(
        table.set_point(&twist(0.0, 0.0, 0.0), 0.3).steering_rad,
        0.3,
        "held at standstill"
    );
    assert_eq!(table.set_point(&twist(0.1, 0.0, 3.0), 0.0).steering_rad, 0.5, "limited");
    // Back again: velocity of the body origin, which lies 0.13 m ahead of the rear axle.
    let seen = table.twist(&set_point.wheel_rad_per_s, set_point.steering_rad);
    assert!(near(seen.forward_m_per_s, u) && near(seen.yaw_rate_rad_per_s, r) && near(seen.left_m_per_s, 0.13 * r));
}

#[test]
fn there_and_back_is_the_same_for_every_twist_a_robot_can_have() {
    let mut random = Random(77);
    for (name, table, sideways) in [("omni", kit::omni(), true), ("diff", kit::diff(), false)] {
        let mut worst: f64 = 0.0;
        for _ in 0..10_000 {
            let left = if sideways { random.between(-1.0, 1.0) } else { 0.0 };
            let made = twist(random.between(-1.0, 1.0), left, random.between(-3.0, 3.0));
            let seen = table.twist(&table.set_point(&made, 0.0).wheel_rad_per_s, 0.0);
            worst = worst
                .max((seen.forward_m_per_s - made.forward_m_per_s).abs())
                .max((seen.left_m_per_s - made.left_m_per_s).abs())
                .max((seen.yaw_rate_rad_per_s - made.yaw_rate_rad_per_s).abs());
        }
        assert!(worst < 1e-12, "{name}: {worst}");
    }
}

#[test]
fn unusable_tables_are_refused() {
    let wheel = kit::wheel(WheelKind::Omni, 0.1, 0.1, 0.0);
    assert_eq!(
        WheelTable::new(&[wheel; MAX_MOTORS + 1], 0.0).unwrap_err(),
        WheelTableError::TooMany
    );
    assert_eq!(WheelTable::new(&[wheel; 7], 0.0).unwrap_err(), WheelTableError::TooMany);
    let flat = Wheel { radius_m: 0.0, ..wheel };
    assert_eq!(
        WheelTable::new(&[wheel, flat], 0.0).unwrap_err(),
        WheelTableError::Radius { wheel: 1 }
    );
    let steered = Wheel { steered: true, ..wheel };
    assert_eq!(
        WheelTable::new(&[steered], 0.5).unwrap_err(),
        WheelTableError::Wheelbase
    );
}
