//! Motor controllers of a description: closed forms, stability of the reference gains, exact snapshots.

mod support;

use core::f64::consts::TAU;

use support::{all, car, diff4, motor, omni4, robot};
use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::free::{FreeRobot, Start};
use twin::motor_control::{ControlSample, Controller, MotorController};
use twin::pose::Pose;
use twin::robot::{Motor, Robot, RobotDescription};
use twin::twist::BodyTwist;
use twin::world::{Arena, World};

const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};

fn with(mut description: RobotDescription, controller: MotorController) -> RobotDescription {
    if let Some(motor) = &mut description.motor {
        motor.controller = Some(controller);
    }
    description
}

fn controlled(controller: MotorController) -> Motor {
    Motor {
        controller: Some(controller),
        ..motor()
    }
}

fn forward(robot: &Robot, forward_m_per_s: f64) -> WheelCommand {
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s,
        ..BodyTwist::default()
    })
}

#[test]
fn the_plain_speed_loop_written_out_changes_no_bit() {
    for description in all() {
        let absent = robot(description.clone());
        let written = robot(with(description, MotorController::plain_speed_pi()));
        let mut a = FreeRobot::at_rest(&absent, Pose::default());
        let mut b = FreeRobot::at_rest(&written, Pose::default());
        for step in 0..1500 {
            let twist = BodyTwist {
                forward_m_per_s: if step < 700 { 0.9 } else { -0.4 },
                left_m_per_s: 0.2,
                yaw_rate_rad_per_s: 0.5,
            };
            a.step(&absent.wheel_speeds(twist));
            b.step(&written.wheel_speeds(twist));
            assert_eq!(a.state(), b.state(), "{} step {step}", absent.name());
        }
    }
}

/// V = -W with k_p = 1, k_i = 0: the voltage shows the estimate.
#[test]
fn the_speed_estimate_is_counts_over_the_window() {
    for (ticks, window, rate) in [(4096, 8, 1920), (1000, 1, 480), (64, 5, 120)] {
        let shown = Motor {
            speed_loop_kp_v_s_per_rad: 1.0,
            speed_loop_ki_v_per_rad: 0.0,
            ..controlled(MotorController {
                sample_rate_hz: rate,
                encoder_ticks_per_rev: Some(ticks),
                speed_window_samples: Some(window),
                ..MotorController::plain_speed_pi()
            })
        };
        let mut controller = Controller::new(&shown);
        let sample_s = 1.0 / f64::from(rate);
        let resolution = TAU / (f64::from(ticks) * f64::from(window) * sample_s);
        let got = controller.speed_resolution_rad_per_s().unwrap_or(f64::NAN);
        assert!((got / resolution - 1.0).abs() < 1e-14);
        let wheel_rad_per_s = 7.3;
        let mut counts = Vec::new();
        for k in 0..400 {
            let count = controller.count_at(wheel_rad_per_s * sample_s * f64::from(k));
            counts.push(count);
            let estimate = -controller.step(&ControlSample {
                encoder_count: count,
                bus_v: 1e6,
                ..ControlSample::default()
            });
            let before = counts.len().checked_sub(window as usize + 1).map_or(0, |at| counts[at]);
            let expected = (count - before) as f64 * resolution;
            assert!(
                (estimate - expected).abs() <= 1e-13 * expected.abs(),
                "{k}: {estimate} {expected}"
            );
            if k >= window as i32 {
                assert!((estimate - wheel_rad_per_s).abs() < resolution, "{k}: {estimate}");
            }
        }
    }
}

/// A winding at standstill: i_{k+1} = V_k / R. Wanted current i* = the limit, as the speed error is large.
fn stalled_currents(controller: MotorController, samples: usize) -> Vec<f64> {
    let motor = controlled(controller);
    let mut controller = Controller::new(&motor);
    let mut currents = vec![0.0];
    for k in 0..samples {
        let voltage_v = controller.step(&ControlSample {
            command_rad_per_s: 1e3,
            current_a: currents[k],
            bus_v: 1e6,
            ..ControlSample::default()
        });
        currents.push(voltage_v / motor.resistance_ohm);
    }
    currents
}

