//! Energy: never created by contacts, drives or steering; paid for by the motors; kept where nothing dissipates.

mod support;

use proptest::prelude::{ProptestConfig, prop, prop_assert, proptest};
use proptest::test_runner::RngSeed;
use support::drive::{assert_close, rolling, run, torque_free, twist};
use support::{all, robot};
use twin::PHYSICS_PERIOD_S;
use twin::command::WheelCommand;
use twin::free::{FreeRobot, Start};
use twin::pose::Pose;

#[test]
fn a_frictionless_straight_roll_keeps_its_energy() {
    // No drive torque, no drive friction, no slip: nothing dissipates, so nothing may decay either.
    for description in all() {
        for speed in [1.2, -0.9] {
            let description = torque_free(description.clone(), 0.0, 0.0);
            let start = rolling(&description, twist(speed, 0.0, 0.0));
            let robot = robot(description);
            let mut free = FreeRobot::moving(&robot, &start);
            let before = free.kinetic_energy_j();
            run(&mut free, &WheelCommand::default(), 20.0);
            // Rounding over 9600 steps, and a motor that brakes with 1e-16/0.6 N m s.
            assert_close(robot.name(), free.kinetic_energy_j(), before, 1e-10);
        }
    }
}

#[test]
fn a_spinning_wheel_loses_to_the_floor_what_momentum_says() {
    // diff2, body at rest, wheels at 30 rad/s, nothing else: each wheel's angular momentum J_w W goes into the body by the
    // same force, m u R/2 + J_w W = J_w W0 until u = R W:  u = 2 J_w W0/(R (m + 2 J_w/R^2)) = 0.07595 m/s.
    let description = torque_free(support::diff2(), 0.0, 0.0);
    let start = Start {
        wheel_rad_per_s: [30.0, 30.0, 0.0, 0.0, 0.0, 0.0],
        ..Start::default()
    };
    let mut free = FreeRobot::moving(&robot(description), &start);
    run(&mut free, &WheelCommand::default(), 4.0);
    let mass = 12.0 + 2.0 * 0.0008 / (0.05 * 0.05);
    let speed = 2.0 * 0.0008 * 30.0 / 0.05 / mass;
    // Both sums are conserved by every step up to its Newton iteration's residual.
    assert_close("speed, m/s", free.state().twist.forward_m_per_s, speed, 1e-5);
    assert_close(
        "energy left, J",
        free.kinetic_energy_j(),
        0.5 * mass * speed * speed,
        2e-5,
    );
}

#[test]
fn motors_pay_for_the_kinetic_energy() {
    // d(kinetic energy)/dt = sum torque W - losses, torque = n k clamp((V - n k W)/R_a, +-i_max) with V held in a step:
    // the trapezium of torque W over a step bounds the gain from above.
    for description in all() {
        let robot = robot(description);
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        let (mut paid, mut moved, mut least_margin) = (0.0, 0.0_f64, f64::INFINITY);
        for step in 0..4800_u32 {
            let turn = f64::from(step / 192 % 5) - 2.0;
            let side = if (step / 384).is_multiple_of(2) { 20.0 } else { -12.0 };
            let mut command = support::wheels(&[side + turn, side - turn, side + turn, side - turn]);
            command.steering_rad = 0.2 * turn;
            let before = free.state();
            free.step(&command);
            let after = free.state();
            for index in (0..4).filter(|index| robot.description().wheels[*index].driven) {
                let power = |speed: f64| {
                    let current = ((after.voltage_v[index] - 19.2 * 0.031 * speed) / 0.6).clamp(-9.0, 9.0);
                    19.2 * 0.031 * current * speed
                };
                let work = 0.5
                    * PHYSICS_PERIOD_S
                    * (power(before.wheel_rad_per_s[index]) + power(after.wheel_rad_per_s[index]));
                paid += work;
                moved += work.abs();
            }
            least_margin = least_margin.min(paid - free.kinetic_energy_j());
        }
        println!(
            "{}: paid {paid:.3} J of {moved:.1} J moved, margin {least_margin:.2e} J",
            robot.name()
        );
        // A trapezium errs where the current leaves its limit within a step; losses are far larger.
        assert!(least_margin > -1e-3, "{}: {least_margin} J from nowhere", robot.name());
        assert!(moved > 10.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn energy_never_rises_without_motor_torque(
        kind in 0..6_usize,
        u in -2.0..2.0_f64, v in -1.5..1.5_f64, r in -12.0..12.0_f64,
        spins in prop::collection::vec(-60.0..60.0_f64, 4), spinning in 0..2_u32,
        steering in prop::collection::vec(-0.5..0.5_f64, 2),
        friction in 0.05..1.5_f64, height in 0.0..0.3_f64, drag in 0.0..0.1_f64, short_circuit in 0..2_u32,
    ) {
        let mut description = torque_free(all().swap_remove(kind), 0.1 * drag, drag);
        (description.floor_friction, description.com_height_m) = (friction, height);
        if let (1, Some(motor)) = (short_circuit, &mut description.motor) {
            // V = 0: the motors brake.
            (motor.gear_ratio, motor.torque_constant_n_m_per_a) = (19.2, 0.031);
        }
        let mut start = rolling(&description, twist(u, v, r));
        if spinning == 1 {
            for (index, _) in description.wheels.iter().enumerate().filter(|(_, wheel)| wheel.kind != "caster") {
                start.wheel_rad_per_s[index] += spins[index];
            }
        }
        start.steering_rad = steering[0];
        // The steered wheels turn on the way: that redirects forces and must not feed them.
        let command = WheelCommand { steering_rad: steering[1], ..WheelCommand::default() };
        let mut free = FreeRobot::moving(&robot(description), &start);
        let first = free.kinetic_energy_j();
        let mut energy = first;
        for step in 0..1440 {
            free.step(&command);
            // What sticks gives back what it took.
            let now = free.kinetic_energy_j() + free.stored_energy_j();
            prop_assert!(now <= energy + 1e-9 * (1.0 + first), "step {}: {} -> {}", step, energy, now);
            energy = now;
        }
        prop_assert!(energy <= first);
    }
}
