//! Omni wheels: diagonals, rotation in place, and two powered wheels out of four.
//!
//! The test robot has its wheels at rho = 0.12 sqrt 2 m on the diagonals, rolling tangentially: wheel 0 at 45 degrees
//! rolls to 135 degrees, and so on round. Along the diagonal d (45 degrees) and across it e (135 degrees):
//!   a_0 = v_e + rho r,  a_1 = -v_d + rho r,  a_2 = -v_e + rho r,  a_3 = v_d + rho r.

mod support;

use core::f64::consts::{FRAC_PI_4, SQRT_2};

use support::drive::{assert_close, rolling, run, torque_free, twist};
use support::{omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::RobotDescription;

const RHO_M: f64 = 0.12 * SQRT_2;
const RADIUS_M: f64 = 0.05;

/// Wheels 0 and 2 roll freely; wheels 1 and 3 drive along the diagonal.
fn two_wheel_mode() -> RobotDescription {
    let mut description = omni4();
    description.wheels[0].driven = false;
    description.wheels[2].driven = false;
    description
}

/// Speeds along and across the 45 degree diagonal.
fn diagonal(free: &FreeRobot) -> (f64, f64) {
    let (u, v) = (free.state().twist.forward_m_per_s, free.state().twist.left_m_per_s);
    ((u + v) / SQRT_2, (v - u) / SQRT_2)
}

fn steady(command: &WheelCommand) -> FreeRobot {
    let mut free = FreeRobot::at_rest(&robot(omni4()), Pose::default());
    run(&mut free, command, 6.0);
    free
}

#[test]
fn a_wheel_speed_drives_sqrt_2_faster_forward_than_along_a_diagonal() {
    // Forward: every wheel at 45 degrees to the motion, R W = u/sqrt 2. Diagonal: two wheels roll along it, R W = v_d.
    // The drive's friction stays inside the drive and a steady body needs no force, so there is no slip: rounding only.
    let forward = steady(&wheels(&[-10.0, -10.0, 10.0, 10.0]));
    let slanted = steady(&wheels(&[0.0, -10.0, 0.0, 10.0]));
    let sideways = steady(&wheels(&[10.0, -10.0, -10.0, 10.0]));
    assert_close(
        "forward, m/s",
        forward.state().twist.forward_m_per_s,
        SQRT_2 * RADIUS_M * 10.0,
        1e-8,
    );
    assert_close(
        "sideways, m/s",
        sideways.state().twist.left_m_per_s,
        SQRT_2 * RADIUS_M * 10.0,
        1e-8,
    );
    let (along, across) = diagonal(&slanted);
    assert_close("diagonal, m/s", along, RADIUS_M * 10.0, 1e-8);
    assert_close("ratio", forward.state().twist.forward_m_per_s / along, SQRT_2, 1e-8);
    assert!(across.abs() < 1e-9 && forward.state().twist.left_m_per_s.abs() < 1e-9);
    assert!(sideways.state().twist.forward_m_per_s.abs() < 1e-9);
}

#[test]
fn equal_wheel_speeds_turn_in_place() {
    // rho r = R W.
    let free = steady(&wheels(&[8.0; 4]));
    let state = free.state();
    assert_close(
        "yaw rate, rad/s",
        state.twist.yaw_rate_rad_per_s,
        RADIUS_M * 8.0 / RHO_M,
        1e-8,
    );
    assert!(state.pose.x_m.abs() < 1e-9 && state.pose.y_m.abs() < 1e-9);
}

#[test]
fn spinning_wheels_turn_the_body_up_at_the_friction_limit() {
    // Four tangential forces mu m g/4 at rho: J dr/dt = mu m g rho.
    let mut description = omni4();
    description.floor_friction = 0.2;
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    run(&mut free, &wheels(&[40.0; 4]), 0.025);
    let before = free.state().twist.yaw_rate_rad_per_s;
    run(&mut free, &wheels(&[40.0; 4]), 0.025);
    let got = (free.state().twist.yaw_rate_rad_per_s - before) / 0.025;
    // Slip above 0.1 m/s throughout: tanh 5 = 1 - 9e-5.
    assert!(RADIUS_M * free.state().wheel_rad_per_s[0] - RHO_M * free.state().twist.yaw_rate_rad_per_s > 0.1);
    assert_close("yaw acceleration, rad/s^2", got, 0.2 * 12.0 * 9.81 * RHO_M / 0.25, 5e-4);
}

#[test]
fn free_omni_wheels_keep_every_twist_straight() {
    // No drive torque and no drive friction: nothing but the wheels' inertia is left, and it changes nothing in a
    // straight line of any direction.
    for (u, v) in [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4), (0.2, 0.2)] {
        let description = torque_free(omni4(), 0.0, 0.0);
        let start = rolling(&description, twist(u, v, 0.0));
        let mut free = FreeRobot::moving(&robot(description), &start);
        run(&mut free, &WheelCommand::default(), 5.0);
        let pose = free.state().pose;
        // Nothing accelerates: rounding only.
        assert!(
            (pose.x_m - 5.0 * u).abs() < 1e-9 && (pose.y_m - 5.0 * v).abs() < 1e-9,
            "{pose:?}"
        );
    }
}

