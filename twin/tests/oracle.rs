//! Equations against closed forms.

mod support;

use support::{all, car, diff2, omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::{FreeRobot, Start};
use twin::pose::Pose;
use twin::twist::BodyTwist;
use twin::{GRAVITY_M_PER_S2, PHYSICS_PERIOD_S, SLIP_SCALE_M_PER_S};

fn run(free: &mut FreeRobot, command: &WheelCommand, seconds: f64) {
    for _ in 0..(seconds / PHYSICS_PERIOD_S).round() as u32 {
        free.step(command);
    }
}

#[test]
fn at_rest_stays_at_rest() {
    for description in all() {
        let robot = robot(description);
        let pose = Pose {
            x_m: 0.3,
            y_m: -0.2,
            yaw_rad: 0.7,
        };
        let mut free = FreeRobot::at_rest(&robot, pose);
        run(&mut free, &WheelCommand::default(), 60.0);
        assert_eq!(free.state().pose, pose, "{}", robot.name());
        assert_eq!(free.kinetic_energy_j(), 0.0);
    }
}

#[test]
fn friction_limits_acceleration() {
    // Both driven wheels spin far above the body: each pushes with mu N, the casters carry load and push nothing.
    let mut description = diff2();
    description.com_height_m = 0.0;
    description.floor_friction = 0.1;
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    run(&mut free, &wheels(&[30.0, 30.0]), 0.5);
    let before = free.state().twist.forward_m_per_s;
    run(&mut free, &wheels(&[30.0, 30.0]), 0.5);
    let slip = 0.05 * free.state().wheel_rad_per_s[0] - free.state().twist.forward_m_per_s;
    assert!(slip > 10.0 * SLIP_SCALE_M_PER_S, "slip {slip}");
    // Minimum norm on a symmetric cross: every wheel carries a quarter; two of four push.
    let expected = 0.1 * GRAVITY_M_PER_S2 * 0.5;
    let got = (free.state().twist.forward_m_per_s - before) / 0.5;
    assert!((got / expected - 1.0).abs() < 1e-6, "{got} against {expected}");
}

#[test]
fn current_limits_acceleration() {
    // On a sticky floor: (m + sum J_w/R^2) a = sum (n k_t i_max - b_w W - t_c)/R.
    let mut description = diff2();
    description.floor_friction = 2.0;
    description.com_height_m = 0.0;
    let limit = 1.5;
    if let Some(motor) = &mut description.motor {
        motor.current_limit_a = Some(limit);
        motor.viscous_n_m_s = 0.0;
    }
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    run(&mut free, &wheels(&[36.0, 36.0]), 0.2);
    let before = free.state();
    run(&mut free, &wheels(&[36.0, 36.0]), 0.2);
    let after = free.state();
    assert_eq!(after.current_a[0], limit);
    let force = 2.0 * (19.2 * 0.031 * limit - 0.02) / 0.05;
    let expected = force / (12.0 + 2.0 * 0.0008 / (0.05 * 0.05));
    let got = (after.twist.forward_m_per_s - before.twist.forward_m_per_s) / 0.2;
    assert!((got / expected - 1.0).abs() < 2e-3, "{got} against {expected}");
}

#[test]
fn omni_drives_a_steady_diagonal() {
    let robot = robot(omni4());
    let wanted = BodyTwist {
        forward_m_per_s: 0.4,
        left_m_per_s: 0.4,
        yaw_rate_rad_per_s: 0.0,
    };
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    let command = robot.wheel_speeds(wanted);
    run(&mut free, &command, 3.0);
    let twist = free.state().twist;
    // Drive friction needs little force, so the slip in the steady state is far below s0.
    assert!(
        (twist.forward_m_per_s - 0.4).abs() < 1e-3 && (twist.left_m_per_s - 0.4).abs() < 1e-3,
        "{twist:?}"
    );
    assert!(twist.yaw_rate_rad_per_s.abs() < 1e-9);
    assert!((free.state().wheel_rad_per_s[1] - command.wheel_rad_per_s[1]).abs() < 1e-3);
}

#[test]
fn diff2_spins_in_place_at_the_kinematic_rate() {
    let robot = robot(diff2());
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &wheels(&[-6.0, 6.0]), 3.0);
    let state = free.state();
    let expected = 0.05 / 0.3 * (state.wheel_rad_per_s[1] - state.wheel_rad_per_s[0]);
    assert!((expected - 2.0).abs() < 1e-3);
    assert!(
        (state.twist.yaw_rate_rad_per_s / expected - 1.0).abs() < 1e-3,
        "{}",
        state.twist.yaw_rate_rad_per_s
    );
    assert!(state.pose.x_m.abs() < 1e-9 && state.pose.y_m.abs() < 1e-9);
}

#[test]
fn steady_current_carries_the_drive_friction() {
    let robot = robot(diff2());
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &wheels(&[10.0, 10.0]), 5.0);
    let expected = (0.0004 * 10.0 + 0.02) / (19.2 * 0.031);
    for current in &free.state().current_a[..2] {
        assert!((current / expected - 1.0).abs() < 1e-4, "{current} against {expected}");
    }
    let voltage = expected * 0.6 + 19.2 * 0.031 * 10.0;
    assert!((free.state().voltage_v[0] / voltage - 1.0).abs() < 1e-4);
}

