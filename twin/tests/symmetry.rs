//! The equations know no left, no right and no compass.

mod support;

use proptest::prelude::{ProptestConfig, any, prop, prop_assert, proptest};
use support::{all, car, diff2, diff4, omni4, robot};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::{Pose, wrapped_rad};
use twin::robot::Robot;
use twin::twist::BodyTwist;

fn end(robot: &Robot, start: Pose, commands: &[WheelCommand]) -> Pose {
    let mut free = FreeRobot::at_rest(robot, start);
    for command in commands {
        for _ in 0..48 {
            free.step(command);
        }
    }
    free.state().pose
}

fn twist(forward: f64, left: f64, yaw_rate: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s: forward,
        left_m_per_s: left,
        yaw_rate_rad_per_s: yaw_rate,
    }
}

#[test]
fn left_and_right_mirror() {
    for description in [omni4(), diff2(), diff4(), car("fwd"), car("rwd"), car("awd")] {
        let robot = robot(description);
        let twists: Vec<BodyTwist> = (0..20)
            .map(|i| twist(0.8 - 0.05 * f64::from(i), 0.02 * f64::from(i), 0.15 * f64::from(i % 7)))
            .collect();
        let straight: Vec<WheelCommand> = twists.iter().map(|t| robot.wheel_speeds(*t)).collect();
        let mirrored: Vec<WheelCommand> = twists
            .iter()
            .map(|t| robot.wheel_speeds(twist(t.forward_m_per_s, -t.left_m_per_s, -t.yaw_rate_rad_per_s)))
            .collect();
        let (a, b) = (
            end(&robot, Pose::default(), &straight),
            end(&robot, Pose::default(), &mirrored),
        );
        let gap = (a.x_m - b.x_m).abs() + (a.y_m + b.y_m).abs() + wrapped_rad(a.yaw_rad + b.yaw_rad).abs();
        assert!(a.x_m.abs() + a.y_m.abs() > 0.05);
        assert!(gap < 1e-6, "{}: {a:?} {b:?}", robot.name());
    }
}

#[test]
fn inverse_and_forward_kinematics_agree() {
    for description in all() {
        let robot = robot(description);
        let omni = robot.chassis() == "omni4";
        // A car's body origin moves sideways in a turn: v = -r x_fixed.
        let left = if omni {
            -0.2
        } else if robot.chassis().ends_with("wd") {
            0.5 * 0.12
        } else {
            0.0
        };
        let wanted = twist(0.6, left, 0.5);
        let got = robot.twist_of_wheels(&robot.wheel_speeds(wanted));
        let gap =
            (got.forward_m_per_s - 0.6).abs() + (got.left_m_per_s - left).abs() + (got.yaw_rate_rad_per_s - 0.5).abs();
        // Four fixed wheels cannot turn without slip; least squares gives the direction only.
        assert!(gap < 1e-9 || robot.chassis() == "diff4", "{}: {got:?}", robot.name());
        assert!(got.yaw_rate_rad_per_s > 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_rotated_start_gives_a_rotated_path(
        kind in 0..6_usize, yaw in -3.0..3.0_f64, x in -2.0..2.0_f64, y in -2.0..2.0_f64,
        speeds in prop::collection::vec(-25.0..25.0_f64, 30), steering in -0.5..0.5_f64, _any in any::<bool>(),
    ) {
        let robot = robot(all().swap_remove(kind));
        let commands: Vec<WheelCommand> = speeds.chunks(3).map(|s| {
            let mut command = WheelCommand { steering_rad: steering, ..WheelCommand::default() };
            command.wheel_rad_per_s[..4].copy_from_slice(&[s[0], s[1], s[2], 0.5 * (s[0] + s[2])]);
            command
        }).collect();
        let base = end(&robot, Pose::default(), &commands);
        let moved = end(&robot, Pose { x_m: x, y_m: y, yaw_rad: yaw }, &commands);
        let (sin, cos) = libm::sincos(yaw);
        let expected = Pose { x_m: x + cos * base.x_m - sin * base.y_m, y_m: y + sin * base.x_m + cos * base.y_m, yaw_rad: 0.0 };
        prop_assert!(expected.distance_m(&moved) < 1e-9);
        prop_assert!(wrapped_rad(moved.yaw_rad - base.yaw_rad - yaw).abs() < 1e-9);
    }
}
