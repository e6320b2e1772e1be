//! Motor control of the twin against that of the firmware: equal to the bit at every sample.

mod support;

use robot::motor_control::{self as firmware, Law};
use robot::speed_loop::{SpeedLoop, SpeedLoopSettings, WheelSpeed};
use support::{car, omni4, robot};
use twin::free::{FreeRobot, RobotState};
use twin::motor_control::{ControlSample, Controller, MotorController};
use twin::parameter;
use twin::pose::Pose;
use twin::robot::{Motor, RobotDescription};
use twin::twist::BodyTwist;

fn firmware_settings(motor: &Motor) -> firmware::ControllerSettings {
    let plain = MotorController::plain_speed_pi();
    let controller = motor.controller.as_ref().unwrap_or(&plain);
    let law = match controller.kind.as_str() {
        "speed_pi" => Law::SpeedPi {
            kp_v_s_per_rad: motor.speed_loop_kp_v_s_per_rad,
            ki_v_per_rad: motor.speed_loop_ki_v_per_rad,
        },
        _ => Law::Cascade {
            speed_kp_a_s_per_rad: controller.speed_kp_a_s_per_rad.unwrap_or(f64::NAN),
            speed_ki_a_per_rad: controller.speed_ki_a_per_rad.unwrap_or(f64::NAN),
            current_kp_v_per_a: controller.current_kp_v_per_a.unwrap_or(f64::NAN),
            current_ki_v_per_a_s: controller.current_ki_v_per_a_s.unwrap_or(f64::NAN),
            current_limit_a: controller
                .current_limit_a
                .or(motor.current_limit_a)
                .unwrap_or(motor.supply_v / motor.resistance_ohm),
        },
    };
    firmware::ControllerSettings {
        law,
        sample_rate_hz: controller.sample_rate_hz,
        computation_delay_samples: controller.computation_delay_samples as usize,
        encoder: controller
            .encoder_ticks_per_rev
            .map(|ticks_per_rev| firmware::EncoderSettings {
                ticks_per_rev,
                window_samples: controller.speed_window_samples.unwrap_or(1) as usize,
            }),
    }
}

/// Set-points that saturate, stop and turn round.
fn twist(step: u32) -> BodyTwist {
    let phase = f64::from(step / 200 % 5);
    BodyTwist {
        forward_m_per_s: 0.8 - 0.5 * phase,
        left_m_per_s: 0.3 * phase,
        yaw_rate_rad_per_s: if phase == 3.0 { 6.0 } else { -0.4 * phase },
    }
}

fn variants() -> Vec<MotorController> {
    let cascade = MotorController::reference_cascade;
    let speed_pi = MotorController::plain_speed_pi;
    vec![
        speed_pi(),
        MotorController {
            sample_rate_hz: 480,
            current_kp_v_per_a: Some(0.05),
            current_ki_v_per_a_s: Some(90.0),
            ..cascade()
        },
        MotorController {
            sample_rate_hz: 160,
            computation_delay_samples: 0,
            speed_window_samples: Some(2),
            current_kp_v_per_a: Some(0.0),
            current_ki_v_per_a_s: Some(30.0),
            speed_kp_a_s_per_rad: Some(0.1),
            current_limit_a: Some(4.0),
            ..cascade()
        },
        MotorController {
            sample_rate_hz: 240,
            computation_delay_samples: 3,
            encoder_ticks_per_rev: Some(1000),
            speed_window_samples: Some(5),
            ..speed_pi()
        },
    ]
}

/// Drives the twin and hands what its encoders and current sensors say to the firmware before every sample.
fn compare_in_the_loop(description: &RobotDescription, steps: u32) {
    let Some(motor) = description.motor.clone() else {
        panic!("no motor")
    };
    let settings = firmware_settings(&motor);
    let counter = Controller::new(&motor);
    let twin_robot = robot(description.clone());
    let mut free = FreeRobot::at_rest(&twin_robot, Pose::default());
    let mut controllers: Vec<firmware::Controller> = description
        .wheels
        .iter()
        .map(|_| firmware::Controller::new(settings, 0))
        .collect();
    let mut voltages = vec![0.0; controllers.len()];
    let (every, mut differing) = (480 / settings.sample_rate_hz, 0);
    for step in 0..steps {
        let command = twin_robot.wheel_speeds(twist(step));
        let before: RobotState = free.state();
        for (wheel, controller) in controllers.iter_mut().enumerate() {
            if step % every == 0 {
                voltages[wheel] = controller.step(&firmware::ControlSample {
                    command_rad_per_s: command.wheel_rad_per_s[wheel],
                    wheel_rad_per_s: before.wheel_rad_per_s[wheel],
                    encoder_count: counter.count_at(before.wheel_rad[wheel]) as i32,
                    current_a: before.current_a[wheel],
                    bus_v: before.bus_v,
                });
            }
        }
        free.step(&command);
        for (wheel, voltage) in voltages.iter().enumerate() {
            let twin_v = free.state().voltage_v[wheel];
            assert_eq!(
                twin_v.to_bits(),
                voltage.to_bits(),
                "step {step} wheel {wheel}: {twin_v} {voltage}"
            );
            differing += u32::from(*voltage != 0.0);
        }
    }
    assert!(differing > steps, "the comparison saw only zeros");
}

