//! Starts in motion: plays and casters stand where the motion before left them.

use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::free::{FreeRobot, RobotState, Start};
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::reversals::Reversals;
use twin::robot::Robot;
use twin::twist::BodyTwist;

fn robot(chassis: &str, effect: Effect) -> Robot {
    Robot::with_effects(reference_robot(chassis), &[effect]).expect("a robot")
}

fn wheels(robot: &Robot, speed_m_per_s: f64, yaw_rate_rad_per_s: f64) -> WheelCommand {
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: speed_m_per_s,
        yaw_rate_rad_per_s,
        ..BodyTwist::default()
    })
}

/// Drives on for `steps` in uninterrupted motion and from the measured state, with and without the history of the steering;
/// largest differences of the yaw rate, rad/s, and of a wheel's speed, rad/s.
fn taken_up(robot: &Robot, command: impl Fn(u64) -> WheelCommand, cut: u64, steps: u64) -> [(f64, f64); 2] {
    let mut whole = FreeRobot::at_rest(robot, Pose::default());
    let mut history = Reversals::default();
    for step in 0..cut {
        history.push(whole.state().steering_rad);
        whole.step(&command(step));
    }
    let seen = whole.state();
    [history, Reversals::default()].map(|steering_history| {
        let start = Start {
            pose: seen.pose,
            twist: seen.twist,
            wheel_rad_per_s: seen.wheel_rad_per_s,
            current_a: seen.current_a,
            steering_rad: seen.steering_rad,
            steering_history,
        };
        let mut part = FreeRobot::moving(robot, &start);
        let mut whole = whole.clone();
        let mut worst = (0.0_f64, 0.0_f64);
        for step in cut..cut + steps {
            whole.step(&command(step));
            part.step(&command(step));
            let (a, b): (RobotState, RobotState) = (whole.state(), part.state());
            let yaw_rate = (a.twist.yaw_rate_rad_per_s - b.twist.yaw_rate_rad_per_s).abs();
            let wheel = (a.wheel_rad_per_s[0] - b.wheel_rad_per_s[0]).abs();
            worst = (worst.0.max(yaw_rate), worst.1.max(wheel));
        }
        worst
    })
}

#[test]
fn the_wheels_lie_in_the_play_of_the_steering_as_the_way_left_them() {
    let robot = robot("fwd", Effect::new("steering_backlash", &[("play", 0.04)]));
    // Into a turn, back to straight ahead: the wheels stay half a play short of it.
    let command = |step: u64| wheels(&robot, 0.5, if step < 480 { 0.6 } else { 0.0 });
    let [with, without] = taken_up(&robot, command, 960, 240);
    assert!(with.0 < 0.002, "{with:?}");
    assert!(
        without.0 > 0.02,
        "without the history it is another motion: {without:?}"
    );
}

#[test]
fn casters_trail_behind_the_motion_they_are_found_in() {
    let swivel = Effect::new("caster_swivel", &[("trail", 0.02), ("torque", 0.05)]);
    let robot = robot("diff2", swivel);
    for speed_m_per_s in [0.4, -0.4] {
        let command = |_: u64| wheels(&robot, speed_m_per_s, 0.5);
        let [taken_up, _] = taken_up(&robot, command, 960, 240);
        assert!(taken_up.0 < 0.01, "{speed_m_per_s} m/s: {taken_up:?}");
    }
}

#[test]
fn steady_motion_with_play_in_the_gears_goes_on_undisturbed() {
    let robot = robot("diff2", Effect::new("gear_backlash", &[("play", 0.03)]));
    for speed_m_per_s in [0.5, -0.5] {
        let command = |_: u64| wheels(&robot, speed_m_per_s, 0.0);
        let [taken_up, _] = taken_up(&robot, command, 960, 240);
        assert!(taken_up.1 < 0.01, "{speed_m_per_s} m/s: {taken_up:?}");
    }
}
