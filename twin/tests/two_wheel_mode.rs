//! The two-wheel mode of `omni4`: two opposite wheels driven, the others free.
//!
//! Wheels 1 and 3 roll along the 45 degree diagonal d and stand rho = 0.12 sqrt 2 m beside it; across it, e, nothing but
//! the inertia of the free wheels 0 and 2 resists.

mod support;

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

use support::drive::{assert_close, run, twist};
use support::{diff2, omni4, robot, wheels};
use twin::free::{FreeRobot, Start};
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

const RHO_M: f64 = 0.12 * SQRT_2;
const RADIUS_M: f64 = 0.05;

fn driving(driven: &[usize]) -> RobotDescription {
    let mut description = omni4();
    for (index, wheel) in description.wheels.iter_mut().enumerate() {
        wheel.driven = driven.contains(&index);
    }
    description
}

fn two_wheels() -> Robot {
    robot(driving(&[1, 3]))
}

/// Along and across the 45 degree diagonal.
fn diagonal(twist: &BodyTwist) -> (f64, f64) {
    let (u, v) = (twist.forward_m_per_s, twist.left_m_per_s);
    ((u + v) / SQRT_2, (v - u) / SQRT_2)
}

#[test]
fn the_drive_axis_is_the_diagonal_of_the_driven_pair() {
    let axis = |description| robot(description).drive_axis_rad();
    assert!((axis(driving(&[1, 3])).expect("an axis") - FRAC_PI_4).abs() < 1e-12);
    assert!((axis(driving(&[0, 2])).expect("an axis") + FRAC_PI_4).abs() < 1e-12);
    for other in [omni4(), driving(&[0, 1, 2]), diff2()] {
        assert_eq!(axis(other), None);
    }
    // A description may lay its body frame along the diagonal; then forward is forward.
    let mut turned = driving(&[1, 3]);
    for wheel in &mut turned.wheels {
        let (x, y) = (wheel.x_m, wheel.y_m);
        (wheel.x_m, wheel.y_m) = ((x + y) / SQRT_2, (y - x) / SQRT_2);
        wheel.rolling_direction_rad -= FRAC_PI_4;
    }
    assert!(axis(turned).expect("an axis").abs() < 1e-12);
}

#[test]
fn only_the_part_along_the_diagonal_and_the_yaw_rate_can_be_commanded() {
    let robot = two_wheels();
    // R W_1 = -v_d + rho r, R W_3 = v_d + rho r; the free wheels get nothing.
    let command = robot.wheel_speeds(twist(0.4, 0.2, 0.5));
    let along = 0.6 / SQRT_2;
    let expected = [
        0.0,
        (-along + RHO_M * 0.5) / RADIUS_M,
        0.0,
        (along + RHO_M * 0.5) / RADIUS_M,
    ];
    for (wheel, speed) in expected.into_iter().enumerate() {
        assert!((command.wheel_rad_per_s[wheel] - speed).abs() < 1e-9, "wheel {wheel}");
    }
    // And back: the projection on the diagonal, with the yaw rate.
    let back = robot.twist_of_wheels(&command);
    assert!(
        (back.forward_m_per_s - 0.3).abs() < 1e-9 && (back.left_m_per_s - 0.3).abs() < 1e-9,
        "{back:?}"
    );
    assert!((back.yaw_rate_rad_per_s - 0.5).abs() < 1e-9);
    // Nothing is left of a command across the diagonal.
    let across = robot.wheel_speeds(twist(-0.3, 0.3, 0.0));
    assert!(across.wheel_rad_per_s.iter().all(|speed| speed.abs() < 1e-9));
}

#[test]
fn forward_commands_drive_it_along_the_diagonal() {
    let robot = two_wheels();
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &robot.wheel_speeds(twist(0.5, 0.0, 0.0)), 6.0);
    let (along, across) = diagonal(&free.state().twist);
    assert_close("along, m/s", along, 0.5 / SQRT_2, 1e-8);
    assert!(across.abs() < 1e-9);
    let pose = free.state().pose;
    assert!((pose.x_m - pose.y_m).abs() < 1e-9 && pose.x_m > 1.4, "{pose:?}");
}

