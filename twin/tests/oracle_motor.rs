//! Motor and speed loop against closed forms.
//!
//! Numbers of the test motor: n k = 19.2 x 0.031 = 0.5952 N m/A, R_a = 0.6 ohm, V_bus = 24 V, i_max = 9 A,
//! b_w = 0.0004 N m s, t_c = 0.02 N m, k_p = 0.8 V s/rad, k_i = 6 V/rad; wheel R = 0.05 m, J_w = 0.0008 kg m^2.

mod support;

use support::drive::{assert_close, rolling, run, twist};
use support::{all, diff2, robot, wheels};
use twin::PHYSICS_PERIOD_S;
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::RobotDescription;
use twin::world::{Arena, World};

const TORQUE_PER_CURRENT: f64 = 19.2 * 0.031;

/// `diff2` with its load on the driven wheels' friction alone (centre of mass on the floor).
fn low(resistance_ohm: f64, current_limit_a: Option<f64>) -> RobotDescription {
    let mut description = diff2();
    description.com_height_m = 0.0;
    description.floor_friction = 3.0;
    if let Some(motor) = &mut description.motor {
        motor.resistance_ohm = resistance_ohm;
        motor.current_limit_a = current_limit_a;
    }
    description
}

/// Current and wheel speed of a robot that has pushed against a wall for two seconds at full supply.
fn against_a_wall(description: RobotDescription) -> (f64, f64) {
    let arena = Arena {
        width_m: 2.0,
        height_m: 2.0,
    };
    let start = Pose {
        x_m: 0.75,
        ..Pose::default()
    };
    let mut world = match World::new(arena, vec![(robot(description), start, 0.25)]) {
        Ok(world) => world,
        Err(error) => panic!("{error}"),
    };
    for _ in 0..240 {
        assert!(world.step(&[wheels(&[35.0, 35.0])]).is_ok());
    }
    let state = world.state(0);
    assert!(state.twist.forward_m_per_s.abs() < 1e-6, "the wall gave way");
    assert_eq!(state.voltage_v[0], 24.0);
    (state.current_a[0], state.wheel_rad_per_s[0])
}

#[test]
fn stall_current_is_the_lesser_of_supply_over_resistance_and_limit() {
    // V/R = 24/0.6 = 40 A is cut to i_max. 4 A x 0.5952 / 0.05 = 48 N a wheel is below mu N = 3 x 29.4 = 88 N: it stalls.
    let (current, _) = against_a_wall(low(0.6, Some(4.0)));
    assert_eq!(current, 4.0);
    // V/R = 24/6 = 4 A without a limit and below a limit of 9 A, less the back-EMF of the creep: the contact carries
    // force by slip alone, so the stalled wheel turns at some W below 1 rad/s: i = (V - n k W)/R_a, at most 2.5 % less.
    for limit in [None, Some(9.0)] {
        let (current, speed) = against_a_wall(low(6.0, limit));
        assert!((0.0..1.0).contains(&speed), "the wheel turns at {speed} rad/s");
        assert_close(
            "stall current, A",
            current,
            (24.0 - TORQUE_PER_CURRENT * speed) / 6.0,
            1e-12,
        );
        assert_close("stall current beside V/R, A", current, 4.0, 0.025);
    }
}

#[test]
fn a_wheel_stalled_at_a_wall_creeps_at_the_slip_that_carries_its_torque() {
    // W is the root of n k (V - n k W)/R = t_c tanh(W/0.3) + b W + R mu N tanh(R W/s0): 0.238 rad/s.
    let load = 12.0 * 9.81 / 4.0;
    let excess = |speed: f64| {
        let torque = TORQUE_PER_CURRENT * (24.0 - TORQUE_PER_CURRENT * speed) / 6.0;
        let drag = 0.02 * libm::tanh(speed / 0.3) + 0.0004 * speed;
        torque - drag - 0.05 * 3.0 * load * libm::tanh(0.05 * speed / 0.02)
    };
    let (mut below, mut above) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (below + above);
        if excess(middle) > 0.0 {
            below = middle;
        } else {
            above = middle;
        }
    }
    let (_, speed) = against_a_wall(low(6.0, None));
    assert_close("creep of the stalled wheel, rad/s", speed, below, 0.05);
}

#[test]
fn no_load_speed_balances_torque_and_drive_friction() {
    // n k (V - n k W)/R = b W + t_c  =>  W = (0.5952 x 40 - 0.02) / (0.5952^2/0.6 + 0.0004) = 40.26 rad/s.
    let expected = (TORQUE_PER_CURRENT * 40.0 - 0.02) / (TORQUE_PER_CURRENT * TORQUE_PER_CURRENT / 0.6 + 0.0004);
    assert!((expected - 40.262).abs() < 1e-3);
    for description in all() {
        let robot = robot(description);
        assert_close(
            "stated no-load speed, rad/s",
            robot.max_wheel_speed_rad_per_s(),
            expected,
            1e-12,
        );
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        // All wheels of omni4 turn it in place, the others drive straight: nothing resists but the drive.
        run(&mut free, &wheels(&[60.0; 4]), 10.0);
        for (index, wheel) in robot.description().wheels.iter().enumerate().filter(|(_, w)| w.driven) {
            let got = free.state().wheel_rad_per_s[index];
            // The approach decays with (n k)^2/(R_a R^2 m_eff) > 10 1/s: after 10 s rounding is left.
            assert_close(&format!("{} {}", robot.name(), wheel.x_m), got, expected, 1e-8);
        }
    }
}