#[test]
fn the_twin_drives_as_the_firmware_would() {
    for reference in [omni4(), car("awd")] {
        for controller in variants() {
            let mut description = reference.clone();
            if let Some(motor) = &mut description.motor {
                motor.controller = Some(controller);
            }
            compare_in_the_loop(&description, 2000);
        }
    }
}

#[test]
fn without_a_controller_object_too() {
    for description in [omni4(), car("awd")] {
        compare_in_the_loop(&description, 2000);
        // The loop that the firmware runs today is the same one.
        let twin_robot = robot(description.clone());
        let mut free = FreeRobot::at_rest(&twin_robot, Pose::default());
        let mut loops = [SpeedLoop::new(SpeedLoopSettings {
            kp_v_s_per_rad: 0.8,
            ki_v_per_rad: 6.0,
            sample_s: 1.0 / 480.0,
        }); 4];
        for step in 0..2000 {
            let command = twin_robot.wheel_speeds(twist(step));
            let before = free.state();
            free.step(&command);
            for (wheel, speed_loop) in loops.iter_mut().enumerate() {
                let voltage = speed_loop.step(
                    WheelSpeed {
                        command_rad_per_s: command.wheel_rad_per_s[wheel],
                        measured_rad_per_s: before.wheel_rad_per_s[wheel],
                    },
                    before.bus_v,
                );
                assert_eq!(
                    free.state().voltage_v[wheel].to_bits(),
                    voltage.to_bits(),
                    "{step} {wheel}"
                );
            }
        }
    }
}

#[test]
fn recorded_samples_give_the_same_voltages_at_every_rate_delay_and_window() {
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    for (rate, delay, window) in [(1920, 1, 8), (9600, 8, 64), (10, 0, 1), (960, 2, 3), (480, 0, 64)] {
        for kind in ["cascade", "speed_pi"] {
            let mut motor = support::motor();
            let base = if kind == "cascade" {
                MotorController::reference_cascade()
            } else {
                MotorController::plain_speed_pi()
            };
            motor.controller = Some(MotorController {
                sample_rate_hz: rate,
                computation_delay_samples: delay,
                encoder_ticks_per_rev: Some(4096),
                speed_window_samples: Some(window),
                ..base
            });
            let mut ours = Controller::new(&motor);
            // A counter of 32 bits that starts just below its end.
            let first = i32::MAX - 1000;
            let mut theirs = firmware::Controller::new(firmware_settings(&motor), first);
            let mut count = 0_i64;
            for sample in 0..4000 {
                count += (60.0 * (next() - 0.4)) as i64;
                let bad = sample % 997 == 996;
                let (command_rad_per_s, current_a) = (40.0 * (next() - 0.5), if bad { f64::NAN } else { 9.0 * next() });
                let bus_v = 20.0 + 4.0 * next();
                let a = ours.step(&ControlSample {
                    command_rad_per_s,
                    encoder_count: count,
                    current_a,
                    bus_v,
                    ..ControlSample::default()
                });
                let b = theirs.step(&firmware::ControlSample {
                    command_rad_per_s,
                    encoder_count: first.wrapping_add(count as i32),
                    current_a,
                    bus_v,
                    ..firmware::ControlSample::default()
                });
                assert_eq!(a.to_bits(), b.to_bits(), "{kind} {rate} Hz, sample {sample}: {a} {b}");
            }
        }
    }
}

#[test]
fn what_the_table_allows_fits_the_firmware() {
    let most = |path: &str| parameter::find(path).map_or(f64::NAN, |parameter| parameter.high);
    assert_eq!(
        most("motor.controller.computation_delay_samples"),
        firmware::MAX_DELAY_SAMPLES as f64
    );
    assert_eq!(
        most("motor.controller.speed_window_samples"),
        firmware::MAX_WINDOW_SAMPLES as f64
    );
}
