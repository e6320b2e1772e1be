//! Command fusion on an ideal robot: what it is told it does, and no target makes it leave its region.
#![allow(clippy::disallowed_methods, reason = "an oracle may use the platform's functions")]

mod kit;

use kit::Random;
use robot::estimator::Estimate;
use robot::frame::{Aim, Region, Target};
use robot::fusion::{DynamicLimits, Fusion};
use robot::kinematics::{Twist, WheelTable};

const STEP_S: f64 = 1.0 / 480.0;

const REGION: Region = Region {
    left_m: -1.5,
    right_m: 1.5,
    bottom_m: -1.0,
    top_m: 1.0,
};

fn target(aim: Aim) -> Target {
    Target {
        enable: true,
        stop: false,
        clear: false,
        aim,
        speed_cap_m_per_s: 0.6,
        yaw_rate_cap_rad_per_s: 2.0,
        region: REGION,
        expiry_ms: 100,
    }
}

fn forward(speed: f64) -> Aim {
    Aim::Twist(Twist {
        forward_m_per_s: speed,
        ..Twist::default()
    })
}

/// A robot that does what its wheels are told, and knows where it is.
struct Ideal {
    fusion: Fusion,
    wheels: WheelTable,
    estimate: Estimate,
}

impl Ideal {
    fn new(wheels: WheelTable) -> Self {
        Self {
            fusion: Fusion::new(DynamicLimits::default(), STEP_S),
            wheels,
            estimate: Estimate {
                anchored: true,
                position_sd_m: 0.002,
                ..Estimate::default()
            },
        }
    }

    fn step(&mut self) -> Twist {
        let set_point = self.fusion.step(&self.estimate, &self.wheels);
        let twist = self.wheels.twist(&set_point.wheel_rad_per_s, set_point.steering_rad);
        let (sin, cos) = self.estimate.yaw_rad.sin_cos();
        self.estimate.x_m += STEP_S * (cos * twist.forward_m_per_s - sin * twist.left_m_per_s);
        self.estimate.y_m += STEP_S * (sin * twist.forward_m_per_s + cos * twist.left_m_per_s);
        self.estimate.yaw_rad += STEP_S * twist.yaw_rate_rad_per_s;
        self.estimate.twist = twist;
        twist
    }

    fn outside_m(&self) -> f64 {
        let Estimate { x_m, y_m, .. } = self.estimate;
        (x_m.abs() - 1.5).max(y_m.abs() - 1.0)
    }
}

#[test]
fn a_twist_is_reached_at_the_acceleration_limit_and_capped() {
    let mut robot = Ideal::new(kit::omni());
    for k in 1..=480 {
        robot.fusion.accept(&target(forward(5.0)), 0.0);
        let twist = robot.step();
        let by_hand = (1.5 * f64::from(k) * STEP_S).min(0.6);
        assert!(
            (twist.forward_m_per_s - by_hand).abs() < 1e-9,
            "step {k}: {twist:?} {by_hand}"
        );
    }
}

#[test]
fn a_target_whose_time_is_over_stops_the_robot_at_the_limit() {
    let mut robot = Ideal::new(kit::omni());
    for _ in 0..480 {
        robot.fusion.accept(&target(forward(0.6)), 0.0);
        robot.step();
    }
    robot.fusion.accept(&target(forward(0.6)), 60.0);
    // 40 ms are left of 100: 19 steps. Then 0.6 m/s at 1.5 m/s2 are 192 steps.
    for k in 1..=260 {
        let speed = robot.step().forward_m_per_s;
        let by_hand = (0.6 - 1.5 * STEP_S * f64::from((k - 19).max(0))).max(0.0);
        assert!((speed - by_hand).abs() < 1e-9, "step {k}: {speed} {by_hand}");
    }
    robot.fusion.accept(&target(forward(0.6)), 101.0);
    assert_eq!(robot.step().forward_m_per_s, 0.0, "over before it came");
}

#[test]
fn without_an_anchored_estimate_a_robot_stands() {
    let mut robot = Ideal::new(kit::omni());
    robot.estimate.anchored = false;
    for _ in 0..100 {
        robot.fusion.accept(&target(forward(0.6)), 0.0);
        assert_eq!(robot.step(), Twist::default());
    }
}

