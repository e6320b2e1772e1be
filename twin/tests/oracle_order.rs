//! Order of the integration: halving the step.
//!
//! The speed loops stay at 480 Hz; only the physics between their samples is refined.

mod support;

use support::drive::{rolling, torque_free, twist};
use support::{all, robot};
use twin::command::WheelCommand;
use twin::free::{FreeRobot, Start};
use twin::pose::wrapped_rad;
use twin::robot::{Robot, RobotDescription};

/// Pose and heading error in metres (heading at an arm of 0.1 m) plus the velocity error over 0.1 s.
fn gap_m(a: &FreeRobot, b: &FreeRobot) -> f64 {
    let (a, b) = (a.state(), b.state());
    let turn = wrapped_rad(a.pose.yaw_rad - b.pose.yaw_rad).abs();
    let (du, dv) = (
        a.twist.forward_m_per_s - b.twist.forward_m_per_s,
        a.twist.left_m_per_s - b.twist.left_m_per_s,
    );
    a.pose.distance_m(&b.pose) + 0.1 * turn + 0.1 * (du * du + dv * dv).sqrt()
}

fn after(robot: &Robot, start: &Start, steps: u32, refinement: u32, command: &WheelCommand) -> FreeRobot {
    let mut free = FreeRobot::moving(robot, start).with_refinement(refinement);
    for _ in 0..steps {
        free.step(command);
    }
    free
}

/// Errors at 1, 2, 4 and 8 parts against 128 parts, m.
fn errors(robot: &Robot, start: &Start, steps: u32, command: &WheelCommand) -> Vec<f64> {
    let exact = after(robot, start, steps, 128, command);
    [1, 2, 4, 8]
        .iter()
        .map(|refinement| gap_m(&after(robot, start, steps, *refinement, command), &exact))
        .collect()
}

/// Observed order between 1 and 8 parts: log2(e_1/e_8)/3.
fn order(errors: &[f64]) -> f64 {
    libm::log2(errors[0] / errors[3]) / 3.0
}

fn report(name: &str, errors: &[f64]) {
    println!(
        "{name}: {:.1e} {:.1e} {:.1e} {:.1e} m, order {:.2}",
        errors[0],
        errors[1],
        errors[2],
        errors[3],
        order(errors)
    );
}

/// A throw: turning and sliding with heavy wheels that spin on, so that no slip ends within 0.1 s.
fn sliding(mut description: RobotDescription, com_height_m: f64) -> (Robot, Start) {
    description = torque_free(description, 0.01, 0.05);
    (description.floor_friction, description.com_height_m) = (0.3, com_height_m);
    let mut start = rolling(&description, twist(0.9, -0.6, 2.0));
    // Opposite signs on omni4: its wheels all turn the body the same way round.
    let sign = if description.chassis == "omni4" { -1.0 } else { 1.0 };
    for (index, spin) in [22.0, sign * 27.0, 23.0, sign * 29.0].iter().enumerate() {
        if description.wheels[index].kind != "caster" {
            start.wheel_rad_per_s[index] += spin;
            description.wheels[index].spin_inertia_kg_m2 = Some(0.02);
        }
    }
    start.steering_rad = 0.2;
    (robot(description), start)
}

#[test]
fn a_smooth_slide_converges_with_the_second_order() {
    for description in all() {
        let (robot, start) = sliding(description, 0.0);
        let command = WheelCommand {
            steering_rad: -0.3,
            ..WheelCommand::default()
        };
        let errors = errors(&robot, &start, 48, &command);
        report(robot.name(), &errors);
        // The smallest error stays above rounding (1e-14), so the order is that of the method: 2, less curvature.
        assert!(order(&errors) >= 1.8, "{}: order {}", robot.name(), order(&errors));
    }
}

#[test]
fn load_transfer_converges_with_the_second_order() {
    // The loads follow the acceleration of their own step.
    for description in all() {
        let (robot, start) = sliding(description, 0.11);
        let errors = errors(&robot, &start, 48, &WheelCommand::default());
        report(robot.name(), &errors);
        assert!(order(&errors) >= 1.8, "{}: order {}", robot.name(), order(&errors));
        assert!(errors[0] < 5e-6, "{}: {} m in 0.1 s", robot.name(), errors[0]);
    }
}

#[test]
fn a_gripping_curve_is_exact_to_the_residual_of_the_iteration() {
    for mut description in all() {
        description.com_height_m = 0.0;
        if let Some(motor) = &mut description.motor {
            // Coasting against short-circuited motors, in grip: stiff contacts (mu N/s0 of 1200 N s/m) all the way.
            (motor.speed_loop_kp_v_s_per_rad, motor.speed_loop_ki_v_per_rad) = (0.0, 0.0);
            motor.resistance_ohm = 2.0;
        }
        let mut start = rolling(&description, twist(1.2, 0.0, 0.6));
        start.steering_rad = libm::atan(0.26 * 0.5);
        let command = WheelCommand {
            steering_rad: start.steering_rad,
            ..WheelCommand::default()
        };
        let robot = robot(description);
        let errors = errors(&robot, &start, 240, &command);
        report(robot.name(), &errors);
        // A stage stops when no slip moves by more than 1e-4 m/s; the error left is its square over s0, 5e-7 m/s, for
        // half a second. The division of a step at the start, where the derivative jumps, leaves a few micrometres more.
        assert!(errors.iter().all(|error| *error < 1e-5), "{}: {errors:?}", robot.name());
    }
}

/// Poses after 10 s at full speed with hard steering, all driven wheels spinning: 1 part against 2, m.
fn halving_gap_m(mut description: RobotDescription, com_height_m: f64) -> f64 {
    (description.floor_friction, description.com_height_m) = (0.15, com_height_m);
    let robot = robot(description);
    let mut command = support::wheels(&[36.0, 33.0, 36.0, 33.0]);
    command.steering_rad = -0.25;
    if robot.chassis() == "omni4" {
        command = support::wheels(&[-36.0, -20.0, 30.0, 25.0]);
    }
    let end = |refinement| {
        after(&robot, &Start::default(), 4800, refinement, &command)
            .state()
            .pose
    };
    let gap = end(1).distance_m(&end(2));
    println!("{} at height {com_height_m}: {gap:.2e} m", robot.name());
    gap
}

#[test]
fn ten_seconds_at_the_friction_limit_do_not_depend_on_the_step() {
    for description in all() {
        for com_height_m in [0.0, 0.11] {
            let gap = halving_gap_m(description.clone(), com_height_m);
            assert!(gap < 1e-4, "{} at {com_height_m} m: {gap} m", description.name);
        }
    }
}