#[test]
fn braking_reverses_the_current() {
    // e = -20 rad/s: V = 0.8 x (-20) + 6 x (I0 - 20/480), I0 = 11.904/6 (the loop held 20 rad/s before): V = -4.35 V;
    // (V - 11.9)/0.6 = -27 A is cut to -9 A. Mirrored when rolling backward.
    for sign in [1.0, -1.0] {
        let description = low(0.6, Some(9.0));
        let start = rolling(&description, twist(sign, 0.0, 0.0));
        let mut free = FreeRobot::moving(&robot(description), &start);
        free.step(&WheelCommand::default());
        let state = free.state();
        assert_eq!(state.current_a[..2], [-9.0 * sign; 2]);
        let voltage = sign * (0.8 * -20.0 + 6.0 * (TORQUE_PER_CURRENT * 20.0 / 6.0 - 20.0 * PHYSICS_PERIOD_S));
        assert_close("voltage, V", state.voltage_v[0], voltage, 1e-12);
        assert!(state.twist.forward_m_per_s * sign < 1.0, "braking slows down");
    }
}

#[test]
fn short_circuited_motors_brake_exponentially() {
    // V = 0: i = -n k W/R_a, so the drive is a damper d = 2 ((n k)^2/R_a + b)/R^2 in series with the contact's
    // c = mu N_2/s0 (small slip; N_2 = m g/2 on two of four supports), acting on the body's m while it slows down
    // M = m + 2 J_w/R^2:   v = v0 exp(-t d c/(d + c)/M).
    let mut description = low(6.0, None);
    if let Some(motor) = &mut description.motor {
        (motor.speed_loop_kp_v_s_per_rad, motor.speed_loop_ki_v_per_rad) = (0.0, 0.0);
        motor.coulomb_n_m = 0.0;
    }
    let start = rolling(&description, twist(0.25, 0.0, 0.0));
    let mut free = FreeRobot::moving(&robot(description), &start);
    let damper = 2.0 * (TORQUE_PER_CURRENT * TORQUE_PER_CURRENT / 6.0 + 0.0004) / (0.05 * 0.05);
    let contact = 3.0 * 12.0 * 9.81 / 2.0 / 0.02;
    let rate = damper * contact / (damper + contact) / (12.0 + 2.0 * 0.0008 / (0.05 * 0.05));
    run(&mut free, &WheelCommand::default(), 0.5);
    let state = free.state();
    let expected = 0.25 * libm::exp(-0.5 * rate);
    // The series element leaves terms of order (d/c)^2 = 3e-5 and the rotor's share of d/c in the exponent of 2.
    assert_close("speed, m/s", state.twist.forward_m_per_s, expected, 2e-3);
    let current = -TORQUE_PER_CURRENT * state.wheel_rad_per_s[0] / 6.0;
    assert_close("current, A", state.current_a[0], current, 1e-12);
    assert!(current < 0.0);
}

#[test]
fn the_integral_removes_the_speed_error_and_without_it_the_error_is_known() {
    for description in all() {
        let with_integral = robot(description.clone());
        let mut free = FreeRobot::at_rest(&with_integral, Pose::default());
        run(&mut free, &wheels(&[12.0; 4]), 20.0);
        let driven = |index: usize| with_integral.description().wheels[index].driven;
        for index in (0..4).filter(|index| driven(*index)) {
            // The slow pole k_i/(k_p + n k) = 4.3 1/s leaves exp(-86) of the start: rounding.
            let error = 12.0 - free.state().wheel_rad_per_s[index];
            assert!(error.abs() < 1e-9, "{}: error {error:e}", with_integral.name());
        }
        let mut description = description;
        if let Some(motor) = &mut description.motor {
            motor.speed_loop_ki_v_per_rad = 0.0;
        }
        let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
        run(&mut free, &wheels(&[12.0; 4]), 20.0);
        // k_p (W_c - W) = n k W + R_a (b W + t_c)/(n k)
        //   =>  W = (k_p W_c - R_a t_c/(n k)) / (k_p + n k + R_a b/(n k)) = 6.863 rad/s.
        let expected = (0.8 * 12.0 - 0.6 * 0.02 / TORQUE_PER_CURRENT)
            / (0.8 + TORQUE_PER_CURRENT + 0.6 * 0.0004 / TORQUE_PER_CURRENT);
        for index in (0..4).filter(|index| driven(*index)) {
            let got = free.state().wheel_rad_per_s[index];
            assert_close(with_integral.name(), got, expected, 1e-9);
        }
    }
}

#[test]
fn the_integral_stops_at_the_supply() {
    // Ten seconds at a set-point that the motor cannot reach: k_i I stands at V_bus = 24 V. A set-point 1 rad/s below
    // the wheel then lowers the voltage at once: V = k_p (-1) + 24 - k_i/480 = 23.1875 V. A wound-up loop stays at 24 V.
    let robot = robot(diff2());
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &wheels(&[80.0, 80.0]), 10.0);
    assert_eq!(free.state().voltage_v[0], 24.0);
    let below = free.state().wheel_rad_per_s[0] - 1.0;
    free.step(&wheels(&[below, below]));
    assert_close("voltage, V", free.state().voltage_v[0], 24.0 - 0.8 - 6.0 / 480.0, 1e-12);
}