#[test]
fn poses_are_reached() {
    let mut random = Random(3);
    for (name, wheels, car) in [
        ("omni", kit::omni(), false),
        ("diff", kit::diff(), false),
        ("car", kit::car(), true),
    ] {
        let mut robot = Ideal::new(wheels);
        let mut worst_m: f64 = 0.0;
        for _ in 0..20 {
            // A car goes to points ahead of it only; where it cannot turn it would have to manoeuvre.
            let (x_m, y_m, yaw_rad) = if car {
                robot.estimate = Estimate {
                    x_m: -1.0,
                    y_m: 0.0,
                    yaw_rad: 0.0,
                    ..robot.estimate
                };
                (random.between(0.2, 1.3), random.between(-0.3, 0.3), 0.0)
            } else {
                (
                    random.between(-1.3, 1.3),
                    random.between(-0.8, 0.8),
                    random.between(-3.0, 3.0),
                )
            };
            for _ in 0..480 * 20 {
                robot.fusion.accept(&target(Aim::Pose { x_m, y_m, yaw_rad }), 0.0);
                robot.step();
            }
            let gap_m = (robot.estimate.x_m - x_m).hypot(robot.estimate.y_m - y_m);
            worst_m = worst_m.max(gap_m);
            if !car {
                let turn = (robot.estimate.yaw_rad - yaw_rad).rem_euclid(std::f64::consts::TAU);
                assert!(
                    turn.min(std::f64::consts::TAU - turn) < 0.02,
                    "{name}: yaw off by {turn}"
                );
            }
        }
        println!("{name}: at most {worst_m} m from the goal");
        assert!(worst_m < 0.025, "{name}: {worst_m}");
    }
}

#[test]
fn no_target_makes_a_robot_leave_its_region_or_break_a_limit() {
    let limits = DynamicLimits::default();
    for (name, wheels) in [("omni", kit::omni()), ("diff", kit::diff()), ("car", kit::car())] {
        let (mut outside_m, mut fastest, mut steps): (f64, f64, u32) = (f64::NEG_INFINITY, 0.0, 0);
        for seed in 1..=60 {
            let mut random = Random(seed * 104_729);
            let mut robot = Ideal::new(wheels);
            robot.estimate.x_m = random.between(-1.3, 1.3);
            robot.estimate.y_m = random.between(-0.8, 0.8);
            robot.estimate.yaw_rad = random.between(-3.0, 3.0);
            let mut aim = forward(1.0);
            for step in 0..480 * 6 {
                if step % 97 == 0 {
                    aim = if random.below(2) == 0 {
                        Aim::Pose {
                            x_m: random.between(-4.0, 4.0),
                            y_m: random.between(-4.0, 4.0),
                            yaw_rad: random.between(-3.0, 3.0),
                        }
                    } else {
                        Aim::Twist(Twist {
                            forward_m_per_s: random.between(-3.0, 3.0),
                            left_m_per_s: random.between(-3.0, 3.0),
                            yaw_rate_rad_per_s: random.between(-9.0, 9.0),
                        })
                    };
                }
                let asked = Target {
                    speed_cap_m_per_s: 5.0,
                    yaw_rate_cap_rad_per_s: 12.0,
                    ..target(aim)
                };
                robot.fusion.accept(&asked, 0.0);
                robot.step();
                let twist = *robot.fusion.twist();
                assert!(twist.speed_m_per_s() <= limits.speed_m_per_s + 1e-9);
                assert!(twist.yaw_rate_rad_per_s.abs() <= limits.yaw_rate_rad_per_s + 1e-9);
                fastest = fastest.max(twist.speed_m_per_s());
                outside_m = outside_m.max(robot.outside_m());
                steps += 1;
            }
        }
        println!("{name}: {steps} steps, nearest to the border {outside_m} m, fastest {fastest} m/s");
        // The margin is 3 x 2 mm.
        assert!(outside_m < 0.0, "{name}: {outside_m} m outside");
        assert!(
            outside_m > -0.1 && fastest > 0.5,
            "{name}: it never came near: {outside_m} {fastest}"
        );
    }
}
