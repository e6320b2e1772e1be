//! Invariance of whole trajectories: compass, place, left and right, front and back, quarter turns.
//!
//! Every step is compared, from a start in motion and through set-points that make wheels slip.

mod support;

use core::f64::consts::FRAC_PI_2;

use support::drive::{rolling, twist};
use support::{all, car, diff2, diff4, omni4, robot};
use twin::MAX_WHEELS;
use twin::command::WheelCommand;
use twin::free::{FreeRobot, RobotState, Start};
use twin::pose::{Pose, wrapped_rad};
use twin::robot::{Robot, RobotDescription};

/// Largest gap of positions and headings that is taken for rounding, m and rad. Rounding of 1e-16 grows where wheels
/// lose grip, and no instability of the equations lasts longer than a slide.
const ROUNDING: f64 = 1e-9;
const STEPS: u32 = 1440;

fn command(step: u32) -> WheelCommand {
    let phase = f64::from(step / 160);
    let mut command = WheelCommand::default();
    command.wheel_rad_per_s[..4].copy_from_slice(&[
        14.0 - 4.0 * phase,
        18.0 - 3.0 * phase,
        -6.0 + 5.0 * phase,
        22.0 - 5.0 * phase,
    ]);
    command.steering_rad = 0.1 * phase - 0.4;
    command
}

fn start(description: &RobotDescription) -> Start {
    let mut start = rolling(description, twist(0.7, -0.3, 1.1));
    if description.wheels[0].kind != "caster" {
        start.wheel_rad_per_s[0] += 9.0;
    }
    start.steering_rad = 0.2;
    start
}

fn trajectory(robot: &Robot, start: &Start, command: impl Fn(u32) -> WheelCommand) -> Vec<RobotState> {
    let mut free = FreeRobot::moving(robot, start);
    (0..STEPS)
        .map(|step| {
            free.step(&command(step));
            free.state()
        })
        .collect()
}

/// Compares `got` with `expected(reference)`, pose and twist, at every step.
fn assert_same(name: &str, reference: &[RobotState], got: &[RobotState], expected: impl Fn(&RobotState) -> [f64; 6]) {
    let mut worst = 0.0_f64;
    for (reference, got) in reference.iter().zip(got) {
        let want = expected(reference);
        let have = [
            got.pose.x_m,
            got.pose.y_m,
            got.pose.yaw_rad,
            got.twist.forward_m_per_s,
            got.twist.left_m_per_s,
            got.twist.yaw_rate_rad_per_s,
        ];
        for (index, (want, have)) in want.iter().zip(have).enumerate() {
            let gap = if index == 2 {
                wrapped_rad(have - want)
            } else {
                have - want
            };
            worst = worst.max(gap.abs());
        }
    }
    println!("{name}: {worst:.1e}");
    assert!(worst < ROUNDING, "{name}: {worst:e}");
    let travelled = reference[reference.len() - 1].pose.distance_m(&Pose::default());
    assert!(
        travelled > 0.05,
        "{name} went {travelled} m: too little to see anything"
    );
}

#[test]
fn there_is_no_compass_and_no_origin() {
    for description in all() {
        let start = start(&description);
        let robot = robot(description);
        let reference = trajectory(&robot, &start, command);
        for (x_m, y_m, yaw_rad) in [
            (0.0, 0.0, FRAC_PI_2),
            (0.0, 0.0, -2.9),
            (3.0, -7.0, 0.0),
            (-1.0, 4.0, 1.234),
        ] {
            let pose = Pose { x_m, y_m, yaw_rad };
            let moved = trajectory(&robot, &Start { pose, ..start }, command);
            let (sin, cos) = libm::sincos(yaw_rad);
            assert_same(robot.name(), &reference, &moved, |state| {
                let (pose, twist) = (state.pose, state.twist);
                [
                    x_m + cos * pose.x_m - sin * pose.y_m,
                    y_m + sin * pose.x_m + cos * pose.y_m,
                    pose.yaw_rad + yaw_rad,
                    twist.forward_m_per_s,
                    twist.left_m_per_s,
                    twist.yaw_rate_rad_per_s,
                ]
            });
        }
    }
}

/// Wheel values of the mirrored robot: wheel `i` takes `sign` times the value of wheel `partner[i]`.
fn permuted(values: &[f64; MAX_WHEELS], partner: [usize; 4], sign: f64) -> [f64; MAX_WHEELS] {
    let mut out = [0.0; MAX_WHEELS];
    for (index, from) in partner.iter().enumerate() {
        out[index] = sign * values[*from];
    }
    out
}

