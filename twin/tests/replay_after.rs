//! A replay taken up in motion remembers set-points as the uninterrupted one does.

use twin::effect::Effect;
use twin::free::Start;
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, replay, replay_after, replay_from};
use twin::robot::Robot;

fn rows() -> Vec<CommandRow> {
    let row = |tick: u32| {
        let mut row = CommandRow {
            time_s: f64::from(tick) / 120.0,
            ..CommandRow::default()
        };
        let step = f64::from(tick / 17 * 7 % 11) - 5.0;
        row.wheel_rad_per_s[..2].copy_from_slice(&[Some(step), Some(2.0 - step)]);
        row
    };
    (0..360).map(row).collect()
}

#[test]
fn delay_lag_and_slew_go_on_as_if_nothing_had_been_cut() {
    // Without motors the wheels are where the set-points are: nothing else remembers.
    let mut description = reference_robot("diff2");
    description.motor = None;
    let effects = [
        Effect::new("command_delay", &[("delay", 0.3137)]),
        Effect::new("acceleration_limit", &[("limit", 0.8)]),
        Effect::new("motor_lag", &[("time_constant", 0.07)]),
    ];
    let robot = Robot::with_effects(description, &effects).expect("a robot");
    let rows = rows();
    let whole = replay(&robot, Pose::default(), &rows).expect("finite");
    let cut = 200;
    let state = &whole[cut].state;
    let start = Start {
        pose: state.pose,
        twist: state.twist,
        wheel_rad_per_s: state.wheel_rad_per_s,
        ..Start::default()
    };
    let worst = |part: Vec<twin::replay::ReplayRow>| {
        let pairs = part.iter().zip(&whole[cut..]);
        pairs
            .flat_map(|(a, b)| [0, 1].map(|k| (a.state.wheel_rad_per_s[k] - b.state.wheel_rad_per_s[k]).abs()))
            .fold(0.0, f64::max)
    };
    let taken_up = replay_after(&robot, &start, HeldCommand::default(), &rows[..cut], &rows[cut..]).expect("finite");
    assert!(worst(taken_up) < 1e-9);
    // Without the memory it is another motion.
    let mut held = HeldCommand::default();
    held.apply(&robot, &rows[cut - 1]);
    let forgetful = replay_from(&robot, &start, held, &rows[cut..]).expect("finite");
    assert!(worst(forgetful) > 0.5);
}

/// Rows of a ramp, 12 rad/s a second, and from where on it is taken up.
fn ramp() -> (Vec<CommandRow>, usize) {
    let row = |tick: u32| {
        let mut row = CommandRow {
            time_s: f64::from(tick) / 120.0,
            ..CommandRow::default()
        };
        row.wheel_rad_per_s[..2].fill(Some(0.1 * f64::from(tick)));
        row
    };
    ((0..300).map(row).collect(), 200)
}

/// Largest difference of a wheel's speed between a ramp driven through and one taken up in its middle, rad/s: with the set-points before
/// it, and without.
fn taken_up_in_a_ramp(current_is_known: bool) -> [f64; 2] {
    let robot = Robot::new(reference_robot("diff2")).expect("a robot");
    let (rows, cut) = ramp();
    let whole = replay(&robot, Pose::default(), &rows).expect("finite");
    let state = &whole[cut].state;
    let start = Start {
        pose: state.pose,
        twist: state.twist,
        wheel_rad_per_s: state.wheel_rad_per_s,
        current_a: if current_is_known {
            state.current_a
        } else {
            Default::default()
        },
        ..Start::default()
    };
    let mut held = HeldCommand::default();
    held.apply(&robot, &rows[cut - 1]);
    [
        replay_after(&robot, &start, HeldCommand::default(), &rows[..cut], &rows[cut..]),
        replay_from(&robot, &start, held, &rows[cut..]),
    ]
    .map(|part| {
        let part = part.expect("finite");
        let pairs = part.iter().zip(&whole[cut..]);
        pairs
            .map(|(a, b)| (a.state.wheel_rad_per_s[0] - b.state.wheel_rad_per_s[0]).abs())
            .fold(0.0, f64::max)
    })
}

#[test]
fn a_speed_loop_in_a_ramp_goes_on_with_the_error_it_has() {
    let [after, from] = taken_up_in_a_ramp(true);
    // What is left is within the encoder's noise, or was told in the last 29 ms.
    assert!(after < 0.5 * from, "rad/s: {after} {from}");
}

#[test]
fn without_its_current_a_loop_is_left_to_its_error() {
    let [after, from] = taken_up_in_a_ramp(false);
    assert_eq!(after, from);
}