/// With a = k_pc / R, b = k_ic T / R: z^2 - (1 - a - b) z - a = 0 and i_k = i* (1 + c_1 z_1^k + c_2 z_2^k),
/// i_0 = 0, i_1 = (a + b) i*.
#[test]
fn the_current_follows_its_closed_loop_poles() {
    for (kp, ki) in [(0.12, 360.0), (0.0, 230.0), (0.2, 700.0)] {
        let limit_a = 3.0;
        let currents = stalled_currents(
            MotorController {
                computation_delay_samples: 0,
                current_kp_v_per_a: Some(kp),
                current_ki_v_per_a_s: Some(ki),
                current_limit_a: Some(limit_a),
                ..MotorController::reference_cascade()
            },
            200,
        );
        let (a, b) = (kp / 0.6, ki / 1920.0 / 0.6);
        let half = 0.5 * (1.0 - a - b);
        let root = (half * half + a).sqrt();
        let poles = [half + root, half - root];
        let c1 = (a + b - 1.0 + poles[1]) / (poles[0] - poles[1]);
        let c2 = -1.0 - c1;
        let (mut one, mut two) = (c1, c2);
        for (k, current_a) in currents.iter().enumerate() {
            let expected = limit_a * (1.0 + one + two);
            assert!(
                (current_a - expected).abs() < 1e-10,
                "{kp} {ki} sample {k}: {current_a} {expected}"
            );
            (one, two) = (one * poles[0], two * poles[1]);
        }
        assert!((currents[200] - limit_a).abs() < 1e-9);
    }
}

/// The same in the twin, on wheels too heavy to turn (10 kg m^2: 2 mrad/s in 10 ms, 2 mA of back voltage).
#[test]
fn and_so_it_does_in_the_twin() {
    let mut description = with(
        diff4(),
        MotorController {
            computation_delay_samples: 0,
            current_limit_a: Some(3.0),
            ..MotorController::reference_cascade()
        },
    );
    for wheel in &mut description.wheels {
        wheel.spin_inertia_kg_m2 = Some(10.0);
    }
    let heavy = robot(description);
    let mut free = FreeRobot::at_rest(&heavy, Pose::default());
    let expected = stalled_currents(
        MotorController {
            computation_delay_samples: 0,
            current_limit_a: Some(3.0),
            ..MotorController::reference_cascade()
        },
        20,
    );
    for step in 1..=5 {
        free.step(&support::wheels(&[30.0; 4]));
        for wheel in 0..4 {
            let current_a = free.state().current_a[wheel];
            assert!(
                (current_a - expected[4 * step]).abs() < 4e-3,
                "{step}: {current_a} {}",
                expected[4 * step]
            );
        }
    }
}

#[test]
fn a_delay_is_exactly_so_many_samples() {
    for delay in 0..=8 {
        let delayed = |samples| MotorController {
            computation_delay_samples: samples,
            ..MotorController::reference_cascade()
        };
        let currents = stalled_currents(delayed(delay), 30);
        let first = currents.iter().position(|current_a| *current_a != 0.0);
        assert_eq!(first, Some(delay as usize + 1), "{currents:?}");
        assert_eq!(currents[delay as usize + 1], stalled_currents(delayed(0), 1)[1]);
        // In the twin: voltages of a slow loop on an exact speed.
        let slow = robot(with(
            diff4(),
            MotorController {
                sample_rate_hz: 240,
                computation_delay_samples: delay,
                ..MotorController::plain_speed_pi()
            },
        ));
        let mut free = FreeRobot::at_rest(&slow, Pose::default());
        let mut steps = 0;
        while free.state().voltage_v[0] == 0.0 {
            free.step(&support::wheels(&[5.0; 4]));
            steps += 1;
        }
        // A sample every second step; the first voltage stands after the step that it drives.
        assert_eq!(steps, 2 * delay + 1);
        assert_eq!(free.state().voltage_v[0], 0.8 * 5.0 + 6.0 * (5.0 / 240.0));
    }
}