#[test]
fn two_powered_wheels_drive_straight_along_their_diagonal() {
    let mut free = FreeRobot::at_rest(&robot(two_wheel_mode()), Pose::default());
    run(&mut free, &wheels(&[0.0, -10.0, 0.0, 10.0]), 6.0);
    let (along, across) = diagonal(&free);
    assert_close("along, m/s", along, 0.5, 1e-8);
    assert!(across.abs() < 1e-9);
    let pose = free.state().pose;
    assert!((pose.x_m - pose.y_m).abs() < 1e-9 && pose.x_m > 1.9, "{pose:?}");
}

/// Distance from the centre of the wanted circle (left of the robot) after an arc at 0.5 m/s and 0.5 rad/s for 1.5 s,
/// and the speed across the diagonal at its end.
fn arc(description: RobotDescription) -> (f64, f64) {
    let start = rolling(&description, twist(0.5 / SQRT_2, 0.5 / SQRT_2, 0.5));
    let command = WheelCommand {
        wheel_rad_per_s: start.wheel_rad_per_s,
        ..WheelCommand::default()
    };
    let mut free = FreeRobot::moving(&robot(description), &start);
    run(&mut free, &command, 1.5);
    // The centre is V/r = 1 m to the left of the diagonal, at 135 degrees from the start.
    let (sin, cos) = libm::sincos(3.0 * FRAC_PI_4);
    let (x, y) = (free.state().pose.x_m - cos, free.state().pose.y_m - sin);
    ((x * x + y * y).sqrt(), diagonal(&free).1)
}

#[test]
fn two_powered_wheels_drift_out_of_an_arc_as_derived() {
    // Nothing pushes across the diagonal but the free wheels' inertia: (m + 2 J_w/R^2) dv_e/dt = -m r V, so
    // v_e = -k r V t with k = 12/12.64; the powered wheels hold V and r. In the plane of the diagonal at the start,
    // z' = (V + i v_e) exp(i r t), centre i V/r:
    //   z(t) = (V/(i r)) (E - 1) - k V (t E - (E - 1)/(i r)),   E = exp(i r t).
    let (radius, across) = arc(two_wheel_mode());
    let (speed, rate, time, share) = (0.5, 0.5, 1.5, 12.0 / (12.0 + 2.0 * 0.0008 / (0.05 * 0.05)));
    let (sin, cos) = libm::sincos(rate * time);
    // (E - 1)/(i r) = sin/r + i (1 - cos)/r.
    let (re, im) = (sin / rate, (1.0 - cos) / rate);
    let x = speed * re - share * speed * (time * cos - re);
    let y = speed * im - share * speed * (time * sin - im) - speed / rate;
    let expected = (x * x + y * y).sqrt();
    // To hold V against the drift the powered wheels slip by s0 x (m r v_e/2)/(mu N) = 0.9 mm/s, 0.2 % of V.
    assert_close("speed across, m/s", across, -share * rate * speed * time, 4e-3);
    assert_close("distance from the centre, m", radius, expected, 2e-3);
    assert!(radius > 1.1, "the drift is outward");
}

#[test]
fn four_powered_wheels_hold_the_same_arc() {
    // Across the diagonal wheels 0 and 2 give m V r = 3 N by a slip of s0 x 1.5 N/23.5 N = 1.3 mm/s: below 2 mm in 1.5 s.
    let (radius, _) = arc(omni4());
    assert!((radius - 1.0).abs() < 2.5e-3, "{radius} m from the centre");
}