#[test]
fn left_and_right_are_mirror_images() {
    // Mirroring at the x axis swaps the wheels at y and -y. An omni wheel's mirror image rolls along the mirrored
    // direction, which is its partner's reversed one: 135 degrees -> -135 = 225, the partner has 45: the sign turns.
    for (description, partner, sign) in [
        (omni4(), [3, 2, 1, 0], -1.0),
        (diff2(), [1, 0, 2, 3], 1.0),
        (diff4(), [1, 0, 3, 2], 1.0),
        (car("fwd"), [1, 0, 3, 2], 1.0),
        (car("rwd"), [1, 0, 3, 2], 1.0),
        (car("awd"), [1, 0, 3, 2], 1.0),
    ] {
        let start = start(&description);
        let robot = robot(description);
        let mirrored = Start {
            twist: twist(0.7, 0.3, -1.1),
            wheel_rad_per_s: permuted(&start.wheel_rad_per_s, partner, sign),
            steering_rad: -start.steering_rad,
            ..start
        };
        let reference = trajectory(&robot, &start, command);
        let got = trajectory(&robot, &mirrored, |step| WheelCommand {
            wheel_rad_per_s: permuted(&command(step).wheel_rad_per_s, partner, sign),
            steering_rad: -command(step).steering_rad,
        });
        assert_same(robot.name(), &reference, &got, |state| {
            let (pose, twist) = (state.pose, state.twist);
            [
                pose.x_m,
                -pose.y_m,
                -pose.yaw_rad,
                twist.forward_m_per_s,
                -twist.left_m_per_s,
                -twist.yaw_rate_rad_per_s,
            ]
        });
    }
}

#[test]
fn front_and_back_are_mirror_images_without_steering() {
    // Mirroring at the y axis swaps the wheels at x and -x and reverses standard wheels; an omni wheel's image
    // (135 -> 45 degrees) is its partner's reversed direction (225), too.
    for (description, partner) in [
        (omni4(), [1, 0, 3, 2]),
        (diff2(), [0, 1, 3, 2]),
        (diff4(), [2, 3, 0, 1]),
    ] {
        let start = start(&description);
        let robot = robot(description);
        let mirrored = Start {
            twist: twist(-0.7, -0.3, -1.1),
            wheel_rad_per_s: permuted(&start.wheel_rad_per_s, partner, -1.0),
            ..start
        };
        let reference = trajectory(&robot, &start, command);
        let got = trajectory(&robot, &mirrored, |step| WheelCommand {
            wheel_rad_per_s: permuted(&command(step).wheel_rad_per_s, partner, -1.0),
            ..WheelCommand::default()
        });
        assert_same(robot.name(), &reference, &got, |state| {
            let (pose, twist) = (state.pose, state.twist);
            [
                -pose.x_m,
                pose.y_m,
                -pose.yaw_rad,
                -twist.forward_m_per_s,
                twist.left_m_per_s,
                -twist.yaw_rate_rad_per_s,
            ]
        });
    }
}

#[test]
fn omni4_has_four_fronts() {
    // A quarter turn takes wheel i to the place of wheel i + 1 and (u, v) to (-v, u).
    let description = omni4();
    let start = start(&description);
    let robot = robot(description);
    let turned = Start {
        twist: twist(0.3, 0.7, 1.1),
        wheel_rad_per_s: permuted(&start.wheel_rad_per_s, [3, 0, 1, 2], 1.0),
        ..start
    };
    let reference = trajectory(&robot, &start, command);
    let got = trajectory(&robot, &turned, |step| WheelCommand {
        wheel_rad_per_s: permuted(&command(step).wheel_rad_per_s, [3, 0, 1, 2], 1.0),
        ..WheelCommand::default()
    });
    assert_same("omni4", &reference, &got, |state| {
        let (pose, twist) = (state.pose, state.twist);
        [
            -pose.y_m,
            pose.x_m,
            pose.yaw_rad,
            -twist.left_m_per_s,
            twist.forward_m_per_s,
            twist.yaw_rate_rad_per_s,
        ]
    });
}

#[test]
fn the_order_of_the_wheel_table_means_nothing() {
    for description in all() {
        let start = start(&description);
        let mut reversed = description.clone();
        reversed.wheels.reverse();
        let back = [3, 2, 1, 0];
        let (robot, other) = (robot(description), robot(reversed));
        let swapped = Start {
            wheel_rad_per_s: permuted(&start.wheel_rad_per_s, back, 1.0),
            ..start
        };
        let reference = trajectory(&robot, &start, command);
        let got = trajectory(&other, &swapped, |step| WheelCommand {
            wheel_rad_per_s: permuted(&command(step).wheel_rad_per_s, back, 1.0),
            ..command(step)
        });
        assert_same(robot.name(), &reference, &got, |state| {
            let (pose, twist) = (state.pose, state.twist);
            [
                pose.x_m,
                pose.y_m,
                pose.yaw_rad,
                twist.forward_m_per_s,
                twist.left_m_per_s,
                twist.yaw_rate_rad_per_s,
            ]
        });
    }
}