/// Against a wall on a floor with grip for it: 4 * 3 A * 0.5952 N m/A / 50 mm = 143 N of 353 N. One sample a physics step: the
/// wall stops the body at the end of each, in which it gains 143 N / 12 kg / 480 Hz = 0.025 m/s (0.5 rad/s).
#[test]
fn a_stalled_current_settles_at_the_commanded_limit() {
    let mut description = with(
        diff4(),
        MotorController {
            sample_rate_hz: 480,
            current_kp_v_per_a: Some(0.05),
            current_ki_v_per_a_s: Some(90.0),
            current_limit_a: Some(3.0),
            ..MotorController::reference_cascade()
        },
    );
    (description.floor_friction, description.com_height_m) = (3.0, 0.0);
    let start = Pose {
        x_m: 1.74,
        y_m: 0.0,
        yaw_rad: 0.0,
    };
    let Ok(mut world) = World::new(ARENA, vec![(robot(description), start, 0.25)]) else {
        panic!("refused")
    };
    for tick in 0..360 {
        assert!(world.step(&[support::wheels(&[10.0; 4])]).is_ok());
        let state = world.state(0);
        for wheel in 0..4 {
            assert!(state.voltage_v[wheel].abs() <= 24.0 && state.current_a[wheel].abs() <= 9.0);
            if tick > 240 {
                let current_a = state.current_a[wheel];
                // The collision agrees with the kernel to 1e-5 m/s: n k_e W/R_a = 19.2 * 0.031 / 0.6 * 1e-5/0.05 = 2e-4 A.
                assert!((current_a - 3.0).abs() < 2e-4, "{tick}: {current_a}");
                assert!(state.wheel_rad_per_s[wheel].abs() < 1.0, "not stalled");
            }
        }
    }
}

/// Two tonnes to push: the back voltage rises by k dW/dt a second, which the integral follows k dW/dt / k_ic behind.
#[test]
fn a_rising_back_voltage_leaves_the_error_of_a_ramp() {
    let mut description = with(
        diff4(),
        MotorController {
            current_limit_a: Some(3.0),
            current_ki_v_per_a_s: Some(60.0),
            ..MotorController::reference_cascade()
        },
    );
    (description.mass_kg, description.yaw_inertia_kg_m2) = (2000.0, 100.0);
    let heavy = robot(description);
    let mut free = FreeRobot::at_rest(&heavy, Pose::default());
    let command = support::wheels(&[30.0; 4]);
    (0..480).for_each(|_| free.step(&command));
    let before = free.state().wheel_rad_per_s[0];
    (0..240).for_each(|_| free.step(&command));
    let acceleration = (free.state().wheel_rad_per_s[0] - before) / 0.5;
    let behind_a = 0.5952 * acceleration / 60.0;
    let current_a = free.state().current_a[0];
    println!("{current_a} A, {behind_a} A behind");
    assert!(
        behind_a > 0.01 && (current_a - (3.0 - behind_a)).abs() < 0.02 * behind_a,
        "{current_a} {behind_a}"
    );
}

/// Of the reference cascade: 2 pi / (n w T) = 0.368 rad/s.
const RESOLUTION_RAD_PER_S: f64 = TAU * 1920.0 / (4096.0 * 8.0);

/// What the last part of a run looked like, over all wheels.
struct Tail {
    worst_rad_per_s: f64,
    swing_rad_per_s: f64,
    swing_a: f64,
    /// Last time at which a wheel was more than 5 % of the step and more than the resolution away, s.
    settled_s: f64,
}

/// Drives with one command for `seconds` and looks at the last `tail_s`.
fn drive(free: &mut FreeRobot, command: &WheelCommand, seconds: f64, tail_s: f64) -> Tail {
    let steps = (480.0 * seconds) as usize;
    let tail = (480.0 * tail_s) as usize;
    let start = free.state();
    let mut seen: Vec<([f64; 4], [f64; 4])> = Vec::with_capacity(steps);
    let mut settled = 0;
    for step in 0..steps {
        free.step(command);
        let state = free.state();
        let (mut speed, mut current) = ([0.0; 4], [0.0; 4]);
        for wheel in 0..4 {
            assert!(state.current_a[wheel].abs() <= 9.0 && state.voltage_v[wheel].abs() <= 24.0);
            (speed[wheel], current[wheel]) = (state.wheel_rad_per_s[wheel], state.current_a[wheel]);
            let wanted = command.wheel_rad_per_s[wheel];
            let step_rad_per_s = (wanted - start.wheel_rad_per_s[wheel]).abs();
            if (speed[wheel] - wanted).abs() > (0.05 * step_rad_per_s).max(RESOLUTION_RAD_PER_S) {
                settled = step + 1;
            }
        }
        seen.push((speed, current));
    }
    let mut out = Tail {
        worst_rad_per_s: 0.0,
        swing_rad_per_s: 0.0,
        swing_a: 0.0,
        settled_s: settled as f64 / 480.0,
    };
    for wheel in 0..4 {
        let last = &seen[steps - tail..];
        let swing = |values: &[f64]| {
            values.iter().copied().fold(f64::MIN, f64::max) - values.iter().copied().fold(f64::MAX, f64::min)
        };
        let speeds: Vec<f64> = last.iter().map(|(speed, _)| speed[wheel]).collect();
        let currents: Vec<f64> = last.iter().map(|(_, current)| current[wheel]).collect();
        for (speed, _) in last {
            out.worst_rad_per_s = out
                .worst_rad_per_s
                .max((speed[wheel] - command.wheel_rad_per_s[wheel]).abs());
        }
        out.swing_rad_per_s = out.swing_rad_per_s.max(swing(&speeds));
        out.swing_a = out.swing_a.max(swing(&currents));
    }
    out
}