#[test]
fn slow_car_turns_on_the_ackermann_circle() {
    for chassis in ["fwd", "rwd", "awd"] {
        let robot = robot(car(chassis));
        let wanted = BodyTwist {
            forward_m_per_s: 0.2,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: 0.3,
        };
        let command = robot.wheel_speeds(wanted);
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        run(&mut free, &command, 4.0);
        let state = free.state();
        assert!((state.steering_rad - libm::atan(0.26 * 1.5)).abs() < 1e-6);
        let curvature = state.twist.yaw_rate_rad_per_s / state.twist.forward_m_per_s;
        assert!((curvature / 1.5 - 1.0).abs() < 0.02, "{chassis}: curvature {curvature}");
        assert!(state.twist.yaw_rate_rad_per_s > 0.0);
    }
}

#[test]
fn energy_of_a_coasting_robot_never_rises() {
    for mut description in all() {
        description.motor = description.motor.map(|mut motor| {
            (motor.speed_loop_kp_v_s_per_rad, motor.speed_loop_ki_v_per_rad) = (0.0, 0.0);
            motor
        });
        let robot = robot(description);
        let mut start = Start {
            twist: BodyTwist {
                forward_m_per_s: 1.5,
                left_m_per_s: -0.8,
                yaw_rate_rad_per_s: 9.0,
            },
            wheel_rad_per_s: [40.0, -15.0, 0.0, 7.0, 0.0, 0.0],
            ..Start::default()
        };
        start.wheel_rad_per_s[robot.wheel_count()..].fill(0.0);
        let mut free = FreeRobot::moving(&robot, &start);
        let mut energy = free.kinetic_energy_j();
        for step in 0..4800 {
            free.step(&WheelCommand::default());
            let now = free.kinetic_energy_j() + free.stored_energy_j();
            assert!(now <= energy + 1e-9, "{} step {step}: {energy} -> {now}", robot.name());
            energy = now;
        }
        assert!(energy < 1e-3, "{}: {energy} J left", robot.name());
    }
}

/// Set-points that keep the tyres near their limit: hard reversals and turns every 0.4 s.
fn wild(robot: &twin::robot::Robot, step: u32) -> WheelCommand {
    let turn = f64::from(step / 192 % 5) - 2.0;
    let forward = if (step / 192).is_multiple_of(2) { 1.2 } else { -0.6 };
    let mut command = robot.wheel_speeds(BodyTwist {
        forward_m_per_s: forward,
        left_m_per_s: 0.3 * turn,
        yaw_rate_rad_per_s: 1.5 * turn,
    });
    command.wheel_rad_per_s[0] += 3.0;
    command
}

fn end(robot: &twin::robot::Robot, refinement: u32, command: impl Fn(u32) -> WheelCommand) -> Pose {
    let mut free = FreeRobot::at_rest(robot, Pose::default()).with_refinement(refinement);
    for step in 0..4800 {
        free.step(&command(step));
    }
    free.state().pose
}

#[test]
fn halving_the_step_at_the_friction_limit_keeps_the_pose() {
    for mut description in all() {
        description.floor_friction = 0.15;
        let robot = robot(description);
        // Spinning wheels on a slippery floor all the way, one side faster than the other.
        let command = robot.wheel_speeds(BodyTwist {
            forward_m_per_s: 1.9,
            left_m_per_s: 0.1,
            yaw_rate_rad_per_s: 1.0,
        });
        let (one, two) = (end(&robot, 1, |_| command), end(&robot, 2, |_| command));
        println!(
            "{}: halving moves the end by {:.2e} m",
            robot.name(),
            one.distance_m(&two)
        );
        assert!(
            one.distance_m(&two) < 1e-3,
            "{}: {} m",
            robot.name(),
            one.distance_m(&two)
        );
    }
}

#[test]
fn halving_the_step_through_hard_reversals_keeps_the_path() {
    for mut description in all() {
        description.floor_friction = 0.3;
        let robot = robot(description);
        let (one, two, many) = (
            end(&robot, 1, |s| wild(&robot, s)),
            end(&robot, 2, |s| wild(&robot, s)),
            end(&robot, 16, |s| wild(&robot, s)),
        );
        println!(
            "{}: halving {:.2e} m, against 16 parts {:.2e} m",
            robot.name(),
            one.distance_m(&two),
            one.distance_m(&many)
        );
        assert!(
            one.distance_m(&two) < 0.01 && one.distance_m(&many) < 0.02,
            "{}",
            robot.name()
        );
    }
}

/// A tread whose wheels, standing, hold at less than a millimetre a second: the stiffest that a description may have.
#[test]
fn halving_the_step_on_tyres_that_hardly_slip_keeps_the_path() {
    for mut description in all() {
        description.floor_friction = 0.3;
        description.tread = Some(twin::tread::Tread {
            slip_scale_m_per_s: 0.0007,
            creep: 0.01,
            tail: 0.3,
            sliding: 0.9,
        });
        let robot = robot(description);
        let (one, two, many) = (
            end(&robot, 1, |s| wild(&robot, s)),
            end(&robot, 2, |s| wild(&robot, s)),
            end(&robot, 16, |s| wild(&robot, s)),
        );
        let [halved, finest] = [two, many].map(|other| one.distance_m(&other));
        println!(
            "{}: halving {halved:.2e} m, against 16 parts {finest:.2e} m",
            robot.name()
        );
        assert!(halved < 0.02 && finest < 0.02, "{}", robot.name());
    }
}

#[test]
fn without_a_motor_wheels_follow_their_commands() {
    let mut description = diff2();
    description.motor = None;
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    run(&mut free, &wheels(&[4.0, 8.0]), 1.0);
    assert_eq!(free.state().wheel_rad_per_s[..2], [4.0, 8.0]);
    assert!((free.state().twist.forward_m_per_s - 0.3).abs() < 1e-3);
    assert!((free.state().wheel_rad[1] - 8.0).abs() < 1e-9);
}
