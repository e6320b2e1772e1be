//! Play in the gears: what the motor, the wheel and the body do while a rotor crosses.

use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::free::FreeRobot;
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

fn robot(play_rad: f64) -> Robot {
    // Gently, so that the tyres slip little.
    let effects = [
        Effect::new("acceleration_limit", &[("limit", 0.6)]),
        Effect::new("gear_backlash", &[("play", play_rad)]),
    ];
    Robot::with_effects(reference_robot("diff2"), &effects).expect("a robot")
}

fn drive(robot: &Robot, free: &mut FreeRobot, speed_m_per_s: f64, steps: u32) -> Vec<(f64, f64, f64)> {
    let command = robot.wheel_speeds(BodyTwist {
        forward_m_per_s: speed_m_per_s,
        ..BodyTwist::default()
    });
    (0..steps)
        .map(|_| {
            free.step(&command);
            let state = free.state();
            (
                state.wheel_rad_per_s[0],
                state.twist.forward_m_per_s,
                state.current_a[0],
            )
        })
        .collect()
}

#[test]
fn steady_motion_is_that_without_play() {
    let (with, without) = (robot(0.03), robot(0.0));
    let mut speeds = [&with, &without].map(|robot| {
        let mut free = FreeRobot::at_rest(robot, Pose::default());
        drive(robot, &mut free, 0.5, 1440).pop().expect("steps")
    });
    let [a, b] = &mut speeds;
    assert!((a.0 - b.0).abs() < 0.02, "wheel {a:?} {b:?}");
    assert!((a.2 - b.2).abs() < 0.02, "current {a:?} {b:?}");
}

#[test]
fn a_reversal_takes_the_rotor_through_the_play_before_the_body_turns_round() {
    let motion = |play_rad: f64| {
        let robot = robot(play_rad);
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        drive(&robot, &mut free, 0.3, 960);
        let start = free.state();
        let turning = drive(&robot, &mut free, -0.3, 720);
        let turned = turning.iter().position(|step| step.1 < 0.0).expect("it turns round");
        (
            turned,
            free.state().wheel_rad[0] - start.wheel_rad[0],
            free.pose().x_m - start.pose.x_m,
        )
    };
    let (without, with) = (motion(0.0), motion(0.05));
    assert!(with.0 >= without.0, "not earlier: step {} and {}", with.0, without.0);
    // The encoder, at the rotor, has gone back by the play more than the wheels have.
    let radius_m = reference_robot("diff2").wheels[0].radius_m.expect("a radius");
    let crossed = |(_, encoder, way): (usize, f64, f64)| way / radius_m - encoder;
    let more = crossed(with) - crossed(without);
    assert!((more - 0.05).abs() < 0.01, "{more} of 0.05 rad");
}

#[test]
fn a_loop_does_not_race_while_its_rotor_crosses() {
    let robot = robot(0.05);
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    let start = drive(&robot, &mut free, 0.4, 480);
    let fastest = start.iter().map(|step| step.1).fold(0.0, f64::max);
    assert!(fastest < 0.5, "no kick beyond the set-point: {fastest} m/s");
    let encoder = start.iter().map(|step| step.0).fold(0.0, f64::max);
    let radius_m = reference_robot("diff2").wheels[0].radius_m.expect("a radius");
    assert!(encoder * radius_m < 0.8, "the loop does not race: {encoder} rad/s");
    assert!(start.iter().all(|step| step.2.is_finite()));
}

#[test]
fn a_wheel_of_a_robot_at_rest_stays_at_rest() {
    let robot = robot(0.05);
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    drive(&robot, &mut free, 0.0, 480);
    let state = free.state();
    assert!(state.pose.x_m.abs() < 1e-9 && state.wheel_rad_per_s[0].abs() < 1e-9);
}

/// Encoder speeds of every step of a robot that turns to and fro, and its yaw.
fn turned(robot: &Robot, encoders: Option<&[WheelCommand]>) -> (Vec<WheelCommand>, Vec<f64>) {
    let mut free = FreeRobot::at_rest(robot, Pose::default());
    let (mut told, mut yaw_rad) = (Vec::new(), Vec::new());
    for step in 0..1920_u32 {
        let sign = if (step / 320).is_multiple_of(2) { 1.0 } else { -1.0 };
        let own = robot.wheel_speeds(BodyTwist {
            forward_m_per_s: 0.1,
            yaw_rate_rad_per_s: sign,
            ..BodyTwist::default()
        });
        free.step(encoders.map_or(&own, |encoders| &encoders[step as usize]));
        let state = free.state();
        told.push(WheelCommand {
            wheel_rad_per_s: state.wheel_rad_per_s,
            steering_rad: 0.0,
        });
        yaw_rad.push(state.pose.yaw_rad);
    }
    (told, yaw_rad)
}

/// What encoders at the rotors say, and the play behind them, tell how the robot turned.
#[test]
fn wheels_behind_told_rotors_move_the_robot_as_its_motors_did() {
    let play = |play_rad: f64| [Effect::new("gear_backlash", &[("play", play_rad)])];
    for chassis in ["diff2", "diff4", "omni4"] {
        let driven = Robot::with_effects(reference_robot(chassis), &play(0.05)).expect("a robot");
        let (encoders, truth) = turned(&driven, None);
        let off = |play_rad: f64| {
            let told = Robot::with_told_rotors(reference_robot(chassis), &play(play_rad)).expect("a robot");
            assert!(told.description().motor.is_none());
            let (_, yaw_rad) = turned(&told, Some(&encoders));
            let squares = yaw_rad.iter().zip(&truth).map(|(a, b)| (a - b) * (a - b));
            (squares.sum::<f64>() / truth.len() as f64).sqrt()
        };
        let (without, with) = (off(0.0), off(0.05));
        assert!(
            with < 0.5 * without,
            "{chassis}, rad: {with} with the play, {without} without"
        );
    }
}

#[test]
fn told_rotors_without_play_are_wheels_without_motors() {
    let told = Robot::with_told_rotors(reference_robot("diff4"), &[]).expect("a robot");
    let mut plain = reference_robot("diff4");
    plain.motor = None;
    let plain = Robot::new(plain).expect("a robot");
    assert_eq!(turned(&told, None), turned(&plain, None));
}