/// Settled within the resolution of the estimate (see above), swinging less than it, the current less than two counts ask for.
#[track_caller]
fn assert_quiet(what: &str, tail: &Tail, within_s: f64) {
    let resolution = RESOLUTION_RAD_PER_S;
    println!(
        "{what}: settled {:.3} s, worst {:.4} rad/s, swing {:.4} rad/s, {:.4} A",
        tail.settled_s, tail.worst_rad_per_s, tail.swing_rad_per_s, tail.swing_a
    );
    assert!(tail.settled_s <= within_s, "{what}: settled after {} s", tail.settled_s);
    assert!(
        tail.worst_rad_per_s < resolution,
        "{what}: off by {}",
        tail.worst_rad_per_s
    );
    assert!(
        tail.swing_rad_per_s < resolution,
        "{what}: swings {}",
        tail.swing_rad_per_s
    );
    assert!(
        tail.swing_a < 2.0 * 0.5 * resolution,
        "{what}: current swings {}",
        tail.swing_a
    );
}

#[test]
fn the_reference_cascade_is_stable_in_grip_in_slip_and_lifted_off() {
    for reference in [omni4(), car("awd")] {
        let name = reference.chassis.clone();
        let description = with(reference, MotorController::reference_cascade());
        let run = |change: &dyn Fn(&mut RobotDescription)| {
            let mut changed = description.clone();
            change(&mut changed);
            robot(changed)
        };
        let grip = run(&|_| {});
        let mut free = FreeRobot::at_rest(&grip, Pose::default());
        for speed in [0.5, 1.2, -0.3, 0.0] {
            let tail = drive(&mut free, &forward(&grip, speed), 2.0, 0.5);
            assert_quiet(&format!("{name} in grip at {speed} m/s"), &tail, 1.2);
        }
        // 0.49 m/s^2 at most: the body needs 2 s to 1 m/s, and until then the wheels slip.
        let slip = run(&|d| d.floor_friction = 0.05);
        let mut free = FreeRobot::at_rest(&slip, Pose::default());
        let tail = drive(&mut free, &forward(&slip, 1.0), 1.5, 0.7);
        assert!(free.state().twist.forward_m_per_s < 0.8, "it did not slip");
        assert_quiet(&format!("{name} in slip"), &tail, 0.3);
        let tail = drive(&mut free, &forward(&slip, 1.0), 2.0, 0.5);
        assert_quiet(&format!("{name} from slip to grip"), &tail, 0.3);
        // 10 g and mu 0.01 leave 1 mN on the wheels' rims: they turn as in the air.
        let lifted = run(&|d| (d.mass_kg, d.yaw_inertia_kg_m2, d.floor_friction) = (0.01, 2e-4, 0.01));
        let mut free = FreeRobot::at_rest(&lifted, Pose::default());
        for speed in [0.5, 1.2, -0.3, 0.0] {
            let tail = drive(&mut free, &forward(&lifted, speed), 1.0, 0.5);
            assert_quiet(&format!("{name} lifted at {speed} m/s"), &tail, 0.3);
        }
    }
}

