//! Driving straight: acceleration at the friction limit with load transfer, coasting down.
//!
//! Cars of the tests: l_f = 0.14 m, l_r = 0.12 m, L = 0.26 m, h = 0.11 m, m = 12 kg, R = 0.05 m, J_w = 0.0008 kg m^2.
//! A wheel that is dragged along adds J_w/R^2 = 0.32 kg to the mass that its axle has to move.

mod support;

use core::f64::consts::{FRAC_1_SQRT_2, PI};

use support::drive::{assert_close, rolling, run, torque_free, twist};
use support::{all, car, diff2, diff4, omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::RobotDescription;

const G: f64 = 9.81;
const DRAGGED_KG: f64 = 0.0008 / (0.05 * 0.05);

/// Mean acceleration along the wheels' push between 25 and 50 ms of spinning wheels, m/s^2; backward negative.
fn push(mut description: RobotDescription, friction: f64, command: &WheelCommand) -> f64 {
    description.floor_friction = friction;
    let driven: Vec<usize> = (0..4).filter(|index| description.wheels[*index].driven).collect();
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    run(&mut free, command, 0.025);
    let before = free.state().twist;
    run(&mut free, command, 0.025);
    let state = free.state();
    for index in driven.iter().filter(|index| command.wheel_rad_per_s[**index] != 0.0) {
        // tanh(0.1/0.02) = 0.9999: the wheel pushes with all it has.
        let rim = 0.05 * state.wheel_rad_per_s[*index].abs();
        assert!(rim - state.twist.speed_m_per_s() > 0.1, "wheel {index} grips");
    }
    let (du, dv) = (
        state.twist.forward_m_per_s - before.forward_m_per_s,
        state.twist.left_m_per_s - before.left_m_per_s,
    );
    (du * du + dv * dv).sqrt().copysign(du) / 0.025
}

/// 40 rad/s (more than the motors reach) on the four wheels.
fn spin(direction: f64) -> WheelCommand {
    wheels(&[40.0 * direction; 4])
}

// Tolerance of all accelerations: the slip at 25 ms is at least 0.1 m/s (1 - tanh 5 = 9e-5) and the loads follow the
// acceleration within a few steps.
const TOLERANCE: f64 = 5e-4;

#[test]
fn a_rear_driven_car_presses_its_driven_axle_down() {
    // Moments about the front contact: N_r L = m (g l_f + h a); m a = mu N_r - 2 (J_w/R^2) a for the dragged front wheels.
    for mu in [0.2, 0.4, 0.8] {
        let expected = mu * G * 0.14 / (0.26 * (1.0 + 2.0 * DRAGGED_KG / 12.0) - mu * 0.11);
        assert_close("rwd, m/s^2", push(car("rwd"), mu, &spin(1.0)), expected, TOLERANCE);
        // Backward the transfer has the other sign.
        let expected = -mu * G * 0.14 / (0.26 * (1.0 + 2.0 * DRAGGED_KG / 12.0) + mu * 0.11);
        assert_close(
            "rwd back, m/s^2",
            push(car("rwd"), mu, &spin(-1.0)),
            expected,
            TOLERANCE,
        );
    }
}

#[test]
fn a_front_driven_car_lifts_its_driven_axle() {
    // Moments about the rear contact: N_f L = m (g l_r - h a).
    for mu in [0.2, 0.4, 0.8] {
        let expected = mu * G * 0.12 / (0.26 * (1.0 + 2.0 * DRAGGED_KG / 12.0) + mu * 0.11);
        assert_close("fwd, m/s^2", push(car("fwd"), mu, &spin(1.0)), expected, TOLERANCE);
        let expected = -mu * G * 0.12 / (0.26 * (1.0 + 2.0 * DRAGGED_KG / 12.0) - mu * 0.11);
        assert_close(
            "fwd back, m/s^2",
            push(car("fwd"), mu, &spin(-1.0)),
            expected,
            TOLERANCE,
        );
    }
}

#[test]
fn all_wheels_driven_use_the_whole_weight() {
    // sum mu N = mu m g, however the load shifts.
    for mu in [0.2, 0.8] {
        for description in [car("awd"), diff4()] {
            assert_close(
                "all driven, m/s^2",
                push(description, mu, &spin(1.0)),
                mu * G,
                TOLERANCE,
            );
        }
    }
}

#[test]
fn casters_take_load_and_give_nothing() {
    // Four supports on a cross, driven wheels at x = 0: they carry m g/4 each whatever the acceleration (the casters
    // at +-0.12 m answer the pitch moment): a = mu g/2.
    for mu in [0.2, 0.8] {
        assert_close("diff2, m/s^2", push(diff2(), mu, &spin(1.0)), 0.5 * mu * G, TOLERANCE);
    }
    // Casters only: no horizontal force at all, a thrown robot keeps its velocity.
    let mut description = torque_free(diff2(), 0.0, 0.0);
    description.wheels[0].x_m = 0.12;
    description.wheels[1].x_m = 0.12;
    description.wheels[2].x_m = -0.12;
    let start = rolling(&description, twist(0.7, 0.0, 0.0));
    let mut free = FreeRobot::moving(&robot(description), &start);
    run(&mut free, &WheelCommand::default(), 5.0);
    assert_close(
        "coasting on casters, m/s",
        free.state().twist.forward_m_per_s,
        0.7,
        1e-9,
    );
}

#[test]
fn omni_wheels_push_along_their_own_directions() {
    for mu in [0.2, 0.6] {
        // Forward: four forces mu N at 45 degrees to the motion, sum N = m g: a = mu g/sqrt 2.
        let forward = wheels(&[-40.0, -40.0, 40.0, 40.0]);
        assert_close(
            "omni4, m/s^2",
            push(omni4(), mu, &forward),
            mu * G * FRAC_1_SQRT_2,
            TOLERANCE,
        );
        // Diagonal: two of the wheels push along it; the load moves between the two that do not: a = mu g/2.
        let diagonal = wheels(&[0.0, -40.0, 0.0, 40.0]);
        assert_close(
            "omni4 diagonal, m/s^2",
            push(omni4(), mu, &diagonal),
            0.5 * mu * G,
            TOLERANCE,
        );
    }
}

#[test]
fn a_lifted_front_axle_leaves_all_weight_to_the_rear() {
    // mu = 1.5: m (g l_r - h a) < 0 at a = mu g, so the front wheels are in the air, the rear carries m g, and nothing
    // is dragged: a = mu g = 14.7 m/s^2. Without the removal the rear would carry more than the weight (22.1 m/s^2).
    assert_close("wheelie, m/s^2", push(car("rwd"), 1.5, &spin(1.0)), 1.5 * G, TOLERANCE);
    // And backward a front-driven car lifts its rear.
    assert_close(
        "stoppie, m/s^2",
        push(car("fwd"), 1.5, &spin(-1.0)),
        -1.5 * G,
        TOLERANCE,
    );
}

#[test]
fn a_lifted_caster_shifts_load_from_the_driven_wheels() {
    // Where mu h > x_c (two casters at +-x_c = 0.12 m) the front caster is in the air; the rear one carries m h a/x_c
    // and the driven wheels the rest: a = mu (g - h a/x_c)  =>  a = mu g/(1 + mu h/x_c).
    let (mu, height, caster) = (0.8, 0.2, 0.12);
    let mut description = diff2();
    description.com_height_m = height;
    let expected = mu * G / (1.0 + mu * height / caster);
    assert!(height * expected > 0.5 * G * caster, "both casters stay down");
    assert_close(
        "diff2 on three wheels, m/s^2",
        push(description, mu, &spin(1.0)),
        expected,
        5e-3,
    );
}

#[test]
fn coasting_ends_after_the_known_distance() {
    // M dv/dt = -C tanh(v/v_s) - D v, with the sums over the driven wheels (kappa = |cos beta|, W = kappa v/R):
    //   M = m + sum kappa^2 J_w/R^2 (all wheels),  C = sum kappa t_c/R,  D = sum kappa^2 b/R^2,  v_s = 0.3 R/kappa.
    // Without the rounding: x = v0/l - (c/l^2) ln(1 + l v0/c), l = D/M, c = C/M. The rounding of the dry friction adds
    //   (1/c) int v (coth(v/v_s) - 1) dv = pi^2 v_s^2/(12 c).
    for description in all() {
        let mut description = torque_free(description, 0.004, 0.06);
        description.floor_friction = 3.0;
        let kappa = if description.chassis == "omni4" {
            FRAC_1_SQRT_2
        } else {
            1.0
        };
        let rolling_wheels = description.wheels.iter().filter(|wheel| wheel.kind != "caster").count() as f64;
        let driven = description.wheels.iter().filter(|wheel| wheel.driven).count() as f64;
        let mass = 12.0 + rolling_wheels * kappa * kappa * DRAGGED_KG;
        let dry = driven * kappa * 0.06 / 0.05 / mass;
        let viscous = driven * kappa * kappa * 0.004 / (0.05 * 0.05) / mass;
        let rounding_m_per_s = 0.3 * 0.05 / kappa;
        let expected = 0.8 / viscous - dry / (viscous * viscous) * libm::log(1.0 + viscous * 0.8 / dry)
            + PI * PI * rounding_m_per_s * rounding_m_per_s / (12.0 * dry);
        let start = rolling(&description, twist(0.8, 0.0, 0.0));
        let robot = robot(description);
        let mut free = FreeRobot::moving(&robot, &start);
        run(&mut free, &WheelCommand::default(), 20.0);
        assert!(free.kinetic_energy_j() < 1e-9);
        // The wheels run ahead of the body by the time s0/(kappa^2 mu g) (twice that on half the load) < 1.4 ms of its
        // deceleration, which lengthens the way by at most 0.3 m/s x 1.4 ms in 0.6 m.
        assert_close(robot.name(), free.state().pose.x_m, expected, 1e-3);
    }
}