#[test]
fn it_accelerates_by_the_friction_under_two_wheels() {
    // The driven wheels stand beside the diagonal: speeding up along it moves load between the free ones only, so each
    // driven wheel keeps m g/4. Both slip far beyond s0: a = 2 mu (m g/4)/m = mu g/2. The free wheels do not turn.
    let mut description = driving(&[1, 3]);
    description.floor_friction = 0.2;
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    let full = wheels(&[0.0, -30.0, 0.0, 30.0]);
    run(&mut free, &full, 0.1);
    let (before, _) = diagonal(&free.state().twist);
    run(&mut free, &full, 0.1);
    let state = free.state();
    let (after, across) = diagonal(&state.twist);
    // Slip above 0.1 m/s throughout: tanh 5 = 1 - 9e-5.
    assert!(RADIUS_M * state.wheel_rad_per_s[3] - after > 0.1);
    assert_close("acceleration, m/s^2", (after - before) / 0.1, 0.2 * 9.81 / 2.0, 5e-4);
    assert!(across.abs() < 1e-9 && state.wheel_rad_per_s[0].abs() < 1e-9);
}

#[test]
fn it_turns_in_place() {
    let robot = two_wheels();
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &robot.wheel_speeds(twist(0.0, 0.0, 1.0)), 4.0);
    let state = free.state();
    assert_close("yaw rate, rad/s", state.twist.yaw_rate_rad_per_s, 1.0, 1e-8);
    assert!(state.pose.x_m.abs() < 1e-9 && state.pose.y_m.abs() < 1e-9);
    // The free wheels are taken along: R W = rho r.
    assert_close("free wheel, rad/s", state.wheel_rad_per_s[0], RHO_M / RADIUS_M, 1e-6);
    assert_eq!((state.current_a[0], state.voltage_v[0]), (0.0, 0.0));
}

#[test]
fn an_arc_at_half_a_metre_per_second_slides_outward() {
    // Across the diagonal (m + 2 J_w/R^2) dv_e/dt = -m r V, while the drives hold V and r: v_e = -k r V t, and the free
    // wheels' speed differs by 2 v_e/R. The way slid, in the turning frame, grows as k r V t^2/2 at first.
    let robot = two_wheels();
    let (speed, rate, time_s) = (0.5, 0.4, 0.5);
    let share = 12.0 / (12.0 + 2.0 * 0.0008 / (RADIUS_M * RADIUS_M));
    let arc = twist(speed / SQRT_2, speed / SQRT_2, rate);
    let mut start = Start {
        twist: arc,
        wheel_rad_per_s: robot.wheel_speeds(arc).wheel_rad_per_s,
        ..Start::default()
    };
    // The free wheels start in pure rolling.
    start.wheel_rad_per_s[0] = RHO_M * rate / RADIUS_M;
    start.wheel_rad_per_s[2] = RHO_M * rate / RADIUS_M;
    let mut free = FreeRobot::moving(&robot, &start);
    let mut slid_m = 0.0;
    for step in 1..=240_u32 {
        free.step(&robot.wheel_speeds(arc));
        let (_, across) = diagonal(&free.state().twist);
        slid_m += across * twin::PHYSICS_PERIOD_S;
        let elapsed_s = f64::from(step) * twin::PHYSICS_PERIOD_S;
        let expected = -share * rate * speed * elapsed_s;
        assert!(
            (across - expected).abs() < 4e-4,
            "{elapsed_s} s: {across} against {expected} m/s"
        );
    }
    let expected = -share * rate * speed * time_s * time_s / 2.0;
    assert_close("way slid outward, m", slid_m, expected, 1e-2);
    // A left turn has its centre on the left: across the diagonal to the right is outward.
    assert!(slid_m < -0.02);
    // The same arc on four wheels does not slide.
    let four = support::robot(omni4());
    let command = four.wheel_speeds(arc);
    let start = Start {
        wheel_rad_per_s: command.wheel_rad_per_s,
        ..start
    };
    let mut held = FreeRobot::moving(&four, &start);
    run(&mut held, &command, time_s);
    assert!(diagonal(&held.state().twist).1.abs() < 2e-3);
}

#[test]
fn wheels_that_are_not_opposite_are_no_two_wheel_mode() {
    for neighbours in [[0, 1], [1, 2], [2, 3], [0, 3]] {
        let problem = Robot::new(driving(&neighbours)).expect_err("neighbours");
        assert_eq!(problem.field, "wheels");
        assert!(
            problem.message.contains("parallel") && problem.remedy.contains("opposite"),
            "{problem}"
        );
    }
    // In line one behind the other they could not turn it.
    let mut inline = driving(&[1, 3]);
    for index in [1, 3] {
        inline.wheels[index].rolling_direction_rad += FRAC_PI_2;
    }
    let problem = Robot::new(inline).expect_err("in line");
    assert!(problem.message.contains("cannot turn"), "{problem}");
    for pair in [[0, 2], [1, 3]] {
        assert!(Robot::new(driving(&pair)).is_ok());
    }
}