#[test]
fn a_start_in_motion_goes_on_without_a_jerk() {
    for controller in [
        MotorController::reference_cascade(),
        MotorController {
            computation_delay_samples: 2,
            encoder_ticks_per_rev: Some(4096),
            speed_window_samples: Some(4),
            ..MotorController::plain_speed_pi()
        },
    ] {
        let resolution = Controller::new(&controlled(controller.clone())).speed_resolution_rad_per_s();
        let moving = robot(with(omni4(), controller));
        let command = forward(&moving, 0.5);
        let mut free = FreeRobot::at_rest(&moving, Pose::default());
        (0..1920).for_each(|_| free.step(&command));
        let state = free.state();
        let mut again = FreeRobot::moving(
            &moving,
            &Start {
                twist: state.twist,
                wheel_rad_per_s: state.wheel_rad_per_s,
                current_a: state.current_a,
                ..Start::default()
            },
        );
        for _ in 0..480 {
            free.step(&command);
            again.step(&command);
            for wheel in 0..4 {
                let off = again.state().wheel_rad_per_s[wheel] - free.state().wheel_rad_per_s[wheel];
                assert!(Some(off.abs()) < resolution, "{off}");
            }
        }
    }
}

/// The world of the snapshot test: a fast cascade, a slow loop whose phase is not that of the tick, and effects.
fn mixed_world() -> World {
    let fast = with(
        car("awd"),
        MotorController {
            sample_rate_hz: 960,
            computation_delay_samples: 2,
            current_kp_v_per_a: Some(0.1),
            current_ki_v_per_a_s: Some(150.0),
            ..MotorController::reference_cascade()
        },
    );
    let slow = with(
        omni4(),
        MotorController {
            sample_rate_hz: 160,
            computation_delay_samples: 1,
            encoder_ticks_per_rev: Some(2000),
            speed_window_samples: Some(3),
            ..MotorController::plain_speed_pi()
        },
    );
    let effects = [
        Effect::new("battery_sag", &[("resistance", 0.05)]),
        Effect::new("gear_backlash", &[("play", 0.01)]),
    ];
    let at = |x_m: f64| Pose {
        x_m,
        y_m: 0.1,
        yaw_rad: 0.4,
    };
    let (Ok(slow), fast) = (Robot::with_effects(slow, &effects), robot(fast)) else {
        panic!("refused")
    };
    match World::new(ARENA, vec![(fast, at(-1.0), 0.25), (slow, at(1.0), 0.25)]) {
        Ok(world) => world,
        Err(problem) => panic!("{problem}"),
    }
}

fn mixed_commands(tick: u64) -> [WheelCommand; 2] {
    let speed = if tick % 90 < 50 { 12.0 } else { -6.0 };
    let mut first = support::wheels(&[speed; 4]);
    first.steering_rad = 0.2;
    [first, support::wheels(&[speed, -3.0, -speed, 4.0])]
}

#[test]
fn a_restored_world_goes_on_bit_for_bit() {
    for at in [0, 1, 2, 37, 101] {
        let mut world = mixed_world();
        for tick in 0..at {
            assert!(world.step(&mixed_commands(tick)).is_ok());
        }
        let snapshot = world.snapshot();
        let mut again = mixed_world();
        // A world that has been elsewhere takes everything over.
        for tick in 0..13 {
            assert!(again.step(&mixed_commands(tick + 60)).is_ok());
        }
        assert_eq!(again.restore(&snapshot), Ok(()));
        for tick in at..at + 150 {
            assert!(world.step(&mixed_commands(tick)).is_ok() && again.step(&mixed_commands(tick)).is_ok());
            assert_eq!(world.digest(), again.digest(), "from {at}, tick {tick}");
            assert_eq!((world.state(0), world.state(1)), (again.state(0), again.state(1)));
        }
        let mut short = snapshot.clone();
        let text = &mut short.robots[0];
        text.truncate(text.len() - 16);
        assert!(world.restore(&short).is_err());
    }
}

#[test]
fn the_digest_sees_the_controller() {
    let mut world = mixed_world();
    let mut other = mixed_world();
    let snapshot = world.snapshot();
    let mut changed = snapshot.clone();
    // The last number is the newest count of the last wheel.
    let text = &mut changed.robots[1];
    text.truncate(text.len() - 16);
    text.push_str(&format!("{:016x}", 7.0_f64.to_bits()));
    assert_eq!((world.restore(&snapshot), other.restore(&changed)), (Ok(()), Ok(())));
    assert!(world.step(&mixed_commands(0)).is_ok() && other.step(&mixed_commands(0)).is_ok());
    assert_ne!(world.digest(), other.digest());
}
